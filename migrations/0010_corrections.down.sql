DROP TRIGGER chain_salts_no_delete;
CREATE TRIGGER chain_salts_no_delete BEFORE DELETE ON chain_salts
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
DROP TRIGGER answers_no_update;
CREATE TRIGGER answers_no_update BEFORE UPDATE ON answers BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END;
DROP TRIGGER comments_no_update;
CREATE TRIGGER comments_no_update BEFORE UPDATE ON comments BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
DROP TABLE unfinished_erasures;
DROP TABLE erasures;
DROP TABLE consents;
DROP TABLE corrections;

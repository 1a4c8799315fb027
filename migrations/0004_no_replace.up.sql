-- REPLACE takes rows away without asking the triggers on DELETE, so what is there already is not inserted again. A comment or an answer
-- that was sent twice is passed over in silence, as the program relies on (ON CONFLICT DO NOTHING).
CREATE TRIGGER sessions_no_replace BEFORE INSERT ON sessions
WHEN EXISTS (SELECT 1 FROM sessions WHERE session = NEW.session OR rowid = NEW.rowid)
BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER segments_no_replace BEFORE INSERT ON segments
WHEN EXISTS (SELECT 1 FROM segments WHERE number = NEW.number OR segment = NEW.segment OR (session = NEW.session AND setting = NEW.setting))
BEGIN SELECT RAISE(ABORT, 'segments are append-only'); END;
CREATE TRIGGER events_no_replace BEFORE INSERT ON events
WHEN EXISTS (SELECT 1 FROM events WHERE session = NEW.session AND number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
CREATE TRIGGER comments_no_replace BEFORE INSERT ON comments
WHEN EXISTS (SELECT 1 FROM comments WHERE number = NEW.number OR key = NEW.key)
BEGIN SELECT RAISE(IGNORE); END;
CREATE TRIGGER answers_no_replace BEFORE INSERT ON answers
WHEN EXISTS (SELECT 1 FROM answers WHERE number = NEW.number OR key = NEW.key)
BEGIN SELECT RAISE(IGNORE); END;

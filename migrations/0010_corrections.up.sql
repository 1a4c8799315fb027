-- Corrections of what was recorded: a row beside the original, which stays as it is. record is the key of the answer or
-- the comment, or the session's id. Of several about the same field of a record the latest counts.
CREATE TABLE corrections (
    number INTEGER PRIMARY KEY,
    session TEXT NOT NULL REFERENCES sessions,
    subject TEXT NOT NULL CHECK (subject IN ('session', 'answer', 'comment')),
    record TEXT NOT NULL,
    field TEXT NOT NULL CHECK (field IN ('participant', 'value', 'note')),
    old_value TEXT NOT NULL,
    new_value TEXT NOT NULL,
    reason TEXT NOT NULL,
    role TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX corrections_by_session ON corrections (session, number);

-- What a participant consented to: the text by its version, the day, who obtained it, on paper or on a screen.
CREATE TABLE consents (
    number INTEGER PRIMARY KEY,
    session TEXT NOT NULL REFERENCES sessions,
    text_version TEXT NOT NULL,
    given_on TEXT NOT NULL,
    obtained_by TEXT NOT NULL,
    medium TEXT NOT NULL CHECK (medium IN ('paper', 'screen')),
    role TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX consents_by_session ON consents (session, number);

-- Words that were erased: the record stays, without its text and without the salt of its hash.
CREATE TABLE erasures (
    number INTEGER PRIMARY KEY,
    session TEXT NOT NULL REFERENCES sessions,
    subject TEXT NOT NULL CHECK (subject IN ('answer', 'comment', 'correction')),
    record TEXT NOT NULL,
    reason TEXT NOT NULL,
    role TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    UNIQUE (subject, record)
) STRICT;
CREATE INDEX erasures_by_session ON erasures (session, number);

-- A working note: erased words may still stand in free pages of the file or in its log.
CREATE TABLE unfinished_erasures (
    number INTEGER PRIMARY KEY REFERENCES erasures
) STRICT;

-- Only an erasure changes what was said, and only to nothing.
DROP TRIGGER comments_no_update;
CREATE TRIGGER comments_no_update BEFORE UPDATE ON comments
WHEN NEW.text IS NOT '' OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'comment' AND record = OLD.key)
    OR (NEW.number, NEW.key, NEW.session, NEW.segment, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.client_millis,
        NEW.frame, NEW.kind, NEW.frame_run, NEW.waited_ms, NEW.device, NEW.sequence, NEW.waited_by, NEW.late)
    IS NOT (OLD.number, OLD.key, OLD.session, OLD.segment, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.client_millis,
        OLD.frame, OLD.kind, OLD.frame_run, OLD.waited_ms, OLD.device, OLD.sequence, OLD.waited_by, OLD.late)
BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
DROP TRIGGER answers_no_update;
CREATE TRIGGER answers_no_update BEFORE UPDATE ON answers
WHEN NEW.value IS NOT '""' OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'answer' AND record = OLD.key)
    OR (NEW.number, NEW.key, NEW.session, NEW.segment, NEW.question, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.device,
        NEW.sequence, NEW.client_millis, NEW.waited_ms, NEW.waited_by, NEW.late)
    IS NOT (OLD.number, OLD.key, OLD.session, OLD.segment, OLD.question, OLD.run, OLD.wall, OLD.monotonic_ns,
        OLD.device, OLD.sequence, OLD.client_millis, OLD.waited_ms, OLD.waited_by, OLD.late)
BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END;
CREATE TRIGGER corrections_no_update BEFORE UPDATE ON corrections
WHEN NEW.old_value IS NOT '' OR NEW.new_value IS NOT '' OR NEW.reason IS NOT ''
    OR NOT EXISTS (
        SELECT 1 FROM erasures WHERE subject = 'correction' AND record = CAST(OLD.number AS TEXT))
    OR (NEW.number, NEW.session, NEW.subject, NEW.record, NEW.field, NEW.role, NEW.run, NEW.wall, NEW.monotonic_ns)
    IS NOT (OLD.number, OLD.session, OLD.subject, OLD.record, OLD.field, OLD.role, OLD.run, OLD.wall,
        OLD.monotonic_ns)
BEGIN SELECT RAISE(ABORT, 'corrections are append-only'); END;
DROP TRIGGER chain_salts_no_delete;
CREATE TRIGGER chain_salts_no_delete BEFORE DELETE ON chain_salts
WHEN NOT EXISTS (
    SELECT 1 FROM chain AS c JOIN erasures AS e ON e.subject = c.kind AND e.record = c.key WHERE c.number = OLD.number)
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;

CREATE TRIGGER corrections_no_delete BEFORE DELETE ON corrections
BEGIN SELECT RAISE(ABORT, 'corrections are append-only'); END;
CREATE TRIGGER corrections_no_replace BEFORE INSERT ON corrections
WHEN EXISTS (SELECT 1 FROM corrections WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'corrections are append-only'); END;
CREATE TRIGGER consents_no_update BEFORE UPDATE ON consents
BEGIN SELECT RAISE(ABORT, 'consents are append-only'); END;
CREATE TRIGGER consents_no_delete BEFORE DELETE ON consents
BEGIN SELECT RAISE(ABORT, 'consents are append-only'); END;
CREATE TRIGGER consents_no_replace BEFORE INSERT ON consents
WHEN EXISTS (SELECT 1 FROM consents WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'consents are append-only'); END;
CREATE TRIGGER erasures_no_update BEFORE UPDATE ON erasures
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;
CREATE TRIGGER erasures_no_delete BEFORE DELETE ON erasures
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;
CREATE TRIGGER erasures_no_replace BEFORE INSERT ON erasures
WHEN EXISTS (
    SELECT 1 FROM erasures WHERE number = NEW.number OR (subject = NEW.subject AND record = NEW.record))
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;

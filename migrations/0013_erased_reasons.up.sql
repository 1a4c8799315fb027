-- The reason of an event can be erased: 'event' names an event of a session, 'study-event' the event of its study that
-- repeats the reason.
-- A CHECK cannot be changed, so the table is made anew. Triggers of other tables name it; the old way of renaming
-- leaves them as they are.
PRAGMA legacy_alter_table = ON;
CREATE TABLE erasures_anew (
    number INTEGER PRIMARY KEY,
    session TEXT NOT NULL REFERENCES sessions,
    subject TEXT NOT NULL CHECK (subject IN ('answer', 'comment', 'correction', 'event', 'study-event')),
    record TEXT NOT NULL,
    reason TEXT NOT NULL,
    role TEXT NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    UNIQUE (subject, record)
) STRICT;
INSERT INTO erasures_anew SELECT * FROM erasures;
CREATE TABLE unfinished_erasures_anew (
    number INTEGER PRIMARY KEY REFERENCES erasures_anew
) STRICT;
INSERT INTO unfinished_erasures_anew SELECT * FROM unfinished_erasures;
DROP TABLE unfinished_erasures;
DROP TABLE erasures;
ALTER TABLE erasures_anew RENAME TO erasures;
ALTER TABLE unfinished_erasures_anew RENAME TO unfinished_erasures;
PRAGMA legacy_alter_table = OFF;

CREATE INDEX erasures_by_session ON erasures (session, number);
CREATE TRIGGER erasures_no_update BEFORE UPDATE ON erasures
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;
CREATE TRIGGER erasures_no_delete BEFORE DELETE ON erasures
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;
CREATE TRIGGER erasures_no_replace BEFORE INSERT ON erasures
WHEN EXISTS (
    SELECT 1 FROM erasures WHERE number = NEW.number OR (subject = NEW.subject AND record = NEW.record))
BEGIN SELECT RAISE(ABORT, 'erasures are append-only'); END;

-- Only an erasure changes an event, and only its reason to nothing.
DROP TRIGGER events_no_update;
CREATE TRIGGER events_no_update BEFORE UPDATE ON events
WHEN NEW.payload ->> 'reason' IS NOT ''
    OR json_remove(NEW.payload, '$.reason') IS NOT json_remove(OLD.payload, '$.reason')
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'event' AND record = OLD.session || '/' || OLD.number)
    OR (NEW.session, NEW.number, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.role, NEW.kind)
    IS NOT (OLD.session, OLD.number, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.role, OLD.kind)
BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
DROP TRIGGER study_events_no_update;
CREATE TRIGGER study_events_no_update BEFORE UPDATE ON study_events
WHEN NEW.reason IS NOT ''
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'study-event' AND record = OLD.study || '/' || OLD.number)
    OR (NEW.study, NEW.number, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.role, NEW.person, NEW.kind, NEW.session,
        NEW.commitment)
    IS NOT (OLD.study, OLD.number, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.role, OLD.person, OLD.kind, OLD.session,
        OLD.commitment)
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;

DROP TRIGGER study_events_no_update;
CREATE TRIGGER study_events_no_update BEFORE UPDATE ON study_events
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;
DROP TRIGGER events_no_update;
CREATE TRIGGER events_no_update BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;

-- Where a reason was erased, the check refuses its row, and the database stays as it is.
PRAGMA legacy_alter_table = ON;
CREATE TABLE erasures_anew (
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

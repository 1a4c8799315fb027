-- Studies: what was planned, what became of it, and which sessions belong to it. A session without a row in
-- study_sessions is outside any study, as is every session of an earlier version.
-- study is the name that the definition gives; the same definition has the same name and hash at every site. sites is a
-- JSON list: the sites of the study that this database runs.
CREATE TABLE studies (
    study TEXT PRIMARY KEY,
    wall TEXT NOT NULL,
    definition TEXT NOT NULL,
    definition_sha256 TEXT NOT NULL,
    sites TEXT NOT NULL CHECK (json_valid(sites))
) STRICT;

-- The protocols as they were when the study was planned. The definition names their hashes.
CREATE TABLE study_protocols (
    study TEXT NOT NULL REFERENCES studies,
    protocol TEXT NOT NULL,
    protocol_toml TEXT NOT NULL,
    PRIMARY KEY (study, protocol)
) STRICT, WITHOUT ROWID;

-- What all orders of the study are drawn from, since it was opened. The commitment of the event 'opened' binds it.
CREATE TABLE study_seeds (
    study TEXT PRIMARY KEY REFERENCES studies,
    seed TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- run and monotonic_ns are empty for what was done from the command line. session is the one that the event is about;
-- commitment is that of the orders, which the first opening makes known.
CREATE TABLE study_events (
    study TEXT NOT NULL REFERENCES studies,
    number INTEGER NOT NULL,
    run INTEGER REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER,
    role TEXT NOT NULL,
    person TEXT NOT NULL,
    reason TEXT NOT NULL,
    kind TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    commitment TEXT,
    PRIMARY KEY (study, number)
) STRICT, WITHOUT ROWID;

-- place counts from 1 in the list of a site and a protocol.
CREATE TABLE study_sessions (
    session TEXT PRIMARY KEY REFERENCES sessions,
    study TEXT NOT NULL REFERENCES studies,
    site TEXT NOT NULL,
    protocol TEXT NOT NULL,
    place INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX study_sessions_by_study ON study_sessions (study);

CREATE TRIGGER studies_no_update BEFORE UPDATE ON studies BEGIN SELECT RAISE(ABORT, 'studies are append-only'); END;
CREATE TRIGGER studies_no_delete BEFORE DELETE ON studies BEGIN SELECT RAISE(ABORT, 'studies are append-only'); END;
CREATE TRIGGER studies_no_replace BEFORE INSERT ON studies
WHEN EXISTS (SELECT 1 FROM studies WHERE study = NEW.study OR rowid = NEW.rowid)
BEGIN SELECT RAISE(ABORT, 'studies are append-only'); END;
CREATE TRIGGER study_protocols_no_update BEFORE UPDATE ON study_protocols
BEGIN SELECT RAISE(ABORT, 'study_protocols are append-only'); END;
CREATE TRIGGER study_protocols_no_delete BEFORE DELETE ON study_protocols
BEGIN SELECT RAISE(ABORT, 'study_protocols are append-only'); END;
CREATE TRIGGER study_protocols_no_replace BEFORE INSERT ON study_protocols
WHEN EXISTS (SELECT 1 FROM study_protocols WHERE study = NEW.study AND protocol = NEW.protocol)
BEGIN SELECT RAISE(ABORT, 'study_protocols are append-only'); END;
CREATE TRIGGER study_seeds_no_update BEFORE UPDATE ON study_seeds
BEGIN SELECT RAISE(ABORT, 'study_seeds are append-only'); END;
CREATE TRIGGER study_seeds_no_delete BEFORE DELETE ON study_seeds
BEGIN SELECT RAISE(ABORT, 'study_seeds are append-only'); END;
CREATE TRIGGER study_seeds_no_replace BEFORE INSERT ON study_seeds
WHEN EXISTS (SELECT 1 FROM study_seeds WHERE study = NEW.study)
BEGIN SELECT RAISE(ABORT, 'study_seeds are append-only'); END;
CREATE TRIGGER study_events_no_update BEFORE UPDATE ON study_events
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;
CREATE TRIGGER study_events_no_delete BEFORE DELETE ON study_events
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;
CREATE TRIGGER study_events_no_replace BEFORE INSERT ON study_events
WHEN EXISTS (SELECT 1 FROM study_events WHERE study = NEW.study AND number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;
CREATE TRIGGER study_sessions_no_update BEFORE UPDATE ON study_sessions
BEGIN SELECT RAISE(ABORT, 'study_sessions are append-only'); END;
CREATE TRIGGER study_sessions_no_delete BEFORE DELETE ON study_sessions
BEGIN SELECT RAISE(ABORT, 'study_sessions are append-only'); END;
CREATE TRIGGER study_sessions_no_replace BEFORE INSERT ON study_sessions
WHEN EXISTS (SELECT 1 FROM study_sessions WHERE session = NEW.session)
BEGIN SELECT RAISE(ABORT, 'study_sessions are append-only'); END;

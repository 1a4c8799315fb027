-- Everything that parfocal keeps. Wall times are UTC in RFC 3339; monotonic times are nanoseconds of the machine's
-- monotonic clock, comparable within a run of the server (and its machine's boot). Focal power is 0..1.

-- One row for each start of the server.
CREATE TABLE runs (
    run INTEGER PRIMARY KEY,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    version TEXT NOT NULL,
    camera TEXT NOT NULL,
    lens TEXT NOT NULL,
    seed INTEGER
) STRICT;

CREATE TABLE participants (
    code TEXT PRIMARY KEY CHECK (length(code) BETWEEN 2 AND 16 AND code NOT GLOB '*[^A-Z0-9-]*'),
    wall TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- Sessions of a balanced set share a seed; set_index is their place in it.
CREATE TABLE sessions (
    session TEXT PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    participant TEXT NOT NULL REFERENCES participants,
    protocol TEXT NOT NULL,
    protocol_toml TEXT NOT NULL,
    protocol_sha256 TEXT NOT NULL,
    practice INTEGER NOT NULL CHECK (practice IN (0, 1)),
    algorithm TEXT NOT NULL,
    seed TEXT NOT NULL,
    set_index INTEGER NOT NULL,
    commitment TEXT NOT NULL
) STRICT;
CREATE INDEX sessions_by_set ON sessions (protocol_sha256, algorithm);

-- number is what telemetry carries, being shorter than the segment's id.
CREATE TABLE segments (
    number INTEGER PRIMARY KEY,
    segment TEXT NOT NULL UNIQUE,
    session TEXT NOT NULL REFERENCES sessions,
    setting INTEGER NOT NULL,
    policy TEXT NOT NULL,
    UNIQUE (session, setting)
) STRICT;

CREATE TABLE events (
    session TEXT NOT NULL REFERENCES sessions,
    number INTEGER NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    role TEXT NOT NULL,
    kind TEXT NOT NULL,
    payload TEXT NOT NULL CHECK (json_valid(payload)),
    PRIMARY KEY (session, number)
) STRICT, WITHOUT ROWID;

-- key is the browser's idempotency key: a comment sent twice is one row.
CREATE TABLE comments (
    number INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE,
    session TEXT NOT NULL REFERENCES sessions,
    segment TEXT REFERENCES segments (segment),
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    client_millis INTEGER,
    frame INTEGER,
    kind TEXT NOT NULL,
    text TEXT
) STRICT;
CREATE INDEX comments_by_session ON comments (session, number);

-- A changed answer is a further row; the latest counts.
CREATE TABLE answers (
    number INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE,
    session TEXT NOT NULL REFERENCES sessions,
    segment TEXT REFERENCES segments (segment),
    question TEXT NOT NULL,
    value TEXT NOT NULL CHECK (json_valid(value)),
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX answers_by_session ON answers (session, number);

-- How far a segment's clock had come, written each second so that a restart loses no more than that.
CREATE TABLE session_clocks (
    session TEXT PRIMARY KEY REFERENCES sessions,
    segment TEXT NOT NULL REFERENCES segments (segment),
    inspected_ms INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE policies (
    number INTEGER PRIMARY KEY,
    name TEXT NOT NULL UNIQUE
) STRICT;

-- Fifty rows a second all day long: numbers only, and one index over the rows of trials alone.
CREATE TABLE telemetry (
    number INTEGER PRIMARY KEY,
    run INTEGER NOT NULL,
    frame INTEGER NOT NULL,
    exposed_ns INTEGER NOT NULL,
    segment INTEGER REFERENCES segments (number),
    policy INTEGER REFERENCES policies (number),
    asked REAL NOT NULL,
    measured REAL,
    metric REAL,
    policy_micros INTEGER NOT NULL,
    latency_micros INTEGER NOT NULL,
    held TEXT,
    optimal REAL
) STRICT;
CREATE INDEX telemetry_by_segment ON telemetry (segment, number) WHERE segment IS NOT NULL;

CREATE TABLE device_events (
    number INTEGER PRIMARY KEY,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    device TEXT NOT NULL,
    working INTEGER NOT NULL CHECK (working IN (0, 1)),
    message TEXT NOT NULL
) STRICT;

-- What was recorded of a trial stays as it was recorded, whoever has the file open.
CREATE TRIGGER sessions_no_update BEFORE UPDATE ON sessions BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER sessions_no_delete BEFORE DELETE ON sessions BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER segments_no_update BEFORE UPDATE ON segments BEGIN SELECT RAISE(ABORT, 'segments are append-only'); END;
CREATE TRIGGER segments_no_delete BEFORE DELETE ON segments BEGIN SELECT RAISE(ABORT, 'segments are append-only'); END;
CREATE TRIGGER events_no_update BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
CREATE TRIGGER events_no_delete BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
CREATE TRIGGER comments_no_update BEFORE UPDATE ON comments BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
CREATE TRIGGER comments_no_delete BEFORE DELETE ON comments BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
CREATE TRIGGER answers_no_update BEFORE UPDATE ON answers BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END;
CREATE TRIGGER answers_no_delete BEFORE DELETE ON answers BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END;

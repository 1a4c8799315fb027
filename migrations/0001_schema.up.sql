-- Everything that parfocal keeps. Wall times are UTC in RFC 3339; monotonic times are nanoseconds of the machine's
-- monotonic clock, comparable within a run of the server (and its machine's boot). Focal power is 0..1.

-- One row for each start of the server. calibration is the sensor's. weights is the SHA-256 of each learned policy's
-- weights, by its name. blur is how fast the optic blurs, as the policies were told: pixels a unit of focal power; NULL
-- where they were told nothing.
CREATE TABLE runs (
    run INTEGER PRIMARY KEY,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    version TEXT NOT NULL,
    camera TEXT NOT NULL,
    lens TEXT NOT NULL,
    calibration TEXT NOT NULL,
    weights TEXT NOT NULL CHECK (json_valid(weights)),
    blur REAL,
    seed INTEGER
) STRICT;

-- When the last step of a run was taken. The next start of the server notes it.
CREATE TABLE run_ends (
    run INTEGER PRIMARY KEY,
    monotonic_ns INTEGER NOT NULL
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

-- key is the browser's idempotency key: a comment sent twice is one row. device and sequence say where it was said;
-- sequence counts up with everything that is said on a device. waited_ms is how long it waited on the device before it
-- was sent, and waited_by the clock that measured this. Frames are counted anew in each run, and a comment may be kept
-- in a later one than it was made in: frame_run is the run that counted the frame. picture_width and
-- pictures_per_second are what the surgeon saw then, as the page counted it. late is whether it arrived when
-- nothing counted any more.
CREATE TABLE comments (
    number INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE,
    session TEXT NOT NULL REFERENCES sessions,
    segment TEXT REFERENCES segments (segment),
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    device TEXT,
    sequence INTEGER,
    client_millis INTEGER,
    waited_ms INTEGER CHECK (waited_ms >= 0),
    waited_by TEXT CHECK (waited_by IN ('page-clock', 'wall-clock')),
    late INTEGER NOT NULL CHECK (late IN (0, 1)),
    frame INTEGER,
    frame_run INTEGER,
    picture_width INTEGER CHECK (picture_width > 0),
    pictures_per_second REAL CHECK (pictures_per_second >= 0),
    kind TEXT NOT NULL,
    text TEXT
) STRICT;
CREATE INDEX comments_by_session ON comments (session, number);

-- A changed answer is a further row. The one given last counts, late ones left aside.
CREATE TABLE answers (
    number INTEGER PRIMARY KEY,
    key TEXT NOT NULL UNIQUE,
    session TEXT NOT NULL REFERENCES sessions,
    segment TEXT REFERENCES segments (segment),
    question TEXT NOT NULL,
    value TEXT NOT NULL CHECK (json_valid(value)),
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    device TEXT,
    sequence INTEGER,
    client_millis INTEGER,
    waited_ms INTEGER CHECK (waited_ms >= 0),
    waited_by TEXT CHECK (waited_by IN ('page-clock', 'wall-clock')),
    late INTEGER NOT NULL CHECK (late IN (0, 1))
) STRICT;
CREATE INDEX answers_by_session ON answers (session, number);

-- How much of what was said in a session each surgeon's device held when it last told.
CREATE TABLE surgeon_devices (
    session TEXT NOT NULL REFERENCES sessions,
    device TEXT NOT NULL,
    holding INTEGER NOT NULL,
    run INTEGER NOT NULL REFERENCES runs,
    monotonic_ns INTEGER NOT NULL,
    PRIMARY KEY (session, device)
) STRICT, WITHOUT ROWID;

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

-- Fifty rows a second all day long: numbers only, and one index over the rows of trials alone. picture_width is that of
-- the surgeon's picture at that time; patch_x and patch_y are the patch's left column and top row, in mosaic cells.
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
    optimal REAL,
    picture_width INTEGER,
    patch_x INTEGER NOT NULL,
    patch_y INTEGER NOT NULL
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

-- The chain: a row for each record that counts as evidence, written in the same transaction as the record.
-- docs/evidence.md tells, byte for byte, what is hashed. place counts the rows of a session from 1. sealed is the hash
-- of what of the record can be withheld or erased; its salt is in chain_salts.
CREATE TABLE chain (
    number INTEGER PRIMARY KEY,
    wall TEXT NOT NULL,
    kind TEXT NOT NULL,
    key TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    place INTEGER,
    salt TEXT NOT NULL,
    sealed TEXT NOT NULL,
    content TEXT NOT NULL,
    previous TEXT NOT NULL,
    hash TEXT NOT NULL,
    UNIQUE (kind, key)
) STRICT;
CREATE UNIQUE INDEX chain_by_session ON chain (session, place) WHERE session IS NOT NULL;

CREATE TABLE chain_salts (
    number INTEGER PRIMARY KEY REFERENCES chain,
    salt TEXT NOT NULL
) STRICT;

-- Who looked at what of the evidence: let in by a role's link, a focal path seen, an export, a backup, a restore.
CREATE TABLE accesses (
    number INTEGER PRIMARY KEY,
    run INTEGER REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER,
    role TEXT NOT NULL,
    kind TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    detail TEXT
) STRICT;

-- Studies: what was planned, what became of it, and which sessions belong to it. A session without a row in
-- study_sessions is outside any study.
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

-- Words that were erased: the record stays, without its text and without the salt of its hash. 'event' names an event
-- of a session, whose reason is erased; 'study-event' the event of its study that repeats the reason.
CREATE TABLE erasures (
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
CREATE INDEX erasures_by_session ON erasures (session, number);

-- A working note: erased words may still stand in free pages of the file or in its log.
CREATE TABLE unfinished_erasures (
    number INTEGER PRIMARY KEY REFERENCES erasures
) STRICT;

-- Personal accounts. Of a passphrase only its argon2id hash is kept, with what it was made with (hexadecimal). Accounts
-- are never removed: records name them.
CREATE TABLE accounts (
    account TEXT PRIMARY KEY,
    display TEXT NOT NULL UNIQUE,
    role TEXT NOT NULL CHECK (role IN ('lead', 'operator', 'researcher', 'monitor')),
    disabled INTEGER NOT NULL CHECK (disabled IN (0, 1)),
    memory_kib INTEGER NOT NULL,
    passes INTEGER NOT NULL,
    salt TEXT NOT NULL,
    hash TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TRIGGER accounts_no_delete BEFORE DELETE ON accounts
BEGIN SELECT RAISE(ABORT, 'accounts are never removed'); END;

-- Working notes: the browsers that are signed in, by the SHA-256 of their token. Times are of the wall clock.
CREATE TABLE sign_ins (
    token_sha256 TEXT PRIMARY KEY,
    account TEXT NOT NULL REFERENCES accounts,
    began TEXT NOT NULL,
    used TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX sign_ins_by_account ON sign_ins (account);

-- What happened to accounts, sign-ins included. account is empty where somebody gave a name that no account has: it may
-- be a passphrase in the wrong field. done_by is the account of whoever did it; empty for the command line, and for a
-- failed attempt. run and monotonic_ns are empty for the command line.
CREATE TABLE account_events (
    number INTEGER PRIMARY KEY,
    run INTEGER REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER,
    account TEXT REFERENCES accounts,
    kind TEXT NOT NULL,
    done_by TEXT REFERENCES accounts,
    detail TEXT
) STRICT;

-- Under which account a record was made: a row beside the record, which is named by its kind and its key in the chain.
CREATE TABLE actors (
    number INTEGER PRIMARY KEY,
    kind TEXT NOT NULL,
    record TEXT NOT NULL,
    session TEXT REFERENCES sessions,
    account TEXT NOT NULL REFERENCES accounts,
    display TEXT NOT NULL,
    UNIQUE (kind, record)
) STRICT;
CREATE INDEX actors_by_session ON actors (session, number);

-- Voice: what a surgeon said aloud, in the pieces in which the page sent it while it was spoken. comment is the key of
-- the comment that it belongs to, whose kind is 'voice'; piece counts from 1. through_ms is how far the recording had
-- come at the piece's end, by the page. ended says on the last piece why the recording ended; without one it was cut
-- off. audio is empty where it was erased: bytes and sha256 stay.
CREATE TABLE voice_pieces (
    number INTEGER PRIMARY KEY,
    comment TEXT NOT NULL REFERENCES comments (key),
    session TEXT NOT NULL REFERENCES sessions,
    piece INTEGER NOT NULL CHECK (piece > 0),
    media_type TEXT NOT NULL,
    through_ms INTEGER NOT NULL CHECK (through_ms >= 0),
    ended TEXT CHECK (ended IN ('released', 'limit', 'microphone-lost', 'left')),
    bytes INTEGER NOT NULL,
    sha256 TEXT NOT NULL,
    audio BLOB,
    run INTEGER NOT NULL REFERENCES runs,
    wall TEXT NOT NULL,
    monotonic_ns INTEGER NOT NULL,
    UNIQUE (comment, piece)
) STRICT;
CREATE INDEX voice_pieces_by_session ON voice_pieces (session, number);

-- What was recorded of a trial stays as it was recorded, whoever has the file open.
CREATE TRIGGER sessions_no_update BEFORE UPDATE ON sessions BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER sessions_no_delete BEFORE DELETE ON sessions BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER segments_no_update BEFORE UPDATE ON segments BEGIN SELECT RAISE(ABORT, 'segments are append-only'); END;
CREATE TRIGGER segments_no_delete BEFORE DELETE ON segments BEGIN SELECT RAISE(ABORT, 'segments are append-only'); END;
CREATE TRIGGER events_no_delete BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
CREATE TRIGGER comments_no_delete BEFORE DELETE ON comments BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
CREATE TRIGGER answers_no_delete BEFORE DELETE ON answers BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END;

-- REPLACE takes rows away without asking the triggers on DELETE, so what is there already is not inserted again. A
-- comment or an answer that was sent twice is passed over in silence, as the program relies on (ON CONFLICT DO
-- NOTHING).
CREATE TRIGGER sessions_no_replace BEFORE INSERT ON sessions
WHEN EXISTS (SELECT 1 FROM sessions WHERE session = NEW.session OR rowid = NEW.rowid)
BEGIN SELECT RAISE(ABORT, 'sessions are append-only'); END;
CREATE TRIGGER segments_no_replace BEFORE INSERT ON segments
WHEN EXISTS (
    SELECT 1 FROM segments
    WHERE number = NEW.number OR segment = NEW.segment OR (session = NEW.session AND setting = NEW.setting))
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

CREATE TRIGGER chain_no_update BEFORE UPDATE ON chain BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_no_delete BEFORE DELETE ON chain BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_no_replace BEFORE INSERT ON chain
WHEN EXISTS (SELECT 1 FROM chain WHERE number = NEW.number OR (kind = NEW.kind AND key = NEW.key)
    OR (session = NEW.session AND place = NEW.place))
BEGIN SELECT RAISE(ABORT, 'chain is append-only'); END;
CREATE TRIGGER chain_salts_no_update BEFORE UPDATE ON chain_salts
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
CREATE TRIGGER chain_salts_no_replace BEFORE INSERT ON chain_salts
WHEN EXISTS (SELECT 1 FROM chain_salts WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'chain_salts is append-only'); END;
CREATE TRIGGER accesses_no_update BEFORE UPDATE ON accesses BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;
CREATE TRIGGER accesses_no_delete BEFORE DELETE ON accesses BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;
CREATE TRIGGER accesses_no_replace BEFORE INSERT ON accesses
WHEN EXISTS (SELECT 1 FROM accesses WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'accesses are append-only'); END;

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

-- Only an erasure changes what was said, and only to nothing.
CREATE TRIGGER comments_no_update BEFORE UPDATE ON comments
WHEN NEW.text IS NOT '' OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'comment' AND record = OLD.key)
    OR (NEW.number, NEW.key, NEW.session, NEW.segment, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.client_millis,
        NEW.frame, NEW.kind, NEW.frame_run, NEW.picture_width, NEW.pictures_per_second, NEW.waited_ms, NEW.device,
        NEW.sequence, NEW.waited_by, NEW.late)
    IS NOT (OLD.number, OLD.key, OLD.session, OLD.segment, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.client_millis,
        OLD.frame, OLD.kind, OLD.frame_run, OLD.picture_width, OLD.pictures_per_second, OLD.waited_ms, OLD.device,
        OLD.sequence, OLD.waited_by, OLD.late)
BEGIN SELECT RAISE(ABORT, 'comments are append-only'); END;
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

-- Only an erasure changes an event, and only its reason to nothing.
CREATE TRIGGER events_no_update BEFORE UPDATE ON events
WHEN NEW.payload ->> 'reason' IS NOT ''
    OR json_remove(NEW.payload, '$.reason') IS NOT json_remove(OLD.payload, '$.reason')
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'event' AND record = OLD.session || '/' || OLD.number)
    OR (NEW.session, NEW.number, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.role, NEW.kind)
    IS NOT (OLD.session, OLD.number, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.role, OLD.kind)
BEGIN SELECT RAISE(ABORT, 'events are append-only'); END;
CREATE TRIGGER study_events_no_update BEFORE UPDATE ON study_events
WHEN NEW.reason IS NOT ''
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'study-event' AND record = OLD.study || '/' || OLD.number)
    OR (NEW.study, NEW.number, NEW.run, NEW.wall, NEW.monotonic_ns, NEW.role, NEW.person, NEW.kind, NEW.session,
        NEW.commitment)
    IS NOT (OLD.study, OLD.number, OLD.run, OLD.wall, OLD.monotonic_ns, OLD.role, OLD.person, OLD.kind, OLD.session,
        OLD.commitment)
BEGIN SELECT RAISE(ABORT, 'study_events are append-only'); END;

CREATE TRIGGER account_events_no_update BEFORE UPDATE ON account_events
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER account_events_no_delete BEFORE DELETE ON account_events
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER account_events_no_replace BEFORE INSERT ON account_events
WHEN EXISTS (SELECT 1 FROM account_events WHERE number = NEW.number)
BEGIN SELECT RAISE(ABORT, 'account_events are append-only'); END;
CREATE TRIGGER actors_no_update BEFORE UPDATE ON actors BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;
CREATE TRIGGER actors_no_delete BEFORE DELETE ON actors BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;
CREATE TRIGGER actors_no_replace BEFORE INSERT ON actors
WHEN EXISTS (SELECT 1 FROM actors WHERE number = NEW.number OR (kind = NEW.kind AND record = NEW.record))
BEGIN SELECT RAISE(ABORT, 'actors are append-only'); END;

-- Only the erasure of its comment takes the sound away, and nothing else with it.
CREATE TRIGGER voice_pieces_no_update BEFORE UPDATE ON voice_pieces
WHEN NEW.audio IS NOT NULL
    OR NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'comment' AND record = OLD.comment)
    OR (NEW.number, NEW.comment, NEW.session, NEW.piece, NEW.media_type, NEW.through_ms, NEW.ended, NEW.bytes,
        NEW.sha256, NEW.run, NEW.wall, NEW.monotonic_ns)
    IS NOT (OLD.number, OLD.comment, OLD.session, OLD.piece, OLD.media_type, OLD.through_ms, OLD.ended, OLD.bytes,
        OLD.sha256, OLD.run, OLD.wall, OLD.monotonic_ns)
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;
CREATE TRIGGER voice_pieces_no_delete BEFORE DELETE ON voice_pieces
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;
CREATE TRIGGER voice_pieces_no_replace BEFORE INSERT ON voice_pieces
WHEN EXISTS (
    SELECT 1 FROM voice_pieces
    WHERE number = NEW.number OR (comment = NEW.comment AND piece = NEW.piece))
BEGIN SELECT RAISE(ABORT, 'voice_pieces are append-only'); END;

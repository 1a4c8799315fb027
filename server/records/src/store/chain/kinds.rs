//! The kinds of records that the chain has rows for: where each is kept, and which of its columns are hashed.

/// A kind of record.
#[derive(Debug)]
pub struct Kind {
    /// Its name, as in the chain.
    pub name: &'static str,
    /// Name of its table in exports.
    pub table: &'static str,
    /// Columns that an export never withholds.
    pub open: &'static [&'static str],
    /// Columns that can be withheld or erased. They are hashed with a salt of their own.
    pub sealed: &'static [&'static str],
    /// SQL that selects `chain_key`, `chain_session`, `chain_order` and every column as exports have it.
    pub select: &'static str,
    /// SQL condition that picks one record by its key. The parts of the key, divided by slashes, are its parameters.
    pub one: &'static str,
    /// SQL expression for the order in which records are kept.
    pub order: &'static str,
}

const RUN: Kind = Kind {
    name: "run",
    table: "runs",
    open: &["run", "wall", "monotonic_ns", "version", "camera", "lens", "calibration", "blur"],
    sealed: &["weights", "seed"],
    select: "SELECT CAST(run AS TEXT) AS chain_key, NULL AS chain_session, run AS chain_order, * FROM runs",
    one: "run = ?",
    order: "run",
};

const PARTICIPANT: Kind = Kind {
    name: "participant",
    table: "participants",
    open: &["code", "wall"],
    sealed: &[],
    select: "SELECT code AS chain_key, NULL AS chain_session, 0 AS chain_order, * FROM participants",
    one: "code = ?",
    order: "wall, code",
};

const SESSION: Kind = Kind {
    name: "session",
    table: "sessions",
    open: &[
        "session",
        "participant",
        "protocol",
        "protocol_sha256",
        "practice",
        "algorithm",
        "commitment",
        "wall",
        "run",
        "monotonic_ns",
        "segments",
    ],
    sealed: &[],
    select:
        "SELECT session AS chain_key, session AS chain_session, rowid AS chain_order, session, participant, protocol,
         protocol_sha256, iif(practice, 'true', 'false') AS practice, algorithm, commitment, wall, run, monotonic_ns,
         (SELECT group_concat(segment, ',') FROM (
             SELECT segment FROM segments AS g WHERE g.session = sessions.session ORDER BY setting)) AS segments
         FROM sessions",
    one: "session = ?",
    order: "rowid",
};

// Two columns hold the kind of an event. If they differ, neither is believed.
const EVENT: Kind = Kind {
    name: "event",
    table: "events",
    open: &["session", "number", "wall", "run", "monotonic_ns", "role", "kind", "segment", "inspected_ms", "emergency"],
    sealed: &["reason"],
    select: "SELECT session || '/' || number AS chain_key, session AS chain_session, number AS chain_order, session,
         number, wall, run, monotonic_ns, role, iif(kind IS payload ->> 'kind', kind, 'unclear') AS kind,
         payload ->> 'segment' AS segment, payload ->> 'inspected_ms' AS inspected_ms,
         CASE payload ->> 'emergency' WHEN 1 THEN 'true' WHEN 0 THEN 'false' END AS emergency,
         payload ->> 'reason' AS reason FROM events",
    one: "session = ? AND number = ?",
    order: "(SELECT s.rowid FROM sessions AS s WHERE s.session = events.session), events.number",
};

const COMMENT: Kind = Kind {
    name: "comment",
    table: "comments",
    open: &[
        "key",
        "session",
        "segment",
        "kind",
        "frame",
        "frame_run",
        "wall",
        "run",
        "monotonic_ns",
        "client_millis",
        "waited_ms",
        "waited_by",
        "device",
        "sequence",
        "late",
    ],
    sealed: &["text"],
    select: "SELECT key AS chain_key, session AS chain_session, number AS chain_order, key, session, segment, kind,
         iif(frame < 0, format('%u', frame), frame) AS frame, frame_run, wall, run, monotonic_ns, client_millis,
         iif(waited_ms >= 0, waited_ms, NULL) AS waited_ms,
         iif(waited_ms >= 0, coalesce(waited_by, 'wall-clock'), NULL) AS waited_by, device, sequence,
         iif(late, 'true', 'false') AS late, text FROM comments",
    one: "key = ?",
    order: "number",
};

const ANSWER: Kind = Kind {
    name: "answer",
    table: "answers",
    open: &[
        "key",
        "session",
        "segment",
        "question",
        "wall",
        "run",
        "monotonic_ns",
        "client_millis",
        "waited_ms",
        "waited_by",
        "device",
        "sequence",
        "late",
    ],
    sealed: &["given_value"],
    select: "SELECT key AS chain_key, session AS chain_session, number AS chain_order, key, session, segment, question,
         wall, run, monotonic_ns, client_millis, iif(waited_ms >= 0, waited_ms, NULL) AS waited_ms,
         iif(waited_ms >= 0, coalesce(waited_by, 'wall-clock'), NULL) AS waited_by, device, sequence,
         iif(late, 'true', 'false') AS late, value AS given_value FROM answers",
    one: "key = ?",
    order: "number",
};

const DEVICE: Kind = Kind {
    name: "device",
    table: "devices",
    open: &["number", "wall", "run", "monotonic_ns", "device", "working", "message"],
    sealed: &[],
    select: "SELECT CAST(number AS TEXT) AS chain_key, NULL AS chain_session, number AS chain_order, number, wall, run,
         monotonic_ns, device, iif(working, 'true', 'false') AS working, message FROM device_events",
    one: "number = ?",
    order: "number",
};

const ACCESS: Kind = Kind {
    name: "access",
    table: "accesses",
    open: &["number", "wall", "run", "monotonic_ns", "role", "kind", "session", "detail"],
    sealed: &[],
    select: "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, *
         FROM accesses",
    one: "number = ?",
    order: "number",
};

const CORRECTION: Kind = Kind {
    name: "correction",
    table: "corrections",
    open: &["number", "session", "subject", "record", "field", "role", "wall", "run", "monotonic_ns"],
    sealed: &["old_value", "new_value", "reason"],
    select: "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, *
         FROM corrections",
    one: "number = ?",
    order: "number",
};

const CONSENT: Kind = Kind {
    name: "consent",
    table: "consents",
    open: &["number", "session", "text_version", "given_on", "medium", "role", "wall", "run", "monotonic_ns"],
    sealed: &["obtained_by"],
    select: "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, *
         FROM consents",
    one: "number = ?",
    order: "number",
};

const ERASURE: Kind = Kind {
    name: ERASED,
    table: "erasures",
    open: &["number", "session", "subject", "record", "role", "wall", "run", "monotonic_ns"],
    sealed: &["reason"],
    select: "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, *
         FROM erasures",
    one: "number = ?",
    order: "number",
};

const STUDY: Kind = Kind {
    name: "study",
    table: "studies",
    open: &["study", "definition_sha256", "sites", "wall"],
    sealed: &[],
    select: "SELECT study AS chain_key, NULL AS chain_session, rowid AS chain_order, study, definition_sha256, sites,
         wall FROM studies",
    one: "study = ?",
    order: "rowid",
};

const STUDY_EVENT: Kind = Kind {
    name: "study-event",
    table: "study_events",
    open: &["study", "number", "wall", "run", "monotonic_ns", "role", "person", "kind", "about_session", "commitment"],
    sealed: &["reason"],
    select: "SELECT study || '/' || number AS chain_key, NULL AS chain_session, 0 AS chain_order, study, number, wall,
         run, monotonic_ns, role, person, kind, session AS about_session, commitment, reason FROM study_events",
    one: "study = ? AND number = ?",
    order: "study, number",
};

const STUDY_SESSION: Kind = Kind {
    name: "study-session",
    table: "study_sessions",
    open: &["session", "study", "site", "protocol", "place"],
    sealed: &[],
    select: "SELECT session AS chain_key, session AS chain_session, 0 AS chain_order, session, study, site, protocol,
         place FROM study_sessions",
    one: "session = ?",
    order: "session",
};

const ACCOUNT_EVENT: Kind = Kind {
    name: "account-event",
    table: "account_events",
    open: &["number", "run", "wall", "monotonic_ns", "account", "kind", "done_by", "detail"],
    sealed: &[],
    select: "SELECT CAST(number AS TEXT) AS chain_key, NULL AS chain_session, number AS chain_order, *
         FROM account_events",
    one: "number = ?",
    order: "number",
};

const ACTOR: Kind = Kind {
    name: "actor",
    table: "actors",
    open: &["number", "kind", "record", "session", "account", "display"],
    sealed: &[],
    select: "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, * FROM actors",
    one: "number = ?",
    order: "number",
};

// The sound itself is in none of these columns. Its hash is, and stays when the sound is erased.
const VOICE_PIECE: Kind = Kind {
    name: "voice-piece",
    table: "voice_pieces",
    open: &[
        "number",
        "session",
        "comment",
        "piece",
        "media_type",
        "through_ms",
        "ended",
        "bytes",
        "sha256",
        "wall",
        "run",
        "monotonic_ns",
    ],
    sealed: &[],
    select:
        "SELECT CAST(number AS TEXT) AS chain_key, session AS chain_session, number AS chain_order, number, session,
         comment, piece, media_type, through_ms, ended, bytes, sha256, wall, run, monotonic_ns FROM voice_pieces",
    one: "number = ?",
    order: "number",
};

/// Every kind except telemetry, which is chained in blocks.
pub const KINDS: [Kind; 17] = [
    RUN,
    PARTICIPANT,
    SESSION,
    EVENT,
    COMMENT,
    ANSWER,
    DEVICE,
    ACCESS,
    CORRECTION,
    CONSENT,
    ERASURE,
    STUDY,
    STUDY_EVENT,
    STUDY_SESSION,
    ACCOUNT_EVENT,
    ACTOR,
    VOICE_PIECE,
];

/// The kind called `name`.
pub fn kind(name: &str) -> Option<&'static Kind> {
    static ALL: [Kind; KINDS.len()] = KINDS;
    ALL.iter().find(|kind| kind.name == name)
}

/// The kind of a block of telemetry: consecutive steps of a segment. Its key is `SEGMENT/FIRST/LAST`, counted from 1
/// within the segment.
pub const TELEMETRY: &str = "telemetry";

/// The kind of a record that says that the sealed columns of another one were erased.
pub const ERASED: &str = "erasure";

/// The kind of an event whose reason may name a policy.
pub const UNBLINDED: &str = "unblinded";

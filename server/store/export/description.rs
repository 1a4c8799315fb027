//! The data dictionary: every table and column of an export.

use super::table::Type::{Boolean, Datetime, Integer, Number, String};
use super::table::{Column, Table, Type};

const fn column(name: &'static str, kind: Type, unit: &'static str, description: &'static str) -> Column {
    Column { name, kind, unit, description, since: 1 }
}

/// `column`, which exports of the first format did not have.
const fn new_in_2(column: Column) -> Column {
    Column { since: 2, ..column }
}

const SESSION: Column = column("session", String, "", "Session's random id");
const SETTING: Column =
    column("setting", Integer, "", "Number of the setting in the session, from 1, as the surgeon read it");
const SEGMENT: Column = column("segment", String, "", "Segment's random id, never shared by two segments");
const WALL: Column = column("wall", Datetime, "UTC", "When it was recorded, by the server's wall clock");
const RUN: Column = column("run", Integer, "", "Start of the server that recorded it; see runs");
const MONOTONIC: Column =
    column("monotonic_ns", Integer, "ns", "When it was recorded, by the monotonic clock; comparable within a run");
const DEVICE: Column = new_in_2(column(
    "device",
    String,
    "",
    "Random id of the surgeon's device, kept by its browser; empty where the page told none",
));
const SEQUENCE: Column = new_in_2(column(
    "sequence",
    Integer,
    "",
    "Counts up with everything that was said on the device, in whatever tab; gaps mean nothing",
));
const WAITED_BY: Column = new_in_2(column(
    "waited_by",
    String,
    "",
    "Clock that measured waited_ms: page-clock, which nobody can set; or wall-clock, the device's, which may have been set meanwhile, where the page was loaded anew or the device slept before sending",
));
const CLIENT_MILLIS: Column =
    column("client_millis", Integer, "ms", "The browser's clock when it was said, milliseconds since 1970-01-01 UTC");
const WAITED: Column = column(
    "waited_ms",
    Integer,
    "ms",
    "Time between saying and sending, on the surgeon's device: said at wall less this",
);
const LATE: Column = new_in_2(column(
    "late",
    Boolean,
    "",
    "Whether it arrived after counts_until of sessions.csv; always false of what was kept by a version without that time",
));
const FRAME: Column = column("frame", Integer, "", "Frame's number within the run");
const EXPOSED: Column = column("exposed_ns", Integer, "ns", "End of the exposure, by the monotonic clock");
const KEY: Column = column("key", String, "", "Key by which the browser could send it again without it counting twice");

/// Starts of the server.
pub const RUNS: Table = Table {
    name: "runs",
    description: "The starts of the server that the session's records belong to; by their clocks a monotonic time has a time of day",
    columns: &[
        column("run", Integer, "", "Start of the server, counting from 1"),
        column("wall", Datetime, "UTC", "The wall clock at the start"),
        column("monotonic_ns", Integer, "ns", "The monotonic clock at the start"),
        column("version", String, "", "Version of parfocal"),
        column("camera", String, "", "The camera"),
        column("lens", String, "", "The lens"),
        column("calibration", String, "", "The sensor's calibration: name, unit, version and date"),
    ],
    key: &["run"],
};

/// The session.
pub const SESSIONS: Table = Table {
    name: "sessions",
    description: "The session",
    columns: &[
        SESSION,
        column("participant", String, "", "Participant's code"),
        column("protocol", String, "", "Protocol's name; its text is protocol.toml"),
        column("protocol_sha256", String, "", "SHA-256 of protocol.toml"),
        column("practice", Boolean, "", "Whether it is practice, never to be mixed with real data"),
        column("algorithm", String, "", "Algorithm that drew the order from the seed"),
        column("commitment", String, "", "SHA-256 published when the session was made; commits to seed and order"),
        column("wall", Datetime, "UTC", "When it was made, by the server's wall clock"),
        column("run", Integer, "", "Start of the server that made it; see runs"),
        column("status", String, "", "under-way, completed or aborted"),
        column("settings", Integer, "", "Settings in all"),
        column("finished_settings", Integer, "", "Settings inspected to the end"),
        column("comments", Integer, "", "Comments kept"),
        column("unblinded", String, "", "no; after-end; or while-under-way, which is emergency unblinding"),
        new_in_2(column(
            "counts_until",
            Datetime,
            "UTC",
            "Until when what arrived counts: the session's end and the protocol's grace_minutes, or unblinding if that came first; empty while the session is under way",
        )),
    ],
    key: &["session"],
};

/// Its segments.
pub const SEGMENTS: Table = Table {
    name: "segments",
    description: "The session's settings in order, one policy's segment each; which, allocation.csv tells after unblinding",
    columns: &[
        SESSION,
        SETTING,
        SEGMENT,
        column("started", Datetime, "UTC", "When inspection began, by the server's wall clock; empty if it never did"),
        column("finished", Datetime, "UTC", "When inspection ended, by the server's wall clock"),
        column("finished_by", String, "", "Who ended it: surgeon, operator, or system at the time limit"),
        column("inspected_seconds", Number, "s", "Time inspected, without pauses"),
    ],
    key: &["segment"],
};

/// What was said.
pub const COMMENTS: Table = Table {
    name: "comments",
    description: "What the surgeon said, in the order it was kept",
    columns: &[
        column("number", Integer, "", "Order of the comment in the session, from 1"),
        KEY,
        SESSION,
        SETTING,
        SEGMENT,
        column("kind", String, "", "text (typed), quick (one tap) or mark (\"mark this moment\")"),
        column("text", String, "", "What was said, as it was said; empty for a mark"),
        column("frame", Integer, "", "Number of the frame on the surgeon's screen"),
        column("frame_run", Integer, "", "Start of the server that counted that frame; see runs"),
        WALL,
        RUN,
        MONOTONIC,
        CLIENT_MILLIS,
        WAITED,
        WAITED_BY,
        DEVICE,
        SEQUENCE,
        LATE,
    ],
    key: &["key"],
};

/// Answers.
pub const ANSWERS: Table = Table {
    name: "answers",
    description: "Answers in the order they were kept, those that do not count included",
    columns: &[
        column("number", Integer, "", "Order of the answer in the session, from 1"),
        KEY,
        SESSION,
        column("setting", Integer, "", "Setting asked about, from 1; empty for a closing question"),
        column("segment", String, "", "Segment asked about; empty for a closing question"),
        column("question", String, "", "Question's id in the protocol"),
        column("question_text", String, "", "The question as the surgeon read it"),
        column("kind", String, "", "text, likert, ranking or sus"),
        column("revision", Integer, "", "Place among the answers to the question in the order they were given, from 1"),
        column("counts", Boolean, "", "Whether it is the answer that counts: the one given last, late ones left aside"),
        column(
            "value",
            String,
            "",
            "JSON: a text; a Likert point from 1; settings from 1, best first (ranking); ten points of 1..5 (sus), 0 for an item still open; as it stood after this revision; of a late answer, as it was given",
        ),
        column("sus_score", Number, "points", "System Usability Scale score, 0..100"),
        WALL,
        RUN,
        MONOTONIC,
        new_in_2(column(
            "given",
            Datetime,
            "UTC",
            "When it was given, by the server's clocks: when it arrived less waited_ms; answers of one device are ordered by sequence all the same",
        )),
        new_in_2(CLIENT_MILLIS),
        new_in_2(WAITED),
        WAITED_BY,
        DEVICE,
        SEQUENCE,
        LATE,
        new_in_2(column(
            "disagrees",
            Boolean,
            "",
            "Whether it is its device's last answer to the question, and another device's last answer differs",
        )),
    ],
    key: &["key"],
};

/// Events.
pub const EVENTS: Table = Table {
    name: "events",
    description: "Everything that happened to the session, in order and without gaps",
    columns: &[
        SESSION,
        column("number", Integer, "", "Order of the event in the session, from 1"),
        WALL,
        RUN,
        MONOTONIC,
        column("role", String, "", "Who: surgeon, operator, researcher, or system (a time limit, a restart)"),
        column(
            "kind",
            String,
            "",
            "created, started, segment-started, segment-finished, questions-finished, paused, resumed, server-restarted, completed, aborted or unblinded",
        ),
        SETTING,
        SEGMENT,
        column("inspected_ms", Integer, "ms", "Time inspected in the segment by then, without pauses"),
        column(
            "reason",
            String,
            "",
            "Reason given; an unblinding's stands in allocation.json alone, as it may name a policy",
        ),
        column("emergency", Boolean, "", "For an unblinding: whether the session was still under way"),
    ],
    key: &["session", "number"],
};

/// Camera and lens.
pub const DEVICES: Table = Table {
    name: "devices",
    description: "When camera and lens ceased to work and, once they had for a second, worked again, in words, and what the operator changed of the camera; from the start of each run of the server that served the session, so that the state in which the session began is told, to the session's end",
    columns: &[
        column("number", Integer, "", "Order of the record in the database"),
        WALL,
        RUN,
        MONOTONIC,
        column("device", String, "", "camera or lens"),
        column("working", Boolean, "", "Whether it worked from then on"),
        column("message", String, "", "What it said of itself, or what was changed"),
    ],
    key: &["number"],
};

/// Telemetry, blinded.
pub const TELEMETRY: Table = Table {
    name: "telemetry",
    description: "Every step of the control loop during the settings. Metric and timing are left to policy_steps.csv, as they tell the policy; the focal path itself, and frames left out where the loop waited, may suggest one to an expert",
    columns: &[
        SETTING,
        RUN,
        FRAME,
        EXPOSED,
        column("asked", Number, "focal power, 0..1", "Focal power asked of the lens after the frame"),
        column(
            "measured",
            Number,
            "focal power, 0..1",
            "Focal power at the middle of the frame's exposure, by the lens's dynamics; empty while the lens was away",
        ),
        column(
            "held",
            Boolean,
            "",
            "Whether the lens was held by a pause or because lens or camera failed; holds for the policy's sake are in policy_steps.csv, as they tell the policy",
        ),
        column("optimal", Number, "focal power, 0..1", "The optimum, where camera and lens are simulated"),
    ],
    key: &["run", "frame"],
};

/// Which policy ran.
pub const ALLOCATION: Table = Table {
    name: "allocation",
    description: "Which policy ran in which setting",
    columns: &[SESSION, SETTING, SEGMENT, column("policy", String, "", "Policy's name")],
    key: &["segment"],
};

/// What a learned policy was.
pub const WEIGHTS: Table = Table {
    name: "weights",
    description: "The weights that the session's learned policies had in each start of the server that served it",
    columns: &[
        RUN,
        column("policy", String, "", "Policy's name"),
        column("sha256", String, "", "SHA-256 of the file of its weights"),
    ],
    key: &["run", "policy"],
};

/// Telemetry that tells the policy.
pub const POLICY_STEPS: Table = Table {
    name: "policy_steps",
    description: "What of each step tells the policy; belongs to telemetry.csv by run and frame",
    columns: &[
        SETTING,
        RUN,
        FRAME,
        column("policy", String, "", "Policy that was asked; empty where none was"),
        column("metric", Number, "", "The policy's focus metric (mean gradient magnitude or mean local ratio)"),
        column("policy_micros", Integer, "us", "Duration of the policy's step"),
        column("latency_micros", Integer, "us", "From the end of the exposure to the lens command"),
        column(
            "held",
            String,
            "",
            "Why the lens was held: paused, policy-panicked, policy-nonsense, policy-slow, policy-unavailable, lens-failed or camera-failed",
        ),
    ],
    key: &["run", "frame"],
};

/// Every table that an export may have.
pub const ALL: [Table; 11] =
    [RUNS, SESSIONS, SEGMENTS, COMMENTS, ANSWERS, EVENTS, DEVICES, TELEMETRY, ALLOCATION, WEIGHTS, POLICY_STEPS];

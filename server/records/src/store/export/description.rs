//! The data dictionary: every table of an export, with a struct for its rows. A new column is a new field here, and the
//! compiler shows where its value is still missing. `open()` and `sealed()` say which columns the chain hashes, and how.

use jiff::Timestamp;

use super::table::{Meaning, Row, Table, means, table};
use parfocal_base::PolicyName;
use parfocal_base::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::role::Role;

const SESSION: Meaning = means("Session's random id");
const SETTING: Meaning = means("Number of the setting in the session, from 1, as the surgeon read it");
const SEGMENT: Meaning = means("Segment's random id, never shared by two segments");
const WALL: Meaning = means("When it was recorded, by the server's wall clock").in_unit("UTC");
const RUN: Meaning = means("Start of the server that recorded it; see runs");
const MONOTONIC: Meaning = means("When it was recorded, by the monotonic clock; comparable within a run").in_unit("ns");
const DEVICE: Meaning = means("Random id of the surgeon's device, kept by its browser; empty where the page told none");
const SEQUENCE: Meaning =
    means("Counts up with everything that was said on the device, in whatever tab; gaps mean nothing");
const WAITED_BY: Meaning = means(
    "Clock that measured waited_ms: page-clock, which nobody can set; or wall-clock, the device's, \
     which may have been set meanwhile, where the page was loaded anew or the device slept before \
     sending",
);
const CLIENT_MILLIS: Meaning =
    means("The browser's clock when it was said, milliseconds since 1970-01-01 UTC").in_unit("ms");
const WAITED: Meaning =
    means("Time between saying and sending, on the surgeon's device: said at wall less this").in_unit("ms");
const LATE: Meaning = means("Whether it arrived after counts_until of sessions.csv");
const FRAME: Meaning = means("Frame's number within the run");
const EXPOSED: Meaning = means("End of the exposure, by the monotonic clock").in_unit("ns");
const ERASED: Meaning =
    means("When its words were erased, by the server's wall clock; by whom and why is in erasures").in_unit("UTC");
const KEY: Meaning = means("Key by which the browser could send it again without it counting twice");

table! {
    name: "runs",
    description:
        "The starts of the server that the session's records belong to; by their clocks a monotonic \
         time has a time of day",
    key: [run],
    row:
    /// A start of the server.
    #[derive(Debug, Clone)]
    RunRow {
        run: i64 = means("Start of the server, counting from 1").open(),
        wall: Timestamp = means("The wall clock at the start").in_unit("UTC").open(),
        monotonic_ns: i64 = means("The monotonic clock at the start").in_unit("ns").open(),
        version: String = means("Version of parfocal").open(),
        camera: String = means("The camera").open(),
        lens: String = means("The lens").open(),
        calibration: String = means("The sensor's calibration: name, unit, version and date").open(),
        blur: Option<f64> =
            means("How fast the optic blurs a unit of focal power, as the policies were told; else empty")
                .in_unit("px").open(),
    }
}

table! {
    name: "sessions",
    description: "The session",
    key: [session],
    row:
    /// A session.
    #[derive(Debug, Clone)]
    SessionRow {
        session: SessionId = SESSION.open(),
        participant: String = means("Participant's code").open(),
        protocol: String = means("Protocol's name; its text is protocol.toml").open(),
        protocol_sha256: String = means("SHA-256 of protocol.toml").open(),
        practice: bool = means("Whether it is practice, never to be mixed with real data").open(),
        algorithm: &'static str = means("Algorithm that drew the order from the seed").open(),
        commitment: String =
            means("SHA-256 published when the session was made; commits to seed and order").open(),
        wall: Timestamp = means("When it was made, by the server's wall clock").in_unit("UTC").open(),
        run: i64 = means("Start of the server that made it; see runs").open(),
        status: SessionStatus = means("under-way, completed or aborted"),
        settings: i64 = means("Settings in all"),
        finished_settings: i64 = means("Settings inspected to the end"),
        comments: i64 = means("Comments kept"),
        monotonic_ns: i64 = MONOTONIC.open(),
        unblinded: &'static str =
            means("no; after-end; emergency-after-end; or while-under-way, which is emergency unblinding, too"),
        counts_until: Option<Timestamp> = means(
            "Deadline for what counts: the session's end plus the protocol's grace_minutes, or unblinding \
             if that came first; empty while the session is under way",
        )
        .in_unit("UTC"),
    }
}

table! {
    name: "segments",
    description:
        "The session's settings in order, each a segment of one policy; after unblinding, allocation.csv \
         says which policy",
    key: [segment],
    row:
    /// A segment of a session.
    #[derive(Debug, Clone)]
    SegmentRow {
        session: SessionId = SESSION,
        setting: usize = SETTING,
        segment: SegmentId = SEGMENT,
        started: Option<Timestamp> = means(
            "When inspection began, by the server's wall clock; empty if it never did",
        )
        .in_unit("UTC"),
        finished: Option<Timestamp> =
            means("When inspection ended, by the server's wall clock").in_unit("UTC"),
        finished_by: Option<Role> =
            means("Who ended it: surgeon, operator, or system at the time limit"),
        inspected_seconds: Option<f64> = means("Time inspected, without pauses").in_unit("s"),
    }
}

table! {
    name: "comments",
    description: "What the surgeon said, in the order it was kept",
    key: [key],
    row:
    /// A comment.
    #[derive(Debug, Clone)]
    CommentRow {
        number: usize = means("Order of the comment in the session, from 1"),
        key: IdempotencyKey = KEY.open(),
        session: SessionId = SESSION.open(),
        setting: Option<usize> = SETTING,
        segment: Option<SegmentId> = SEGMENT.open(),
        kind: &'static str = means(
            "text (typed), quick (one tap), mark (\"mark this moment\"), voice (said aloud; see voice) or withdrawal \
                (takes another comment back)",
        ).open(),
        text: Option<String> = means(
            "What was said, as it was said; empty for a mark and for voice; of a withdrawal the key of the other comment",
        ).sealed(),
        frame: Option<u64> = means("Number of the frame on the surgeon's screen").open(),
        frame_run: Option<i64> = means("Start of the server that counted that frame; see runs").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        client_millis: Option<i64> = CLIENT_MILLIS.open(),
        waited_ms: Option<i64> = WAITED.open(),
        waited_by: Option<&'static str> = WAITED_BY.open(),
        device: Option<DeviceId> = DEVICE.open(),
        sequence: Option<i64> = SEQUENCE.open(),
        late: bool = LATE.open(),
        erased: Option<Timestamp> = ERASED,
        withdrawn: Option<Timestamp> =
            means("When the surgeon took it back, by the server's wall clock; empty if not").in_unit("UTC"),
    }
}

table! {
    name: "answers",
    description: "Answers in the order they were kept, those that do not count included",
    key: [key],
    row:
    /// An answer.
    #[derive(Debug, Clone)]
    AnswerRow {
        number: usize = means("Order of the answer in the session, from 1"),
        key: IdempotencyKey = KEY.open(),
        session: SessionId = SESSION.open(),
        setting: Option<usize> = means("Setting asked about, from 1; empty for a closing question"),
        segment: Option<SegmentId> = means("Segment asked about; empty for a closing question").open(),
        question: String = means("Question's id in the protocol").open(),
        question_text: Option<String> = means("The question as the surgeon read it"),
        kind: Option<&'static str> = means(
            "text, likert, visual-analogue, ranking, sus, nasa-tlx, surg-tlx or recognition",
        ),
        revision: usize =
            means("Place among the answers to the question in the order they were given, from 1"),
        counts: bool =
            means("Whether it is the answer that counts: the one given last, late ones left aside"),
        value: Option<String> = means(
            "JSON: a text; a Likert point from 1; a place from 0 to 100 (visual-analogue); 1 no, 2 not sure, \
             3 yes (recognition); settings from 1, best first, or with ties the place of each setting \
             (ranking); ten points of 1..5 (sus); gradations of 1..21, of which 1 is a rating of 0 and 21 of \
             100 (nasa-tlx, surg-tlx), then 1 or 2 for the chosen scale of each pair; 0 for an item still \
             open; as it stood after this revision; of a late answer, as it was given; scores has all of it \
             as numbers",
        ),
        given_value: Option<String> = means(
            "JSON: what was given this time, before items of a questionnaire given earlier were joined to it",
        ).sealed(),
        sus_score: Option<f64> = means("System Usability Scale score, 0..100").in_unit("points"),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        given: Timestamp = means(
            "When it was given, by the server's clocks: when it arrived less waited_ms; answers of one \
             device are ordered by sequence all the same",
        )
        .in_unit("UTC"),
        client_millis: Option<i64> = CLIENT_MILLIS.open(),
        waited_ms: Option<i64> = WAITED.open(),
        waited_by: Option<&'static str> = WAITED_BY.open(),
        device: Option<DeviceId> = DEVICE.open(),
        sequence: Option<i64> = SEQUENCE.open(),
        late: bool = LATE.open(),
        disagrees: bool = means(
            "Whether it is its device's last answer to the question, and another device's last answer \
             differs",
        ),
        erased: Option<Timestamp> = ERASED,
    }
}

table! {
    name: "scores",
    description:
        "The items and scores of the answers that count, one a row, corrections applied; a score that \
         lacks an item is empty",
    key: [question, setting, measure],
    row:
    /// An item or a score of an answer.
    #[derive(Debug, Clone)]
    ScoreRow {
        session: SessionId = SESSION,
        setting: Option<usize> =
            means("Setting asked about, from 1; empty for a closing question"),
        segment: Option<SegmentId> = means("Segment asked about; empty for a closing question"),
        question: String = means("Question's id in the protocol"),
        kind: &'static str = means("Kind of the question, as in answers"),
        measure: String = means(
            "Name of the item or score: item-1..10 and sus-score; the names of the scales, 0..100, raw-tlx \
             (nasa-tlx), raw-surg-tlx, weight-of-..., 0..5, and weighted-surg-tlx (surg-tlx); point (likert); \
             position (visual-analogue); rank-of-setting-N, 1 for the best, ties sharing their ranks (ranking); \
             recognised (recognition)",
        ),
        label: String = means("The same for reading"),
        value: Option<f64> = means("The number; empty where it is missing"),
        computed: bool = means("Whether it is computed from other items"),
        corrected: bool = means("Whether the answer was corrected; see corrections"),
    }
}

table! {
    name: "corrections",
    description:
        "What a researcher put right, in order; the originals stand in their tables as they were \
         recorded. Of several about the same field of a record the latest counts",
    key: [number],
    row:
    /// A correction.
    #[derive(Debug, Clone)]
    CorrectionRow {
        number: i64 = means("Order of the record in the database").open(),
        session: SessionId = SESSION.open(),
        subject: &'static str = means("What was corrected: session, answer or comment").open(),
        record: String = means("The key of the answer or comment, or the session's id").open(),
        field: &'static str = means(
            "What of it: participant, value (of an answer, JSON), or note (beside an answer or a comment)",
        ).open(),
        old_value: String = means("What stood there so far").sealed(),
        new_value: String = means("What is right").sealed(),
        reason: String = means("Why, as the researcher said").sealed(),
        role: Role = means("Who did it: researcher").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        erased: Option<Timestamp> = ERASED,
    }
}

table! {
    name: "consents",
    description: "What the participant consented to; the latest counts",
    key: [number],
    row:
    /// A consent.
    #[derive(Debug, Clone)]
    ConsentRow {
        number: i64 = means("Order of the record in the database").open(),
        session: SessionId = SESSION.open(),
        text_version: String = means("Version of the text").open(),
        given_on: String = means("The day on which it was given, YYYY-MM-DD").open(),
        obtained_by: String = means("Who obtained it: initials or a code").sealed(),
        medium: &'static str = means("paper or screen").open(),
        role: Role = means("Who recorded it: operator").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "erasures",
    description: "Words that were erased: the record stays, with the hash of what it said",
    key: [number],
    row:
    /// An erasure.
    #[derive(Debug, Clone)]
    ErasureRow {
        number: i64 = means("Order of the record in the database").open(),
        session: SessionId = SESSION.open(),
        subject: &'static str = means("What was erased: answer, comment or correction; or the reason of an event or study-event").open(),
        record: String = means("Its key, as in the chain: of a correction its number, of an event SESSION/NUMBER, of a study-event STUDY/NUMBER").open(),
        reason: String = means("Why, as the researcher said").sealed(),
        role: Role = means("Who did it: researcher").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "withdrawals",
    description:
        "The sessions of the same protocol whose participants withdrew: their data are in no export",
    key: [session],
    row:
    /// A withdrawn session.
    #[derive(Debug, Clone)]
    WithdrawalRow {
        session: SessionId = SESSION,
        protocol: String = means("Protocol's name"),
        place: i64 = means(
            "Place among the sessions of the protocol, in the order in which they were made, from 1",
        ),
        wall: Timestamp = means("When it was withdrawn, by the server's wall clock").in_unit("UTC"),
        role: String = means("Who recorded that: operator or researcher"),
    }
}

table! {
    name: "events",
    description: "Everything that happened to the session, in order and without gaps",
    key: [session, number],
    row:
    /// An event.
    #[derive(Debug, Clone)]
    EventRow {
        session: SessionId = SESSION.open(),
        number: u32 = means("Order of the event in the session, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        role: Role = means("Who: surgeon, operator, researcher, or system (a time limit, a restart)").open(),
        kind: &'static str = means(
            "created, started, segment-started, segment-finished, questions-finished, paused, reason-given, \
             focused-by-hand, tablet-away, tablet-back, pictures-seen, resumed, server-restarted, completed, aborted, \
             withdrawn or unblinded",
        ).open(),
        setting: Option<usize> = SETTING,
        segment: Option<SegmentId> = SEGMENT.open(),
        inspected_ms: Option<u64> =
            means("Time inspected in the segment by then, without pauses").in_unit("ms").open(),
        reason: Option<String> = means(
            "Reason given; that of an unblinding is only in allocation.json, as it may name a policy",
        ).sealed(),
        emergency: Option<bool> = means("For an unblinding: whether the session was still under way").open(),
    }
}

table! {
    name: "devices",
    description:
        "When camera and lens ceased to work and, once they had for a second, worked again, in words, \
         and what the operator changed of the camera; from the start of each run of the server that \
         served the session, so that the state in which the session began is told, to the session's \
         end",
    key: [number],
    row:
    /// A change in the state of camera or lens.
    #[derive(Debug, Clone)]
    DeviceRow {
        number: i64 = means("Order of the record in the database").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        device: String = means("camera or lens").open(),
        working: bool = means("Whether it worked from then on").open(),
        message: String = means("What it said of itself, or what was changed").open(),
    }
}

table! {
    name: "recordings",
    description:
        "What was recorded of the session, one row a folder; the recordings themselves stay in the data folder",
    key: [name],
    row:
    /// A recording of the session.
    #[derive(Debug, Clone)]
    RecordingRow {
        session: SessionId = SESSION,
        name: String = means("Name of the recording"),
        path: String = means("Its folder, relative to the data folder"),
        kind: Option<&'static str> =
            means("mosaic (raw mosaics in Zarr v3) or view (JPEG pictures); empty where it cannot be read"),
        run: Option<i64> = means("Start of the server that recorded it; see runs"),
        started: Option<Timestamp> =
            means("When it began, by the server's wall clock; its frames count from then").in_unit("UTC"),
        monotonic_ns: Option<i64> =
            means("The same by the monotonic clock; comparable within a run").in_unit("ns"),
        first_ns: Option<i64> = means("End of the first frame's exposure, since it began").in_unit("ns"),
        last_ns: Option<i64> = means("End of the last frame's exposure, since it began").in_unit("ns"),
        frames: Option<usize> = means("Frames that it holds"),
        lost: Option<u64> = means(
            "Frames that the recorder was too slow for; empty of a view, which has the frames that viewers could get",
        ),
        ended: Option<String> =
            means("How it ended: stopped, or why it stopped by itself; empty if it was cut short or goes on"),
        description_sha256: Option<String> = means("SHA-256 of its zarr.json or view.json"),
        problem: Option<String> = means("Why it cannot be read, where it cannot"),
    }
}

table! {
    name: "accesses",
    description: "Who looked at the session's focal path or recordings, or exported the session, this export included",
    key: [number],
    row:
    /// A look at the evidence.
    #[derive(Debug, Clone)]
    AccessRow {
        number: i64 = means("Order of the record in the database").open(),
        wall: Timestamp = WALL.open(),
        run: Option<i64> =
            means("Start of the server that recorded it; empty for the command line").open(),
        monotonic_ns: Option<i64> = MONOTONIC.open(),
        role: String = means("Who: researcher, or command-line").open(),
        kind: String = means("path-viewed, recording-viewed or exported").open(),
        session: SessionId = SESSION.open(),
        detail: Option<String> = means("Of an export: blinded or unblinded").open(),
    }
}

table! {
    name: "studies",
    description: "The study that the session belongs to; without a row where it is outside any study",
    key: [study],
    row:
    /// A study.
    #[derive(Debug, Clone)]
    StudyRow {
        study: String = means("The study's name: the same at every site").open(),
        title: String = means("Its title"),
        definition_sha256: String = means("SHA-256 of study.toml: the same at every site").open(),
        sites: String = means("JSON: the names of its sites that this database runs").open(),
        wall: Timestamp = means("When it was planned, by the server's wall clock").in_unit("UTC").open(),
        stage: &'static str = means("planned, open, closed, locked or unblinded"),
        commitment: Option<String> =
            means("SHA-256 published when it was first opened; commits to the orders of all its places here"),
    }
}

table! {
    name: "study_sessions",
    description: "The session's place in its study; without a row where it is outside any study",
    key: [session],
    row:
    /// The place of a session in a study.
    #[derive(Debug, Clone)]
    StudySessionRow {
        session: SessionId = SESSION.open(),
        study: String = means("The study's name").open(),
        site: String = means("The site's name").open(),
        protocol: String = means("The protocol's name").open(),
        place: usize = means("Place in the list of site and protocol, from 1; tells nothing of the order").open(),
    }
}

table! {
    name: "study_events",
    description:
        "What happened to the study as a whole, and to this session in it. Numbers that are missing are of \
         other sessions",
    key: [study, number],
    row:
    /// An event of a study.
    #[derive(Debug, Clone)]
    StudyEventRow {
        study: String = means("The study's name").open(),
        number: i64 = means("Order of the event in the study, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: Option<i64> = means("Start of the server that recorded it; empty for the command line").open(),
        monotonic_ns: Option<i64> = MONOTONIC.open(),
        role: String = means("How it was recorded: researcher (on the page), or command-line").open(),
        person: String = means("Who, as the person said").open(),
        kind: String = means(
            "planned, opened, closed, locked, unblinded, session-withdrawn, or session-unblinded, which is \
             emergency unblinding of one session",
        ).open(),
        about_session: Option<SessionId> = means("The session that it is about; empty for the whole study").open(),
        commitment: Option<String> = means("Of the first opening: commits to all orders").open(),
        reason: String = means("Reason given").sealed(),
    }
}

table! {
    name: "actors",
    description: "Under which personal account a record was made; a record without a row was made through a \
                  role's link, by the command line, or by the server",
    key: [number],
    row:
    /// The account behind a record.
    #[derive(Debug, Clone, sqlx::FromRow)]
    ActorRow {
        number: i64 = means("Order of the row in the database").open(),
        kind: String = means("Kind of the record, as in chain.csv").open(),
        record: String = means("Key of the record, as in chain.csv").open(),
        session: String = means("Session id").open(),
        account: String = means("The account's name").open(),
        display: String = means("The person's name then").open(),
    }
}

table! {
    name: "voice",
    description: "The recordings of voice comments; each is a file in the folder voice",
    key: [comment],
    row:
    /// The recording of a voice comment.
    #[derive(Debug, Clone)]
    VoiceRow {
        comment: IdempotencyKey = means("Key of the comment, as in comments.csv"),
        session: SessionId = SESSION,
        setting: Option<usize> = SETTING,
        file: Option<String> =
            means("The file; empty where nothing of the recording arrived, or its sound was erased"),
        media_type: Option<&'static str> = means("What the file is, as the browser recorded it"),
        seconds: f64 = means("How long the recording is, as the page told").in_unit("s"),
        pieces: usize = means("Pieces that arrived; see voice_pieces"),
        missing: usize = means("Pieces that did not arrive, though later ones did"),
        bytes: i64 = means("Length of the pieces that arrived"),
        sha256: Option<String> = means("SHA-256 of the file"),
        ended: Option<&'static str> = means(
            "Why it ended: released (the surgeon let go), limit (after two minutes), microphone-lost or left (the \
             page went out of sight); empty where it was cut off",
        ),
        complete: bool = means("Whether it has its end and all its pieces"),
        transcript: Option<String> =
            means("What was said, typed out by a researcher; by whom and when is in corrections"),
        erased: Option<Timestamp> =
            means("When its sound was erased, by the server's wall clock; by whom and why is in erasures")
                .in_unit("UTC"),
    }
}

table! {
    name: "voice_pieces",
    description: "The pieces in which the recordings of voice comments arrived, in the order they were kept",
    key: [number],
    row:
    /// A piece of a recording.
    #[derive(Debug, Clone)]
    VoicePieceRow {
        number: i64 = means("Order of the record in the database").open(),
        session: SessionId = SESSION.open(),
        comment: IdempotencyKey = means("Key of the comment, as in comments.csv").open(),
        piece: u32 = means("Place in the recording, from 1: the file is the pieces one after another").open(),
        media_type: &'static str = means("What it is, as the browser recorded it").open(),
        through_ms: i64 = means("How far the recording had come at its end, as the page told").in_unit("ms").open(),
        ended: Option<&'static str> = means("On the last piece: why the recording ended, as in voice").open(),
        bytes: i64 = means("Its length").open(),
        sha256: String = means("SHA-256 of its bytes; stays when the sound is erased").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "chain",
    description:
        "The chain of all records of the database up to this export, in order: of the rows that are not \
         about this session only number, entry and hash; docs/evidence.md says what is hashed",
    key: [number],
    row:
    /// A row of the chain.
    #[derive(Debug, Clone, Default)]
    ChainRow {
        number: i64 = means("Order of the row, from 1, without gaps"),
        entry: String = means("SHA-256 of the columns from wall to content"),
        hash: String = means("SHA-256 of number, the hash of the row before, and entry"),
        wall: Option<String> = means("When it was written, by the server's wall clock").in_unit("UTC"),
        kind: Option<String> =
            means(
            "Kind of the record: run, participant, session, event, comment, answer, device, access, \
             correction, consent, erasure, telemetry, study, study-event, study-session, account-event, \
             actor or voice-piece",
        ),
        key: Option<String> = means("The record's key"),
        session: Option<String> = means("The record's session; empty for runs and devices"),
        place: Option<i64> = means("Order of the row among those of the session, from 1"),
        salt: Option<String> = means("Random; keeps entry from being guessed"),
        sealed: Option<String> = means("SHA-256 of the record's sealed columns, with sealed_salt"),
        sealed_salt: Option<String> =
            means("Random; empty where the sealed columns are withheld; see chain_salts.csv"),
        content: Option<String> = means("SHA-256 of the record"),
    }
}

table! {
    name: "chain_salts",
    description: "The salts of sealed columns, which are withheld until unblinding",
    key: [number],
    row:
    /// The salt of a row's sealed columns.
    #[derive(Debug, Clone, sqlx::FromRow)]
    ChainSaltRow {
        number: i64 = means("The row of chain.csv"),
        salt: String = means("Random"),
    }
}

table! {
    name: "telemetry",
    description:
        "Every step of the control loop during the settings. Metric and timing are left to \
         policy_steps.csv, as they tell the policy; the focal path itself, and frames left out where \
         the loop waited, may suggest one to an expert",
    key: [run, frame],
    row:
    /// A step of the control loop, without the columns that reveal the policy.
    #[derive(Debug, Clone, sqlx::FromRow)]
    TelemetryRow {
        setting: i64 = SETTING,
        run: i64 = RUN,
        frame: i64 = FRAME,
        exposed_ns: i64 = EXPOSED,
        asked: f64 =
            means("Focal power asked of the lens after the frame").in_unit("focal power, 0..1"),
        measured: Option<f64> = means(
            "Focal power at the middle of the frame's exposure, by the lens's dynamics; empty while \
             the lens was away",
        )
        .in_unit("focal power, 0..1"),
        held: bool = means(
            "Whether the lens was held by a pause or because lens or camera failed; holds for the \
             policy's sake are in policy_steps.csv, as they tell the policy",
        ),
        optimal: Option<f64> =
            means("The optimum, where camera and lens are simulated").in_unit("focal power, 0..1"),
    }
}

table! {
    name: "allocation",
    description: "Which policy ran in which setting",
    key: [segment],
    row:
    /// The policy of a segment.
    #[derive(Debug, Clone)]
    AllocationRow {
        session: SessionId = SESSION,
        setting: usize = SETTING,
        segment: SegmentId = SEGMENT,
        policy: PolicyName = means("Policy's name"),
    }
}

table! {
    name: "weights",
    description:
        "The weights that the session's learned policies had in each start of the server that served \
         it",
    key: [run, policy],
    row:
    /// The weights that a learned policy had in a start of the server.
    #[derive(Debug, Clone, sqlx::FromRow)]
    WeightsRow {
        run: i64 = RUN,
        policy: String = means("Policy's name"),
        sha256: String = means("SHA-256 of the file of its weights"),
    }
}

table! {
    name: "policy_steps",
    description: "The columns of each step that reveal the policy; join with telemetry.csv by run and frame",
    key: [run, frame],
    row:
    /// The columns of a step of the control loop that reveal the policy.
    #[derive(Debug, Clone, sqlx::FromRow)]
    PolicyStepRow {
        setting: i64 = SETTING,
        run: i64 = RUN,
        frame: i64 = FRAME,
        policy: Option<String> = means("Policy that was asked; empty where none was"),
        metric: Option<f64> =
            means("The policy's focus metric (mean gradient magnitude or mean local ratio)"),
        policy_micros: i64 = means("Duration of the policy's step").in_unit("us"),
        latency_micros: i64 = means("From the end of the exposure to the lens command").in_unit("us"),
        held: Option<String> = means(
            "Why the lens was held: paused, policy-panicked, policy-nonsense, policy-slow, \
             policy-unavailable, lens-failed or camera-failed",
        ),
    }
}

/// Every table that an export may have.
pub const ALL: [Table; 26] = [
    RunRow::TABLE,
    SessionRow::TABLE,
    SegmentRow::TABLE,
    CommentRow::TABLE,
    AnswerRow::TABLE,
    EventRow::TABLE,
    DeviceRow::TABLE,
    RecordingRow::TABLE,
    AccessRow::TABLE,
    ScoreRow::TABLE,
    CorrectionRow::TABLE,
    ConsentRow::TABLE,
    ErasureRow::TABLE,
    WithdrawalRow::TABLE,
    StudyRow::TABLE,
    StudySessionRow::TABLE,
    StudyEventRow::TABLE,
    ActorRow::TABLE,
    VoiceRow::TABLE,
    VoicePieceRow::TABLE,
    ChainRow::TABLE,
    TelemetryRow::TABLE,
    AllocationRow::TABLE,
    WeightsRow::TABLE,
    PolicyStepRow::TABLE,
    ChainSaltRow::TABLE,
];

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_unique_and_every_key_is_made_of_columns() {
        let tables: BTreeSet<_> = ALL.iter().map(|table| table.name).collect();
        assert_eq!(tables.len(), ALL.len());

        for table in ALL {
            let columns: BTreeSet<_> = table.header().collect();
            assert_eq!(columns.len(), table.columns.len(), "{}", table.name);
            assert!(table.key.iter().all(|part| columns.contains(part)), "{}", table.name);
        }
    }

    #[test]
    fn every_column_says_what_it_means() {
        for table in ALL {
            for column in table.columns {
                assert!(!column.description.is_empty(), "{}.{}", table.name, column.name);
            }
        }
    }
}

//! The data dictionary: every table of an export, with a struct for its rows. A new column is a new field here, and the
//! compiler shows where its value is still missing. `open()` and `sealed()` say which columns the chain hashes, and how.

use jiff::Timestamp;

use super::table::{Meaning, Row, Table, means, table};
use parfocal_base::PolicyName;
use parfocal_base::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::role::Role;

const SESSION: Meaning = means("Random id of the session");
const SETTING: Meaning = means("Number of the setting in the session, from 1, as the surgeon's page showed it");
const SETTING_IF_ANY: Meaning = means(
    "Number of the setting in the session, from 1, as the surgeon's page showed it; empty if the row belongs to no \
     setting",
);
const SEGMENT: Meaning = means("Random id of the segment");
const SEGMENT_IF_ANY: Meaning = means("Random id of the segment; empty if the row belongs to no segment");
const WALL: Meaning = means("Time of recording, by the server's wall clock").in_unit("UTC");
const RUN: Meaning = means("Number of the server start that recorded the row; see runs");
const MONOTONIC: Meaning =
    means("Time of recording, by the server's monotonic clock; comparable only within one run").in_unit("ns");
const MONOTONIC_IF_ANY: Meaning = means(
    "Time of recording, by the server's monotonic clock; comparable only within one run; empty if the command line \
     recorded the row",
)
.in_unit("ns");
const DEVICE: Meaning =
    means("Random id of the surgeon's device, stored in its browser; empty if the page did not send one");
const SEQUENCE: Meaning = means(
    "Number that rises with every entry made on the device, across all its tabs; a missing number is not a missing \
     entry; empty if the page did not send one",
);
const WAITED_BY: Meaning = means(
    "Clock that measured waited_ms: page-clock, which nobody can set, or wall-clock, the device's own clock, which is \
     used if the page was reloaded or the device slept before sending; empty if waited_ms is",
);
const CLIENT_MILLIS: Meaning =
    means("Time of the entry by the device's clock, counted from 1970-01-01 UTC; empty if the page did not send it")
        .in_unit("ms");
const WAITED: Meaning = means(
    "Time from the entry on the device to its sending; wall minus waited_ms is the time of the entry; empty if the \
     page did not send it",
)
.in_unit("ms");
const LATE: Meaning = means("Whether the row arrived after counts_until of sessions.csv, and so does not count");
const FRAME: Meaning = means("Number of the frame within the run");
const EXPOSED: Meaning = means("End of the frame's exposure, by the server's monotonic clock").in_unit("ns");
const ERASED: Meaning =
    means("Time when the row's words were erased, by the server's wall clock; see erasures; empty if they were not")
        .in_unit("UTC");
const KEY: Meaning = means("Random key that the browser gave the entry, so that an entry sent twice counts once");

table! {
    name: "runs",
    description:
        "The server starts that recorded the session; each gives the wall time that belongs to its monotonic clock",
    key: [run],
    stored row:
    /// A start of the server.
    #[derive(Debug, Clone)]
    RunRow {
        run: i64 = means("Number of the server start, from 1").open(),
        wall: Timestamp = means("Wall clock at the start").in_unit("UTC").open(),
        monotonic_ns: i64 = means("Monotonic clock at the start").in_unit("ns").open(),
        version: String = means("Version of parfocal").open(),
        camera: String = means("Camera, as the server names it").open(),
        lens: String = means("Lens, as the server names it").open(),
        calibration: String = means("Calibration of the sensor: name, unit, version and date").open(),
        blur: Option<f64> = means(
            "Blur radius that one unit of focal power adds, as given to the policies; empty if it was not \
             configured",
        ).in_unit("px").open(),
    }
}

table! {
    name: "sessions",
    description: "The session: one participant with one protocol",
    key: [session],
    row:
    /// A session.
    #[derive(Debug, Clone)]
    SessionRow {
        session: SessionId = SESSION.open(),
        participant: String = means("Code of the participant").open(),
        protocol: String = means("Name of the protocol; protocol.toml holds its text").open(),
        protocol_sha256: String = means("SHA-256 of protocol.toml").open(),
        practice: bool = means("Whether the session is practice, which must not be mixed with trial data").open(),
        algorithm: &'static str = means("Algorithm that draws the order of policies from the seed").open(),
        commitment: String =
            means("SHA-256 published when the session was created; it commits to seed and order").open(),
        wall: Timestamp = means("Time of creation, by the server's wall clock").in_unit("UTC").open(),
        run: i64 = means("Number of the server start that created the session; see runs").open(),
        status: SessionStatus = means("State of the session: under-way, completed or aborted"),
        settings: i64 = means("Number of settings that the protocol asks for"),
        finished_settings: i64 = means("Number of settings inspected to the end"),
        comments: i64 = means("Number of comments recorded"),
        monotonic_ns: i64 = MONOTONIC.open(),
        unblinded: &'static str = means(
            "Unblinding: no, after-end, emergency-after-end or while-under-way; the last is an emergency, too",
        ),
        counts_until: Option<Timestamp> = means(
            "Time until which arriving comments and answers count: the session's end plus the protocol's \
             grace_minutes, or the unblinding or the study's locking if that came first; empty while the session is \
             under way",
        ).in_unit("UTC"),
    }
}

table! {
    name: "segments",
    description:
        "The session's settings in order; in each of them one policy ran, which allocation.csv names after unblinding",
    key: [segment],
    row:
    /// A segment of a session.
    #[derive(Debug, Clone)]
    SegmentRow {
        session: SessionId = SESSION,
        setting: usize = SETTING,
        segment: SegmentId = SEGMENT,
        started: Option<Timestamp> = means(
            "Time when inspection began, by the server's wall clock; empty if it did not begin",
        ).in_unit("UTC"),
        finished: Option<Timestamp> =
            means("Time when inspection ended, by the server's wall clock; empty if it did not end").in_unit("UTC"),
        finished_by: Option<Role> = means(
            "Who ended the inspection: surgeon, operator, or system at the time limit; empty if it did not end",
        ),
        inspected_seconds: Option<f64> =
            means("Duration of the inspection without pauses; empty if it did not end").in_unit("s"),
        least_picture_width: Option<u32> = means(
            "Width of the smallest picture that the surgeon saw; a slow link makes pictures smaller; empty if no tablet \
             drew one",
        ).in_unit("px"),
        mean_picture_width: Option<f64> = means(
            "Width of the pictures that the surgeon saw, averaged over the time; empty if no tablet drew one",
        ).in_unit("px"),
        pictures_per_second: Option<f64> = means(
            "Average number of pictures that the surgeon saw in a second; empty if no tablet drew one",
        ).in_unit("1/s"),
    }
}

table! {
    name: "comments",
    description: "The surgeon's comments, in the order in which the server recorded them",
    key: [key],
    row:
    /// A comment.
    #[derive(Debug, Clone)]
    CommentRow {
        number: usize = means("Number of the comment in the session, from 1"),
        key: IdempotencyKey = KEY.open(),
        session: SessionId = SESSION.open(),
        setting: Option<usize> = SETTING_IF_ANY,
        segment: Option<SegmentId> = SEGMENT_IF_ANY.open(),
        kind: &'static str = means(
            "Kind of comment: text (typed), quick (one tap), mark (\"mark this moment\"), voice (spoken; see voice) \
             or withdrawal (takes back another comment)",
        ).open(),
        text: Option<String> = means(
            "Text of the comment, word for word; for a withdrawal the key of the comment taken back; empty for a \
             mark and for voice, and if the text was erased",
        ).sealed(),
        frame: Option<u64> =
            means("Number of the frame on the surgeon's screen; empty if the page did not send it").open(),
        frame_run: Option<i64> =
            means("Number of the server start that counted that frame; see runs; empty if frame is").open(),
        picture_width: Option<u32> = means(
            "Width of the picture on the surgeon's screen; a slow link makes it smaller; empty if the page did not \
             send it",
        ).in_unit("px").open(),
        pictures_per_second: Option<f64> = means(
            "Pictures that the page drew in a second, averaged over the two seconds before; empty if it did not send it",
        ).in_unit("1/s").open(),
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
        withdrawn: Option<Timestamp> = means(
            "Time when the surgeon took the comment back, by the server's wall clock; empty if it was not taken \
             back",
        ).in_unit("UTC"),
    }
}

table! {
    name: "answers",
    description: "All answers, also those that do not count, in the order in which the server recorded them",
    key: [key],
    row:
    /// An answer.
    #[derive(Debug, Clone)]
    AnswerRow {
        number: usize = means("Number of the answer in the session, from 1"),
        key: IdempotencyKey = KEY.open(),
        session: SessionId = SESSION.open(),
        setting: Option<usize> =
            means("Number of the setting that the question is about, from 1; empty for a closing question"),
        segment: Option<SegmentId> =
            means("Random id of the segment that the question is about; empty for a closing question").open(),
        question: String = means("Id of the question in the protocol").open(),
        question_text: Option<String> =
            means("Text of the question as shown to the surgeon; empty if the protocol has no such question"),
        kind: Option<&'static str> = means(
            "Kind of question: text, likert, visual-analogue, ranking, sus, nasa-tlx, surg-tlx or recognition; \
             empty if the protocol has no such question",
        ),
        revision: usize =
            means("Number of the answer among those to the same question, in the order of entry, from 1"),
        counts: bool = means("Whether the answer counts: of those that are not late, only the last entered does"),
        value: String = means(
            "Answer as it stands after this revision, as JSON; a late answer as entered; the text \"\" if erased. By kind: \
             a text; a Likert point from 1; a position from 0 to 100 (visual-analogue); 1 no, 2 not sure, 3 yes \
             (recognition); the settings from best to worst, or with ties the rank of each setting (ranking); ten \
             points from 1 to 5, 0 for an open item (sus); gradations from 1 (a rating of 0) to 21 (a rating of \
             100), then 1 or 2 for the scale chosen of each pair, 0 for an open item (nasa-tlx, surg-tlx). The \
             table scores has the same as numbers",
        ),
        given_value: String = means(
            "The part of the answer that was entered this time, as JSON, before it was joined with the \
             questionnaire's earlier items; the text \"\" if erased",
        ).sealed(),
        sus_score: Option<f64> = means(
            "System Usability Scale score, 0..100; empty for other kinds and if an item is open",
        ).in_unit("points"),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        given: Timestamp = means(
            "Time of entry, by the server's clocks: the arrival minus waited_ms; the answers of one device are \
             ordered by sequence all the same",
        ).in_unit("UTC"),
        client_millis: Option<i64> = CLIENT_MILLIS.open(),
        waited_ms: Option<i64> = WAITED.open(),
        waited_by: Option<&'static str> = WAITED_BY.open(),
        device: Option<DeviceId> = DEVICE.open(),
        sequence: Option<i64> = SEQUENCE.open(),
        late: bool = LATE.open(),
        disagrees: bool = means(
            "Whether another device's last answer to the question differs from this one, which is its own device's \
             last",
        ),
        erased: Option<Timestamp> = ERASED,
    }
}

table! {
    name: "scores",
    description:
        "The items and scores of the answers that count, one per row, with corrections applied",
    key: [question, setting, measure],
    row:
    /// An item or a score of an answer.
    #[derive(Debug, Clone)]
    ScoreRow {
        session: SessionId = SESSION,
        setting: Option<usize> =
            means("Number of the setting that the question is about, from 1; empty for a closing question"),
        segment: Option<SegmentId> =
            means("Random id of the segment that the question is about; empty for a closing question"),
        question: String = means("Id of the question in the protocol"),
        kind: &'static str = means("Kind of question, as in answers"),
        measure: String = means(
            "Name of the item or score: item-1..10 and sus-score (sus); the names of the scales, 0..100, and \
             raw-tlx (nasa-tlx) or raw-surg-tlx, weight-of-..., 0..5, and weighted-surg-tlx (surg-tlx); point \
             (likert); position (visual-analogue); rank-of-setting-N, 1 for the best, with shared ranks for ties \
             (ranking); recognised (recognition)",
        ),
        label: String = means("Name of the item or score in words"),
        value: Option<f64> =
            means("Value of the item or score; empty if the item is open, or the score lacks an item"),
        computed: bool = means("Whether the value is computed from other items"),
        corrected: bool = means("Whether the answer was corrected; see corrections"),
    }
}

table! {
    name: "corrections",
    description:
        "Corrections by researchers, in order; the other tables keep the original values; of several corrections of \
         the same field the latest counts",
    key: [number],
    stored row:
    /// A correction.
    #[derive(Debug, Clone)]
    CorrectionRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        session: SessionId = SESSION.open(),
        subject: String = means("Kind of record corrected: session, answer or comment").open(),
        record: String = means("Key of the answer or comment, or id of the session").open(),
        field: String = means(
            "Field corrected: participant, value (of an answer, as JSON) or note (beside an answer or a comment)",
        ).open(),
        old_value: String = means("Value before the correction; empty if there was none, or it was erased").sealed(),
        new_value: String = means("Correct value; empty if it was erased").sealed(),
        reason: String = means("Reason, in the researcher's words; empty if it was erased").sealed(),
        role: Role = means("Role that made the record: researcher").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        erased: Option<Timestamp> = ERASED,
    }
}

table! {
    name: "consents",
    description: "Consents of the participant; the latest counts",
    key: [number],
    stored row:
    /// A consent.
    #[derive(Debug, Clone)]
    ConsentRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        session: SessionId = SESSION.open(),
        text_version: String = means("Version of the consent text").open(),
        given_on: String = means("Day of the consent, YYYY-MM-DD").open(),
        obtained_by: String = means("Initials or code of the person who obtained the consent").sealed(),
        medium: String = means("Form of the consent: paper or screen").open(),
        role: Role = means("Role that made the record: operator").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "erasures",
    description: "Erasures of words: the erased record stays, with the hash of its words",
    key: [number],
    stored row:
    /// An erasure.
    #[derive(Debug, Clone)]
    ErasureRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        session: SessionId = SESSION.open(),
        subject: String = means(
            "Kind of record erased: answer, comment or correction, or event or study-event, of which the reason was \
             erased",
        ).open(),
        record: String = means(
            "Key of that record as in chain: number of a correction, SESSION/NUMBER of an event, STUDY/NUMBER of a \
             study-event, else the key",
        ).open(),
        reason: String = means("Reason, in the researcher's words").sealed(),
        role: Role = means(
            "Role that made the record: researcher, or system once the time is over for which the protocol keeps voice",
        ).open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "withdrawals",
    description:
        "The sessions of the same protocol whose participants withdrew; no export has their data",
    key: [session],
    stored row:
    /// A withdrawn session.
    #[derive(Debug, Clone)]
    WithdrawalRow {
        session: SessionId = SESSION,
        protocol: String = means("Name of the protocol"),
        place: i64 = means("Number of the session among those of the protocol, in the order of creation, from 1"),
        wall: Timestamp = means("Time of the withdrawal, by the server's wall clock").in_unit("UTC"),
        role: String = means("Role that made the record: operator or researcher"),
    }
}

table! {
    name: "events",
    description: "All events of the session, in order; no number is missing",
    key: [session, number],
    row:
    /// An event.
    #[derive(Debug, Clone)]
    EventRow {
        session: SessionId = SESSION.open(),
        number: u32 = means("Number of the event in the session, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        role: Role = means(
            "Role that caused the event: surgeon, operator, researcher, or system (a time limit, a restart)",
        ).open(),
        kind: &'static str = means(
            "Kind of event: created, started, segment-started, segment-finished, questions-finished, paused, \
             reason-given, focused-by-hand, tablet-away, tablet-back, pictures-seen, patch-placed, \
             patch-centred, focus-held, focus-released, resumed, server-restarted, completed, aborted, withdrawn or \
             unblinded",
        ).open(),
        setting: Option<usize> = SETTING_IF_ANY,
        segment: Option<SegmentId> = SEGMENT_IF_ANY.open(),
        inspected_ms: Option<u64> = means(
            "Duration of inspection in the segment so far, without pauses; empty outside a segment",
        ).in_unit("ms").open(),
        reason: Option<String> = means(
            "Reason given for the event; empty if none was given or it was erased, and for an unblinding, whose \
             reason may name a policy and is only in allocation.json",
        ).sealed(),
        emergency: Option<bool> = means(
            "Whether the unblinding was an emergency: the session was under way, or its study was blinded; empty for \
             other events",
        ).open(),
        about: Option<u32> = means(
            "Number of the event whose reason this is; empty for other events than reason-given",
        ).open(),
        focal_power: Option<f64> = means(
            "Focal power to which the lens was sent by hand; empty for other events than focused-by-hand",
        ).in_unit("focal power, 0..1").open(),
        left_at: Option<f64> = means(
            "Focal power before the movement by hand, from which the segment continues; empty for other events, and if \
             the lens was moved by hand before",
        ).in_unit("focal power, 0..1").open(),
        hidden: Option<bool> = means(
            "Whether a tablet has the page open, but not on screen; empty for other events than tablet-away",
        ).open(),
        picture_width: Option<u32> = means(
            "Width of the pictures on the surgeon's screen; empty for other events than pictures-seen",
        ).in_unit("px").open(),
        picture_height: Option<u32> =
            means("Height of those pictures; empty for other events than pictures-seen").in_unit("px").open(),
        pictures: Option<u64> =
            means("Number of those pictures that were drawn; empty for other events than pictures-seen").open(),
        over_ms: Option<u64> = means(
            "Duration in which they were drawn, up to the event; empty for other events than pictures-seen",
        ).in_unit("ms").open(),
        frame: Option<u64> = means(
            "Number of the frame that was on screen when somebody chose what is to be in focus; empty for other events \
             than patch-placed and patch-centred",
        ).open(),
        touched_x: Option<f64> = means(
            "Where the picture was touched, from its left edge; empty for other events than patch-placed",
        ).in_unit("mosaic cells").open(),
        touched_y: Option<f64> = means(
            "Where the picture was touched, from its top edge; empty for other events than patch-placed",
        ).in_unit("mosaic cells").open(),
        patch_across: Option<f64> = means(
            "How far the patch's new place lies to the right of the bright circle's centre; empty for other events than \
             patch-placed",
        ).in_unit("radii of the bright circle").open(),
        patch_down: Option<f64> = means(
            "How far the patch's new place lies below the bright circle's centre; empty for other events than \
             patch-placed",
        ).in_unit("radii of the bright circle").open(),
    }
}

table! {
    name: "devices",
    description:
        "Failures and recoveries of camera and lens, and the operator's changes of the camera. A recovery is recorded \
         after the device has worked for a second. The rows reach from the start of each server run that served the \
         session to the end of the session, so they include the state at its beginning",
    key: [number],
    stored row:
    /// A change in the state of camera or lens.
    #[derive(Debug, Clone)]
    DeviceRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
        device: String = means("Device: camera or lens").open(),
        working: bool = means("Whether the device worked from then on").open(),
        message: String = means("Message of the device, or the operator's change, in words").open(),
    }
}

table! {
    name: "recordings",
    description:
        "The recordings of the session, one folder per row; the recordings themselves stay in the data folder",
    key: [name],
    row:
    /// A recording of the session.
    #[derive(Debug, Clone)]
    RecordingRow {
        session: SessionId = SESSION,
        name: String = means("Name of the recording"),
        path: String = means("Folder of the recording, relative to the data folder"),
        kind: Option<&'static str> = means(
            "Kind of recording: mosaic (raw mosaics in Zarr v3) or view (JPEG pictures); empty if it cannot be read",
        ),
        run: Option<i64> =
            means("Number of the server start that made the recording; see runs; empty if it cannot be read"),
        started: Option<Timestamp> = means(
            "Start of the recording, by the server's wall clock; first_ns and last_ns count from it; empty if it \
             cannot be read",
        ).in_unit("UTC"),
        monotonic_ns: Option<i64> = means(
            "Start of the recording, by the server's monotonic clock; comparable only within one run; empty if it \
             cannot be read",
        ).in_unit("ns"),
        first_ns: Option<i64> = means(
            "End of the first frame's exposure, from the recording's start; empty if it has no frame",
        ).in_unit("ns"),
        last_ns: Option<i64> = means(
            "End of the last frame's exposure, from the recording's start; empty if it has no frame",
        ).in_unit("ns"),
        frames: Option<usize> = means("Number of frames in the recording; empty if it cannot be read"),
        lost: Option<u64> = means(
            "Number of frames that the recorder was too slow for; empty for a view, which holds the frames sent to \
             viewers, and if the recording cannot be read",
        ),
        ended: Option<String> = means(
            "How the recording ended: stopped, or the reason why it stopped by itself; empty if it was cut short or \
             continues",
        ),
        description_sha256: Option<String> =
            means("SHA-256 of the recording's zarr.json or view.json; empty if it cannot be read"),
        problem: Option<String> = means("Reason why the recording cannot be read; empty if it can"),
    }
}

table! {
    name: "accesses",
    description:
        "Views of the session's focal path and recordings, and exports of the session, this one included",
    key: [number],
    stored row:
    /// A look at the evidence.
    #[derive(Debug, Clone)]
    AccessRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: Option<i64> =
            means("Number of the server start that recorded the row; empty if the command line did").open(),
        monotonic_ns: Option<i64> = MONOTONIC_IF_ANY.open(),
        role: String = means("Role that had access: researcher, or command-line").open(),
        kind: String = means("Kind of access: path-viewed, recording-viewed or exported").open(),
        session: SessionId = SESSION.open(),
        detail: Option<String> =
            means("Kind of export: blinded or unblinded; empty for other kinds of access").open(),
    }
}

table! {
    name: "studies",
    description: "The study that the session belongs to; no row if it belongs to none",
    key: [study],
    row:
    /// A study.
    #[derive(Debug, Clone)]
    StudyRow {
        study: String = means("Name of the study, the same at every site").open(),
        title: String = means("Title of the study"),
        definition_sha256: String = means("SHA-256 of study.toml, the same at every site").open(),
        sites: String = means("Names of the study's sites that this database holds, as JSON").open(),
        wall: Timestamp =
            means("Time when the study was planned, by the server's wall clock").in_unit("UTC").open(),
        stage: &'static str = means("Stage of the study: planned, open, closed, locked or unblinded"),
        commitment: Option<String> = means(
            "SHA-256 published when the study was first opened; it commits to the orders of all its places in this \
             database; empty before",
        ),
    }
}

table! {
    name: "study_sessions",
    description: "The session's place in its study; no row if it belongs to none",
    key: [session],
    row:
    /// The place of a session in a study.
    #[derive(Debug, Clone)]
    StudySessionRow {
        session: SessionId = SESSION.open(),
        study: String = means("Name of the study").open(),
        site: String = means("Name of the site").open(),
        protocol: String = means("Name of the protocol").open(),
        place: usize = means(
            "Place in the list of site and protocol, from 1; it does not reveal the order of policies",
        ).open(),
    }
}

table! {
    name: "study_events",
    description:
        "Events of the study as a whole, and of this session in it; missing numbers belong to other sessions",
    key: [study, number],
    stored row:
    /// An event of a study.
    #[derive(Debug, Clone)]
    StudyEventRow {
        study: String = means("Name of the study").open(),
        number: i64 = means("Number of the event in the study, from 1").open(),
        wall: Timestamp = WALL.open(),
        run: Option<i64> =
            means("Number of the server start that recorded the row; empty if the command line did").open(),
        monotonic_ns: Option<i64> = MONOTONIC_IF_ANY.open(),
        role: String = means("How the event was recorded: researcher (on the page), or command-line").open(),
        person: String = means("Name of the person, as entered").open(),
        kind: String = means(
            "Kind of event: planned, opened, closed, locked, unblinded, session-withdrawn, or session-unblinded \
             (emergency unblinding of one session)",
        ).open(),
        about_session: Option<SessionId> =
            means("Random id of the session that the event is about; empty for the whole study").open(),
        commitment: Option<String> = means(
            "SHA-256 published at the first opening, which commits to all orders; empty for other events",
        ).open(),
        reason: String = means("Reason given for the event; empty if none was given, or it was erased").sealed(),
    }
}

table! {
    name: "actors",
    description:
        "The personal account behind each record; a record without a row was made through a role's link, by the \
         command line or by the server",
    key: [number],
    stored row:
    /// The account behind a record.
    #[derive(Debug, Clone)]
    ActorRow {
        number: i64 = means("Number of the row in the database, from 1").open(),
        kind: String = means("Kind of record, as in chain.csv").open(),
        record: String = means("Key of the record, as in chain.csv").open(),
        session: String = means("Random id of the session").open(),
        account: String = means("Name of the account").open(),
        display: String = means("Name of the person when the record was made").open(),
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
        setting: Option<usize> = SETTING_IF_ANY,
        file: Option<String> =
            means("Name of the file; empty if no piece of the recording arrived, or its sound was erased"),
        media_type: Option<&'static str> =
            means("Media type of the file, as the browser recorded it; empty if no piece arrived"),
        seconds: f64 = means("Duration of the recording, as the page measured it").in_unit("s"),
        pieces: usize = means("Number of pieces that arrived; see voice_pieces"),
        missing: usize = means("Number of pieces that did not arrive although later ones did"),
        bytes: i64 = means("Length of the pieces that arrived").in_unit("bytes"),
        sha256: Option<String> = means("SHA-256 of the file; empty if there is no file"),
        ended: Option<&'static str> = means(
            "Why the recording ended: released (the surgeon let go), limit (after two minutes), microphone-lost or \
             left (the page was hidden); empty if it was cut off",
        ),
        complete: bool = means("Whether the end and all pieces of the recording arrived"),
        transcript: Option<String> = means("Transcript by a researcher; see corrections; empty if there is none"),
        erased: Option<Timestamp> = means(
            "Time when the sound was erased, by the server's wall clock; see erasures; empty if it was not",
        ).in_unit("UTC"),
    }
}

table! {
    name: "voice_pieces",
    description: "The pieces of the recordings of voice comments, in the order in which the server recorded them",
    key: [number],
    stored row:
    /// A piece of a recording.
    #[derive(Debug, Clone)]
    VoicePieceRow {
        number: i64 = means("Number of the record in the database, from 1").open(),
        session: SessionId = SESSION.open(),
        comment: IdempotencyKey = means("Key of the comment, as in comments.csv").open(),
        piece: u32 =
            means("Number of the piece in the recording, from 1; the pieces in this order are the file").open(),
        media_type: String = means("Media type of the piece, as the browser recorded it").open(),
        through_ms: i64 = means(
            "Duration of the recording up to the end of the piece, as the page measured it",
        ).in_unit("ms").open(),
        ended: Option<String> =
            means("Why the recording ended, as in voice; empty if the piece is not the last").open(),
        bytes: i64 = means("Length of the piece").in_unit("bytes").open(),
        sha256: String = means("SHA-256 of the piece; it stays when the sound is erased").open(),
        wall: Timestamp = WALL.open(),
        run: i64 = RUN.open(),
        monotonic_ns: i64 = MONOTONIC.open(),
    }
}

table! {
    name: "chain",
    description:
        "The chain of all records of the database up to this export, in order; rows of other sessions have only \
         number, entry and hash; docs/evidence.md describes what is hashed",
    key: [number],
    row:
    /// A row of the chain.
    #[derive(Debug, Clone, Default)]
    ChainRow {
        number: i64 = means("Number of the row, from 1; no number is missing"),
        entry: String = means("SHA-256 of the columns from wall to content"),
        hash: String = means("SHA-256 of number, the hash of the previous row, and entry"),
        wall: Option<String> = means(
            "Time of writing, by the server's wall clock; empty if the row is of another session",
        ).in_unit("UTC"),
        kind: Option<String> = means(
            "Kind of record: run, participant, session, event, comment, answer, device, access, correction, \
             consent, erasure, telemetry, study, study-event, study-session, account-event, actor or voice-piece; \
             empty if the row is of another session",
        ),
        key: Option<String> = means("Key of the record; empty if the row is of another session"),
        session: Option<String> = means(
            "Random id of the record's session; empty for runs and devices, and if the row is of another session",
        ),
        place: Option<i64> = means(
            "Number of the row among those of the session, from 1; empty if it is of no session or another one",
        ),
        salt: Option<String> =
            means("Random bytes that keep entry from being guessed; empty if the row is of another session"),
        sealed: Option<String> =
            means("SHA-256 of sealed_salt and the record's sealed columns; empty if it has none"),
        sealed_salt: Option<String> = means(
            "Random bytes that keep sealed from being guessed; empty if the record has no sealed columns, or they \
             are withheld until unblinding; see chain_salts.csv",
        ),
        content: Option<String> = means("SHA-256 of the record; empty if the row is of another session"),
    }
}

table! {
    name: "chain_salts",
    description: "The salts of sealed columns, which are withheld until unblinding",
    key: [number],
    stored row:
    /// The salt of a row's sealed columns.
    #[derive(Debug, Clone)]
    ChainSaltRow {
        number: i64 = means("Number of the row of chain.csv"),
        salt: String = means("Random bytes that keep the sealed columns from being guessed"),
    }
}

table! {
    name: "telemetry",
    description:
        "Every step of the control loop during the settings. Metric and timing would reveal the policy and are in \
         policy_steps.csv. An expert may still guess a policy from the focal path, and from frames that are missing \
         because the loop waited",
    key: [run, frame],
    stored row:
    /// A step of the control loop, without the columns that reveal the policy.
    #[derive(Debug, Clone)]
    TelemetryRow {
        setting: i64 = SETTING,
        run: i64 = RUN,
        frame: i64 = FRAME,
        exposed_ns: i64 = EXPOSED,
        asked: f64 = means("Focal power commanded after the frame").in_unit("focal power, 0..1"),
        measured: Option<f64> = means(
            "Focal power at the middle of the frame's exposure, computed from the lens's dynamics; empty while the \
             lens was unavailable",
        ).in_unit("focal power, 0..1"),
        held: bool = means(
            "Whether the lens was held on request, because of a pause, or because of a failure of lens or camera; holds \
             caused by the policy would reveal it and are in policy_steps.csv",
        ),
        optimal: Option<f64> = means(
            "Best focal power for the frame; empty unless camera and lens are simulated",
        ).in_unit("focal power, 0..1"),
        picture_width: Option<i64> = means(
            "Width of the picture on the surgeon's tablet, to half a second; empty if no tablet showed one",
        ).in_unit("px"),
        patch_x: i64 = means("Left column of the patch").in_unit("mosaic cells"),
        patch_y: i64 = means("Top row of the patch").in_unit("mosaic cells"),
    }
}

table! {
    name: "allocation",
    description: "The policy that ran in each setting",
    key: [segment],
    row:
    /// The policy of a segment.
    #[derive(Debug, Clone)]
    AllocationRow {
        session: SessionId = SESSION,
        setting: usize = SETTING,
        segment: SegmentId = SEGMENT,
        policy: PolicyName = means("Name of the policy"),
    }
}

table! {
    name: "weights",
    description:
        "The weights of the session's learned policies in each server start that served the session",
    key: [run, policy],
    stored row:
    /// The weights that a learned policy had in a start of the server.
    #[derive(Debug, Clone)]
    WeightsRow {
        run: i64 = RUN,
        policy: String = means("Name of the policy"),
        sha256: String = means("SHA-256 of the policy's weights file"),
    }
}

table! {
    name: "policy_steps",
    description: "The columns of each step that reveal the policy; to be joined with telemetry.csv by run and frame",
    key: [run, frame],
    stored row:
    /// The columns of a step of the control loop that reveal the policy.
    #[derive(Debug, Clone)]
    PolicyStepRow {
        setting: i64 = SETTING,
        run: i64 = RUN,
        frame: i64 = FRAME,
        policy: Option<String> = means("Name of the policy that ran; empty if none did"),
        metric: Option<f64> = means(
            "Focus metric of the policy: mean gradient magnitude or mean local ratio; empty if it computed none",
        ),
        policy_micros: i64 = means("Duration of the policy's step").in_unit("us"),
        latency_micros: i64 = means("Time from the end of the exposure to the lens command").in_unit("us"),
        held: Option<String> = means(
            "Why the lens was held; empty if it was not: paused, focus-held, policy-panicked, policy-nonsense, policy-slow, \
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

    #[test]
    fn every_column_that_may_be_empty_says_when() {
        for table in ALL {
            for column in table.columns.iter().filter(|column| column.may_be_empty) {
                assert!(column.description.contains("empty"), "{}.{}", table.name, column.name);
            }
        }
    }
}

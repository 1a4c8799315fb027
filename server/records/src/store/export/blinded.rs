//! The blinded part of an export. Its types have no field for a policy, the order, the seed, or a reason that may name
//! them.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value, json};

use super::ExportError;
use super::description::{
    AccessRow, ActorRow, AnswerRow, ChainRow, CommentRow, ConsentRow, CorrectionRow, DeviceRow, ErasureRow, EventRow,
    RecordingRow, RunRow, SegmentRow, SessionRow, TelemetryRow, VoicePieceRow, WithdrawalRow,
};
use super::folder::Folder;
use super::study::ExportedStudy;
use super::table::{FORMAT, Row, TEXTS_IN_CSV, objects};
use crate::store::remarks::{said_columns, withdrawn};
use crate::store::sessions::StoredSession;
use crate::store::values::nanoseconds;
use crate::store::{
    Answer, Comment, Erased, Head, Reader, RunClocks, SessionLine, StoreError, StoredCorrection, VoiceRecording,
    standings,
};
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_base::{FocalPower, PatchPlace};
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::grace::Grace;
use parfocal_trial::instruments::sus_score;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::QuestionKind;
use parfocal_trial::remark::WaitClock;
use parfocal_trial::session::{Inspection, inspections};
use parfocal_trial::sight::{SegmentSight, sights_by_segment};
use parfocal_trial::standing::AnswerStanding;

/// The beginning of an export's description of itself.
const ABOUT: &str = "Exported by parfocal. Wall times are UTC; monotonic times are nanoseconds, \
    comparable within a run. Focal power is normalised to 0..1 over the lens's range. session.json \
    holds all tables but telemetry and policy_steps.";

/// A session without anything that unblinding reveals.
pub struct Blinded {
    line: SessionLine,
    run: i64,
    monotonic_ns: i64,
    protocol_toml: String,
    protocol_sha256: String,
    /// `None` if this version cannot read it. Then the questions have no text.
    pub(super) protocol: Option<Protocol>,
    algorithm: &'static str,
    commitment: String,
    segments: Vec<SegmentId>,
    events: Vec<(i64, Event)>,
    pub(super) comments: Vec<(i64, Comment)>,
    /// The recordings of voice comments.
    pub(super) voice: BTreeMap<IdempotencyKey, VoiceRecording>,
    pub(super) answers: Vec<(i64, Answer)>,
    pub(super) corrections: Vec<StoredCorrection>,
    pub(super) erased: Erased,
    pub(super) clocks: RunClocks,
    grace: Grace,
    study: ExportedStudy,
}

impl Blinded {
    /// The blinded part of `stored`.
    pub async fn of(reader: &Reader, stored: StoredSession) -> Result<Self, StoreError> {
        let session = stored.made.session;
        let line = reader.session_line(session).await?;
        let line = line.ok_or_else(|| StoreError::Damaged(format!("session {session} is not in the list")))?;

        let clocks = reader.run_clocks().await?;

        // Nothing that reveals the policies gets past this point.
        let blind = |(run, event): (i64, Event)| (run, Event { kind: event.kind.for_the_blinded(), ..event });

        Ok(Self {
            line,
            run: stored.run,
            monotonic_ns: nanoseconds(stored.made.stamp.at),
            grace: stored.grace(&clocks),
            clocks,
            protocol: stored.protocol().ok(),
            protocol_toml: stored.made.protocol_toml,
            protocol_sha256: stored.made.protocol_sha256,
            algorithm: stored.made.algorithm.name(),
            commitment: stored.made.commitment,
            segments: stored.made.segments.into_iter().map(|(segment, _)| segment).collect(),
            events: stored.events.into_iter().map(blind).collect(),
            comments: reader.comments(session).await?,
            voice: reader.voice(session).await?,
            answers: reader.answers(session).await?,
            corrections: reader.corrections(session).await?,
            erased: Erased::by(&reader.erasures(session).await?),
            study: ExportedStudy::of(reader, session).await?,
        })
    }

    /// Whether the session is practice.
    pub const fn practice(&self) -> bool {
        self.line.practice
    }

    pub(super) const fn session(&self) -> SessionId {
        self.line.session
    }

    /// Writes all its files except the description. `recordings` are the session's recordings.
    pub async fn write(
        &self,
        reader: &Reader,
        recordings: &[RecordingRow],
        folder: &mut Folder,
    ) -> Result<(), ExportError> {
        let session = self.session();
        let mut copies = Map::new();
        let runs: Vec<RunRow> = reader.export_rows(session).await?;
        let devices: Vec<DeviceRow> = reader.export_rows(session).await?;
        let own = self.own_rows(&runs, &devices);

        copy(folder, &mut copies, &runs).await?;
        copy(folder, &mut copies, &[self.session_row()]).await?;
        copy(folder, &mut copies, &self.segment_rows()).await?;
        copy(folder, &mut copies, &self.comment_rows()).await?;
        copy(folder, &mut copies, &self.answer_rows()).await?;
        copy(folder, &mut copies, &self.event_rows()).await?;
        copy(folder, &mut copies, &devices).await?;
        copy(folder, &mut copies, recordings).await?;
        copy(folder, &mut copies, &reader.export_rows::<AccessRow>(session).await?).await?;
        copy(folder, &mut copies, &self.score_rows()).await?;
        copy(folder, &mut copies, &reader.export_rows::<CorrectionRow>(session).await?).await?;
        copy(folder, &mut copies, &reader.export_rows::<ConsentRow>(session).await?).await?;
        copy(folder, &mut copies, &reader.export_rows::<ErasureRow>(session).await?).await?;
        copy(folder, &mut copies, &reader.export_rows::<WithdrawalRow>(session).await?).await?;
        copy(folder, &mut copies, &self.study.rows).await?;
        copy(folder, &mut copies, &self.study.places).await?;
        copy(folder, &mut copies, &self.study.events).await?;
        copy(folder, &mut copies, &reader.export_rows::<ActorRow>(session).await?).await?;
        let voice = self.write_voice(reader, folder).await?;
        copy(folder, &mut copies, &voice).await?;
        copy(folder, &mut copies, &reader.export_rows::<VoicePieceRow>(session).await?).await?;
        folder.json("session.json", &Value::Object(copies)).await?;

        folder.file("protocol.toml", self.protocol_toml.as_bytes()).await?;
        if let Some(definition) = &self.study.definition {
            folder.file("study.toml", definition.as_bytes()).await?;
        }

        let mut chain = folder.begin()?;
        reader.export_chain(async |row| chain.row(&own.told_of(row)).await).await?;
        chain.end().await?;

        reader.export_long::<TelemetryRow>(session, folder).await
    }

    /// The description of the whole export, without its tables.
    pub fn package(&self, unblinded: bool, head: &Head) -> Value {
        let name = super::folder::folder_name(self.session(), unblinded);
        let study = self.study.rows.first();
        json!({
            "profile": "tabular-data-package",
            "name": name,
            "title": format!("Usability trial of autofocus policies: session {}", self.session()),
            "description": format!("{ABOUT} {TEXTS_IN_CSV}"),
            "parfocal": {
                "version": env!("CARGO_PKG_VERSION"),
                "format": FORMAT,
                "practice": self.line.practice,
                "blinded": !unblinded,
                "unblinded": self.unblinded(),
                "study": study.map(|study| &study.study),
                "study_definition_sha256": study.map(|study| &study.definition_sha256),
                "chain": { "number": head.number, "hash": head.hash },
            },
        })
    }

    /// The rows of the chain that the export shows whole.
    fn own_rows(&self, runs: &[RunRow], devices: &[DeviceRow]) -> OwnRows {
        let unblinding = |(_, event): &&(i64, Event)| matches!(event.kind, EventKind::Unblinded { .. });
        let key = |(_, event): &(i64, Event)| format!("{}/{}", self.session(), event.number);
        OwnRows {
            session: self.session().to_string(),
            runs: runs.iter().map(|row| row.run.to_string()).collect(),
            devices: devices.iter().map(|row| row.number.to_string()).collect(),
            unblindings: self.events.iter().filter(unblinding).map(key).collect(),
            study: self.study.keys().collect(),
        }
    }

    /// Whether the session has not ended.
    pub fn under_way(&self) -> bool {
        self.line.status == SessionStatus::UnderWay
    }

    fn unblinded(&self) -> &'static str {
        match (self.line.unblinded, self.line.emergency) {
            (false, _) => "no",
            (true, false) => "after-end",
            (true, true) if self.ended_before_unblinding() => "emergency-after-end",
            (true, true) => "while-under-way",
        }
    }

    fn ended_before_unblinding(&self) -> bool {
        let before = self.events.iter().take_while(|(_, event)| !matches!(event.kind, EventKind::Unblinded { .. }));
        before.into_iter().any(|(_, event)| matches!(event.kind, EventKind::Completed | EventKind::Aborted { .. }))
    }

    pub(super) fn setting(&self, segment: Option<SegmentId>) -> Option<usize> {
        self.segments.iter().position(|&known| Some(known) == segment).map(|position| position + 1)
    }

    fn session_row(&self) -> SessionRow {
        let line = &self.line;
        SessionRow {
            session: line.session,
            participant: line.participant.clone(),
            protocol: line.protocol.clone(),
            protocol_sha256: self.protocol_sha256.clone(),
            practice: line.practice,
            algorithm: self.algorithm,
            commitment: self.commitment.clone(),
            wall: line.created,
            run: self.run,
            monotonic_ns: self.monotonic_ns,
            status: line.status,
            settings: line.settings,
            finished_settings: line.finished_settings,
            comments: self.comments.len() as i64,
            unblinded: self.unblinded(),
            counts_until: self.grace.until(),
        }
    }

    fn segment_rows(&self) -> Vec<SegmentRow> {
        let inspections = inspections(self.events.iter().map(|(_, event)| (event, &event.kind)));
        let sights = sights_by_segment(self.events.iter().map(|(_, event)| &event.kind));
        let row = |(&segment, setting): (&SegmentId, usize)| {
            let inspection = inspections.iter().find(|inspection| inspection.segment == segment);
            let finished = inspection.and_then(Inspection::finished);
            let sight = sights.get(&segment);

            SegmentRow {
                session: self.session(),
                setting,
                segment,
                started: inspection.map(|inspection| inspection.began.wall),
                finished: finished.map(|event| event.wall),
                finished_by: finished.map(|event| event.by),
                inspected_seconds: inspection
                    .and_then(|inspection| inspection.inspected)
                    .map(|time| time.as_secs_f64()),
                least_picture_width: sight.map(|sight| sight.least_width),
                mean_picture_width: sight.map(SegmentSight::mean_width),
                pictures_per_second: sight.map(SegmentSight::per_second),
            }
        };

        self.segments.iter().zip(1..).map(row).collect()
    }

    fn comment_rows(&self) -> Vec<CommentRow> {
        let withdrawn = withdrawn(&self.comments);
        let row = |((run, comment), number): (&(i64, Comment), usize)| {
            let (kind, text) = said_columns(&comment.said);

            CommentRow {
                number,
                key: comment.key,
                session: comment.session,
                setting: self.setting(comment.segment),
                segment: comment.segment,
                kind,
                text: text.map(Cow::into_owned),
                frame: comment.frame,
                frame_run: comment.frame_run,
                picture_width: comment.sight.picture_width,
                pictures_per_second: comment.sight.pictures_per_second,
                wall: comment.stamp.wall,
                run: *run,
                monotonic_ns: nanoseconds(comment.stamp.at),
                client_millis: comment.origin.client_millis,
                waited_ms: comment.origin.waited_millis,
                waited_by: comment.origin.waited_by.map(WaitClock::name),
                device: comment.origin.device,
                sequence: comment.origin.sequence,
                late: comment.late,
                erased: self.erased.at(Erasable::Comment, &comment.key),
                withdrawn: withdrawn.get(&comment.key).copied(),
            }
        };

        self.comments.iter().zip(1..).map(row).collect()
    }

    fn answer_rows(&self) -> Vec<AnswerRow> {
        let standings = standings(&self.answers, &self.clocks);
        let row = |(((run, answer), standing), number): ((&(i64, Answer), AnswerStanding), usize)| {
            let question = self.protocol.as_ref().and_then(|p| p.question(&answer.question, answer.segment.is_some()));
            let kind = question.map(|question| &question.kind);
            AnswerRow {
                number,
                key: answer.key,
                session: answer.session,
                setting: self.setting(answer.segment),
                segment: answer.segment,
                question: answer.question.clone(),
                question_text: question.map(|question| question.text.clone()),
                kind: kind.map(QuestionKind::name),
                revision: standing.revision,
                counts: standing.counts,
                value: serde_json::to_string(&standing.value).unwrap_or_default(),
                given_value: serde_json::to_string(&answer.value).unwrap_or_default(),
                sus_score: sus_score(kind, &standing.value),
                wall: answer.stamp.wall,
                run: *run,
                monotonic_ns: nanoseconds(answer.stamp.at),
                given: self.clocks.entered_at(*run, answer.stamp.at, &answer.origin),
                client_millis: answer.origin.client_millis,
                waited_ms: answer.origin.waited_millis,
                waited_by: answer.origin.waited_by.map(WaitClock::name),
                device: answer.origin.device,
                sequence: answer.origin.sequence,
                late: answer.late,
                disagrees: standing.disagrees,
                erased: self.erased.at(Erasable::Answer, &answer.key),
            }
        };

        self.answers.iter().zip(standings).zip(1..).map(row).collect()
    }

    fn event_rows(&self) -> Vec<EventRow> {
        let row = |(run, event): &(i64, Event)| {
            let (reason, emergency) = match &event.kind {
                EventKind::Paused { reason, .. }
                | EventKind::ReasonGiven { reason, .. }
                | EventKind::Aborted { reason, .. }
                | EventKind::Withdrawn { reason } => (Some(reason), None),
                EventKind::Unblinded { emergency, .. } => (None, Some(*emergency)),
                _ => (None, None),
            };

            let seen = event.kind.seen();
            let choice = event.kind.choice();
            let touched = choice.and_then(|choice| choice.at);
            let place = choice.filter(|choice| choice.at.is_some()).map(|choice| choice.place);
            EventRow {
                session: self.session(),
                number: event.number,
                wall: event.wall,
                run: *run,
                monotonic_ns: nanoseconds(event.at),
                role: event.by,
                kind: event.kind.name(),
                setting: self.setting(event.kind.segment()),
                segment: event.kind.segment(),
                inspected_ms: event.kind.inspected_ms(),
                reason: reason.cloned(),
                emergency,
                about: event.kind.about(),
                focal_power: event.kind.focal_power().map(FocalPower::get),
                left_at: event.kind.left_at().map(FocalPower::get),
                hidden: event.kind.hidden(),
                picture_width: seen.map(|seen| seen.size.width),
                picture_height: seen.map(|seen| seen.size.height),
                pictures: seen.map(|seen| seen.pictures),
                over_ms: seen.map(|seen| seen.over_ms),
                frame: choice.map(|choice| choice.frame),
                touched_x: touched.map(|touched| touched.x),
                touched_y: touched.map(|touched| touched.y),
                patch_across: place.map(PatchPlace::across),
                patch_down: place.map(PatchPlace::down),
            }
        };

        self.events.iter().map(row).collect()
    }
}

/// The rows of the chain that are about a session.
struct OwnRows {
    session: String,
    runs: BTreeSet<String>,
    devices: BTreeSet<String>,
    /// Keys of its unblinding, whose reason may name a policy.
    unblindings: BTreeSet<String>,
    /// Keys of its study, and of the study's events that the export shows.
    study: BTreeSet<String>,
}

impl OwnRows {
    /// What a blinded export shows of `row`.
    fn told_of(&self, row: ChainRow) -> ChainRow {
        let kind = row.kind.as_deref().unwrap_or_default();
        let key = row.key.as_deref().unwrap_or_default();
        let own = match kind {
            "run" => self.runs.contains(key),
            "device" => self.devices.contains(key),
            "study" | "study-event" => self.study.contains(key),
            _ => row.session.as_ref() == Some(&self.session),
        };

        if !own {
            return ChainRow { number: row.number, entry: row.entry, hash: row.hash, ..ChainRow::default() };
        }
        let withheld = matches!(kind, "run" | "telemetry") || kind == "event" && self.unblindings.contains(key);
        ChainRow { sealed_salt: row.sealed_salt.filter(|_| !withheld), ..row }
    }
}

/// Writes a table, and copies it into `copies`, which becomes session.json.
async fn copy<R: Row>(folder: &mut Folder, copies: &mut Map<String, Value>, rows: &[R]) -> Result<(), ExportError> {
    copies.insert(R::TABLE.name.to_owned(), objects(rows));
    folder.table(rows).await
}

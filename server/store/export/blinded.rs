//! The blinded part of an export. What it holds has no field for a policy, the order, the seed, or a reason that may
//! name them.

use serde_json::{Value, json};

use super::ExportError;
use super::description::{ANSWERS, COMMENTS, DEVICES, EVENTS, RUNS, SEGMENTS, SESSIONS, TELEMETRY};
use super::folder::Folder;
use super::table::{FORMAT, Row, TEXTS_IN_CSV, Table};
use crate::ids::{SegmentId, SessionId};
use crate::store::remarks::said_columns;
use crate::store::sessions::StoredSession;
use crate::store::{Answer, Comment, DeviceEvent, Reader, RunClocks, SessionLine, StoreError, nanoseconds, standings};
use crate::trial::answers::sus_score;
use crate::trial::event::{Event, EventKind};
use crate::trial::grace::Grace;
use crate::trial::protocol::Protocol;
use crate::trial::question::{AnswerValue, QuestionKind};
use crate::trial::remark::WaitClock;
use crate::trial::standing::Standing;

/// A session without what unblinding tells.
pub struct Blinded {
    line: SessionLine,
    run: i64,
    protocol_toml: String,
    protocol_sha256: String,
    /// `None` where this version cannot read it; then questions stand without their text.
    protocol: Option<Protocol>,
    algorithm: &'static str,
    commitment: String,
    segments: Vec<SegmentId>,
    events: Vec<(i64, Event)>,
    comments: Vec<(i64, Comment)>,
    answers: Vec<(i64, Answer)>,
    clocks: RunClocks,
    grace: Grace,
}

impl Blinded {
    /// The blinded part of `stored`.
    pub async fn of(reader: &Reader, stored: StoredSession) -> Result<Self, StoreError> {
        let session = stored.made.session;
        let lines = reader.sessions(true).await?;
        let line = lines.into_iter().find(|line| line.session == session);
        let line = line.ok_or_else(|| StoreError::Damaged(format!("session {session} is not in the list")))?;
        let clocks = reader.run_clocks().await?;
        let blind = |(run, event): (i64, Event)| (run, Event { kind: event.kind.for_the_blinded(), ..event });
        Ok(Self {
            line,
            run: stored.run,
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
            answers: reader.answers(session).await?,
        })
    }

    /// Whether the session is practice.
    pub const fn practice(&self) -> bool {
        self.line.practice
    }

    const fn session(&self) -> SessionId {
        self.line.session
    }

    /// Writes all its files but the description.
    pub async fn write(&self, reader: &Reader, folder: &mut Folder) -> Result<(), ExportError> {
        let tables: [(Table, Vec<Row>); 7] = [
            (RUNS, reader.export_runs(self.session()).await?),
            (SESSIONS, vec![self.session_row()]),
            (SEGMENTS, self.segment_rows()),
            (COMMENTS, self.comment_rows()),
            (ANSWERS, self.answer_rows()),
            (EVENTS, self.event_rows()),
            (DEVICES, device_rows(&reader.device_events(self.session()).await?)),
        ];
        let mut all = json!({});
        for (table, rows) in &tables {
            folder.table(table, rows).await?;
            all[table.name] = table.objects(rows);
        }
        folder.json("session.json", &all).await?;
        folder.file("protocol.toml", self.protocol_toml.as_bytes()).await?;
        let mut file = folder.begin(&TELEMETRY)?;
        reader.export_telemetry(self.session(), async |row| file.row(&row).await).await?;
        file.end().await
    }

    /// The description of the whole, without its tables.
    pub fn package(&self, unblinded: bool) -> Value {
        let name = super::folder_name(self.session(), unblinded);
        json!({
            "profile": "tabular-data-package",
            "name": name,
            "title": format!("Usability trial of autofocus policies: session {}", self.session()),
            "description": format!("Exported by parfocal. Wall times are UTC; monotonic times are nanoseconds, comparable within a run. Focal power is normalised to 0..1 over the lens's range. session.json holds all tables but telemetry and policy_steps. {TEXTS_IN_CSV}"),
            "parfocal": {
                "version": env!("CARGO_PKG_VERSION"),
                "format": FORMAT,
                "practice": self.line.practice,
                "blinded": !unblinded,
                "unblinded": self.unblinded(),
            },
        })
    }

    const fn unblinded(&self) -> &'static str {
        match (self.line.unblinded, self.line.emergency) {
            (false, _) => "no",
            (true, false) => "after-end",
            (true, true) => "while-under-way",
        }
    }

    fn setting(&self, segment: Option<SegmentId>) -> Option<usize> {
        self.segments.iter().position(|&known| Some(known) == segment).map(|position| position + 1)
    }

    fn session_row(&self) -> Row {
        let line = &self.line;
        vec![
            text(line.session),
            json!(line.participant),
            json!(line.protocol),
            json!(self.protocol_sha256),
            json!(line.practice),
            json!(self.algorithm),
            json!(self.commitment),
            text(line.created),
            json!(self.run),
            json!(line.status),
            json!(line.settings),
            json!(line.finished_settings),
            json!(line.comments),
            json!(self.unblinded()),
            json!(self.grace.until()),
        ]
    }

    fn segment_rows(&self) -> Vec<Row> {
        let row = |&segment: &SegmentId| {
            let of_it =
                || self.events.iter().map(|(_, event)| event).filter(move |e| e.kind.segment() == Some(segment));
            let started = of_it().find(|event| matches!(event.kind, EventKind::SegmentStarted { .. }));
            let finished = of_it().find(|event| matches!(event.kind, EventKind::SegmentFinished { .. }));
            vec![
                text(self.session()),
                json!(self.setting(Some(segment))),
                text(segment),
                json!(started.map(|event| event.wall)),
                json!(finished.map(|event| event.wall)),
                json!(finished.map(|event| event.by)),
                json!(finished.and_then(|event| event.kind.inspected_ms()).map(seconds)),
            ]
        };
        self.segments.iter().map(row).collect()
    }

    fn comment_rows(&self) -> Vec<Row> {
        let row = |((run, comment), number): (&(i64, Comment), u32)| {
            let (kind, said) = said_columns(&comment.said);
            vec![
                json!(number),
                text(comment.key),
                text(comment.session),
                json!(self.setting(comment.segment)),
                json!(comment.segment),
                json!(kind),
                json!(said),
                json!(comment.frame),
                json!(comment.frame_run),
                text(comment.stamp.wall),
                json!(run),
                json!(nanoseconds(comment.stamp.at)),
                json!(comment.origin.client_millis),
                json!(comment.origin.waited_millis),
                json!(comment.origin.waited_by.map(WaitClock::name)),
                json!(comment.origin.device),
                json!(comment.origin.sequence),
                json!(comment.late),
            ]
        };
        self.comments.iter().zip(1..).map(row).collect()
    }

    fn answer_rows(&self) -> Vec<Row> {
        let standings = standings(&self.answers, &self.clocks);
        let row = |(((run, answer), standing), number): ((&(i64, Answer), Standing), u32)| {
            let question = self.protocol.as_ref().and_then(|p| p.question(&answer.question, answer.segment.is_some()));
            let kind = question.map(|question| &question.kind);
            let score = match (kind, &standing.value) {
                (Some(QuestionKind::Sus), AnswerValue::Points(items)) => sus_score(items),
                _ => None,
            };
            vec![
                json!(number),
                text(answer.key),
                text(answer.session),
                json!(self.setting(answer.segment)),
                json!(answer.segment),
                json!(answer.question),
                json!(question.map(|question| &question.text)),
                json!(kind.map(QuestionKind::name)),
                json!(standing.revision),
                json!(standing.counts),
                json!(serde_json::to_string(&standing.value).ok()),
                json!(score),
                text(answer.stamp.wall),
                json!(run),
                json!(nanoseconds(answer.stamp.at)),
                json!(self.clocks.said(*run, answer.stamp.at, &answer.origin)),
                json!(answer.origin.client_millis),
                json!(answer.origin.waited_millis),
                json!(answer.origin.waited_by.map(WaitClock::name)),
                json!(answer.origin.device),
                json!(answer.origin.sequence),
                json!(answer.late),
                json!(standing.disagrees),
            ]
        };
        self.answers.iter().zip(standings).zip(1..).map(row).collect()
    }

    fn event_rows(&self) -> Vec<Row> {
        let row = |(run, event): &(i64, Event)| {
            let (reason, emergency) = match &event.kind {
                EventKind::Paused { reason, .. } | EventKind::Aborted { reason, .. } => (Some(reason), None),
                EventKind::Unblinded { emergency, .. } => (None, Some(emergency)),
                _ => (None, None),
            };
            vec![
                text(self.session()),
                json!(event.number),
                text(event.wall),
                json!(run),
                json!(nanoseconds(event.at)),
                json!(event.by),
                json!(event.kind.name()),
                json!(self.setting(event.kind.segment())),
                json!(event.kind.segment()),
                json!(event.kind.inspected_ms()),
                json!(reason),
                json!(emergency),
            ]
        };
        self.events.iter().map(row).collect()
    }
}

fn device_rows(events: &[(i64, i64, DeviceEvent)]) -> Vec<Row> {
    let row = |(number, run, event): &(i64, i64, DeviceEvent)| {
        vec![
            json!(number),
            text(event.wall),
            json!(run),
            json!(nanoseconds(event.at)),
            json!(event.device),
            json!(event.working),
            json!(event.message),
        ]
    };
    events.iter().map(row).collect()
}

fn text(value: impl std::fmt::Display) -> Value {
    Value::String(value.to_string())
}

fn seconds(milliseconds: u64) -> f64 {
    std::time::Duration::from_millis(milliseconds).as_secs_f64()
}

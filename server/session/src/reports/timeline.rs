//! A session over time: when each setting was inspected, the focal path, and the comments and answers.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::Reports;
use crate::conductor::{ConductError, Course};
use parfocal_base::boxed;
use parfocal_base::clock::Moment;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::{
    Answer, Erased, LatestCorrections, PathPoint, RunClocks, VoiceRecording, standings, withdrawn,
};
use parfocal_trial::correction::Subject;
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::{EventKind, Seen, per_second};
use parfocal_trial::permission;
use parfocal_trial::protocol::Record;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::role::Role;
use parfocal_trial::session::{Inspection, inspections};
use parfocal_trial::standing::AnswerStanding;
use parfocal_trial::tablet::PictureSize;
use parfocal_trial::voice::Ending;

/// A session over time. Seconds count from its start by the server's clocks, pauses included.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Timeline {
    /// When each setting was inspected.
    pub settings: Vec<SettingSpan>,
    /// When the session was paused and the lens held where it was.
    pub pauses: Vec<PauseSpan>,
    /// When no tablet showed the surgeon's page.
    pub absences: Vec<PauseSpan>,
    /// What size of picture the surgeon saw, and how many.
    pub sights: Vec<SightSpan>,
    /// When somebody chose what is to be in focus.
    pub choices: Vec<TimelineChoice>,
    /// Whether a choice stays in the settings that follow. Otherwise each setting begins at the centre.
    pub patch_stays: bool,
    /// When the focus was held on request.
    pub holds: Vec<HoldSpan>,
    /// The focal path.
    pub points: Vec<TimelinePoint>,
    /// The comments.
    pub comments: Vec<TimelineComment>,
    /// Answers that do not count, although they are their device's latest.
    pub set_aside: Vec<SetAside>,
}

/// When a setting was inspected.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SettingSpan {
    /// Setting, from 1.
    pub setting: usize,
    /// Start, in seconds.
    pub from: f64,
    /// End, in seconds; none while it lasts.
    pub to: Option<f64>,
}

/// When the session was paused, by a person or by a restart of the server.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PauseSpan {
    /// Start, in seconds. For a restart: when the server ended, as far as is known.
    pub from: f64,
    /// End, in seconds; none while it lasts.
    pub to: Option<f64>,
    /// Reason in words.
    pub reason: String,
}

/// What the surgeon saw for a while.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SightSpan {
    /// Start, in seconds.
    pub from: f64,
    /// End, in seconds.
    pub to: f64,
    /// Size of the pictures.
    #[serde(flatten)]
    pub size: PictureSize,
    /// Pictures a second.
    pub per_second: f64,
}

/// A choice of what is to be in focus.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelineChoice {
    /// When it was made, in seconds.
    pub seconds: f64,
    /// Number of the frame that was on screen.
    pub frame: u64,
    /// Where the picture was touched, in mosaic cells from its left edge; none for the centre of the bright circle.
    pub x: Option<f64>,
    /// Where the picture was touched, in mosaic cells from its top edge; none for the centre of the bright circle.
    pub y: Option<f64>,
}

/// When the focus was held on request.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct HoldSpan {
    /// Start, in seconds.
    pub from: f64,
    /// End, in seconds; none while it lasts.
    pub to: Option<f64>,
}

/// A point of the focal path.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelinePoint {
    /// Setting, from 1.
    pub setting: i64,
    /// When the frame was exposed, in seconds.
    pub seconds: f64,
    /// Number of the frame.
    pub frame: i64,
    /// Requested focal power, 0 to 1.
    pub asked: f64,
    /// Focal power at which the frame was exposed, 0 to 1.
    pub measured: Option<f64>,
    /// The optimum, 0 to 1, if a simulation knows it.
    pub optimal: Option<f64>,
    /// The policy's focus metric, on a scale of its own; only after the session was unblinded.
    pub metric: Option<f64>,
    /// Left column of the patch, in mosaic cells.
    pub patch_x: i64,
    /// Top row of the patch, in mosaic cells.
    pub patch_y: i64,
}

/// A comment on the timeline.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelineComment {
    /// The comment's key.
    pub key: IdempotencyKey,
    /// When it was stored, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// When the comment was made, in seconds: the time that it waited on the surgeon's device is subtracted.
    pub seconds: f64,
    /// Setting, from 1; none outside settings.
    pub setting: Option<usize>,
    /// Number of the frame that was on screen.
    pub frame: Option<u64>,
    /// Width of the picture on screen, pixels.
    pub picture_width: Option<u32>,
    /// Pictures that the surgeon saw a second.
    pub pictures_per_second: Option<f64>,
    /// Whether it arrived too late to count.
    pub late: bool,
    /// The content of the comment; empty if it was erased.
    #[serde(flatten)]
    pub said: CommentContent,
    /// Whether the surgeon took it back at once.
    pub withdrawn: bool,
    /// A researcher's note on the comment; for a voice comment, its transcript.
    pub note: Option<String>,
    /// The recording of a voice comment; none for other comments.
    pub voice: Option<TimelineVoice>,
    /// When its words were erased, by the server's wall clock; none if they were not.
    #[schema(value_type = Option<String>)]
    pub erased: Option<Timestamp>,
}

/// The recording of a voice comment.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelineVoice {
    /// Media type; none until a part of the recording has arrived.
    pub media_type: Option<String>,
    /// Length in seconds.
    pub seconds: f64,
    /// Why the recording ended; none if it was cut off or still continues.
    pub ended: Option<Ending>,
    /// Number of pieces, of about a second each, that have not arrived although later ones have.
    pub missing: usize,
}

/// An answer that does not count: a later one from another device differs, or it arrived too late.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SetAside {
    /// The answer's key.
    pub key: IdempotencyKey,
    /// When it was stored, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// When the answer was given, in seconds: the time that it waited on the surgeon's device is subtracted.
    pub seconds: f64,
    /// Setting, from 1; none for a closing question.
    pub setting: Option<usize>,
    /// The question's identifier.
    pub question: String,
    /// The question's text.
    pub text: String,
    /// The answer.
    pub value: AnswerValue,
    /// The answer that counts instead; none if there is none.
    pub counted: Option<AnswerValue>,
    /// Whether it arrived too late.
    pub late: bool,
}

impl Reports {
    /// Session `session` over time, as `by` may see it. The focal path is thinned to about `points` points per setting.
    ///
    /// # Errors
    /// If there is no such session, its participant withdrew, or the database failed.
    #[boxed]
    pub async fn timeline(&self, by: Role, session: SessionId, points: u32) -> Result<Timeline, ConductError> {
        let course = self.load(session).await?;
        permission::check_reading(course.state.withdrawn())?;
        let with_metric = permission::may_see_metric(by, course.state.unblinded());
        let reader = &self.reader;
        let runs = &self.run_clock.clocks;
        let start = start(&course);
        let point = |point: PathPoint| TimelinePoint {
            seconds: seconds(start, runs.wall(point.run, point.exposed)),
            setting: point.setting,
            frame: point.frame,
            asked: point.asked,
            measured: point.measured,
            optimal: point.optimal,
            metric: point.metric.filter(|_| with_metric),
            patch_x: point.patch_x,
            patch_y: point.patch_y,
        };

        let notes = LatestCorrections::of(&reader.corrections(session).await?);
        let erased = Erased::by(&reader.erasures(session).await?);
        let mut voice = reader.voice(session).await?;
        let comments = reader.comments(session).await?;
        let withdrawn = withdrawn(&comments);
        let spoken = comments.into_iter().filter(|(_, comment)| comment.said.says_something());
        let comments = spoken.map(|(run, comment)| TimelineComment {
            key: comment.key,
            withdrawn: withdrawn.contains_key(&comment.key),
            note: notes.note(Subject::Comment, &comment.key).map(str::to_owned),
            erased: erased.at(Erasable::Comment, &comment.key),
            voice: (comment.said == CommentContent::Voice)
                .then(|| told_of(&voice.remove(&comment.key).unwrap_or_default())),
            at: comment.stamp.wall,
            seconds: seconds(start, runs.entered_at(run, comment.stamp.at, &comment.origin)).max(0.0),
            setting: comment.segment.map(|segment| course.setting(segment)),
            frame: comment.frame,
            picture_width: comment.sight.picture_width,
            pictures_per_second: comment.sight.pictures_per_second,
            late: comment.late,
            said: comment.said,
        });

        // A comment made without a network arrives late, but is shown at the time it was made.
        let mut comments: Vec<TimelineComment> = comments.collect();
        comments.sort_by(|one, other| one.seconds.total_cmp(&other.seconds));

        let answers = reader.answers(session).await?;
        let events: Vec<(f64, &EventKind)> =
            course.timed_events().map(|(at, event)| (seconds(start, at), &event.kind)).collect();
        let points: Vec<TimelinePoint> = reader.focal_path(session, points).await?.into_iter().map(point).collect();
        Ok(Timeline {
            settings: settings(&course, &events),
            pauses: pauses(&events, &points),
            absences: absences(&events),
            sights: sights(&events),
            choices: choices(&events),
            patch_stays: course.protocol.patch.stays(),
            holds: holds(&events),
            points,
            comments,
            set_aside: set_aside(&course, &answers, runs, start),
        })
    }
}

/// The zero of the session's seconds: its start, or the time when it was made if it has not started.
fn start(course: &Course) -> Timestamp {
    let started = course.timed_events().find(|(_, event)| event.kind == EventKind::Started);
    started.map_or(course.made.stamp.wall, |(at, _)| at)
}

/// The facts about a session that are needed to play its recordings.
#[derive(Debug, Clone)]
pub struct Played {
    start: Timestamp,
    clocks: Arc<RunClocks>,
    /// What the protocol asks to record.
    pub asked: Record,
    /// Whether the session has ended.
    pub ended: bool,
}

impl Played {
    /// Seconds from the session's start to the moment `monotonic_ns` of run `run`; negative before the start.
    pub fn seconds_at(&self, run: i64, monotonic_ns: i64) -> f64 {
        let at = Moment::from_nanos(u64::try_from(monotonic_ns).unwrap_or(0));
        seconds(self.start, self.clocks.wall(run, at))
    }

    /// Seconds from the session's start to `wall`, by the wall clock alone.
    pub fn seconds_of(&self, wall: Timestamp) -> f64 {
        seconds(self.start, wall)
    }
}

impl Reports {
    /// The facts about `session` that are needed to play its recordings.
    ///
    /// # Errors
    /// If `by` may not play them (yet), there is no such session, its participant withdrew, or the database failed.
    #[boxed]
    pub async fn to_play(&self, by: Role, session: SessionId) -> Result<Played, ConductError> {
        let course = self.load(session).await?;
        permission::check_reading(course.state.withdrawn())?;
        permission::check_playing(by, course.state.unblinded())?;

        Ok(Played {
            start: start(&course),
            clocks: Arc::clone(&self.run_clock.clocks),
            asked: course.protocol.record,
            ended: course.state.phase().has_ended(),
        })
    }
}

fn told_of(recorded: &VoiceRecording) -> TimelineVoice {
    TimelineVoice {
        media_type: recorded.media_type().map(|media_type| media_type.name().to_owned()),
        seconds: recorded.seconds(),
        ended: recorded.ended(),
        missing: recorded.missing(),
    }
}

fn set_aside(course: &Course, answers: &[(i64, Answer)], runs: &RunClocks, start: Timestamp) -> Vec<SetAside> {
    let standings = standings(answers, runs);
    let is_aside = |answer: &Answer, standing: &AnswerStanding| !standing.counts && (answer.late || standing.disagrees);
    let aside = answers.iter().zip(&standings).filter(|((_, answer), standing)| is_aside(answer, standing));
    let points = aside.map(|((run, answer), _)| {
        let question = course.protocol.question(&answer.question, answer.segment.is_some());
        SetAside {
            key: answer.key,
            at: answer.stamp.wall,
            seconds: seconds(start, runs.entered_at(*run, answer.stamp.at, &answer.origin)).max(0.0),
            setting: answer.segment.map(|segment| course.setting(segment)),
            question: answer.question.clone(),
            text: question.map(|question| question.text.clone()).unwrap_or_default(),
            value: answer.value.clone(),
            counted: course.state.answer(answer.segment, &answer.question).cloned(),
            late: answer.late,
        }
    });

    points.collect()
}

fn settings(course: &Course, events: &[(f64, &EventKind)]) -> Vec<SettingSpan> {
    let span = |Inspection { segment, began, ended, .. }: Inspection<f64>| SettingSpan {
        setting: course.setting(segment),
        from: began,
        to: ended,
    };
    inspections(events.iter().copied()).into_iter().map(span).collect()
}

/// When the session was paused. A restart is recorded only when the server is back, but the pause starts when the
/// server ended: when the setting's clock stopped, or when the last frame before was exposed, whichever is later.
fn pauses(events: &[(f64, &EventKind)], points: &[TimelinePoint]) -> Vec<PauseSpan> {
    let given: BTreeMap<u32, &str> = events
        .iter()
        .filter_map(|(_, kind)| match kind {
            EventKind::ReasonGiven { about, reason } => Some((*about, reason.as_str())),
            _ => None,
        })
        .collect();
    let mut spans: Vec<PauseSpan> = Vec::new();
    let mut inspecting = false;
    // When the inspection last began or resumed, and how many milliseconds of the setting had been inspected by then.
    let mut since = 0.0;
    let mut before = 0;
    for (&(at, kind), number) in events.iter().zip(1..) {
        match kind {
            EventKind::SegmentStarted { .. } => {
                inspecting = true;
                since = at;
                before = 0;
            }
            EventKind::SegmentFinished { .. } => inspecting = false,
            EventKind::Paused { inspected_ms, .. } | EventKind::ServerRestarted { inspected_ms } => {
                let given = given.get(&number).copied().unwrap_or_default();
                if let Some(open) = spans.last_mut().filter(|span| span.to.is_none()) {
                    add_reason(&mut open.reason, kind.reason().unwrap_or_default());
                    add_reason(&mut open.reason, given);
                } else {
                    let restarted = matches!(kind, EventKind::ServerRestarted { .. });
                    let clock = since + milliseconds(inspected_ms.saturating_sub(before));
                    let frame = points.iter().rev().map(|point| point.seconds).find(|&seconds| seconds < at);
                    let ended = frame.map_or(clock, |frame| frame.max(clock)).min(at);
                    let from = if restarted && inspecting { ended } else { at };
                    let mut reason = kind.in_words(|_| 0);
                    add_reason(&mut reason, given);
                    spans.push(PauseSpan { from, to: None, reason });
                }

                before = *inspected_ms;
            }
            EventKind::Resumed | EventKind::Completed | EventKind::Aborted { .. } => {
                if let Some(open) = spans.last_mut().filter(|span| span.to.is_none()) {
                    open.to = Some(at);
                }
                since = at;
            }
            _ => {}
        }
    }

    spans
}

/// Adds `reason` to a pause in words: one that was given afterwards, or that of a further pause in the same span. It is
/// empty if none was given or it was erased.
fn add_reason(words: &mut String, reason: &str) {
    if reason.is_empty() {
        return;
    }
    words.push_str(if words.contains(": ") { "; " } else { ": " });
    words.push_str(reason);
}

/// When no tablet showed the surgeon's page.
fn absences(events: &[(f64, &EventKind)]) -> Vec<PauseSpan> {
    let begins = |kind: &EventKind| matches!(kind, EventKind::TabletAway { .. });
    let ends =
        |kind: &EventKind| matches!(kind, EventKind::TabletBack | EventKind::Completed | EventKind::Aborted { .. });
    let span = |(from, to, kind): (f64, Option<f64>, &EventKind)| PauseSpan { from, to, reason: kind.in_words(|_| 0) };
    spans(events, begins, ends).into_iter().map(span).collect()
}

/// The spans of time from each event that `begins` one to the next that `ends` it, if there is one, with the first
/// event.
fn spans<'a>(
    events: &[(f64, &'a EventKind)],
    begins: impl Fn(&EventKind) -> bool,
    ends: impl Fn(&EventKind) -> bool,
) -> Vec<(f64, Option<f64>, &'a EventKind)> {
    let mut spans: Vec<(f64, Option<f64>, &EventKind)> = Vec::new();
    for &(at, kind) in events {
        if begins(kind) {
            spans.push((at, None, kind));
        } else if ends(kind)
            && let Some((_, to @ None, _)) = spans.last_mut()
        {
            *to = Some(at);
        }
    }
    spans
}

/// When somebody chose what is to be in focus.
fn choices(events: &[(f64, &EventKind)]) -> Vec<TimelineChoice> {
    let choice = |&(seconds, kind): &(f64, &EventKind)| {
        let choice = kind.choice()?;
        let x = choice.at.map(|touch| touch.x);
        let y = choice.at.map(|touch| touch.y);
        Some(TimelineChoice { seconds, frame: choice.frame, x, y })
    };
    events.iter().filter_map(choice).collect()
}

/// When the focus was held. Whatever stops the setting's clock releases it.
fn holds(events: &[(f64, &EventKind)]) -> Vec<HoldSpan> {
    let begins = |kind: &EventKind| matches!(kind, EventKind::FocusHeld { .. });
    let ends = |kind: &EventKind| {
        matches!(
            kind,
            EventKind::FocusReleased { .. }
                | EventKind::Paused { .. }
                | EventKind::ServerRestarted { .. }
                | EventKind::SegmentFinished { .. }
                | EventKind::Aborted { .. }
        )
    };
    spans(events, begins, ends).into_iter().map(|(from, to, _)| HoldSpan { from, to }).collect()
}

/// What the surgeon saw. Each of these events describes the time before it.
fn sights(events: &[(f64, &EventKind)]) -> Vec<SightSpan> {
    let span = |&(to, kind): &(f64, &EventKind)| {
        let Seen { size, pictures, over_ms, .. } = kind.seen()?;
        let per_second = per_second(pictures, over_ms);
        Some(SightSpan { from: to - milliseconds(over_ms), to, size, per_second })
    };
    events.iter().filter_map(span).collect()
}

/// Converts milliseconds to seconds.
fn milliseconds(count: u64) -> f64 {
    Duration::from_millis(count).as_secs_f64()
}

fn seconds(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;
    use parfocal_base::ids::SegmentId;

    #[test]
    fn a_restart_holds_from_where_the_clock_stood_and_a_pause_from_where_it_was_asked_for() {
        let segment = SegmentId(uuid::Uuid::nil());
        let paused = |inspected_ms| EventKind::Paused { reason: "phone".to_owned(), inspected_ms };
        let restarted = |inspected_ms| EventKind::ServerRestarted { inspected_ms };
        let events = [
            (5.0, EventKind::SegmentStarted { segment }),
            (15.0, paused(10_000)),
            (20.0, EventKind::Resumed),
            // Inspected for 4 s more, so until 24 s. Back after 16 s. Restarted again before anyone resumed.
            (40.0, restarted(14_000)),
            (50.0, restarted(14_000)),
            (60.0, EventKind::Resumed),
            (66.0, EventKind::SegmentFinished { segment, inspected_ms: 20_000 }),
            // No clock runs during the questions.
            (80.0, restarted(20_000)),
        ];

        let events: Vec<(f64, &EventKind)> = events.iter().map(|(at, kind)| (*at, kind)).collect();
        let at = |seconds| TimelinePoint {
            setting: 1,
            seconds,
            frame: 1,
            asked: 0.5,
            measured: None,
            optimal: None,
            metric: None,
            patch_x: 240,
            patch_y: 120,
        };
        let spans = |points: &[TimelinePoint]| -> Vec<(f64, Option<f64>)> {
            pauses(&events, points).iter().map(|span| (span.from, span.to)).collect()
        };
        assert_eq!(spans(&[]), [(15.0, Some(20.0)), (24.0, Some(60.0)), (80.0, None)]);
        // The clock is stored once a second; a frame after that gives a later time.
        assert_eq!(spans(&[at(5.0), at(24.7), at(40.1)])[1], (24.7, Some(60.0)));
        assert_eq!(pauses(&events, &[])[0].reason, "Paused: phone");
    }

    #[test]
    fn a_pause_has_the_reason_that_was_given_afterwards() {
        let paused = EventKind::Paused { reason: String::new(), inspected_ms: 0 };
        let words = |reason: &str| {
            let given = EventKind::ReasonGiven { about: 1, reason: reason.to_owned() };
            pauses(&[(2.0, &paused), (4.0, &given)], &[])[0].reason.clone()
        };
        assert_eq!(words("phone"), "Paused: phone");
        assert_eq!(words(""), "Paused", "the reason was erased");
    }

    #[test]
    fn a_pause_above_another_adds_its_reason() {
        let paused = |reason: &str| EventKind::Paused { reason: reason.to_owned(), inspected_ms: 0 };
        let given = EventKind::ReasonGiven { about: 2, reason: "phone".to_owned() };
        let words = |first: &str, second: &str| {
            let spans = pauses(&[(2.0, &paused(first)), (3.0, &paused(second)), (4.0, &given)], &[]);
            assert_eq!(spans.len(), 1);
            spans[0].reason.clone()
        };
        assert_eq!(words("", "bleeding"), "Paused: bleeding; phone");
        assert_eq!(words("smoke", ""), "Paused: smoke; phone");
        assert_eq!(words("", ""), "Paused: phone");
    }
}

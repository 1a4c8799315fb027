//! A session over time: when each setting was inspected, the focal path, and what was said.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::course::Course;
use super::{ConductError, Conductor};
use crate::ids::SessionId;
use crate::store::PathPoint;
use crate::trial::event::{Event, EventKind};
use crate::trial::view::Said;

/// A session over time. Seconds count from its start by the server's clocks, pauses included.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Timeline {
    /// When each setting was inspected.
    pub settings: Vec<SettingSpan>,
    /// The focal path.
    pub points: Vec<TimelinePoint>,
    /// What was said.
    pub comments: Vec<TimelineComment>,
}

/// When a setting was inspected.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SettingSpan {
    /// Setting, from 1.
    pub setting: usize,
    /// From, seconds.
    pub from: f64,
    /// To, seconds; none while it lasts.
    pub to: Option<f64>,
}

/// A point of the focal path.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelinePoint {
    /// Setting, from 1.
    pub setting: i64,
    /// Seconds.
    pub seconds: f64,
    /// Frame's number.
    pub frame: i64,
    /// Focal power asked for, 0..=1.
    pub asked: f64,
    /// Focal power that the frame was exposed at, 0..=1.
    pub measured: Option<f64>,
    /// The optimum, 0..=1, where a simulation knows it.
    pub optimal: Option<f64>,
}

/// A comment on the timeline.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TimelineComment {
    /// When, by the server's wall clock.
    #[schema(value_type = String)]
    pub at: Timestamp,
    /// Seconds.
    pub seconds: f64,
    /// Setting, from 1.
    pub setting: Option<usize>,
    /// Number of the frame that was on screen.
    pub frame: Option<u64>,
    /// What was said.
    #[serde(flatten)]
    pub said: Said,
}

impl Conductor {
    /// Session `session` over time, its focal path thinned to about `points` a setting.
    ///
    /// # Errors
    /// When there is none, or the database failed.
    pub async fn timeline(&self, session: SessionId, points: u32) -> Result<Timeline, ConductError> {
        let course = self.shared.load(session).await?;
        let reader = self.shared.store.reader();
        let runs = reader.run_clocks().await?;
        let events = reader.events(session).await?;
        let events: Vec<(Timestamp, Event)> =
            events.into_iter().map(|(run, event)| (runs.wall(run, event.at), event)).collect();
        let started = events.iter().find(|(_, event)| event.kind == EventKind::Started);
        let start = started.map_or(course.made.stamp.wall, |(at, _)| *at);
        let point = |point: PathPoint| TimelinePoint {
            seconds: seconds(start, runs.wall(point.run, point.exposed)),
            setting: point.setting,
            frame: point.frame,
            asked: point.asked,
            measured: point.measured,
            optimal: point.optimal,
        };
        let comments = reader.comments(session).await?;
        let comments = comments.into_iter().map(|(run, comment)| TimelineComment {
            at: comment.stamp.wall,
            seconds: seconds(start, runs.wall(run, comment.stamp.at)),
            setting: comment.segment.map(|segment| course.setting(segment)),
            frame: comment.frame,
            said: comment.said,
        });
        Ok(Timeline {
            settings: spans(&course, &events, start),
            points: reader.focal_path(session, points).await?.into_iter().map(point).collect(),
            comments: comments.collect(),
        })
    }
}

fn spans(course: &Course, events: &[(Timestamp, Event)], start: Timestamp) -> Vec<SettingSpan> {
    let mut spans: Vec<SettingSpan> = Vec::new();
    for (at, event) in events {
        let at = seconds(start, *at);
        match event.kind {
            EventKind::SegmentStarted { segment } => {
                spans.push(SettingSpan { setting: course.setting(segment), from: at, to: None });
            }
            EventKind::SegmentFinished { .. } | EventKind::Aborted { .. } => {
                if let Some(open) = spans.last_mut().filter(|span| span.to.is_none()) {
                    open.to = Some(at);
                }
            }
            _ => {}
        }
    }
    spans
}

fn seconds(from: Timestamp, to: Timestamp) -> f64 {
    to.duration_since(from).as_secs_f64()
}

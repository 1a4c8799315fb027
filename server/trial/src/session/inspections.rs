//! When each setting of a session was inspected, from the session's events.

use std::time::Duration;

use crate::event::EventKind;
use parfocal_base::ids::SegmentId;

/// The inspection of a setting. `T` is what the caller knows of an event, such as its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inspection<T> {
    /// The setting's segment.
    pub segment: SegmentId,
    /// The event with which it began.
    pub began: T,
    /// The event with which it ended: its own end, or the end of the session before that.
    pub ended: Option<T>,
    /// Time inspected, without pauses; `None` unless it was inspected to the end.
    pub inspected: Option<Duration>,
}

impl<T: Copy> Inspection<T> {
    /// The event with which it was inspected to the end; `None` if it was not.
    pub fn finished(&self) -> Option<T> {
        self.ended.filter(|_| self.inspected.is_some())
    }
}

/// The inspections of a session in the order in which they began, from its events in order.
pub fn inspections<'e, T: Copy>(events: impl IntoIterator<Item = (T, &'e EventKind)>) -> Vec<Inspection<T>> {
    let mut inspections: Vec<Inspection<T>> = Vec::new();
    for (event, kind) in events {
        let open = inspections.last_mut().filter(|last| last.ended.is_none());
        match kind {
            EventKind::SegmentStarted { segment } => {
                inspections.push(Inspection { segment: *segment, began: event, ended: None, inspected: None });
            }
            EventKind::SegmentFinished { inspected_ms, .. } => {
                if let Some(open) = open {
                    open.ended = Some(event);
                    open.inspected = Some(Duration::from_millis(*inspected_ms));
                }
            }
            EventKind::Aborted { .. } => {
                if let Some(open) = open {
                    open.ended = Some(event);
                }
            }
            _ => {}
        }
    }
    inspections
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(number: u8) -> SegmentId {
        format!("00000000-0000-4000-8000-0000000000{number:02}").parse().unwrap()
    }

    #[test]
    fn an_inspection_ends_with_its_setting_or_with_the_session() {
        let events = [
            EventKind::Started,
            EventKind::SegmentStarted { segment: segment(1) },
            EventKind::SegmentFinished { segment: segment(1), inspected_ms: 2500 },
            EventKind::QuestionsFinished { segment: Some(segment(1)) },
            EventKind::SegmentStarted { segment: segment(2) },
            EventKind::Aborted { reason: "smoke".to_owned(), inspected_ms: 0 },
        ];
        let found = inspections((0..).zip(&events));

        let inspected = Some(Duration::from_millis(2500));
        let first = Inspection { segment: segment(1), began: 1, ended: Some(2), inspected };
        let second = Inspection { segment: segment(2), began: 4, ended: Some(5), inspected: None };
        assert_eq!(found, [first, second]);
        assert_eq!((first.finished(), second.finished()), (Some(2), None));
    }
}

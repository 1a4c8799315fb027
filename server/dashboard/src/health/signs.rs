//! The signs from which the server's health is judged, and the problems that they show.

use std::time::Duration;

use super::{Code, Condition, Problem};
use crate::doctor::LEAST_ROOM;

/// A control loop that has published nothing for this long has stalled: it publishes five times a second, even
/// without a camera.
const STALLED: Duration = Duration::from_secs(5);

/// A write that takes this long is reported as a problem.
const SLOW: Duration = Duration::from_secs(10);
/// A write that takes this long is taken to be stuck. Even an erasure, which rewrites the whole file, takes less.
const STUCK: Duration = Duration::from_mins(5);

/// Writes that have failed for this long, the last time within [`RECENT`], are not a passing problem.
const UNWRITABLE: Duration = Duration::from_mins(1);
const RECENT: Duration = Duration::from_secs(30);

/// The disk's last answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DiskSign {
    /// The disk was not asked yet.
    #[default]
    NotAsked,
    /// Free space in bytes.
    Free(u64),
    /// The disk does not answer, or reports an error.
    Silent,
}

impl DiskSign {
    const fn has_less_than(self, bytes: u64) -> bool {
        matches!(self, Self::Free(free) if free < bytes)
    }
}

/// What the parts of the server report about themselves.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools, reason = "signs that are independent of each other")]
pub struct Signs {
    /// Whether the camera delivers frames.
    pub camera_works: bool,
    /// Whether the lens takes commands.
    pub lens_works: bool,
    /// Whether the lens works, but not properly.
    pub lens_warns: bool,
    /// Time since the control loop last published its status; none once it has ended.
    pub loop_spoke_ago: Option<Duration>,
    /// How long a write to the database has been under way; none if there is none.
    pub write_under_way_for: Option<Duration>,
    /// How long writes have been failing; none unless the last one failed.
    pub writes_failing_for: Option<Duration>,
    /// Time since a write last failed; none if no write ever did.
    pub write_failed_ago: Option<Duration>,
    /// Whether the event that stopped a session is not recorded yet.
    pub events_unrecorded: bool,
    /// Whether telemetry was lost recently.
    pub telemetry_lost: bool,
    /// Last answer of the data folder's disk.
    pub disk: DiskSign,
}

impl Signs {
    /// What is wrong, the worst first.
    pub fn problems(&self) -> Vec<Problem> {
        let stalled = self.loop_spoke_ago.is_none_or(|ago| ago >= STALLED);
        let unwritable = self.is_unwritable();
        let slow = self.write_under_way_for.is_some_and(|under_way| under_way >= SLOW);
        let troubled = !unwritable && (slow || self.writes_failing_for.is_some());

        let found = [
            (stalled, Code::LoopStalled),
            (unwritable, Code::DatabaseUnwritable),
            (troubled, Code::DatabaseTroubled),
            (self.events_unrecorded, Code::EventsUnrecorded),
            (self.telemetry_lost, Code::TelemetryLost),
            (self.disk == DiskSign::Silent, Code::DiskSilent),
            (self.disk.has_less_than(LEAST_ROOM), Code::DiskNearlyFull),
            // A stalled loop knows nothing about its devices.
            (!stalled && !self.camera_works, Code::CameraSilent),
            (!stalled && !self.lens_works, Code::LensGone),
            (!stalled && self.lens_works && self.lens_warns, Code::LensWarns),
        ];
        found.into_iter().filter(|(wrong, _)| *wrong).map(|(_, code)| code.into()).collect()
    }

    fn is_unwritable(&self) -> bool {
        let stuck = self.write_under_way_for.is_some_and(|under_way| under_way >= STUCK);
        let failing = self.writes_failing_for.is_some_and(|failing| failing >= UNWRITABLE);
        // If nothing has been written since, because there was nothing to record, it may work again.
        let tried = self.write_failed_ago.is_some_and(|ago| ago <= RECENT);
        stuck || (failing && tried)
    }
}

/// The condition of a server with these `problems`: that of the worst.
pub(super) fn condition(problems: &[Problem]) -> Condition {
    problems.iter().map(|problem| problem.condition).max().unwrap_or(Condition::Ok)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn well() -> Signs {
        Signs {
            camera_works: true,
            lens_works: true,
            lens_warns: false,
            loop_spoke_ago: Some(Duration::from_millis(200)),
            write_under_way_for: None,
            writes_failing_for: None,
            write_failed_ago: None,
            events_unrecorded: false,
            telemetry_lost: false,
            disk: DiskSign::Free(LEAST_ROOM),
        }
    }

    fn told(signs: &Signs) -> (Condition, Vec<Code>) {
        let problems = signs.problems();
        (condition(&problems), problems.iter().map(|problem| problem.code).collect())
    }

    #[test]
    fn a_server_without_a_problem_is_ok() {
        assert_eq!(told(&well()), (Condition::Ok, vec![]));
        assert_eq!(told(&Signs { disk: DiskSign::NotAsked, ..well() }), (Condition::Ok, vec![]));
    }

    #[test]
    fn a_problem_that_a_restart_does_not_fix_is_not_a_failure() {
        let degraded = [
            (Signs { camera_works: false, ..well() }, Code::CameraSilent),
            (Signs { lens_works: false, ..well() }, Code::LensGone),
            (Signs { lens_warns: true, ..well() }, Code::LensWarns),
            (Signs { disk: DiskSign::Free(LEAST_ROOM - 1), ..well() }, Code::DiskNearlyFull),
            (Signs { disk: DiskSign::Silent, ..well() }, Code::DiskSilent),
            (Signs { events_unrecorded: true, ..well() }, Code::EventsUnrecorded),
            (Signs { telemetry_lost: true, ..well() }, Code::TelemetryLost),
        ];
        for (signs, code) in degraded {
            assert_eq!(told(&signs), (Condition::Degraded, vec![code]));
        }
    }

    #[test]
    fn a_loop_that_says_nothing_has_stalled() {
        let silent = |ago| Signs { loop_spoke_ago: ago, camera_works: false, ..well() };
        assert_eq!(told(&silent(Some(STALLED))), (Condition::Failing, vec![Code::LoopStalled]));
        assert_eq!(told(&silent(None)), (Condition::Failing, vec![Code::LoopStalled]));
        assert_eq!(told(&silent(Some(Duration::from_secs(4)))).0, Condition::Degraded);
    }

    #[test]
    fn a_database_fails_once_it_has_refused_for_a_minute_or_a_write_hangs() {
        let failing = |since, ago| {
            let seconds = |seconds| Some(Duration::from_secs(seconds));
            told(&Signs { writes_failing_for: seconds(since), write_failed_ago: seconds(ago), ..well() })
        };
        assert_eq!(failing(59, 1), (Condition::Degraded, vec![Code::DatabaseTroubled]));
        assert_eq!(failing(60, 1), (Condition::Failing, vec![Code::DatabaseUnwritable]));
        assert_eq!(failing(600, 300), (Condition::Degraded, vec![Code::DatabaseTroubled]), "nothing was tried since");

        let under_way = |seconds| told(&Signs { write_under_way_for: Some(Duration::from_secs(seconds)), ..well() });
        assert_eq!(under_way(9), (Condition::Ok, vec![]));
        assert_eq!(under_way(10), (Condition::Degraded, vec![Code::DatabaseTroubled]));
        assert_eq!(under_way(300), (Condition::Failing, vec![Code::DatabaseUnwritable]));
    }

    #[test]
    fn the_worst_comes_first() {
        let signs = Signs { lens_works: false, loop_spoke_ago: None, telemetry_lost: true, ..well() };
        assert_eq!(told(&signs), (Condition::Failing, vec![Code::LoopStalled, Code::TelemetryLost]));
    }
}

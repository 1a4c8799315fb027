//! How the lens was driven in one setting, in a few figures. They are added up row by row, because a study has millions
//! of rows.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use parfocal_base::IN_FOCUS;
use parfocal_base::ids::SessionId;

/// A change of focal power up to this size does not count, as in evaluations.
const LEAST_MOVE: f64 = 1e-9;

/// A time between frames that is longer than this is a gap, in nanoseconds.
const GAP_NS: i64 = 1_000_000_000;

/// How the lens was driven in a setting. Frames at which the loop held the lens on request, for a pause or for a failed
/// device are left out. Frames that were held because of the policy are counted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LensMotion {
    /// Setting, from 1.
    pub setting: usize,
    /// Number of frames.
    pub frames: u64,
    /// Time between the frames, in seconds. Gaps of more than a second are left out, because nothing was driven there.
    pub seconds: f64,
    /// Distance that the commanded focal power travelled, up and down added.
    pub travel: f64,
    /// Changes of direction of the commanded focal power.
    pub turns: u64,
    /// Number of frames whose optimum is known from a simulation.
    pub known: u64,
    /// Sum over the `known` frames of the distance between the focal power at exposure and the optimum.
    pub error: f64,
    /// How many of the `known` frames were in focus: nearer to the optimum than [`IN_FOCUS`].
    pub in_focus: u64,
}

/// A row of telemetry: run, end of the exposure in nanoseconds, focal power commanded, focal power at exposure,
/// optimum, and whether the loop was held on request, for a pause or for a failed device.
pub type Row = (i64, i64, f64, Option<f64>, Option<f64>, bool);

/// Figures of sessions, each with the number of the last row of telemetry that they come from.
pub type KnownMotions = Arc<Mutex<BTreeMap<SessionId, (i64, Vec<LensMotion>)>>>;

/// A setting's figures so far.
#[derive(Default)]
pub struct RunningFigures {
    pub motion: LensMotion,
    /// Run, end of the exposure and focal power of the frame before; `None` if the loop was held then.
    before: Option<(i64, i64, f64)>,
    /// The latest change of focal power.
    moved: f64,
}

impl RunningFigures {
    pub fn take(&mut self, &(run, exposed_ns, asked, measured, optimal, held): &Row) {
        if held {
            self.before = None;
            return;
        }

        self.motion.frames += 1;
        if let (Some(measured), Some(optimal)) = (measured, optimal) {
            let error = (measured - optimal).abs();
            self.motion.known += 1;
            self.motion.error += error;
            self.motion.in_focus += u64::from(error < IN_FOCUS);
        }

        if let Some((_, exposed_before, asked_before)) = self.before.filter(|before| before.0 == run) {
            let passed = exposed_ns - exposed_before;
            if passed <= GAP_NS {
                self.motion.seconds += passed as f64 * 1e-9;
            }
            self.take_move(asked - asked_before);
        }
        self.before = Some((run, exposed_ns, asked));
    }

    fn take_move(&mut self, change: f64) {
        if change.abs() <= LEAST_MOVE {
            return;
        }
        self.motion.travel += change.abs();
        self.motion.turns += u64::from(change * self.moved < 0.0);
        self.moved = change;
    }
}

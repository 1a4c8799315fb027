//! One step of the loop: frame -> patch -> policy -> lens command. Knows no thread but the
//! policy's.

use std::sync::Arc;
use std::time::Duration;

use super::advice::Advice;
use super::attribution::Attribution;
use super::eye::Eye;
use super::pilot::{HoldReason, Pilot};
use super::runner::guarded;
use super::{Command, ControlledFrame, Drive, Hold, StepRecord};
use crate::autofocus::{Observation, PolicyName, Registry};
use crate::camera::Frame;
use crate::clock::Clock;
use crate::ids::SegmentId;
use crate::imaging::{ContentArea, PatchArea};
use crate::lens::{FocalPower, Lens, LensDynamics, LensError, LensHealth};

/// The loop's state between two frames. Driven by the loop's thread, or directly by a simulation
/// faster than time.
pub struct Stepper {
    clock: Arc<dyn Clock>,
    lens: Box<dyn Lens>,
    eye: Eye,
    pilot: Pilot,
    attribution: Attribution,
    drive: Drive,
    /// Whether a frame was exposed with the lens where the policy is to begin. Until then the
    /// policy is not asked.
    placed: bool,
    segment: Option<SegmentId>,
    content_area: Option<ContentArea>,
    /// The last command that the lens took.
    asked: FocalPower,
    /// The next command for the lens: differs from `asked` only while it does not listen.
    wanted: FocalPower,
    /// Why the lens did not take the last command, if it did not.
    lens_fault: Option<HoldReason>,
    /// Why the last step followed no policy, if it was to hold.
    step_hold: Option<HoldReason>,
}

impl Stepper {
    /// A loop that holds `lens` where it is until told otherwise, and waits for a policy at most
    /// `patience` a frame.
    #[must_use]
    pub fn new(lens: Box<dyn Lens>, eye: Eye, registry: Registry, clock: Arc<dyn Clock>, patience: Duration) -> Self {
        let start = lens.measured().unwrap_or(FocalPower::MIDDLE);
        Self {
            attribution: Attribution::new(lens.dynamics(), start),
            pilot: Pilot::new(registry, clock.clone(), patience),
            clock,
            lens,
            eye,
            drive: Drive::Manual(start),
            placed: false,
            segment: None,
            content_area: None,
            asked: start,
            wanted: start,
            lens_fault: None,
            step_hold: None,
        }
    }

    /// The same with a lens that was measured to move like this.
    #[must_use]
    pub fn moving(mut self, dynamics: LensDynamics) -> Self {
        self.attribution = Attribution::new(dynamics, self.asked);
        self
    }

    /// Obeys. Drive and segment change together, between two frames.
    pub fn obey(&mut self, command: Command) {
        match command {
            Command::ContentArea(area) => self.content_area = area,
            Command::Drive { drive, segment } => {
                self.segment = segment;
                self.change_driver(drive);
                self.tell_lens();
            }
        }
    }

    fn change_driver(&mut self, drive: Drive) {
        self.wanted = match &drive {
            Drive::Manual(power) => *power,
            Drive::Hold { at } => at.unwrap_or(self.asked),
            Drive::Policy { start, .. } => start.unwrap_or(self.asked),
        };
        let policy = match &drive {
            Drive::Policy { name, .. } => Some(name.clone()),
            Drive::Manual(_) | Drive::Hold { .. } => None,
        };

        self.step_hold = None;
        self.placed = false;
        self.drive = drive;
        self.pilot.engage(policy);
    }

    /// Takes one step on `frame`.
    ///
    /// # Errors
    /// When the picture holds no patch; the step is then not taken.
    pub fn step(&mut self, frame: Frame) -> Result<ControlledFrame, HoldReason> {
        // A lens that is away may be anywhere.
        let measured = self.lens.measured().map(|_| self.attribution.focal_power(frame.middle()));
        let patch = self.eye.find(&frame.image, self.content_area.as_ref())?;

        let asks = self.asks_policy(&frame);
        let policy = self.pilot.policy().filter(|_| asks == Ok(true)).cloned();
        let outcome = match asks {
            Ok(true) => self.ask(&frame, patch).map(Some),
            Ok(false) => Ok(None),
            Err(reason) => Err(reason),
        };
        let advice = self.act(outcome);

        let record = StepRecord {
            frame: frame.number,
            exposed_at: frame.exposed_at,
            segment: self.segment,
            policy,
            asked: self.asked,
            measured,
            metric: advice.as_ref().and_then(|advice| advice.metric),
            policy_micros: advice.as_ref().map_or(0, |advice| micros(advice.took)),
            latency_micros: micros(self.clock.now().since(frame.exposed_at)),
            held: self.hold_reason().map(|reason| reason.hold),
            optimal: frame.truth.map(|truth| truth.optimal),
        };

        let belief = advice.and_then(|advice| advice.belief);
        Ok(ControlledFrame { frame, patch, content_area: self.content_area, record, belief })
    }

    /// Between frames that do not come: keeps telling the lens, so that a hand on the slider works
    /// without a camera and a lens that comes back is noticed.
    pub fn idle(&mut self) {
        self.tell_lens();
    }

    /// Whether the policy is asked about `frame`.
    ///
    /// # Errors
    /// When the lens is to be held instead.
    fn asks_policy(&mut self, frame: &Frame) -> Result<bool, HoldReason> {
        match &self.drive {
            Drive::Manual(_) => return Ok(false),
            Drive::Hold { .. } => return Err(HoldReason::new(Hold::Paused, "paused on request")),
            Drive::Policy { .. } => {}
        }

        if let Some(fault) = &self.lens_fault {
            // Frames from a lens that does not move would mislead the policy.
            return Err(fault.clone());
        }

        self.placed = self.placed || self.attribution.settled(frame.middle());
        Ok(self.placed)
    }

    /// Asks the policy about `frame`, whose patch is at `patch`. Only now is a view made, and no wider
    /// than the policy needs.
    fn ask(&mut self, frame: &Frame, patch: PatchArea) -> Result<Advice, HoldReason> {
        let view = self.eye.look(&frame.image, patch, self.pilot.field_of_view());
        let focal_power = self.attribution.focal_power(frame.middle());
        self.pilot.ask(&Observation { view: &view, focal_power })
    }

    /// Tells the lens what was decided, and remembers the reason if it is to be held instead.
    fn act(&mut self, outcome: Result<Option<Advice>, HoldReason>) -> Option<Advice> {
        let (advice, hold) = match outcome {
            Ok(advice) => (advice, None),
            Err(reason) => (None, Some(reason)),
        };

        self.step_hold = hold;
        if let Some(advice) = &advice {
            self.wanted = advice.target;
        }

        self.tell_lens();
        if advice.is_some() {
            // Advice that the lens did not take is not followed later, when its frame is long past.
            self.wanted = self.asked;
        }
        advice
    }

    fn tell_lens(&mut self) {
        let failure = match guarded(|| self.lens.set(self.wanted)) {
            Ok(Ok(())) => {
                self.asked = self.wanted;
                self.attribution.commanded(self.clock.now(), self.wanted);
                None
            }
            Ok(Err(error)) => Some(error),
            Err(panic) => Some(LensError::Gone(format!("its driver failed: {panic}"))),
        };

        match (&failure, &self.lens_fault) {
            (Some(error), None) => tracing::warn!(%error, "the lens does not take commands"),
            (None, Some(_)) => tracing::info!("the lens takes commands again"),
            _ => (),
        }

        self.lens_fault = failure.map(|error| HoldReason::new(Hold::LensFailed, &format!("{error}; trying again")));
    }

    /// The lens's health, in words.
    #[must_use]
    pub fn lens_health(&self) -> LensHealth {
        self.lens.health()
    }

    /// Last focal power that the lens took.
    #[must_use]
    pub const fn focal_power(&self) -> FocalPower {
        self.asked
    }

    /// Policy in charge, if one is.
    #[must_use]
    pub const fn policy(&self) -> Option<&PolicyName> {
        self.pilot.policy()
    }

    /// Why the lens is being held, if it is.
    #[must_use]
    pub fn hold_reason(&self) -> Option<&HoldReason> {
        self.lens_fault.as_ref().or(self.step_hold.as_ref())
    }
}

fn micros(duration: Duration) -> u32 {
    u32::try_from(duration.as_micros()).unwrap_or(u32::MAX)
}

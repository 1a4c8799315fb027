//! One step of the loop: frame -> patch -> policy -> lens command. Knows no thread but the policy's.

use std::sync::Arc;
use std::time::Duration;

use super::attribution::Attribution;
use super::eye::Eye;
use super::pilot::{Advice, HoldReason, Pilot};
use super::runner::guarded;
use super::{Command, ControlledFrame, Drive, Hold, StepRecord};
use crate::autofocus::{Observation, PolicyName, Registry};
use crate::camera::Frame;
use crate::clock::Clock;
use crate::ids::SegmentId;
use crate::imaging::{ContentArea, View};
use crate::lens::{FocalPower, Lens, LensDynamics, LensError, LensHealth};

/// The loop's state between two frames. Driven by the loop's thread, or directly by a simulation faster than time.
pub struct Stepper {
    clock: Arc<dyn Clock>,
    lens: Box<dyn Lens>,
    eye: Eye,
    pilot: Pilot,
    attribution: Attribution,
    drive: Driver,
    segment: Option<SegmentId>,
    content_area: Option<ContentArea>,
    /// What the lens took last.
    asked: FocalPower,
    /// What the lens is to be told next: differs from `asked` only while it does not listen.
    wanted: FocalPower,
    /// Why the lens did not take the last command, if it did not.
    lens_fault: Option<HoldReason>,
    /// Why the last step followed no policy, if it was to hold.
    step_hold: Option<HoldReason>,
}

/// Who drives, without the names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Driver {
    Hand,
    Nobody,
    /// `placed` once a frame was exposed with the lens where the policy is to begin.
    Policy {
        placed: bool,
    },
}

/// What a frame led to, before the lens was told.
struct Choice {
    policy: Option<PolicyName>,
    outcome: Result<Option<Advice>, HoldReason>,
}

impl Stepper {
    /// A loop that holds `lens` where it is until told otherwise, and waits for a policy at most `patience` a frame.
    #[must_use]
    pub fn new(lens: Box<dyn Lens>, eye: Eye, registry: Registry, clock: Arc<dyn Clock>, patience: Duration) -> Self {
        let start = lens.measured().unwrap_or(FocalPower::MIDDLE);
        Self {
            attribution: Attribution::new(lens.dynamics(), start),
            pilot: Pilot::new(registry, clock.clone(), patience),
            clock,
            lens,
            eye,
            drive: Driver::Hand,
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
        self.step_hold = None;
        self.wanted = self.asked;
        let (driver, policy) = match drive {
            Drive::Manual(power) => {
                self.wanted = power;
                (Driver::Hand, None)
            }
            Drive::Hold { at } => {
                self.wanted = at.unwrap_or(self.asked);
                (Driver::Nobody, None)
            }
            Drive::Policy { name, start } => {
                self.wanted = start.unwrap_or(self.asked);
                (Driver::Policy { placed: false }, Some(name))
            }
        };
        self.drive = driver;
        self.pilot.engage(policy);
    }

    /// Takes one step on `frame`.
    ///
    /// # Errors
    /// When the picture holds no patch; the step is then not taken.
    pub fn step(&mut self, frame: Frame) -> Result<ControlledFrame, HoldReason> {
        // A lens that is away may be anywhere.
        let measured = self.lens.measured().map(|_| self.attribution.focal_power(frame.middle()));
        let (area, view) = self.eye.look(&frame.image, self.content_area.as_ref())?;
        let Choice { policy, outcome } = self.choose(&frame, &view);
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
        Ok(ControlledFrame { frame, patch: area, content_area: self.content_area, record, belief })
    }

    /// Between frames that do not come: keeps telling the lens, so that a hand on the slider works without a camera and
    /// a lens that comes back is noticed.
    pub fn idle(&mut self) {
        self.tell_lens();
    }

    fn choose(&mut self, frame: &Frame, view: &View) -> Choice {
        let unasked = |outcome| Choice { policy: None, outcome };
        match self.drive {
            Driver::Hand => unasked(Ok(None)),
            Driver::Nobody => unasked(Err(HoldReason::new(Hold::Paused, "paused on request"))),
            Driver::Policy { placed } => {
                if let Some(fault) = &self.lens_fault {
                    // Frames from a lens that does not move would teach the policy wrong.
                    return unasked(Err(fault.clone()));
                }
                if !placed && !self.attribution.settled(frame.middle()) {
                    return unasked(Ok(None));
                }
                self.drive = Driver::Policy { placed: true };
                let focal_power = self.attribution.focal_power(frame.middle());
                let outcome = self.pilot.ask(&Observation { view, focal_power }).map(Some);
                Choice { policy: self.pilot.policy().cloned(), outcome }
            }
        }
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

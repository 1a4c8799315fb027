//! One step of the loop: frame -> patch -> policy -> lens command. Has no thread except the policy's.

use std::sync::Arc;
use std::time::Duration;

use super::advice::Advice;
use super::attribution::Attribution;
use super::eye::{Eye, cells};
use super::pilot::{HoldReason, Pilot};
use super::{Aim, Command, ControlledFrame, Drive, Following, GAP, PictureGeometry};
use parfocal_autofocus::tracking::{Tracked, Tracker};
use parfocal_autofocus::{FieldOfView, Observation, Registry};
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::guarded;
use parfocal_base::ids::SegmentId;
use parfocal_base::step::Hold;
use parfocal_base::step::StepRecord;
use parfocal_base::{FocalPower, PatchPlace};
use parfocal_devices::camera::{Frame, FrameImage};
use parfocal_devices::lens::{Lens, LensDynamics, LensError, LensHealth, MeasuredDynamics};
use parfocal_imaging::{PatchArea, place_of};

/// The loop's state between two frames. Driven by the loop's thread, or directly by a simulation that runs faster than
/// real time.
pub struct Stepper {
    clock: Arc<dyn Clock>,
    lens: Box<dyn Lens>,
    eye: Eye,
    pilot: Pilot,
    /// The dynamics that were measured, for the lens of that serial number alone.
    measured: Option<MeasuredDynamics>,
    attribution: Attribution,
    drive: Drive,
    /// Whether a frame was exposed after the lens had reached the policy's start. Until then the policy is not asked.
    placed: bool,
    segment: Option<SegmentId>,
    /// Whether the lens stands where a session's policy has left it. That tells the policy, and an aborted session and
    /// the one that takes its place have the same order.
    left_by_session: bool,
    /// Where people have chosen to look.
    aim: Aim,
    /// Carries the patch along with the tissue, while it does.
    tracker: Option<Tracker>,
    following: Following,
    /// How often the policy has been made to forget what it saw.
    jumps: u64,
    /// Where the patch was in the latest frame since then.
    latest_patch: Option<PatchArea>,
    /// When the latest frame was exposed.
    latest_frame: Option<Moment>,
    /// What people can point at.
    geometry: PictureGeometry,
    /// The last focal power that the lens accepted.
    asked: FocalPower,
    /// The focal power to command next. Differs from `asked` only while the lens does not accept commands.
    wanted: FocalPower,
    /// Why the lens did not accept the last command; `None` if it did.
    lens_fault: Option<HoldReason>,
    /// Why the last step held the lens instead of following a policy; `None` if it did not.
    step_hold: Option<HoldReason>,
}

impl Stepper {
    /// A loop that holds `lens` where it is until a command comes. Waits for a policy at most `patience` per frame.
    pub fn new(lens: Box<dyn Lens>, eye: Eye, registry: Registry, clock: Arc<dyn Clock>, patience: Duration) -> Self {
        let start = lens.measured().unwrap_or(FocalPower::MIDDLE);
        Self {
            measured: None,
            attribution: Attribution::new(lens.dynamics(), start),
            pilot: Pilot::new(registry, clock.clone(), patience),
            clock,
            lens,
            eye,
            drive: Drive::Manual(start),
            placed: false,
            segment: None,
            left_by_session: false,
            aim: Aim::default(),
            tracker: None,
            following: Following::Screen,
            jumps: 0,
            latest_patch: None,
            latest_frame: None,
            geometry: PictureGeometry::default(),
            asked: start,
            wanted: start,
            lens_fault: None,
            step_hold: None,
        }
    }

    /// Uses the dynamics that were `measured` instead of those that the driver assumes, unless another lens than the
    /// measured one is there.
    #[must_use]
    pub fn moving(mut self, measured: MeasuredDynamics) -> Self {
        self.measured = Some(measured);
        self.attribution = Attribution::new(self.dynamics(), self.asked);
        self
    }

    /// How the lens that is there moves. One that is away may be the measured one.
    fn dynamics(&self) -> LensDynamics {
        let serial = self.lens.health().info.map(|info| info.serial);
        let is_measured =
            |measured: &&MeasuredDynamics| serial.as_ref().is_none_or(|serial| *serial == measured.serial);
        let measured = self.measured.as_ref().filter(is_measured);
        measured.map_or_else(|| self.lens.dynamics(), MeasuredDynamics::dynamics)
    }

    /// Waits for a policy at most `patience` per frame from now on.
    pub const fn wait_at_most(&mut self, patience: Duration) {
        self.pilot.wait_at_most(patience);
    }

    /// Carries out `command`. Drive and segment change together, between two frames.
    pub fn obey(&mut self, command: Command) {
        match command {
            Command::ContentArea(area) => self.geometry.content_area = area,
            Command::Aim(aim) => self.take_aim(aim),
            Command::Drive { drive, segment } => {
                self.segment = segment;
                self.change_driver(drive);
                self.tell_lens();
            }
        }
    }

    /// Looks where people have chosen. What the policy saw at another place, or before the focus was held, is not
    /// compared with what it sees from now on.
    fn take_aim(&mut self, aim: Aim) {
        if aim.place != self.aim.place || (self.aim.held && !aim.held) {
            self.forget();
        }

        let follows = aim.follows && aim.place != PatchPlace::CENTRE;
        self.tracker = follows.then(Tracker::default);
        self.following = if aim.follows { Following::Tissue } else { Following::Screen };
        self.aim = aim;
    }

    fn forget(&mut self) {
        self.pilot.forget();
        self.jumps += 1;
        self.latest_patch = None;
    }

    /// What the policy saw before the camera was away is not compared with what it sees now.
    fn notice_gap(&mut self, exposed_at: Moment) {
        let latest = self.latest_frame.replace(exposed_at);
        if latest.is_some_and(|latest| exposed_at.since(latest) > GAP) {
            self.forget();
        }
    }

    /// A chosen place is relative to the content area. Where that was found anew far from where it was, the patch shows
    /// another place.
    fn notice_jump(&mut self, patch: PatchArea) {
        if self.tracker.is_none() && self.latest_patch.is_some_and(|latest| !latest.is_near(patch)) {
            self.forget();
        }
        self.latest_patch = Some(patch);
    }

    /// Where the patch is that was at `patch` in the frame before, if it follows the tissue. It is the same tissue, so
    /// the policy forgets nothing. Where the tissue is lost, the patch goes back to the centre.
    fn follow(&mut self, image: &FrameImage, patch: PatchArea) -> Result<PatchArea, HoldReason> {
        let Some(tracker) = &mut self.tracker else { return Ok(patch) };
        let around = self.eye.look(image, patch, FieldOfView::Surroundings).surroundings;
        let found = around.map_or(Tracked::Lost, |around| tracker.see(&around, (patch.x, patch.y)));

        let content = self.geometry.content_area;
        let why = match found {
            Tracked::Unsure => return Ok(patch),
            Tracked::Lost => Following::Lost,
            Tracked::At((x, y)) => {
                let middle = (x as f64 + patch.width as f64 / 2.0, y as f64 + patch.height as f64 / 2.0);
                if let Some(place) = place_of(middle, self.geometry.cells, content.as_ref()) {
                    let moved = self.eye.find(image, place, content.as_ref())?;
                    // Outside the circle or at the picture's edge the patch would be moved.
                    if (moved.x.cast_signed(), moved.y.cast_signed()) == (x, y) {
                        self.aim.place = place;
                        return Ok(moved);
                    }
                }
                Following::Left
            }
        };

        tracing::info!(?why, "the patch does not follow the tissue any more; it is back at the centre");
        self.tracker = None;
        self.following = why;
        self.aim.place = PatchPlace::CENTRE;
        self.forget();
        self.eye.find(image, PatchPlace::CENTRE, content.as_ref())
    }

    fn change_driver(&mut self, drive: Drive) {
        self.wanted = match &drive {
            Drive::Manual(power) => *power,
            Drive::Hold { at } => at.unwrap_or(self.asked),
            Drive::Policy { start: Some(start), .. } => *start,
            // Its path would begin at the place that nobody may see.
            Drive::Policy { .. } if self.left_by_session && self.segment.is_none() => FocalPower::MIDDLE,
            Drive::Policy { .. } => self.asked,
        };
        let policy = match &drive {
            Drive::Policy { name, .. } => Some(name.clone()),
            Drive::Manual(_) | Drive::Hold { .. } => None,
        };

        self.left_by_session |= match &drive {
            Drive::Policy { .. } => self.segment.is_some(),
            // After a restart, a session sends the lens back to where its policy had it.
            Drive::Hold { at } => at.is_some(),
            Drive::Manual(_) => false,
        };
        self.step_hold = None;
        self.placed = false;
        self.drive = drive;
        self.pilot.engage(policy);
    }

    /// Notes whether the lens has left the place where a session's policy left it, when `frame` was exposed.
    fn notice_departure(&mut self, frame: &Frame) {
        let moved_by_others = match self.drive {
            Drive::Manual(_) => true,
            Drive::Policy { .. } => self.segment.is_none(),
            Drive::Hold { .. } => false,
        };
        if moved_by_others && self.asked == self.wanted && self.attribution.settled(frame.middle()) {
            self.left_by_session = false;
        }
    }

    /// Takes one step on `frame`.
    ///
    /// # Errors
    /// If the picture is too small for a patch. Nothing is commanded then.
    pub fn step(&mut self, frame: Frame) -> Result<ControlledFrame, HoldReason> {
        // While the lens is disconnected, its focal power is unknown.
        let measured = self.lens.measured().map(|_| self.attribution.focal_power(frame.middle()));
        self.notice_gap(frame.exposed_at);
        self.geometry.cells = cells(&frame.image);
        let content_area = self.geometry.content_area;
        let patch = self.eye.find(&frame.image, self.aim.place, content_area.as_ref())?;
        let patch = self.follow(&frame.image, patch)?;
        self.notice_jump(patch);
        self.notice_departure(&frame);

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
            patch: (column(patch.x), column(patch.y)),
        };

        Ok(ControlledFrame {
            frame,
            patch,
            content_area,
            aim: self.aim,
            jumps: self.jumps,
            record,
            belief: advice.and_then(|advice| advice.belief),
            left_by_session: self.left_by_session,
        })
    }

    /// Called while no frames come. Repeats the command to the lens, so that the slider works without a camera, and a
    /// lens that is back is noticed.
    pub fn idle(&mut self) {
        self.tell_lens();
    }

    /// Whether to ask the policy about `frame`.
    ///
    /// # Errors
    /// If the lens must be held instead.
    fn asks_policy(&mut self, frame: &Frame) -> Result<bool, HoldReason> {
        match &self.drive {
            Drive::Manual(_) => return Ok(false),
            Drive::Hold { .. } => return Err(HoldReason::new(Hold::Paused, "paused on request")),
            Drive::Policy { .. } if self.aim.held => {
                return Err(HoldReason::new(Hold::FocusHeld, "the focus is held on request"));
            }
            Drive::Policy { .. } => {}
        }

        if let Some(fault) = &self.lens_fault {
            // Frames from a lens that does not move would mislead the policy.
            return Err(fault.clone());
        }

        self.placed = self.placed || self.attribution.settled(frame.middle());
        Ok(self.placed)
    }

    /// Asks the policy about `frame`, whose patch is at `patch`. Makes the view only now, and only as wide as the
    /// policy needs.
    fn ask(&mut self, frame: &Frame, patch: PatchArea) -> Result<Advice, HoldReason> {
        let view = self.eye.look(&frame.image, patch, self.pilot.field_of_view());
        let focal_power = self.attribution.focal_power(frame.middle());
        self.pilot.ask(&Observation { view: &view, focal_power })
    }

    /// Commands the lens according to `outcome`. If the lens must be held, remembers the reason.
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
            // Advice that the lens did not accept is not repeated later, when its frame is long past.
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
            (Some(error), None) => tracing::warn!(%error, "the lens does not accept commands"),
            (None, Some(_)) => {
                tracing::info!("the lens accepts commands again");
                self.regain_lens();
            }
            _ => (),
        }

        self.lens_fault = failure.map(|error| HoldReason::new(Hold::LensFailed, &format!("{error}; trying again")));
    }

    /// The lens may have moved meanwhile, and the tissue has. So the policy is asked only when the lens has arrived,
    /// and compares nothing with what it saw before. It may also be another lens.
    fn regain_lens(&mut self) {
        self.attribution.regained(self.clock.now(), self.dynamics());
        self.placed = false;
        self.forget();
    }

    /// The lens's health. It warns of a lens other than the one that was measured.
    pub fn lens_health(&self) -> LensHealth {
        let mut health = self.lens.health();
        let Some((measured, info)) = self.measured.as_ref().zip(health.info.as_ref()) else { return health };

        if measured.serial != info.serial {
            health.message = Arc::from(format!(
                "{}; this is lens {}, and how it moves was measured on lens {}: typical values are used",
                health.message, info.serial, measured.serial
            ));
            health.caution = true;
        }
        health
    }

    /// The last focal power that the lens accepted.
    pub const fn focal_power(&self) -> FocalPower {
        self.asked
    }

    /// Whether the lens stands where a session's policy has left it.
    pub const fn left_by_session(&self) -> bool {
        self.left_by_session
    }

    /// What people can point at.
    pub const fn geometry(&self) -> PictureGeometry {
        self.geometry
    }

    /// Whether the patch follows the tissue.
    pub const fn following(&self) -> Following {
        self.following
    }

    /// The policy that drives the lens, if any.
    pub const fn policy(&self) -> Option<&PolicyName> {
        self.pilot.policy()
    }

    /// Why the lens is held; `None` if it is not.
    pub fn hold_reason(&self) -> Option<&HoldReason> {
        self.lens_fault.as_ref().or(self.step_hold.as_ref())
    }
}

fn micros(duration: Duration) -> u32 {
    u32::try_from(duration.as_micros()).unwrap_or(u32::MAX)
}

fn column(pixels: usize) -> u32 {
    u32::try_from(pixels).unwrap_or(u32::MAX)
}

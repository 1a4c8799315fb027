//! Single steps of the loop, on a clock that the test advances by 20 ms per frame.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use jiff::Timestamp;
use parfocal_autofocus::{Decision, FieldOfView, Observation, Policy, Registry};
use parfocal_base::clock::{Clock, ManualClock};
use parfocal_base::ids::SegmentId;
use parfocal_base::step::{Hold, StepRecord};
use parfocal_base::{PatchPlace, PolicyName};
use parfocal_devices::lens::{LensError, MeasuredDynamics};
use parfocal_imaging::{ContentArea, Reconstructor};
use parfocal_pipeline::control::{Aim, Command, Drive, Eye, Following, Stepper};
use proptest::prelude::*;
use uuid::Uuid;

use super::fakes::{Deed, FakeLens, Script, drive, frame, power, sized_frame};

const FRAME: Duration = Duration::from_millis(20);
/// Far longer than a sound policy's thread needs to be scheduled on a busy machine.
const PATIENT: Duration = Duration::from_secs(20);
/// Frames in a second, the longest time that a recovery may take.
const SECOND: usize = 50;

struct Fixture {
    clock: Arc<ManualClock>,
    lens: FakeLens,
    script: Script,
    stepper: Stepper,
    number: u64,
}

impl Fixture {
    fn new(patience: Duration) -> Self {
        Self::with_lens(patience, FakeLens::at(power(0.5)))
    }

    fn with_lens(patience: Duration, lens: FakeLens) -> Self {
        let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
        clock.advance(Duration::from_secs(10));
        let script = Script::new(Deed::GoTo(0.6));
        let eye = Eye::new(Reconstructor::default());
        let stepper = Stepper::new(Box::new(lens.clone()), eye, script.registry(), clock.clone(), patience);
        Self { clock, lens, script, stepper, number: 0 }
    }

    /// Takes a step one frame period after the last one.
    fn step(&mut self) -> StepRecord {
        self.step_after(FRAME)
    }

    fn step_after(&mut self, pace: Duration) -> StepRecord {
        self.clock.advance(pace);
        self.number += 1;
        self.stepper.step(frame(self.number, self.clock.now())).unwrap().record
    }

    /// Takes steps until one is not held. Returns their number.
    fn recover(&mut self) -> usize {
        (1..=SECOND).find(|_| self.step().held.is_none()).expect("recovers within a second of the fault's end")
    }

    /// Takes steps, `pace` apart, until one is not held. For hung threads, which return in real time, not in the test's
    /// time.
    fn recover_in_time(&mut self, pace: Duration) {
        while self.step_after(pace).held.is_some() {
            std::thread::yield_now();
        }
    }

    /// Sends the lens to `target`. Returns where it was at 5.47 ms after the command, the middle of an exposure.
    fn way_to(&mut self, target: f64) -> f64 {
        self.stepper.obey(Command::Drive { drive: Drive::Manual(power(target)), segment: None });
        self.clock.advance(Duration::from_micros(15_470));
        self.number += 1;
        let mut late = frame(self.number, self.clock.now());
        late.exposure = FRAME;
        self.stepper.step(late).unwrap().record.measured.unwrap().get()
    }

    fn message(&self) -> &str {
        self.stepper.hold_reason().map_or("", |reason| &reason.message)
    }
}

#[test]
fn a_policy_is_followed() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper.obey(drive("scripted", None));
    let record = fixture.step();
    assert_eq!((record.asked, record.held), (power(0.6), None));
    assert_eq!(record.policy, Some(PolicyName::new("scripted")));
    assert_eq!(record.metric, Some(0.6));
    assert_eq!(fixture.lens.position(), power(0.6));
    fixture.script.set(Deed::GoTo(0.65));
    assert_eq!(fixture.step().asked, power(0.65));
    assert_eq!(fixture.script.seen(), [0.5, 0.6], "each frame is attributed to where the lens was");
}

#[test]
fn where_a_session_has_left_the_lens_is_known_as_its_place_until_something_else_has_moved_it() {
    // A third of the way is left after the next frame, and a hundredth after three.
    let lens = FakeLens::at(power(0.5)).slow(Duration::from_millis(10), Duration::from_millis(30));
    let mut fixture = Fixture::with_lens(PATIENT, lens);
    let hold = Command::Drive { drive: Drive::Hold { at: None }, segment: None };
    let segment = Some(SegmentId(Uuid::from_u128(1)));
    let left = |fixture: &mut Fixture, frames: usize| {
        let told = (0..frames).map(|_| {
            fixture.step();
            fixture.stepper.left_by_session()
        });
        told.collect::<Vec<bool>>()
    };

    fixture.stepper.obey(drive("scripted", None));
    assert_eq!(left(&mut fixture, 5), [false; 5], "a policy outside sessions");
    fixture.stepper.obey(drive("scripted", segment));
    assert_eq!(left(&mut fixture, 2), [true; 2]);
    fixture.stepper.obey(hold.clone());
    assert_eq!(left(&mut fixture, 2), [true; 2]);

    fixture.stepper.obey(Command::Drive { drive: Drive::Manual(power(0.2)), segment: None });
    assert_eq!(left(&mut fixture, 4), [true, true, false, false], "until it has arrived");

    fixture.stepper.obey(drive("scripted", segment));
    assert_eq!(left(&mut fixture, 5), [true; 5]);
    fixture.stepper.obey(hold);
    fixture.script.set(Deed::GoTo(0.9));
    let seen = fixture.script.seen().len();
    fixture.stepper.obey(drive("scripted", None));
    assert_eq!(fixture.lens.position(), power(0.5), "a policy begins in the middle, not at that place");
    assert_eq!(left(&mut fixture, 4).last(), Some(&false));
    assert_eq!(fixture.script.seen().get(seen), Some(&0.5));

    let back = Drive::Hold { at: Some(power(0.8)) };
    fixture.stepper.obey(Command::Drive { drive: back, segment });
    assert_eq!(left(&mut fixture, 4), [true; 4], "sent back after a restart to where the session's policy had it");
}

/// A policy that stays where it is, and records how many wider patches it got with each frame.
struct Spectator {
    field_of_view: FieldOfView,
    shown: Arc<Mutex<Vec<usize>>>,
}

impl Policy for Spectator {
    fn field_of_view(&self) -> FieldOfView {
        self.field_of_view
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        self.shown.lock().unwrap().push(seen.view.wider.iter().flatten().count());
        Decision { target: seen.focal_power.get(), ..Decision::default() }
    }
}

#[test]
fn a_policy_is_shown_wider_patches_only_if_it_uses_them() {
    for (field_of_view, expected) in [(FieldOfView::Patch, 0), (FieldOfView::Wide, 2)] {
        let shown = Arc::new(Mutex::new(Vec::new()));
        let notes = shown.clone();
        let build = move || Box::new(Spectator { field_of_view, shown: notes.clone() }) as Box<dyn Policy>;
        let registry = Registry::default().with("spectator", "notes what it is shown", build);

        let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
        let lens = Box::new(FakeLens::at(power(0.5)));
        let mut stepper = Stepper::new(lens, Eye::new(Reconstructor::default()), registry, clock.clone(), PATIENT);

        clock.advance(Duration::from_secs(10));
        stepper.obey(drive("spectator", None));
        for number in 1..=3 {
            clock.advance(FRAME);
            let record = stepper.step(sized_frame(number, clock.now(), 128)).unwrap().record;
            assert_eq!(record.held, None);
        }

        // The first frame may come before the policy is built. It then gets all wider patches.
        assert_eq!(shown.lock().unwrap()[1..], [expected; 2], "{field_of_view:?}");
    }
}

#[test]
fn a_panic_holds_and_a_fresh_instance_takes_over() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper.obey(drive("scripted", None));
    fixture.step();
    fixture.script.set(Deed::Panic);
    for _ in 0..SECOND {
        let record = fixture.step();
        assert_eq!((record.asked, record.held), (power(0.6), Some(Hold::PolicyPanicked)));
    }

    assert!(fixture.message().contains("being restarted"), "{}", fixture.message());
    assert!(fixture.script.instances() < 8, "a policy that always panics is tried a few times a second");
    fixture.script.set(Deed::GoTo(0.7));
    fixture.recover();
    assert_eq!(fixture.lens.position(), power(0.7));
    assert_eq!(fixture.message(), "");
}

#[test]
fn nonsense_holds_and_a_fresh_instance_takes_over() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper.obey(drive("scripted", None));
    fixture.step();
    for nonsense in [f64::NAN, f64::INFINITY, -0.001, 1.001] {
        fixture.script.set(Deed::GoTo(nonsense));
        for _ in 0..SECOND {
            let record = fixture.step();
            assert_eq!((record.asked, record.held), (power(0.6), Some(Hold::PolicyNonsense)));
        }

        assert!(fixture.message().contains("invalid focal power"), "{}", fixture.message());
        fixture.script.set(Deed::GoTo(0.6));
        fixture.recover();
    }
}

#[test]
fn a_hanging_policy_is_given_up_and_replaced() {
    let mut fixture = Fixture::new(Duration::from_millis(50));
    fixture.stepper.obey(drive("scripted", None));
    fixture.recover_in_time(Duration::ZERO);
    fixture.script.set(Deed::Hang);
    for _ in 0..4 * SECOND {
        let record = fixture.step();
        assert_eq!((record.asked, record.held), (power(0.6), Some(Hold::PolicySlow)));
    }

    assert!(fixture.message().contains("hangs again and again"), "{}", fixture.message());
    assert!(fixture.script.instances() <= 5, "no more threads are left hanging than a few");
    fixture.stepper.obey(drive("fixed", None));
    fixture.recover_in_time(Duration::ZERO);
    fixture.stepper.obey(drive("scripted", None));
    assert_eq!(fixture.step().held, Some(Hold::PolicySlow));
    fixture.script.set(Deed::GoTo(0.7));
    fixture.recover_in_time(FRAME);
    assert_eq!(fixture.lens.position(), power(0.7), "what the hung ones answered too late is not followed");
}

#[test]
fn a_policy_that_is_late_once_keeps_its_memory() {
    let mut fixture = Fixture::new(Duration::from_millis(50));
    fixture.stepper.obey(drive("scripted", None));
    fixture.recover_in_time(Duration::ZERO);
    fixture.script.set(Deed::Hang);
    assert_eq!(fixture.step().held, Some(Hold::PolicySlow));
    fixture.script.set(Deed::GoTo(0.7));
    fixture.recover_in_time(Duration::ZERO);
    assert_eq!(fixture.script.instances(), 1);
}

#[test]
fn a_lens_that_fails_holds_and_comes_back() {
    for (words, panics) in [("over temperature", false), ("its driver failed", true)] {
        let fail = |lens: &FakeLens, on: bool| {
            lens.panic(on && panics);
            lens.fail((on && !panics).then(|| LensError::Refused("over temperature".into())));
        };

        let mut fixture = Fixture::new(PATIENT);
        fixture.stepper.obey(drive("scripted", None));
        fixture.step();
        fail(&fixture.lens, true);
        fixture.script.set(Deed::GoTo(0.7));
        for _ in 0..SECOND {
            let record = fixture.step();
            assert_eq!((record.asked, record.held), (power(0.6), Some(Hold::LensFailed)));
        }

        assert!(fixture.message().contains(words), "{}", fixture.message());
        assert_eq!(fixture.script.seen().len(), 2, "the policy learns nothing from a lens that does not move");
        fail(&fixture.lens, false);
        fixture.recover();
        assert_eq!(fixture.lens.position(), power(0.7));
    }
}

#[test]
fn a_hand_on_the_slider_is_obeyed_without_frames_and_as_soon_as_the_lens_listens() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.lens.fail(Some(LensError::Gone("unplugged".into())));
    fixture.stepper.obey(Command::Drive { drive: Drive::Manual(power(0.9)), segment: None });
    assert_eq!(fixture.stepper.hold_reason().unwrap().hold, Hold::LensFailed);
    fixture.lens.fail(None);
    fixture.stepper.idle();
    assert_eq!((fixture.lens.position(), fixture.stepper.hold_reason()), (power(0.9), None));
}

#[test]
fn a_pause_holds_and_asks_no_policy() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper.obey(drive("scripted", None));
    fixture.step();
    fixture.stepper.obey(Command::Drive { drive: Drive::Hold { at: None }, segment: None });
    fixture.script.set(Deed::GoTo(0.1));
    let record = fixture.step();
    assert_eq!((record.asked, record.held, record.policy), (power(0.6), Some(Hold::Paused), None));
}

/// A policy that stays where it is, and notes each frame that it sees and each time that it must forget.
struct Diarist(Arc<Mutex<Vec<String>>>);

impl Policy for Diarist {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        self.0.lock().unwrap().push("sees".to_owned());
        Decision { target: seen.focal_power.get(), ..Decision::default() }
    }

    fn forget(&mut self) {
        self.0.lock().unwrap().push("forgets".to_owned());
    }
}

/// A loop with the policy "diarist" in charge, and its diary.
fn diarist() -> (Fixture, Arc<Mutex<Vec<String>>>) {
    let diary = Arc::new(Mutex::new(Vec::new()));
    let notes = diary.clone();
    let build = move || Box::new(Diarist(notes.clone())) as Box<dyn Policy>;
    let registry = Registry::default().with("diarist", "notes what it is told", build);

    let mut fixture = Fixture::new(PATIENT);
    let eye = Eye::new(Reconstructor::default());
    let lens = Box::new(fixture.lens.clone());
    fixture.stepper = Stepper::new(lens, eye, registry, fixture.clock.clone(), PATIENT);
    fixture.stepper.obey(drive("diarist", None));
    fixture.recover();
    diary.lock().unwrap().clear();
    (fixture, diary)
}

#[test]
fn after_an_outage_of_the_lens_the_policy_forgets_before_it_is_asked_again() {
    let (mut fixture, diary) = diarist();
    fixture.lens.fail(Some(LensError::Gone("unplugged".into())));
    // The first of these frames still shows what was asked for before.
    fixture.step();
    diary.lock().unwrap().clear();
    for _ in 0..SECOND {
        fixture.step();
    }
    assert_eq!(*diary.lock().unwrap(), [""; 0]);

    fixture.lens.fail(None);
    fixture.recover();
    fixture.step();
    assert_eq!(diary.lock().unwrap()[..2], ["forgets", "sees"]);
}

#[test]
fn after_an_outage_of_the_camera_the_policy_forgets_before_it_is_asked_again() {
    let (mut fixture, diary) = diarist();
    fixture.step_after(Duration::from_secs(1));
    assert_eq!(*diary.lock().unwrap(), ["sees"]);
    fixture.step_after(Duration::from_millis(1001));
    fixture.step();
    assert_eq!(*diary.lock().unwrap(), ["sees", "forgets", "sees", "sees"]);
}

#[test]
fn the_patch_goes_where_people_point_and_the_policy_forgets_the_old_place_first() {
    let (mut fixture, diary) = diarist();
    let content = ContentArea { x: 32.0, y: 32.0, radius: 20.0, confidence: 1.0 };
    fixture.stepper.obey(Command::ContentArea(Some(content)));
    let step = |fixture: &mut Fixture| {
        fixture.clock.advance(FRAME);
        fixture.number += 1;
        fixture.stepper.step(sized_frame(fixture.number, fixture.clock.now(), 64)).unwrap()
    };

    let before = step(&mut fixture);
    assert_eq!((before.patch.x, before.patch.y, before.record.patch), (16, 16, (16, 16)));

    let place = PatchPlace::nearest(0.5, -0.25);
    fixture.stepper.obey(Command::Aim(Aim { place, choices: 1, held: false, follows: false }));
    let after = step(&mut fixture);
    assert_eq!((after.patch.x, after.patch.y, after.record.patch), (26, 11, (26, 11)), "from the very next frame on");
    assert_eq!(after.record.asked, before.record.asked, "the lens does not move by it");
    assert_eq!(after.aim.choices, 1);
    step(&mut fixture);
    assert_eq!(*diary.lock().unwrap(), ["sees", "forgets", "sees", "sees"]);

    // The place is relative to the circle. A choice of the same place is none that must be forgotten for.
    fixture.stepper.obey(Command::ContentArea(Some(ContentArea { x: 30.0, radius: 24.0, ..content })));
    fixture.stepper.obey(Command::Aim(Aim { place, choices: 2, held: false, follows: false }));
    let moved = step(&mut fixture);
    assert_eq!((moved.patch.x, moved.patch.y), (26, 10));
    assert_eq!(diary.lock().unwrap().last().unwrap(), "sees");
    assert_eq!(diary.lock().unwrap().len(), 5);
}

#[test]
fn where_the_content_area_is_found_far_away_the_policy_forgets_the_old_place() {
    let (mut fixture, diary) = diarist();
    let mut see = |x: f64| {
        let area = ContentArea { x, y: 80.0, radius: 40.0, confidence: 1.0 };
        fixture.stepper.obey(Command::ContentArea(Some(area)));
        fixture.clock.advance(FRAME);
        fixture.number += 1;
        fixture.stepper.step(sized_frame(fixture.number, fixture.clock.now(), 160)).unwrap().jumps
    };

    // Half of a patch (32 cells) and less is no jump, a cell more is one.
    see(60.0);
    diary.lock().unwrap().clear();
    let jumps = [60.0, 76.0, 60.0, 77.0, 78.0, 61.0].map(&mut see);
    assert_eq!(jumps.map(|count| count - jumps[0]), [0, 0, 0, 1, 1, 2]);
    assert_eq!(diary.lock().unwrap().join(" "), "sees sees sees forgets sees sees forgets sees");
}

#[test]
fn tissue_that_is_lost_brings_the_patch_back_to_the_centre() {
    let (mut fixture, diary) = diarist();
    let content = ContentArea { x: 80.0, y: 80.0, radius: 70.0, confidence: 1.0 };
    fixture.stepper.obey(Command::ContentArea(Some(content)));
    let aim = |across, follows| Aim { place: PatchPlace::nearest(across, 0.0), choices: 1, held: false, follows };
    fixture.stepper.obey(Command::Aim(aim(0.5, true)));
    let mut step = |stepper: &mut Stepper| {
        fixture.clock.advance(FRAME);
        fixture.number += 1;
        // It shows nothing.
        stepper.step(sized_frame(fixture.number, fixture.clock.now(), 160)).unwrap()
    };

    let mut frames = 0;
    while fixture.stepper.following() == Following::Tissue {
        let seen = step(&mut fixture.stepper);
        frames += 1;
        assert!(seen.patch.x == 80 + 35 - 16 || fixture.stepper.following() == Following::Lost, "{:?}", seen.patch);
        assert!(frames < SECOND, "it waits for half a second");
    }
    let after = step(&mut fixture.stepper);
    assert_eq!((after.patch.x, after.patch.y, after.aim.place), (64, 64, PatchPlace::CENTRE));
    assert_eq!(after.jumps, 2);
    let told = diary.lock().unwrap().clone();
    assert_eq!(told.iter().filter(|entry| *entry == "forgets").count(), 2, "at the choice and at the loss: {told:?}");

    // Another choice follows again, or stays on the screen.
    for (follows, expected) in [(true, Following::Tissue), (false, Following::Screen)] {
        fixture.stepper.obey(Command::Aim(aim(-0.5, follows)));
        assert_eq!(fixture.stepper.following(), expected);
    }
}

#[test]
fn a_held_focus_stays_and_the_policy_begins_anew_when_it_is_released() {
    let (mut fixture, diary) = diarist();
    let asked = fixture.step().asked;
    let aim = |held| Command::Aim(Aim { place: PatchPlace::CENTRE, choices: 0, held, follows: false });
    fixture.stepper.obey(aim(true));
    for _ in 0..3 {
        let record = fixture.step();
        assert_eq!((record.asked, record.held, record.policy), (asked, Some(Hold::FocusHeld), None));
    }
    fixture.stepper.obey(aim(false));
    let record = fixture.step();
    assert_eq!((record.held, record.policy.is_some()), (None, true), "the same instance goes on at once");
    assert_eq!(*diary.lock().unwrap(), ["sees", "forgets", "sees"]);
}

#[test]
fn a_pause_at_a_focal_power_goes_there_as_soon_as_the_lens_listens_and_stays() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.lens.fail(Some(LensError::Gone("unplugged".into())));
    fixture.stepper.obey(Command::Drive { drive: Drive::Hold { at: Some(power(0.8)) }, segment: None });
    fixture.step();
    fixture.lens.fail(None);
    let record = fixture.step();
    assert_eq!((record.asked, record.held, record.policy), (power(0.8), Some(Hold::Paused), None));
    assert_eq!(fixture.lens.position(), power(0.8));
}

#[test]
fn an_unknown_policy_holds_and_says_so() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper.obey(drive("no-such", None));
    assert_eq!(fixture.step().held, Some(Hold::PolicyUnavailable));
    assert!(fixture.message().contains("parfocal policies"), "{}", fixture.message());
}

#[test]
fn no_message_tells_which_policy_runs() {
    for deed in [Deed::Panic, Deed::Hang, Deed::GoTo(2.0)] {
        let mut fixture = Fixture::new(Duration::from_millis(10));
        fixture.script.set(deed);
        fixture.stepper.obey(drive("scripted", None));
        for _ in 0..SECOND {
            fixture.step();
            assert!(!fixture.message().is_empty() && !fixture.message().contains("scripted"));
        }

        fixture.script.set(Deed::GoTo(0.5));
    }
}

#[test]
fn drive_and_segment_change_together_between_two_frames() {
    let mut fixture = Fixture::new(PATIENT);
    let segments = [1, 2].map(|id| SegmentId(Uuid::from_u128(id)));
    for (name, segment) in [("scripted", segments[0]), ("fixed", segments[1])] {
        fixture.stepper.obey(drive(name, Some(segment)));
        for _ in 0..3 {
            let record = fixture.step();
            assert_eq!((record.policy, record.segment), (Some(PolicyName::new(name)), Some(segment)));
        }
    }

    fixture.stepper.obey(Command::Drive { drive: Drive::Manual(power(0.2)), segment: None });
    let record = fixture.step();
    assert_eq!((record.policy, record.segment, record.asked), (None, None, power(0.2)));
}

/// From 0.9 to 0.5 the lens needs 2 ms of dead time, and 21 ms until it is within 0.006 of its destination. So the
/// frames exposed 0 and 20 ms after the command show it still moving; the one after 40 ms shows it at the policy's
/// start.
#[test]
fn a_policy_begins_once_the_lens_is_at_its_start() {
    let lens = FakeLens::at(power(0.9)).slow(Duration::from_millis(2), Duration::from_millis(15));
    let mut fixture = Fixture::with_lens(PATIENT, lens);
    fixture.step();
    let start = Drive::Policy { name: PolicyName::new("scripted"), start: Some(power(0.5)) };
    fixture.stepper.obey(Command::Drive { drive: start, segment: None });
    assert_eq!(fixture.lens.position(), power(0.5), "without waiting for a frame");
    for pace in [Duration::ZERO, FRAME] {
        let early = fixture.step_after(pace);
        assert_eq!((early.policy, early.asked, early.held), (None, power(0.5), None));
    }

    assert_eq!(fixture.step().asked, power(0.6));
    assert_eq!(fixture.script.seen(), [0.5]);
}

/// Half of a step of 0.4 is left after 15 ln 2 / ln 20 = 3.47 ms of movement. An exposure of 20 ms that ends 15.47 ms
/// after the command has its middle there, since the first 2 ms are dead time.
#[test]
fn a_long_exposure_is_attributed_to_its_middle() {
    let lens = FakeLens::at(power(0.5)).slow(Duration::from_millis(2), Duration::from_millis(15));
    let mut fixture = Fixture::with_lens(PATIENT, lens);
    fixture.script.set(Deed::GoTo(0.9));
    fixture.stepper.obey(drive("scripted", None));
    fixture.step();
    fixture.clock.advance(Duration::from_micros(15_470));
    let mut late = frame(2, fixture.clock.now());
    late.exposure = FRAME;
    fixture.stepper.step(late).unwrap();
    let seen = fixture.script.seen();
    assert!((seen[1] - 0.7).abs() < 1e-3, "{seen:?}");
}

/// The same for a lens whose driver assumes that it moves at once, but whose dynamics were measured.
#[test]
fn measured_dynamics_replace_the_drivers_and_stand_in_the_telemetry() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper = fixture.stepper.moving(measured());
    fixture.script.set(Deed::GoTo(0.9));
    fixture.stepper.obey(drive("scripted", None));
    assert_eq!(fixture.step().measured, Some(power(0.5)), "exposed before the first command");
    fixture.clock.advance(Duration::from_micros(15_470));
    let mut late = frame(2, fixture.clock.now());
    late.exposure = FRAME;
    let record = fixture.stepper.step(late).unwrap().record;
    assert!((record.measured.unwrap().get() - 0.7).abs() < 1e-3, "{record:?}");
    assert!((fixture.script.seen()[1] - 0.7).abs() < 1e-3);
}

/// What was measured on lens A: a delay of 2 ms, then 15 ms of settling.
fn measured() -> MeasuredDynamics {
    MeasuredDynamics {
        driver: "fake".into(),
        serial: "A".into(),
        date: "2026-03-01T10:00:00Z".into(),
        delay_ms: 2.0,
        settling_ms: 15.0,
        hysteresis: 0.0,
    }
}

#[test]
fn another_lens_moves_as_its_driver_assumes_and_is_told_until_the_measured_one_is_back() {
    let mut fixture = Fixture::new(PATIENT);
    fixture.stepper = fixture.stepper.moving(measured());
    assert!((fixture.way_to(0.9) - 0.7).abs() < 1e-3, "half of the way from 0.5");
    assert!(!fixture.stepper.lens_health().caution);

    let mut replug = |serial: &'static str| {
        fixture.lens.fail(Some(LensError::Gone("unplugged".into())));
        fixture.step();
        fixture.lens.swap(serial);
        fixture.lens.fail(None);
        for _ in 0..3 {
            fixture.step();
        }
        let health = fixture.stepper.lens_health();
        (health.caution, health.message.to_string(), fixture.way_to(0.1), fixture.way_to(0.9))
    };

    let (caution, message, down, up) = replug("B");
    assert!(caution && message.contains("lens B") && message.contains("lens A"), "{message}");
    assert!((down - 0.1).abs() < 1e-3 && (up - 0.9).abs() < 1e-3, "it moves at once: {down}, {up}");

    let (caution, message, ..) = replug("A");
    assert_eq!((caution, message.as_str()), (false, "as the test says"));
    fixture.step();
    fixture.step();
    assert!((fixture.way_to(0.5) - 0.7).abs() < 1e-3, "half of the way from 0.9");
}

#[test]
fn the_patch_follows_the_content_area() {
    let mut fixture = Fixture::new(PATIENT);
    let mut patch_of = |stepper: &mut Stepper| {
        fixture.number += 1;
        let seen = stepper.step(sized_frame(fixture.number, fixture.clock.now(), 100)).unwrap();
        (seen.patch.x, seen.patch.y)
    };

    assert_eq!(patch_of(&mut fixture.stepper), (34, 34));
    let area = ContentArea { x: 40.0, y: 60.0, radius: 30.0, confidence: 1.0 };
    fixture.stepper.obey(Command::ContentArea(Some(area)));
    assert_eq!(patch_of(&mut fixture.stepper), (24, 44));
}

#[test]
fn a_picture_without_room_for_a_patch_is_a_fault_of_the_camera() {
    let mut fixture = Fixture::new(PATIENT);
    let Err(reason) = fixture.stepper.step(sized_frame(1, fixture.clock.now(), 16)) else { panic!("it has no patch") };
    assert_eq!(reason.hold, Hold::CameraFailed);
    assert!(reason.message.contains("16x16"), "{}", reason.message);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever the policy answers and whenever the lens fails, the lens is sent only to valid focal powers that the
    /// policy asked for. Otherwise it is held where it was.
    #[test]
    fn the_lens_only_ever_gets_a_focal_power(
        answers in prop::collection::vec((prop_oneof![any::<f64>(), -0.5..1.5_f64], any::<bool>()), 1..20)
    ) {
        let mut fixture = Fixture::new(PATIENT);
        fixture.stepper.obey(drive("scripted", None));
        let mut expected = 0.5;
        let mut lens_failed = false;
        for (answer, lens_fails) in answers {
            fixture.script.set(Deed::GoTo(answer));
            fixture.lens.fail(lens_fails.then(|| LensError::Stalled("as the test asked".into())));
            // Longer than the pause before a new instance, so that each answer is used.
            fixture.clock.advance(Duration::from_secs(1));
            let record = fixture.step();
            if (0.0..=1.0).contains(&answer) && !lens_fails && !lens_failed {
                expected = answer;
            }
            lens_failed = lens_fails;
            prop_assert_eq!(record.asked.get().to_bits(), expected.to_bits());
            prop_assert_eq!(fixture.lens.position(), record.asked);
        }
    }
}

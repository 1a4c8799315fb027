//! How well the classical policies keep the phantom in focus, through whole steps of the loop, faster than real time.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use parfocal_autofocus::Registry;
use parfocal_base::clock::{Clock, ManualClock};
use parfocal_base::{FocalPower, PatchPlace, PolicyName};
use parfocal_devices::camera::{Frame, FrameImage, Truth};
use parfocal_devices::lens::{Lens, SimulatedLens};
use parfocal_devices::simulation::phantom::{Hand, Phantom, Pose, SENSOR_HEIGHT, SENSOR_WIDTH};
use parfocal_imaging::{MosaicFrame, Reconstructor};
use parfocal_pipeline::control::{Aim, Command, Drive, Eye, Following, Stepper};

/// A frame every 40 ms, exposed for 10 ms. The lens comes to rest before the next exposure.
const EXPOSURE: Duration = Duration::from_millis(10);
const FROM_COMMAND_TO_MIDDLE: Duration = Duration::from_millis(35);
const SEEDS: [u64; 2] = [1, 2];
const FRAMES: u64 = 75;

/// Mean of |f - f*| at the middle of each exposure, and share of frames in which it is below 0.1.
#[derive(Debug, Clone, Copy)]
struct FocalError {
    mean: f64,
    in_focus: f64,
}

fn run(policy: &str, seed: u64) -> Vec<f64> {
    let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
    let lens = SimulatedLens::new(clock.clone());
    let glass = lens.optics();
    let mut phantom = Phantom::new(seed);
    let mut hand = Hand::new(seed);
    let patience = Duration::from_secs(20);
    let mut stepper =
        Stepper::new(Box::new(lens), Eye::new(Reconstructor::default()), Registry::standard(), clock.clone(), patience);
    stepper.obey(Command::ContentArea(Some(phantom.content_area())));
    let drive = Drive::Policy { name: PolicyName::new(policy), start: Some(FocalPower::MIDDLE) };
    stepper.obey(Command::Drive { drive, segment: None });
    let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
    let mut errors = Vec::new();
    for number in 1..=FRAMES {
        clock.advance(FROM_COMMAND_TO_MIDDLE);
        let middle = clock.now();
        let pose = hand.pose_at(Duration::from_nanos(middle.as_nanos()));
        let exposed = glass.focal_power_at(middle);
        phantom.expose(&pose, exposed, &mut samples);
        phantom.adjust_exposure(&samples);
        clock.advance(EXPOSURE / 2);
        let optimal = phantom.optimal(&pose);
        let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, std::mem::take(&mut samples)).unwrap();
        let image = FrameImage::Mosaic(Arc::new(mosaic));
        let truth = Some(Truth { optimal, exposed });
        let frame = Frame { number, exposed_at: clock.now(), exposure: EXPOSURE, image, truth };
        let controlled = stepper.step(frame).unwrap();
        assert_eq!(controlled.record.held, None);
        errors.push(exposed.distance(optimal));
        let FrameImage::Mosaic(mosaic) = controlled.frame.image else { unreachable!() };
        samples = Arc::into_inner(mosaic).unwrap().into_samples();
    }

    errors
}

fn focal_error(policy: &str) -> FocalError {
    let errors: Vec<f64> = SEEDS.iter().flat_map(|&seed| run(policy, seed)).collect();
    let count = errors.len() as f64;
    FocalError {
        mean: errors.iter().sum::<f64>() / count,
        in_focus: errors.iter().filter(|&&error| error < 0.1).count() as f64 / count,
    }
}

/// The middle of the patch, which follows the tissue, in each frame of a camera that goes around a rectangle of 60 x 40
/// texels: 20 frames along each side.
fn followed(seed: u64) -> Vec<(f64, f64)> {
    let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
    let lens = Box::new(SimulatedLens::new(clock.clone()));
    let mut phantom = Phantom::new(seed);
    let patience = Duration::from_secs(20);
    let mut stepper =
        Stepper::new(lens, Eye::new(Reconstructor::default()), Registry::standard(), clock.clone(), patience);
    stepper.obey(Command::ContentArea(Some(phantom.content_area())));
    let place = PatchPlace::nearest(0.3, -0.2);
    stepper.obey(Command::Aim(Aim { place, choices: 1, held: false, follows: true }));

    let corner = |side: u32| [[-30.0, -20.0], [30.0, -20.0], [30.0, 20.0], [-30.0, 20.0]][side as usize % 4];
    let mut middles = Vec::new();
    for number in 0..=80u32 {
        clock.advance(FROM_COMMAND_TO_MIDDLE + EXPOSURE / 2);
        let (from, to) = (corner(number / 20), corner(number / 20 + 1));
        let part = f64::from(number % 20) / 20.0;
        let place = [0, 1].map(|axis: usize| from[axis] + part * (to[axis] - from[axis]));
        let pose = Pose { place, roll: 0.0, tilt: [0.0; 2], focus: 0.5 };

        let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
        phantom.expose(&pose, phantom.optimal(&pose), &mut samples);
        phantom.adjust_exposure(&samples);
        let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, samples).unwrap();
        let image = FrameImage::Mosaic(Arc::new(mosaic));
        let number = u64::from(number);
        let frame = Frame { number, exposed_at: clock.now(), exposure: EXPOSURE, image, truth: None };
        let controlled = stepper.step(frame).unwrap();

        assert_eq!(stepper.following(), Following::Tissue, "frame {number}");
        assert_eq!(controlled.jumps, 1, "only the choice is a jump");
        let (x, y) = controlled.record.patch;
        assert_eq!((x as usize, y as usize), (controlled.patch.x, controlled.patch.y));
        middles.push((f64::from(x), f64::from(y)));
    }
    middles
}

#[test]
fn the_patch_follows_the_phantoms_tissue_there_and_back() {
    for seed in SEEDS {
        let middles = followed(seed);
        let moved = |from: usize, to: usize| (middles[to].0 - middles[from].0, middles[to].1 - middles[from].1);
        let near = |found: (f64, f64), expected: (f64, f64)| {
            let off = (found.0 - expected.0).abs().max((found.1 - expected.1).abs());
            assert!(off <= 2.0, "seed {seed}: {found:?} is not {expected:?}");
        };

        // What the camera goes past moves the other way, as far along opposite sides, and two thirds as far along the
        // shorter ones.
        let across = moved(0, 20);
        assert!(across.0 < -15.0, "seed {seed}: {across:?}");
        near(across, (across.0, 0.0));
        near(moved(0, 10), (across.0 / 2.0, 0.0));
        near(moved(20, 40), (0.0, across.0 * 2.0 / 3.0));
        near(moved(40, 60), (-across.0, 0.0));
        near(moved(0, 80), (0.0, 0.0));
    }
}

#[test]
fn the_hill_climbers_keep_the_phantom_in_better_focus_than_no_policy() {
    let policies = ["fixed", "mgm-hill-climber", "mlr-hill-climber"];
    let [fixed, mgm, mlr] = std::thread::scope(|scope| {
        policies.map(|policy| scope.spawn(move || focal_error(policy))).map(|thread| thread.join().unwrap())
    });
    for (policy, error) in policies.iter().zip([fixed, mgm, mlr]) {
        println!("{policy:18} mean |f - f*| {:.3}, in focus {:.0} %", error.mean, 100.0 * error.in_focus);
    }
    for climber in [mgm, mlr] {
        assert!(climber.mean < fixed.mean && climber.in_focus > fixed.in_focus, "{climber:?} {fixed:?}");
    }
}

//! Measures what a focus step costs: the metrics, each policy's step, and a whole step of the control loop. Also
//! measures how long the loop takes from exposure to lens command. `cargo bench --features aravis --bench control loop`
//! measures the loop alone, with the phantom, and with Aravis's fake GigE Vision camera and the emulated lens driver.
#![allow(missing_docs, reason = "`criterion_group!` makes a public function")]

#[cfg(feature = "aravis")]
mod devices;
#[cfg(feature = "aravis")]
mod fake_camera;

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use parfocal_autofocus::{Observation, Registry, mgm, mlr};
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::step::StepRecord;
use parfocal_devices::camera::{self, Camera, CameraSettings, Frame, FrameImage};
use parfocal_devices::lens::{Lens, SimulatedLens};
use parfocal_imaging::{
    GrayImage, JpegEncoder, MosaicFrame, PATCH_SIDE, Patch, PatchArea, Reconstructor, RgbImage, Surroundings, View,
    WIDER,
};
use parfocal_pipeline::control::{
    Command, ControlLoop, ControlledFrame, Drive, Eye, LatencyFigures, LoopSettings, Rig, Stepper,
};

fn texture(index: usize) -> usize {
    (index * index * 37 + index * 11) % 256
}

fn patch() -> Patch {
    Patch(std::array::from_fn(|index| texture(index) as f32))
}

fn view() -> View {
    let levels = (0..Surroundings::SIDE * Surroundings::SIDE).map(|index| texture(index) as f32).collect();
    let surroundings = Some(Surroundings { levels, patch: (48, 48) });
    View { patch: patch(), wider: [Some(patch()); WIDER.len()], surroundings }
}

fn metrics(criterion: &mut Criterion) {
    let patch = patch();
    criterion.bench_function("metric/mgm", |bench| bench.iter(|| mgm(black_box(&patch))));
    criterion.bench_function("metric/mlr", |bench| bench.iter(|| mlr(black_box(&patch))));
}

fn available() -> impl Iterator<Item = PolicyName> {
    Registry::standard().entries().into_iter().filter(|entry| entry.available).map(|entry| entry.name)
}

fn policies(criterion: &mut Criterion) {
    let view = view();
    for name in available() {
        let mut policy = Registry::standard().build(&name).expect("is available");
        let mut focal_power = FocalPower::MIDDLE;
        criterion.bench_function(&format!("policy/{name}"), |bench| {
            bench.iter(|| {
                let decision = policy.step(&Observation { view: black_box(&view), focal_power });
                focal_power = FocalPower::nearest(decision.target);
            });
        });
    }
}

/// From a mosaic in memory to the lens command, including the hop to the policy's thread and back.
fn steps(criterion: &mut Criterion) {
    let samples = (0..2048 * 1088).map(|index| texture(index) as u16).collect();
    let image = FrameImage::Mosaic(Arc::new(MosaicFrame::new(2048, 1088, samples).expect("fits")));
    for name in available() {
        let clock = Arc::new(SystemClock);
        let eye = Eye::new(Reconstructor::default());
        let lens = Box::new(SimulatedLens::new(clock.clone()));
        let mut stepper = Stepper::new(lens, eye, Registry::standard(), clock.clone(), Duration::from_millis(20));
        let drive = Drive::Policy { name: name.clone(), start: None };
        stepper.obey(Command::Drive { drive, segment: None });
        let mut number = 0;
        criterion.bench_function(&format!("step/{name}"), |bench| {
            bench.iter(|| {
                number += 1;
                let exposed_at = clock.now();
                let exposure = Duration::ZERO;
                let frame = Frame { number, exposed_at, exposure, image: image.clone(), truth: None };
                stepper.step(frame)
            });
        });
    }
}

/// A depth map: what its trackers see of a mosaic, and what they make of it.
fn depth_map(criterion: &mut Criterion) {
    const PLACES: usize = 21;
    let samples = (0..2048 * 1088).map(|index| texture(index) as u16).collect();
    let image = FrameImage::Mosaic(Arc::new(MosaicFrame::new(2048, 1088, samples).expect("fits")));
    let eye = Eye::new(Reconstructor::default());
    let tracker = || Registry::standard().build(&PolicyName::new("parfocal")).expect("is available");
    let mut trackers: Vec<_> = std::iter::repeat_with(tracker).take(PLACES).collect();
    let patch = PatchArea { x: 240, y: 120, width: PATCH_SIDE, height: PATCH_SIDE };
    let focal_power = FocalPower::MIDDLE;
    criterion.bench_function("depth map/21 places", |bench| {
        bench.iter(|| {
            for tracker in &mut trackers {
                let view = eye.look(&image, patch, tracker.field_of_view());
                black_box(tracker.look_on(&Observation { view: &view, focal_power }, focal_power));
            }
        });
    });
}

/// Exposure to lens command in the whole loop, with the phantom at 50 frames a second.
fn latency(_: &mut Criterion) {
    let clock = Arc::new(SystemClock);
    let lens = Box::new(SimulatedLens::new(clock.clone()));
    let settings = CameraSettings { fps: 50.0, seed: 1, optics: lens.optics(), clock };
    let records = watch_loop(camera::open("phantom", settings).expect("is there"), lens, 50.0, 500);
    let mut latencies: Vec<u32> = records.iter().map(|record| record.latency_micros).collect();
    let LatencyFigures { steps, p50, p99 } = LatencyFigures::of(&mut latencies);
    println!("loop/phantom  {steps} steps at 50 a second: exposure to lens command p50 {p50} µs, p99 {p99} µs");
}

/// Records of `steps` steps of the whole loop, driven by the MGM hill-climber. Telemetry is drained, and a thread makes
/// a picture of each frame meanwhile, as the live view does.
fn watch_loop(camera: Box<dyn Camera>, lens: Box<dyn Lens>, fps: f64, steps: usize) -> Vec<StepRecord> {
    let mut reconstructor = Reconstructor::default();
    let clock = Arc::new(SystemClock);
    let rig = Rig { camera, lens, reconstructor: reconstructor.clone(), registry: Registry::standard(), clock };
    let frame_period = Duration::from_secs_f64(1.0 / fps);
    let settings = LoopSettings { frame_period, telemetry_capacity: 256, dynamics: None };
    let (control, handle, mut telemetry) = ControlLoop::spawn(settings, rig).expect("starts");
    handle.send(Command::Drive {
        drive: Drive::Policy { name: PolicyName::new("mgm-hill-climber"), start: None },
        segment: None,
    });
    let frames = handle.frames.clone();
    let viewer = std::thread::spawn(move || {
        let mut rgb = RgbImage::default();
        let mut gray = GrayImage::default();
        let mut encoder = JpegEncoder::new(80).expect("starts");
        while !frames.is_closed() {
            if let Some(ControlledFrame { frame: Frame { image: FrameImage::Mosaic(mosaic), .. }, .. }) =
                frames.take(Duration::from_millis(100))
            {
                reconstructor.reconstruct(&mosaic, &mut rgb, &mut gray);
                black_box(encoder.encode(&rgb).expect("encodes"));
            }
        }
    });
    let in_charge = std::iter::from_fn(|| telemetry.blocking_recv()).filter(|record| record.policy.is_some());
    let records = in_charge.take(steps).collect();
    control.stop();
    let _ = viewer.join();
    records
}

#[cfg(feature = "aravis")]
fn bench_devices(_: &mut Criterion) {
    devices::measure();
}

/// Real cameras need the feature `aravis`.
#[cfg(not(feature = "aravis"))]
fn bench_devices(_: &mut Criterion) {
    println!("loop/gige  skipped: built without the feature aravis");
}

criterion_group!(benches, metrics, policies, steps, depth_map, latency, bench_devices);
criterion_main!(benches);

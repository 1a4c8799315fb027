//! What a focus step costs: the metrics, each policy's step, and a whole step of the control loop.
#![allow(missing_docs, clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "a benchmark")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use parfocal::autofocus::{Observation, PolicyName, Registry, mgm, mlr};
use parfocal::camera::{Frame, FrameImage};
use parfocal::clock::{Clock, SystemClock};
use parfocal::control::{Command, Drive, Eye, Stepper};
use parfocal::imaging::{Calibration, MosaicFrame, PATCH_SIDE, Patch, Reconstructor};
use parfocal::lens::{FocalPower, SimulatedLens};

fn texture(index: usize) -> usize {
    (index * index * 37 + index * 11) % 256
}

fn patch() -> Patch {
    Patch(std::array::from_fn(|index| texture(index) as f32))
}

fn metrics(criterion: &mut Criterion) {
    let patch = patch();
    assert_eq!(patch.0.len(), PATCH_SIDE * PATCH_SIDE);
    criterion.bench_function("metric/mgm", |bench| bench.iter(|| mgm(black_box(&patch))));
    criterion.bench_function("metric/mlr", |bench| bench.iter(|| mlr(black_box(&patch))));
}

fn available() -> impl Iterator<Item = PolicyName> {
    Registry::standard().entries().into_iter().filter(|entry| entry.available).map(|entry| entry.name)
}

fn policies(criterion: &mut Criterion) {
    let patch = patch();
    for name in available() {
        let mut policy = Registry::standard().build(&name).expect("is available");
        let mut focal_power = FocalPower::MIDDLE;
        criterion.bench_function(&format!("policy/{name}"), |bench| {
            bench.iter(|| {
                let decision = policy.step(&Observation { patch: black_box(&patch), focal_power });
                focal_power = FocalPower::nearest(decision.target);
            });
        });
    }
}

/// From a mosaic in memory to the lens command, the hop to the policy's thread and back included.
fn steps(criterion: &mut Criterion) {
    let samples = (0..2048 * 1088).map(|index| texture(index) as u16).collect();
    let image = FrameImage::Mosaic(Arc::new(MosaicFrame::new(2048, 1088, samples).expect("fits")));
    for name in available() {
        let clock = Arc::new(SystemClock);
        let eye = Eye::new(Reconstructor::new(&Calibration::default()));
        let lens = Box::new(SimulatedLens::new(clock.clone()));
        let mut stepper = Stepper::new(lens, eye, Registry::standard(), clock.clone(), Duration::from_millis(20));
        let drive = Drive::Policy { name: name.clone(), start: None };
        stepper.obey(Command::Drive { drive, segment: None });
        let mut number = 0;
        criterion.bench_function(&format!("step/{name}"), |bench| {
            bench.iter(|| {
                number += 1;
                let (exposed_at, exposure) = (clock.now(), Duration::ZERO);
                let frame = Frame { number, exposed_at, exposure, image: image.clone(), truth: None };
                stepper.step(frame)
            });
        });
    }
}

criterion_group!(benches, metrics, policies, steps);
criterion_main!(benches);

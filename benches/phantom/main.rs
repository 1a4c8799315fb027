//! What a frame of the simulated cameras costs, compared with a plain copy of the phantom's mosaic.

#![allow(missing_docs, reason = "`criterion_group!` makes a public function")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use parfocal_base::FocalPower;
use parfocal_base::clock::{ManualClock, Moment};
use parfocal_devices::camera::{self, CameraSettings};
use parfocal_devices::lens::Optics;
use parfocal_devices::simulation::phantom::{Hand, Phantom, SENSOR_HEIGHT, SENSOR_WIDTH, Scene};

/// A lens that never moves.
struct Still;

impl Optics for Still {
    fn focal_power_at(&self, _: Moment) -> FocalPower {
        FocalPower::MIN
    }
}

fn phantom(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("phantom");
    group.sample_size(20).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    let mut phantom = Phantom::new(1);
    let pose = Hand::new(1).pose_at(Duration::from_secs(1));
    let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
    let mut copy = samples.clone();
    group.bench_function("copy of the mosaic", |bencher| {
        bencher.iter(|| copy.copy_from_slice(black_box(&samples)));
    });
    let sharp = phantom.optimal(&pose);
    for (name, focal_power) in [("frame in focus", sharp), ("frame out of focus", sharp.moved(-0.5))] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| phantom.expose(&pose, focal_power, black_box(&mut samples)));
        });
    }
    group.bench_function("truth", |bencher| bencher.iter(|| black_box(phantom.optimal(&pose))));
    group.bench_function("scene", |bencher| bencher.iter(|| black_box(Scene::new(1))));
    group.finish();
}

/// Whole frames as the camera thread makes them, without the waiting.
fn cameras(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_fn(683, 384, |x, y| image::Rgb([(x ^ y).to_le_bytes()[0]; 3]));
    picture.save(folder.path().join("a.png")).unwrap();
    let footage = format!("footage:{}", folder.path().display());
    let mut group = criterion.benchmark_group("camera");
    group.sample_size(20).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    for (name, spec) in [("phantom", "phantom"), ("footage 512x288", footage.as_str())] {
        let clock = Arc::new(ManualClock::new(jiff::Timestamp::UNIX_EPOCH));
        let settings = CameraSettings { fps: 50.0, seed: 1, optics: Arc::new(Still), clock: Arc::clone(&clock) as _ };
        let mut camera = camera::open(spec, settings).unwrap();
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                clock.advance(Duration::from_millis(20));
                black_box(camera.next_frame(Duration::ZERO).unwrap())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, phantom, cameras);
criterion_main!(benches);

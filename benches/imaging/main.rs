//! Imaging at the sensor's full size, compared with a plain copy of the same mosaic.

#![allow(missing_docs, reason = "`criterion_group!` makes a public function")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_imaging::{
    Calibration, GrayImage, JpegEncoder, MosaicFrame, PatchArea, Reconstructor, Reference, RgbImage, content_area,
};

const WIDTH: usize = 2048;
const HEIGHT: usize = 1088;

/// Texture inside a circle, dark outside, as the sensor sees it.
fn mosaic() -> MosaicFrame {
    let samples = (0..WIDTH * HEIGHT).map(|i| {
        let x = (i % WIDTH) as f32;
        let y = (i / WIDTH) as f32;
        let inside = (x - 1024.0).hypot(y - 544.0) < 700.0;
        let texture = 1.0 + 0.4 * (x / 9.0).sin() * (y / 13.0 + x / 40.0).cos();
        (if inside { 450.0 * texture } else { 12.0 }) as u16
    });
    MosaicFrame::new(WIDTH, HEIGHT, samples.collect()).unwrap()
}

fn per_pixel() -> Calibration {
    let reference = |count: u16| {
        let samples = (0..WIDTH * HEIGHT).map(|i| count + u16::try_from(i % 7).unwrap()).collect();
        Reference::PerPixel(MosaicFrame::new(WIDTH, HEIGHT, samples).unwrap())
    };
    Calibration { dark: reference(30), white: reference(900), ..Calibration::default() }
}

fn imaging(criterion: &mut Criterion) {
    let mosaic = mosaic();
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
    let mut group = criterion.benchmark_group("imaging");
    group.sample_size(20).measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(500));

    let mut copy = vec![0; mosaic.samples().len()];
    group.bench_function("memcpy of the mosaic", |bench| {
        bench.iter(|| black_box(&mut copy).copy_from_slice(black_box(mosaic.samples())));
    });
    let mut reconstructor = Reconstructor::default();
    group.bench_function("reconstruct", |bench| {
        bench.iter(|| reconstructor.reconstruct(black_box(&mosaic), &mut rgb, &mut gray));
    });
    let mut by_pixel = Reconstructor::new(&per_pixel());
    group.bench_function("reconstruct, references per pixel", |bench| {
        bench.iter(|| by_pixel.reconstruct(black_box(&mosaic), &mut rgb, &mut gray));
    });
    let area = PatchArea::central(512, 272, None).unwrap();
    group.bench_function("gray patch", |bench| {
        bench.iter(|| black_box(reconstructor.gray_patch(black_box(&mosaic), area)));
    });
    group.bench_function("content area", |bench| bench.iter(|| content_area::detect(black_box(&gray))));
    let mut encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY).unwrap();
    group.bench_function("jpeg", |bench| bench.iter(|| encoder.encode(black_box(&rgb)).unwrap()));
    group.bench_function("gaussian blur, sigma 4", |bench| bench.iter(|| gaussian_blur(black_box(&gray), 4.0)));
    group.bench_function("new reconstructor", |bench| {
        bench.iter(|| Reconstructor::new(black_box(&Calibration::default())));
    });
    group.finish();
}

criterion_group!(benches, imaging);
criterion_main!(benches);

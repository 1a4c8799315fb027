//! Measures development at each size on one thread, in multiples of a plain copy of the mosaic. Each round times a copy
//! and everything else, and the table has the medians over the rounds. Then measures JPEG encoding of the pictures, as
//! developed for JPEG and from RGB. Times are processor time of the thread, so they leave out what other programs take
//! meanwhile. `cargo bench --bench development`

use std::hint::black_box;
use std::time::Duration;

use parfocal_imaging::{
    Calibration, Developed, Developer, GrayImage, JpegEncoder, MosaicFrame, Reference, RgbImage, Size,
};
use rustix::time::{ClockId, clock_gettime};

const WIDTH: usize = 2048;
const HEIGHT: usize = 1088;
const ROUNDS: usize = 60;
/// Runs within a round; the fastest counts, because whatever disturbs a run only slows it down.
const RUNS: usize = 3;

/// Texture inside a circle, dark outside, as the sensor sees it, with detail down to the sample.
fn mosaic() -> MosaicFrame {
    let sample = |index: usize| {
        let x = (index % WIDTH) as f32;
        let y = (index / WIDTH) as f32;
        let inside = (x - 1024.0).hypot(y - 544.0) < 700.0;
        let waves = 1.0 + 0.3 * (x / 9.0).sin() * (y / 13.0 + x / 40.0).cos() + 0.1 * (1.7 * x + 0.9 * y).sin();
        (if inside { 450.0 * waves } else { 12.0 }) as u16
    };
    MosaicFrame::new(WIDTH, HEIGHT, (0..WIDTH * HEIGHT).map(sample).collect()).unwrap()
}

fn per_pixel() -> Calibration {
    let reference = |count: u16| {
        let samples = (0..WIDTH * HEIGHT).map(|i| count + u16::try_from(i % 7).unwrap()).collect();
        Reference::PerPixel(MosaicFrame::new(WIDTH, HEIGHT, samples).unwrap())
    };
    Calibration { dark: reference(30), white: reference(900), ..Calibration::default() }
}

/// Time of the fastest of [`RUNS`] runs.
fn time(mut run: impl FnMut()) -> Duration {
    let fastest = (0..RUNS).map(|_| {
        let begin = of_this_thread();
        run();
        of_this_thread().saturating_sub(begin)
    });
    fastest.min().unwrap_or_default()
}

/// Processor time of this thread so far.
fn of_this_thread() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.try_into().unwrap_or(0), time.tv_nsec.try_into().unwrap_or(0))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    // `cargo test --benches` only checks that it starts.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }

    let mosaic = mosaic();
    let mut copy = vec![0; mosaic.samples().len()];
    let mut by_band = Developer::new(&Calibration::default());
    let mut by_pixel = Developer::new(&per_pixel());
    let mut pictures = Size::ALL.map(|_| Developed::default());
    let mut gray = GrayImage::default();

    let mut copies = Vec::new();
    let mut steps = vec![(Vec::new(), Vec::new()); 2 * Size::ALL.len()];

    for _ in 0..ROUNDS {
        let of_copy = time(|| black_box(&mut copy).copy_from_slice(black_box(mosaic.samples()))).as_secs_f64();
        copies.push(1e3 * of_copy);

        for (index, (times, ratios)) in steps.iter_mut().enumerate() {
            let which = index % Size::ALL.len();
            let developer = if index < Size::ALL.len() { &mut by_band } else { &mut by_pixel };
            let of_step = time(|| {
                developer.develop_for_jpeg(black_box(&mosaic), Size::ALL[which], &mut pictures[which], &mut gray);
            });
            times.push(1e3 * of_step.as_secs_f64());
            ratios.push(of_step.as_secs_f64() / of_copy);
        }
    }

    println!("| step | time, ms | copies of the mosaic |\n|---|---|---|");
    println!("| copy of the mosaic | {:.3} | 1 |", median(&mut copies));
    for (index, (times, ratios)) in steps.iter_mut().enumerate() {
        let name = format!("{:?}", Size::ALL[index % Size::ALL.len()]).to_lowercase();
        let references = if index < Size::ALL.len() { "band" } else { "pixel" };
        println!("| {name}, references per {references} | {:.3} | {:.1} |", median(times), median(ratios));
    }

    println!("\n| JPEG | as developed, ms | from RGB, ms |\n|---|---|---|");
    for size in Size::ALL {
        let [developed, from_rgb] = encoding(&mut by_band, &mosaic, size);
        println!("| {} | {developed:.3} | {from_rgb:.3} |", size.name());
    }
}

/// Milliseconds of JPEG encoding: of the picture as it is developed, and from RGB.
fn encoding(developer: &mut Developer, mosaic: &MosaicFrame, size: Size) -> [f64; 2] {
    let mut encoder = JpegEncoder::new(JpegEncoder::DEFAULT_QUALITY).unwrap();
    let mut picture = Developed::default();
    let mut rgb = RgbImage::default();
    developer.develop_for_jpeg(mosaic, size, &mut picture, &mut GrayImage::default());
    developer.develop(mosaic, size, &mut rgb, &mut GrayImage::default());

    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        let as_developed = time(|| {
            black_box(match &picture {
                Developed::Rgb(rgb) => encoder.encode(rgb).unwrap(),
                Developed::Ycc(ycc) => encoder.encode_ycc(ycc).unwrap(),
            });
        });
        let from_rgb = time(|| {
            black_box(encoder.encode(&rgb).unwrap());
        });
        times[0].push(1e3 * as_developed.as_secs_f64());
        times[1].push(1e3 * from_rgb.as_secs_f64());
    }
    times.each_mut().map(|times| median(times))
}

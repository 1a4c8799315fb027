//! Cameras from outside: what the simulated ones show, what they claim to know, and how they report bad sources.

mod calibrate;
#[path = "../shared/program.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use parfocal_autofocus::mgm;
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment};
use parfocal_devices::camera::{self, Camera, CameraError, CameraSettings, Frame, FrameImage};
use parfocal_devices::lens::Optics;
use parfocal_devices::simulation::phantom::{Hand, Phantom, SENSOR_HEIGHT, SENSOR_WIDTH};
use parfocal_imaging::{GrayImage, MosaicFrame, PatchArea, Reconstructor, RgbImage, content_area, rgb_patch};

/// A clock that stands still until a test sets it, so that frames take no time.
#[derive(Default)]
struct StepClock(AtomicU64);

impl Clock for StepClock {
    fn now(&self) -> Moment {
        Moment::from_nanos(self.0.load(Ordering::Relaxed))
    }

    fn wall(&self) -> jiff::Timestamp {
        jiff::Timestamp::UNIX_EPOCH
    }
}

/// A lens whose focal power rises from 0 to 1 in each second.
struct Sweep;

impl Optics for Sweep {
    fn focal_power_at(&self, moment: Moment) -> FocalPower {
        let milliseconds = u32::try_from(moment.as_nanos() / 1_000_000 % 1000).unwrap();
        FocalPower::nearest(f64::from(milliseconds) / 1000.0)
    }
}

const PERIOD: Duration = Duration::from_millis(1);

fn open(spec: &str, seed: u64) -> (Result<Box<dyn Camera>, CameraError>, Arc<StepClock>) {
    let clock = Arc::new(StepClock::default());
    let settings = CameraSettings { fps: 1000.0, seed, optics: Arc::new(Sweep), clock: Arc::clone(&clock) as _ };
    (camera::open(spec, settings), clock)
}

/// The frames of camera `spec` at `times`, in milliseconds.
fn frames(spec: &str, seed: u64, times: &[u64]) -> Vec<Frame> {
    let (camera, clock) = open(spec, seed);
    let mut camera = camera.unwrap();
    let at = |&time: &u64| {
        clock.0.store(time * 1_000_000, Ordering::Relaxed);
        camera.next_frame(10 * PERIOD).unwrap()
    };
    times.iter().map(at).collect()
}

fn samples(frame: &Frame) -> &MosaicFrame {
    match &frame.image {
        FrameImage::Mosaic(mosaic) => mosaic,
        FrameImage::Rgb(_) => panic!("the phantom gives mosaics"),
    }
}

fn colours(frame: &Frame) -> &RgbImage {
    match &frame.image {
        FrameImage::Rgb(rgb) => rgb,
        FrameImage::Mosaic(_) => panic!("footage gives colours"),
    }
}

#[test]
fn the_phantom_is_the_same_for_the_same_seed_and_times() {
    let times = [0, 40, 90, 400];
    let one = frames("phantom", 1, &times);
    let same = frames("phantom", 1, &times);
    let other = frames("phantom", 2, &times);
    for (one, same) in one.iter().zip(&same) {
        assert!(samples(one) == samples(same));
        assert_eq!((one.number, one.truth), (same.number, same.truth));
    }

    assert!(samples(&one[3]) != samples(&other[3]));
    let exposed: Vec<f64> = one.iter().map(|frame| frame.truth.unwrap().exposed.get()).collect();
    assert_eq!(exposed, [0.0, 0.04, 0.09, 0.4], "each frame sees the lens as it stood");
}

#[test]
fn frames_that_come_too_late_are_lost_and_counted() {
    let (camera, clock) = open("phantom", 1);
    let mut camera = camera.unwrap();
    assert_eq!(camera.next_frame(PERIOD).unwrap().number, 1);
    clock.0.store(100_000_000, Ordering::Relaxed);
    assert_eq!(camera.next_frame(PERIOD).unwrap().number, 101);
    assert_eq!(camera.health().lost, 99);
}

#[test]
fn the_phantom_knows_where_its_patch_is_sharpest() {
    let reconstructor = Reconstructor::default();
    for seed in [11, 12, 13] {
        let mut phantom = Phantom::new(seed);
        let mut hand = Hand::new(seed);
        let area = PatchArea::central(SENSOR_WIDTH / 4, SENSOR_HEIGHT / 4, Some(&phantom.content_area())).unwrap();
        for second in [0, 7] {
            let pose = hand.pose_at(Duration::from_secs(second));
            let truth = phantom.optimal(&pose).get();
            let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
            let mut sharpness = |focal_power: f64| {
                phantom.expose(&pose, FocalPower::nearest(focal_power), &mut samples);
                let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, samples.clone()).unwrap();
                mgm(&reconstructor.gray_patch(&mosaic, area))
            };

            let stack =
                (0..=20).map(|step| f64::from(step) / 20.0).map(|focal_power| (sharpness(focal_power), focal_power));
            let (_, best) = stack.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            // Half a step of the stack, and half as much again for noise.
            assert!((best - truth).abs() < 0.04, "seed {seed}, {second} s: sharpest at {best}, truth {truth}");
        }
    }
}

#[test]
fn the_phantoms_picture_is_exposed_well_and_its_content_area_can_be_found() {
    let mut phantom = Phantom::new(21);
    let mut hand = Hand::new(21);
    let mut samples = vec![0; SENSOR_WIDTH * SENSOR_HEIGHT];
    for frame in 0..40 {
        let pose = hand.pose_at(Duration::from_millis(20) * frame);
        phantom.expose(&pose, phantom.optimal(&pose), &mut samples);
        phantom.adjust_exposure(&samples);
    }

    let mosaic = MosaicFrame::new(SENSOR_WIDTH, SENSOR_HEIGHT, samples).unwrap();
    let mut rgb = RgbImage::default();
    let mut gray = GrayImage::default();
    Reconstructor::default().reconstruct(&mosaic, &mut rgb, &mut gray);
    let found = content_area::detect(&gray).unwrap();
    let truth = phantom.content_area();
    assert!((found.x - truth.x).hypot(found.y - truth.y) < 3.0, "{found:?} {truth:?}");
    assert!((found.radius - truth.radius).abs() < 3.0, "{found:?} {truth:?}");
    let [red, green, blue] = [0, 1, 2].map(|channel| {
        let inside = rgb.data.chunks_exact(3 * 512).skip(80).take(112).flat_map(|row| &row[3 * 180..3 * 332]);
        inside.skip(channel).step_by(3).map(|value| f64::from(*value)).sum::<f64>() / (112.0 * 152.0)
    });

    assert!((110.0..230.0).contains(&red), "exposure: {red}");
    assert!(red > 1.05 * green && red > 1.05 * blue, "brain is pink: {red} {green} {blue}");
}

/// Saves a checkerboard with squares of 4 pixels.
fn stripes(file: &Path, width: u32, height: u32) {
    let picture = image::RgbImage::from_fn(width, height, |x, y| {
        image::Rgb([if (x / 4 + y / 4) % 2 == 0 { 220 } else { 60 }; 3])
    });
    picture.save(file).unwrap();
}

/// How far a frame is out of focus, and the mean gradient magnitude in its middle.
fn sharpness(frame: &Frame) -> (f64, f64) {
    let rgb = colours(frame);
    let area = PatchArea::central(rgb.width, rgb.height, None).unwrap();
    let truth = frame.truth.unwrap();
    (truth.optimal.distance(truth.exposed), mgm(&rgb_patch(rgb, area)))
}

#[test]
fn footage_is_sharp_at_its_optimum_and_blurred_away_from_it() {
    let folder = tempfile::tempdir().unwrap();
    stripes(&folder.path().join("a.png"), 320, 240);
    let spec = format!("footage:{}", folder.path().display());
    let times: Vec<u64> = (0..50).map(|step| 20 * step).collect();
    let shown = frames(&spec, 3, &times);
    assert_eq!((colours(&shown[0]).width, colours(&shown[0]).height), (240, 180), "three quarters of the picture");
    let mut sharp: Vec<(f64, f64)> = shown.iter().map(sharpness).collect();
    sharp.sort_by(|a, b| a.0.total_cmp(&b.0));
    let nearest = sharp[0];
    let furthest = sharp[49];
    assert!(nearest.0 < 0.05 && furthest.0 > 0.4, "the lens sweeps past the optimum");
    assert!(nearest.1 > 3.0 * furthest.1, "{nearest:?} {furthest:?}");
    let again = frames(&spec, 3, &times);
    assert!(shown.iter().zip(&again).all(|(one, same)| colours(one) == colours(same) && one.truth == same.truth));
}

#[test]
fn a_video_is_played() {
    let Some(file) = std::env::var_os("PARFOCAL_CLIP").map(PathBuf::from) else {
        println!("skipped: PARFOCAL_CLIP names no clip");
        return;
    };

    let shown = frames(&format!("footage:{}", file.display()), 5, &[0, 500]);
    for frame in &shown {
        // 1280x720 scaled to 384 lines is 683x384. The window has three quarters of that.
        assert_eq!((colours(frame).width, colours(frame).height), (512, 288));
        let mean = colours(frame).data.iter().map(|value| f64::from(*value)).sum::<f64>() / (512.0 * 288.0 * 3.0);
        assert!((40.0..200.0).contains(&mean), "{mean}");
    }
}

/// The error from a camera that cannot be opened.
fn refusal(spec: &str) -> String {
    match open(spec, 1).0 {
        Err(error @ CameraError::BadSource(_)) => error.to_string(),
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("{spec} was opened"),
    }
}

#[test]
fn a_mosaic_is_not_footage() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mosaic.png");
    image::ImageBuffer::from_pixel(2048, 1088, image::Luma([400_u16])).save(&file).unwrap();
    assert!(refusal(&format!("footage:{}", file.display())).contains("it is a sensor's mosaic"));
}

#[test]
fn bad_sources_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| -> PathBuf { folder.path().join(name) };
    let refused = |path: &Path| refusal(&format!("footage:{}", path.display()));

    assert!(refused(folder.path()).contains("there is no picture (PNG, JPEG or TIFF)"));
    assert!(refused(&inside("missing.mp4")).contains("missing.mp4: No such file"));
    std::fs::write(inside("notes.mp4"), "no video at all").unwrap();
    assert!(refused(&inside("notes.mp4")).contains("ffmpeg finds no video in it"));
    std::fs::write(inside("broken.png"), "no picture").unwrap();
    assert!(refused(&inside("broken.png")).contains("broken.png"));
    stripes(&inside("cut.jpg"), 200, 100);
    let whole = std::fs::read(inside("cut.jpg")).unwrap();
    std::fs::write(inside("cut.jpg"), &whole[..whole.len() / 2]).unwrap();
    assert!(refused(&inside("cut.jpg")).contains("damaged or cut short"));
    stripes(&inside("a.png"), 100, 100);
    std::fs::rename(inside("a.png"), inside("is-a-png.jpg")).unwrap();
    assert!(open(&format!("footage:{}", inside("is-a-png.jpg").display()), 1).0.is_ok());
    stripes(&inside("small.png"), 100, 48);
    assert!(refused(&inside("small.png")).contains("is 100x48 pixels, but at least 64x64 are needed"));
    for unknown in ["kinect", "footage", "footage:", "phantom:3"] {
        let told = refusal(unknown);
        assert!(told.contains(&format!("`{unknown}`")) && told.contains("`footage:PATH`"), "{told}");
    }
}

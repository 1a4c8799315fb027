//! The dynamics of a lens, measured with a camera.

use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, ManualClock, Moment, SystemClock};
use parfocal_devices::camera::{Camera, CameraError, CameraHealth, Frame, FrameImage};
use parfocal_devices::lens::emulator::Model;
use parfocal_devices::lens::{Lens, LensDynamics, Optics, SimulatedLens};
use parfocal_imaging::{Reconstructor, RgbImage};
use parfocal_pipeline::control::Eye;
use parfocal_pipeline::lens_measurement::{CameraView, Measurement, MeasurementError, Plan, measure};

use super::{emulator, open};

const SIDE: usize = 32;

/// Waits for a camera's next frame, in real time or by advancing the clock.
type Pause = Arc<dyn Fn(Duration) + Send + Sync>;

/// A camera that sees stripes, with a frame every `period`. Their contrast is a Gaussian of the focal power around 0.6.
struct Stripes {
    clock: Arc<dyn Clock>,
    optics: Arc<dyn Optics>,
    pause: Pause,
    period: Duration,
    due: Moment,
    number: u64,
    contrast: f64,
}

impl Camera for Stripes {
    fn next_frame(&mut self, _: Duration) -> Result<Frame, CameraError> {
        (self.pause)(self.due.since(self.clock.now()));
        let at = self.clock.now();
        self.due = at + self.period;
        self.number += 1;
        let off = (self.optics.focal_power_at(at).get() - 0.6) / 0.2;
        let swing = self.contrast * 100.0 * (-off * off).exp();
        let gray = |index: usize| (128.0 + if index % SIDE % 4 < 2 { swing } else { -swing }) as u8;
        let data = (0..SIDE * SIDE).flat_map(|index| [gray(index); 3]).collect();
        let image = FrameImage::Rgb(Arc::new(RgbImage::new(SIDE, SIDE, data).unwrap()));
        Ok(Frame { number: self.number, exposed_at: at, exposure: Duration::ZERO, image, truth: None })
    }

    fn health(&self) -> CameraHealth {
        let name = "stripes".into();
        CameraHealth { name, simulated: true, working: true, message: "".into(), fps: 0.0, lost: 0 }
    }
}

fn measured(
    lens: &mut dyn Lens,
    optics: Arc<dyn Optics>,
    (clock, pause): (Arc<dyn Clock>, Pause),
    contrast: f64,
    plan: Plan,
) -> Result<Measurement, MeasurementError> {
    let due = clock.now();
    let period = Duration::from_millis(20);
    let camera = Stripes { clock: clock.clone(), optics, pause: pause.clone(), period, due, number: 0, contrast };
    let eye = Eye::new(Reconstructor::default());
    measure(lens, &mut CameraView::new(Box::new(camera), eye, clock), plan, &*pause)
}

fn simulated(delay: u64, settling: u64, contrast: f64, plan: Plan) -> Result<Measurement, MeasurementError> {
    let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
    let dynamics = LensDynamics { delay: Duration::from_millis(delay), settling: Duration::from_millis(settling) };
    let mut lens = SimulatedLens::moving(dynamics, clock.clone());
    let moved = clock.clone();
    let pause: Pause = Arc::new(move |time| moved.advance(time));
    let optics = lens.optics();
    measured(&mut lens, optics, (clock, pause), contrast, plan)
}

#[test]
fn a_simulated_lens_is_measured_as_it_was_made() {
    for (delay, settling) in [(2_u32, 15_u32), (20, 60), (0, 100)] {
        let found = simulated(delay.into(), settling.into(), 1.0, Plan::default()).unwrap();
        let seen_delay = 1000.0 * found.both.delay;
        let seen_settling = 1000.0 * found.both.settling;
        // Within a millisecond, plus a tenth of the settling time, although the camera takes a frame only every 20 ms.
        assert!((seen_delay - f64::from(delay)).abs() < 1.0, "{seen_delay} for {delay}");
        assert!((seen_settling - f64::from(settling)).abs() < 1.0 + 0.1 * f64::from(settling), "{seen_settling}");
        // The simulated lens has a play of 0.004, so its two branches are 0.008 apart.
        assert!((found.hysteresis - 0.008).abs() < 0.002, "{}", found.hysteresis);
    }
}

#[test]
fn what_cannot_be_measured_says_why() {
    let message = |outcome: Result<Measurement, MeasurementError>| outcome.unwrap_err().to_string();
    assert!(message(simulated(2, 15, 0.0, Plan::default())).contains("fine texture"));
    let short = Plan { watch: Duration::from_millis(60), ..Plan::default() };
    assert!(message(simulated(30, 60, 1.0, short)).contains("watch for longer"));
}

#[test]
fn an_emulated_driver_is_measured_as_its_glass_moves() {
    let glass = LensDynamics { delay: Duration::from_millis(10), settling: Duration::from_millis(40) };
    let emulator = emulator(Model { glass, latency: Duration::ZERO, ..Model::default() });
    let mut lens = open(&emulator, "").unwrap();
    lens.set(FocalPower::MIDDLE).unwrap();
    let plan = Plan { stops: 11, repeats: 6, watch: Duration::from_millis(120) };
    let pause: Pause = Arc::new(std::thread::sleep);
    let found = measured(lens.as_mut(), emulator.glass(), (Arc::new(SystemClock), pause), 1.0, plan).unwrap();
    let delay = 1000.0 * found.both.delay;
    let settling = 1000.0 * found.both.settling;
    println!("10 ms and 40 ms were measured as {delay:.1} ms and {settling:.1} ms");
    // The transfer over the wire adds to the delay. A busy machine adds some milliseconds to both.
    assert!((7.0..25.0).contains(&delay), "{delay}");
    assert!((25.0..60.0).contains(&settling), "{settling}");
}

#[test]
fn the_command_line_measures_and_the_server_takes_what_it_found() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("lens");
    let lens = "simulated?delay=30&settling=90";
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args([
            "lens",
            "measure",
            "--lens",
            lens,
            "--camera",
            "phantom:still",
            "--fps",
            "20",
            "--repeats",
            "3",
            "--json",
        ])
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();

    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let millis = |key: &str| report[key].as_f64().unwrap();
    println!("30 ms and 90 ms were measured as {:.1} ms and {:.1} ms", millis("delay_ms"), millis("settling_ms"));
    assert!((15.0..45.0).contains(&millis("delay_ms")) && (60.0..130.0).contains(&millis("settling_ms")), "{report}");
    let kept = std::fs::read_to_string(out.join("dynamics.toml")).unwrap();
    assert!(kept.contains("driver = \"simulated\"") && kept.contains("settling_ms"), "{kept}");
    assert!(std::fs::read_to_string(out.join("steps.svg")).unwrap().contains("<polyline"));

    // The dynamics of another lens are rejected.
    let other = out.join("other.toml");
    std::fs::write(&other, kept.replace("serial = \"none\"", "serial = \"AREA0042\"")).unwrap();
    let refused = Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args(["serve", "--bind", "127.0.0.1:0", "--data-dir"])
        .arg(folder.path().join("data"))
        .arg("--lens-dynamics")
        .arg(&other)
        .output()
        .unwrap();

    assert_eq!(refused.status.code(), Some(1));
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(said.contains("belong to the lens AREA0042, but this one is none"), "{said}");
}

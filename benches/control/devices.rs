//! The loop on the bench's devices: Aravis's fake GigE Vision camera on the loopback, and the
//! Optotune driver on an emulated unit behind a pseudo-terminal.
//!
//! The end of the exposure is known from the camera's clock. The first packet leaves then. The transfer comes after it
//! and depends on the link. So it is shown separately, and the loop's own latency counts from the moment when the last
//! packet arrived.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment, SystemClock};
use parfocal_devices::camera::gige::GigeCamera;
use parfocal_devices::camera::{Camera, CameraError, CameraHealth, CameraSettings, Frame};
use parfocal_devices::lens::emulator::{Emulator, Model};
use parfocal_devices::lens::{self, Lens, LensDynamics, LensError, LensHealth, LensInfo, Optics};
use parfocal_pipeline::control::LatencyFigures;

use crate::fake_camera::{FakeCamera, NAME};
use crate::watch_loop;

/// Steps that are left out, until the camera's clock is known well.
const WARM_UP: usize = 50;
const STEPS: usize = 750;

/// When the last packet of each frame arrived, by frame number.
type Arrivals = Arc<Mutex<HashMap<u64, Moment>>>;
/// When each command was given to the driver.
type Commands = Arc<Mutex<Vec<Moment>>>;

/// Prints the figures at the paper's size: the deepest pixels at 25 frames a second, and 50 frames a second.
pub fn measure() {
    let Some(_camera) = FakeCamera::start() else { return };
    for (format, fps) in [("Mono16", 25.0), ("Mono8", 50.0)] {
        scenario(format, fps);
    }
}

fn scenario(format: &str, fps: f64) {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let emulator = Emulator::start(Model::default(), clock.clone()).expect("starts");
    let driver = lens::open(&format!("optotune:{}", emulator.path().display()), clock.clone()).expect("connects");
    let settings = CameraSettings { fps, seed: 0, optics: emulator.glass(), clock };
    let camera = GigeCamera::open(&format!("{NAME}?format={format}"), settings).expect("connects");
    let arrivals = Arrivals::default();
    let commands = Commands::default();
    let lens = Box::new(Timed { lens: driver, commands: commands.clone() });
    let camera = Box::new(Watched { camera, arrivals: arrivals.clone() });
    let mut records = watch_loop(camera, lens, fps, WARM_UP + STEPS);
    let records = records.split_off(WARM_UP);
    let first = records.first().map_or(0, |record| record.frame);
    let frames = records.last().map_or(0, |record| record.frame) + 1 - first;
    println!(
        "loop/gige     2048x1088 {format}, {} steps at {fps} a second, {} frames lost; µs:",
        records.len(),
        frames - records.len() as u64
    );

    let arrivals = arrivals.lock().expect("no panic");
    let at = |micros: u32, from: Moment| from + Duration::from_micros(micros.into());
    let timed = || records.iter().filter_map(|record| Some((record, *arrivals.get(&record.frame)?)));
    let commanded = timed().map(|(record, whole)| at(record.latency_micros, record.exposed_at).since(whole));
    print("last packet in to lens command", commanded);
    print("first packet in to last", timed().map(|(record, whole)| whole.since(record.exposed_at)));
    let micros = |micros: u32| Duration::from_micros(micros.into());
    print("first packet in to lens command", records.iter().map(|record| micros(record.latency_micros)));
    print("lens command to the wire's far end", to_wire(&commands.lock().expect("no panic"), &emulator.commands()));
}

/// Time from each command to the moment when the unit read it. A command that was overtaken by the next one was never
/// sent.
fn to_wire(given: &[Moment], read: &[(Moment, i16)]) -> impl Iterator<Item = Duration> {
    given.iter().enumerate().filter_map(move |(index, &at)| {
        let next = given.get(index + 1).copied().unwrap_or(Moment::from_nanos(u64::MAX));
        let there = read.iter().map(|&(moment, _)| moment).find(|&moment| moment >= at)?;
        (there < next).then(|| there.since(at))
    })
}

fn print(what: &str, times: impl Iterator<Item = Duration>) {
    let mut micros: Vec<u32> = times.map(|time| u32::try_from(time.as_micros()).unwrap_or(u32::MAX)).collect();
    let LatencyFigures { steps, p50, p99 } = LatencyFigures::of(&mut micros);
    println!("  {what:<35} p50 {p50:>6}  p99 {p99:>6}  worst {:>6}  of {steps}", micros.last().unwrap_or(&0));
}

/// A camera that notes when each frame is complete.
struct Watched {
    camera: GigeCamera,
    arrivals: Arrivals,
}

impl Camera for Watched {
    fn next_frame(&mut self, timeout: Duration) -> Result<Frame, CameraError> {
        let frame = self.camera.next_frame(timeout)?;
        if let Some(whole_at) = self.camera.whole_at() {
            self.arrivals.lock().expect("no panic").insert(frame.number, whole_at);
        }
        Ok(frame)
    }

    fn health(&self) -> CameraHealth {
        self.camera.health()
    }

    fn mosaic_size(&self) -> Option<(usize, usize)> {
        self.camera.mosaic_size()
    }
}

/// A lens that notes when each command is given.
struct Timed {
    lens: Box<dyn Lens>,
    commands: Commands,
}

impl Lens for Timed {
    fn set(&mut self, target: FocalPower) -> Result<(), LensError> {
        self.commands.lock().expect("no panic").push(SystemClock.now());
        self.lens.set(target)
    }

    fn measured(&self) -> Option<FocalPower> {
        self.lens.measured()
    }

    fn health(&self) -> LensHealth {
        self.lens.health()
    }

    fn info(&mut self) -> Result<LensInfo, LensError> {
        self.lens.info()
    }

    fn dynamics(&self) -> LensDynamics {
        self.lens.dynamics()
    }

    fn optics(&self) -> Arc<dyn Optics> {
        self.lens.optics()
    }
}

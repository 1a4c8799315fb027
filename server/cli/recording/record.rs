//! `parfocal recording record`: runs camera, lens and control loop without a server, and stores every frame.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use indicatif::ProgressBar;

use crate::cli::input::{frame_rate, frame_rate_help};
use crate::cli::interrupt::{Interrupt, let_lenses_go_first_at_sigquit};
use crate::cli::output::{Failure, print, word};
use parfocal_autofocus::Registry;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::files::remove;
use parfocal_base::{PolicyName, SOFTWARE, notices};
use parfocal_devices::camera::{self, CameraSettings, calibration};
use parfocal_devices::lens::{self, LensHealth};
use parfocal_imaging::{Calibration, Reconstructor};
use parfocal_pipeline::control::{self, Command, ControlHandle, ControlLoop, Drive, LoopSettings, Rig};
use parfocal_recording::{
    CALIBRATION, Ended, FORMAT, Header, Recorder, RecordingError, RecordingProgress, VERSION, Writer,
};

/// Time between two checks whether to stop.
const TICK: Duration = Duration::from_millis(20);
/// Longest wait for the first or next frame.
const PATIENCE: Duration = Duration::from_secs(10);
/// Most seconds that can be asked for: 115 days.
const LONGEST: f64 = 1e7;

/// Arguments of `parfocal recording record`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording; it must not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seconds to record; until Ctrl-C if left out.
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
    /// Camera, as for `parfocal serve`: one with a hyperspectral sensor.
    #[arg(long, value_name = "SPEC", default_value = "phantom")]
    camera: String,
    /// Lens, as for `parfocal serve`.
    #[arg(long, value_name = "SPEC", default_value = "simulated")]
    lens: String,
    /// Policy that focuses meanwhile; without one the lens stays where it is.
    #[arg(long, value_name = "NAME")]
    policy: Option<String>,
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = frame_rate(), help = frame_rate_help())]
    fps: u32,
    /// Seed of simulated devices.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Calibration of the sensor: a TOML file, or a folder of `parfocal calibrate`; a typical unit's by default.
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
}

/// Records until the time is up, Ctrl-C, or a failure.
///
/// # Errors
/// If the folder exists, a device fails, or the disk is full; what was recorded before is kept.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.out.exists() {
        return Err(RecordingError::Exists(arguments.out.clone()).into());
    }

    let interrupt = Interrupt::listen("storing the last frames".to_owned())?;
    interrupt.ask_at_hangup()?;
    let_lenses_go_first_at_sigquit()?;
    control::keep_policies_quiet();

    let (control_loop, control, recorder) = start(arguments)?;
    control.tap.connect(recorder.intake());
    let outcome = watch(arguments, &interrupt, &control, &recorder);

    control.tap.disconnect();
    // First, because a disk that hangs must not keep the lens under current.
    control_loop.stop();
    let progress = recorder.stop();
    if progress.frames == 0 {
        // It would only be in the way of the next attempt.
        remove(&arguments.out);
    }
    outcome?;
    tell(arguments, &progress)
}

fn start(arguments: &Arguments) -> Result<(ControlLoop, ControlHandle, Recorder), Failure> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let own = camera::own_calibration(&arguments.camera);
    let calibration = calibration::read_or_default(arguments.calibration.as_deref().or(own.as_deref()))?;

    let registry = Registry::standard();
    let policy = arguments.policy.as_deref().map(PolicyName::new);
    if let Some(name) = &policy {
        registry.build(name)?;
    }

    let lens = lens::open(&arguments.lens, Arc::clone(&clock))?;
    let settings = CameraSettings {
        fps: arguments.fps.into(),
        seed: arguments.seed,
        optics: lens.optics(),
        clock: Arc::clone(&clock),
    };
    let camera = camera::open(&arguments.camera, settings)?;
    let size = camera.mosaic_size().ok_or_else(|| colour(&arguments.camera))?;
    calibration::check_camera(&calibration, Some(size))?;

    let began = clock.now();
    let header = Header {
        format: FORMAT.to_owned(),
        version: VERSION,
        software: SOFTWARE.to_owned(),
        started: clock.wall(),
        camera: camera.health().name.to_string(),
        lens: lens.health().name.to_string(),
        simulated: camera.health().simulated || lens.health().simulated,
        calibration: calibration.title(),
        camera_settings: camera.controls().map(|controls| controls.offered().by_name()).unwrap_or_default(),
        session: None,
        run: None,
        monotonic_ns: None,
        frames_lost: 0,
        ended: None,
    };
    let recorder = recorder(arguments, header, size, &calibration, began)?;

    let rig = Rig { camera, lens, reconstructor: Reconstructor::new(&calibration), registry, clock };
    let frame_period = Duration::from_secs(1) / arguments.fps;
    let (control_loop, control, _) =
        ControlLoop::spawn(LoopSettings { frame_period, telemetry_capacity: 1, dynamics: None }, rig)?;

    if let Some(name) = policy {
        let drive = Drive::Policy { name, start: None };
        control.send(Command::Drive { drive, segment: None });
    }
    Ok((control_loop, control, recorder))
}

fn recorder(
    arguments: &Arguments,
    header: Header,
    size: (usize, usize),
    calibration: &Calibration,
    began: parfocal_base::clock::Moment,
) -> Result<Recorder, Failure> {
    let writer = Writer::create(&arguments.out, header, size, calibration)?;
    calibration::save(&arguments.out.join(CALIBRATION), calibration, &[]).inspect_err(|_| remove(&arguments.out))?;
    Ok(Recorder::start(writer, began)?)
}

fn colour(camera: &str) -> String {
    format!("the camera {camera} delivers colour pictures; a recording holds the mosaics of a hyperspectral sensor")
}

/// Waits until it is time to stop.
fn watch(
    arguments: &Arguments,
    interrupt: &Interrupt,
    control: &ControlHandle,
    recorder: &Recorder,
) -> Result<(), Failure> {
    let spinner = ProgressBar::new_spinner();
    let clock = SystemClock;
    // Of a disk that hangs, frames are lost; only the camera can keep both numbers from rising.
    let mut seen = ((0, 0), clock.now());
    let mut first = None;
    let mut lens_worked = true;

    loop {
        std::thread::sleep(TICK);
        let lens = control.status.borrow().lens.clone();
        if lens.working != lens_worked {
            lens_worked = lens.working;
            spinner.suspend(|| report(&lens));
        }

        let progress = recorder.progress();
        let now = clock.now();
        spinner.set_message(format!("{} frames, {} lost", progress.frames, progress.lost));
        spinner.tick();

        let taken = (progress.frames, progress.lost);
        if taken != seen.0 {
            seen = (taken, now);
            first = first.or(Some(now));
        }

        let time_is_up = arguments.seconds.zip(first).is_some_and(|(limit, first)| now.since(first) >= limit);
        if time_is_up || interrupt.asked() || progress.ended.is_some() {
            spinner.finish_and_clear();
            return Ok(());
        }
        if now.since(seen.1) > PATIENCE {
            let message = control.status.borrow().camera.message.clone();
            bail!("no frame comes from the camera {}: {message}", arguments.camera);
        }
    }
}

/// Reports that the lens stopped working, or works again. The recording alone shows only that the focus stays the same.
fn report(lens: &LensHealth) {
    if lens.working {
        notices::tell("the lens works again");
    } else {
        notices::tell(format!("the lens stays where it is, and recording goes on: {}", lens.message));
    }
}

fn tell(arguments: &Arguments, progress: &RecordingProgress) -> Result<(), Failure> {
    let out = arguments.out.display();
    let lost = match progress.lost {
        0 => String::new(),
        lost => format!(" ({lost} lost: this machine or its disk is too slow)"),
    };
    let done = match progress.frames {
        0 => format!("no frame was recorded{lost}"),
        frames => format!("{frames} frames in {out}{lost}"),
    };

    match &progress.ended {
        Some(Ended::DiskNearlyFull) => {
            Err(format!("stopped, because the disk of {out} is nearly full; free some space: {done}").into())
        }
        Some(Ended::Failed(problem)) => Err(format!("{problem}: {done}").into()),
        Some(Ended::Stopped) | None if progress.frames == 0 => print(&format!("{done}\n")),
        Some(Ended::Stopped) | None => {
            let named = word(&arguments.out);
            print(&format!("{done}; check them with `parfocal recording info {named}`\n"))
        }
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && *seconds <= LONGEST);
    seconds
        .map(Duration::from_secs_f64)
        .ok_or_else(|| format!("must be a number of seconds above 0, at most {LONGEST}"))
}

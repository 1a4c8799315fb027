//! `parfocal scan record`: records from the phantom, held still at each pose, or from a bench of camera, lens and
//! stepper.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use indicatif::ProgressBar;

use crate::cli::input::{hear_lines, whole_number};
use crate::cli::interrupt::{Interrupt, let_lenses_go_first_beside_an_interrupt};
use crate::cli::output::{Failure, bar_of_poses, poses, print, stored};
use parfocal_base::clock::SystemClock;
use parfocal_base::notices::tell;
use parfocal_devices::camera::recorded::{Header, MOST_POSES, PictureOrder, ScanRecording};
use parfocal_devices::camera::{self, CameraSettings, calibration};
use parfocal_devices::lens;
use parfocal_devices::simulation::phantom::Trajectory;
use parfocal_imaging::{Calibration, Reconstructor};
use parfocal_learning::scans::benchmark::SEED;
use parfocal_learning::scans::recorded::{FOCAL_POWERS, HASTE, POSES, evenly_spread};
use parfocal_learning::scans::recording::{Devices, PhantomPoses, PoseSource, RecordError, Stepper, record};

/// Arguments of `parfocal scan record`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the scan: a new one, or one that the same command began.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Camera, as for `parfocal serve`. `phantom` without a lens holds still at each pose of a hand-held trajectory.
    #[arg(long, value_name = "SPEC", default_value = "phantom")]
    camera: String,
    /// Lens that moves to each focal power, as for `parfocal serve`.
    #[arg(long, value_name = "SPEC")]
    lens: Option<String>,
    /// Shell command that moves the camera to pose number `{pose}` and exits with 0 when it is there. Without it,
    /// parfocal asks you to move the camera and press Enter.
    #[arg(long, value_name = "COMMAND", requires = "lens")]
    stepper: Option<String>,
    /// Number of poses.
    #[arg(long, value_name = "N", default_value_t = POSES, value_parser = whole_number(1..=MOST_POSES))]
    poses: usize,
    /// Number of focal powers, evenly spaced over the range of the lens.
    #[arg(long, value_name = "N", default_value_t = FOCAL_POWERS, value_parser = whole_number(2..=1001))]
    focal_powers: usize,
    /// Seed of the order of the focal powers, and of the whole simulation.
    #[arg(long, value_name = "N", default_value_t = SEED)]
    seed: u64,
    /// Frame rate to request from the camera, per second.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: u32,
    /// Calibration of the sensor: a TOML file, or a folder of `parfocal calibrate`; a typical unit's by default.
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
}

/// Records until all poses are stored, Ctrl-C, or a failure.
///
/// # Errors
/// If something fails; the poses before it are kept.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::listen("stopping after this pose".to_owned())?;
    let progress = bar_of_poses(arguments.poses);

    let (mut source, header) = match &arguments.lens {
        None if arguments.camera == "phantom" => phantom(arguments),
        None => Err(format!("name the lens in front of `{}` with --lens", arguments.camera).into()),
        Some(lens) => devices(arguments, lens, &interrupt, &progress),
    }?;

    let mut recording = ScanRecording::open(&arguments.out, &header)?;
    progress.set_position(recording.folder().poses().len() as u64);
    progress.reset_eta();

    let outcome = record(&mut recording, source.as_mut(), &|| interrupt.asked(), &|| progress.inc(1));
    progress.finish_and_clear();
    let done = recording.folder().poses().len();
    let out = arguments.out.display();

    match outcome {
        Ok(()) => print(&stored(&poses(done), &arguments.out)),
        // Ctrl-C also interrupts the stepper's command.
        Err(RecordError::Stopped | RecordError::Stepper(_)) if interrupt.asked() => print(&format!(
            "stopped: {done} of {} poses are saved in {out}; run the same command again to continue\n",
            arguments.poses
        )),
        Err(RecordError::Folder(error)) => Err(error.into()),
        Err(error) => Err(format!("{error} ({done} of {} poses are saved in {out})", arguments.poses).into()),
    }
}

fn phantom(arguments: &Arguments) -> Result<(Box<dyn PoseSource>, Header), Failure> {
    if arguments.calibration.is_some() {
        bail!("the phantom's sensor needs no calibration: leave out --calibration, or give a --lens");
    }

    let trajectory = Trajectory::new(arguments.seed, arguments.poses, HASTE);
    let header = header(arguments, "brain phantom, held still at each pose (simulated)", None, true);
    Ok((Box::new(PhantomPoses::new(trajectory)), header))
}

fn devices(
    arguments: &Arguments,
    lens: &str,
    interrupt: &Interrupt,
    progress: &ProgressBar,
) -> Result<(Box<dyn PoseSource>, Header), Failure> {
    let calibration = arguments.calibration.as_deref().map(calibration::read).transpose()?;
    let clock = Arc::new(SystemClock);
    let_lenses_go_first_beside_an_interrupt()?;
    let lens = lens::open(lens, Arc::clone(&clock) as _)?;
    let settings = CameraSettings {
        fps: arguments.fps.into(),
        seed: arguments.seed,
        optics: lens.optics(),
        clock: Arc::clone(&clock) as _,
    };

    let camera = camera::open(&arguments.camera, settings)?;
    if let Some(calibration) = &calibration {
        calibration::check_camera(calibration, camera.mosaic_size())?;
    }

    let stepper = match &arguments.stepper {
        Some(command) => Stepper::Command(command.clone()),
        None => Stepper::Asked(Box::new(asker(arguments.poses, interrupt.clone(), progress.clone()))),
    };

    let health = camera.health();
    let simulated = camera.health().simulated || lens.health().simulated;
    let mut header = header(arguments, &health.name, Some(lens.health().name.to_string()), simulated);
    header.calibration = calibration.as_ref().map(Calibration::title);
    let reconstructor = Reconstructor::new(&calibration.unwrap_or_default());
    Ok((Box::new(Devices { camera, lens, reconstructor, stepper, clock }), header))
}

fn header(arguments: &Arguments, camera: &str, lens: Option<String>, simulated: bool) -> Header {
    let powers = evenly_spread(arguments.focal_powers);
    let header = Header::new(camera, arguments.seed, arguments.poses, powers);
    Header { lens, simulated, order: PictureOrder::Random, ..header }
}

/// Asks on the terminal for each pose and waits for Enter.
fn asker(poses: usize, interrupt: Interrupt, progress: ProgressBar) -> impl FnMut(usize) -> Result<(), String> + Send {
    let (sender, lines) = channel();
    hear_lines(move |line| sender.send(line).is_ok());
    let typed = std::io::stdin().is_terminal();

    move |pose| {
        // An Enter from before the question (a bouncing key, or one pressed too early) does not answer it.
        while typed && lines.try_recv().is_ok() {}
        progress.suspend(|| tell(format_args!("pose {pose} of {poses}: move the camera there, then press Enter")));
        loop {
            match lines.recv_timeout(Duration::from_millis(100)) {
                Ok(_) => return Ok(()),
                Err(RecvTimeoutError::Disconnected) => {
                    bail!("nobody confirmed pose {pose}: the input has ended; use --stepper if nobody can press Enter")
                }
                Err(RecvTimeoutError::Timeout) if interrupt.asked() => bail!("stopped before pose {pose}"),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

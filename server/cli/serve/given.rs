//! What `serve` was given, looked at before it takes its port. Everything that is wrong is reported at once.

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;

use tokio::net::TcpListener;

use super::arguments::Arguments;
use crate::cli::library::protocols;
use crate::cli::output::Failure;
use crate::cli::policy_process;
use parfocal_autofocus::{Registry, shipped};
use parfocal_base::PolicyName;
use parfocal_base::clock::Clock;
use parfocal_base::files::is_new_or_empty;
use parfocal_dashboard::http::keys::Keys;
use parfocal_dashboard::tls::Certificates;
use parfocal_devices::camera::{self, CameraSettings, calibration};
use parfocal_devices::lens::{self, LensHealth, MeasuredDynamics, Optics};
use parfocal_imaging::{Calibration, Developer};
use parfocal_pipeline::control::Rig;
use parfocal_records::store::LockedFolder;
use parfocal_session::conductor::Library;

/// What the server starts with: read, opened and checked.
pub(super) struct Given {
    /// The data folder.
    pub folder: LockedFolder,
    /// The roles' keys.
    pub keys: Keys,
    /// The certificates; `None` without TLS.
    pub certificates: Option<Arc<Certificates>>,
    /// The sensor's calibration.
    pub calibration: Arc<Calibration>,
    /// Makes pictures by that calibration.
    pub developer: Developer,
    /// The protocols.
    pub library: Library,
    /// Camera, lens and policies.
    pub rig: Rig,
    /// How a lens moves, if that was measured.
    pub dynamics: Option<MeasuredDynamics>,
    /// The port. Early visitors wait in its queue.
    pub listener: TcpListener,
    /// The port of OpenIGTLink, if it is on.
    pub navigation: Option<TcpListener>,
}

/// What is wrong with that which was given.
#[derive(Default)]
struct Problems(Vec<String>);

impl Problems {
    /// The value of `outcome`; its error is kept, to be reported with the others.
    fn keep<T>(&mut self, outcome: Result<T, impl Into<Failure>>) -> Option<T> {
        outcome.map_err(|error| self.0.push(error.into().to_string())).ok()
    }

    /// All problems in one message.
    fn into_failure(self) -> Failure {
        match <[String; 1]>::try_from(self.0) {
            Ok([only]) => only.into(),
            Err(all) => format!("the server cannot start, for {} reasons:\n- {}", all.len(), all.join("\n- ")).into(),
        }
    }
}

/// Looks at everything that `arguments` name, opens the devices and then takes the port. `seed` is for simulated
/// devices.
///
/// # Errors
/// If something cannot be used. The error names everything that cannot.
pub(super) async fn look(arguments: &Arguments, clock: &Arc<dyn Clock>, seed: u64) -> Result<Given, Failure> {
    // Decided before anything is made or opened.
    arguments.encryption.check(arguments.bind)?;

    let mut problems = Problems::default();
    let registry = registry(arguments, clock, &mut problems);
    let library = problems.keep(protocols(arguments.protocols.as_deref(), &registry));

    let dynamics = arguments.lens_dynamics.as_deref().and_then(|path| problems.keep(measured(path)));
    let lens = problems.keep(lens::open_or_await(&arguments.lens, Arc::clone(clock)));
    let optics = lens.as_ref().map_or_else(|| stand_in(clock), |lens| Ok(lens.optics()))?;
    let settings = CameraSettings { fps: arguments.fps.into(), seed, optics, clock: Arc::clone(clock) };
    let camera = problems.keep(camera::open_or_await(&arguments.camera, settings));

    // A camera that cannot be opened is reported once, and not again by the calibration that comes with it.
    let own = camera::own_calibration(&arguments.camera).filter(|_| camera.is_some());
    let path = arguments.calibration.as_deref().or(own.as_deref());
    let calibration = problems.keep(calibration::read_or_default(path)).map(Arc::new);
    if let (Some(calibration), Some(camera)) = (&calibration, &camera) {
        problems.keep(calibration::check_camera(calibration, camera.mosaic_size()));
    }

    if let (Some(path), Some(measured), Some(lens)) = (&arguments.lens_dynamics, &dynamics, &lens) {
        problems.keep(check_lens(path, measured, &lens.health()));
    }

    // After everything that only reads: a server that cannot start leaves the port alone.
    let listener = TcpListener::bind(arguments.bind).await.map_err(|error| cannot_listen(arguments.bind, &error));
    let listener = problems.keep(listener);
    let navigation = problems.keep(arguments.navigation.listen().await);

    // A start that fails makes no new folder, and nothing in an empty one.
    let is_due = problems.0.is_empty() || is_used(&arguments.data_dir);
    let folder = if is_due { problems.keep(LockedFolder::of(&arguments.data_dir)) } else { None };
    let keys = folder.as_ref().and_then(|_| problems.keep(Keys::load_or_create(&arguments.data_dir)));
    let certificates = problems.keep(certificates(arguments, folder.is_some(), clock));

    // Without a problem, everything is there.
    let given = || {
        let calibration = calibration?;
        let developer = Developer::new(&calibration);
        let reconstructor = developer.reconstructor().clone();
        Some(Given {
            folder: folder?,
            keys: keys?,
            certificates: certificates?.map(Arc::new),
            rig: Rig { camera: camera?, lens: lens?, reconstructor, registry, clock: Arc::clone(clock) },
            calibration,
            developer,
            library: library?,
            dynamics,
            listener: listener?,
            navigation: navigation?,
        })
    };
    match given() {
        Some(given) if problems.0.is_empty() => Ok(given),
        _ => Err(problems.into_failure()),
    }
}

/// The policies that ship, those from files and those in other processes. Each of the latter two is built once, to check
/// it. A policy that cannot be used stays in the list, so that protocols are not reported for naming it.
fn registry(arguments: &Arguments, clock: &Arc<dyn Clock>, problems: &mut Problems) -> Registry {
    let mut registry = Registry::standard().knowing(arguments.blur);
    if let Some(folder) = &arguments.weights {
        registry = problems.keep(shipped::with_folder(registry.clone(), folder)).unwrap_or(registry);
    }

    for name in arguments.policies.iter().map(|name| PolicyName::new(name)) {
        registry = policy_process::with_outside(registry, &name, &policy_process::for_serving(clock));
        problems.keep(registry.build(&name));
    }
    registry
}

/// Whether there is something at `folder` besides an empty folder.
fn is_used(folder: &Path) -> bool {
    !is_new_or_empty(folder).unwrap_or(false)
}

/// The certificates; none without TLS. A local authority is kept in the data folder, so that must be `locked`.
fn certificates(arguments: &Arguments, locked: bool, clock: &Arc<dyn Clock>) -> Result<Option<Certificates>, Failure> {
    let encryption = &arguments.encryption;
    if locked || encryption.is_given() {
        encryption.certificates(&arguments.data_dir, arguments.bind.ip(), clock)
    } else {
        Ok(None)
    }
}

/// Optics for a camera whose lens could not be opened, so that the camera's own problems are found too.
fn stand_in(clock: &Arc<dyn Clock>) -> Result<Arc<dyn Optics>, Failure> {
    Ok(lens::open("simulated", Arc::clone(clock))?.optics())
}

/// Reads measured lens dynamics from the file `path`.
fn measured(path: &Path) -> Result<MeasuredDynamics, Failure> {
    let named = |problem: String| format!("lens dynamics {}: {problem}", path.display());
    let text = std::fs::read_to_string(path).map_err(|error| named(error.to_string()))?;
    Ok(MeasuredDynamics::from_toml(&text).map_err(named)?)
}

/// Checks that the dynamics in the file `path` were `measured` on the lens of this health. One that is not there yet may
/// be that lens.
fn check_lens(path: &Path, measured: &MeasuredDynamics, health: &LensHealth) -> Result<(), Failure> {
    match &health.info {
        Some(info) if info.serial != measured.serial => bail!(
            "lens dynamics {}: they belong to the lens {}, but this one is {}; measure it with `parfocal lens measure`",
            path.display(),
            measured.serial,
            info.serial
        ),
        _ => Ok(()),
    }
}

fn cannot_listen(address: SocketAddr, error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::AddrInUse => {
            format!("{address} is in use by another program; stop it, or choose another address with --bind")
        }
        ErrorKind::AddrNotAvailable => {
            format!("this machine does not have the address {address}; choose another with --bind")
        }
        _ => format!("cannot listen on {address}: {error}; choose another address with --bind"),
    }
}

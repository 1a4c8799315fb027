//! `parfocal serve`: wires camera, lens, control loop, trial and pages together and serves the pages.

mod arguments;
mod given;
mod navigation;
mod upkeep;

use std::io::{IsTerminal, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use getrandom::SysRng;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use tokio::net::TcpListener;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::timeout;
use tracing_subscriber::EnvFilter;

pub use self::arguments::Arguments;
use self::given::Given;
use self::upkeep::keep_up;
use super::announce::announcement;
use super::output::Failure;
use parfocal_autofocus::Registry;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::priority;
use parfocal_dashboard::health::HealthWatch;
use parfocal_dashboard::health::device_log;
use parfocal_dashboard::http::{self, App, Equipment, OpenTablets, ServerAddress, TabletTrials};
use parfocal_dashboard::tls::{Certificates, keep_current};
use parfocal_imaging::{Calibration, Developer, Reconstructor, Size};
use parfocal_pipeline::control::{self, Command, ControlLoop, ControlStatus, Drive, Eye, LoopSettings};
use parfocal_pipeline::{live, openigtlink};
use parfocal_recording as recording;
use parfocal_records::accounts::{Accounts, Cost};
use parfocal_records::store::{self, Backups, LockedFolder, Store, telemetry};
use parfocal_results::study_export::StudyExports;
use parfocal_session::conductor::{Conductor, ConductorParts};
use parfocal_session::playback::Player;
use parfocal_session::recorder::{self, Recordings};
use parfocal_session::reports::Reports;

/// Telemetry records that may wait for the disk: 15 s at 50 frames per second.
const TELEMETRY_CAPACITY: usize = 750;

/// The text at the end of `--help`.
pub const REAL_TIME: &str = "\
Real-time priority:
  Where the system allows it, the threads from camera to lens run before all other programs and their memory is locked,
  so that a busy machine does not delay the focus. The operator's page says whether they do. Root has the right. To
  give it to another USER, write this into /etc/security/limits.d/parfocal.conf, and log in again:
    USER  -  rtprio   40
    USER  -  memlock  unlimited
  A systemd service needs LimitRTPRIO=40 and LimitMEMLOCK=infinity, a container the capabilities SYS_NICE and
  IPC_LOCK.";

/// Time for open connections to end by themselves. The disk then gets as long again to take what is left.
const GRACE: Duration = Duration::from_millis(700);

/// Time for the disk to take the rest of a recording.
const RECORDING: Duration = Duration::from_secs(3);

/// Time for lens and camera to stop.
const DEVICES: Duration = Duration::from_secs(5);

/// Serves until Ctrl-C, SIGTERM or the end of the terminal.
///
/// # Errors
/// If the address is taken, or a folder, camera or lens cannot be used. The error names everything that is wrong.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    // Log through a queue: a paused terminal, or a pipe that nobody reads, must not block the control loop when it logs
    // a line. Lines that do not fit are dropped.
    let (writer, flush) = tracing_appender::non_blocking(std::io::stderr());
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::try_from_default_env().unwrap_or_else(|_| "info,sqlx=warn".into()))
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(writer)
        .init();

    // Everything that the server writes is trial data, so only this user may read it.
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
    control::keep_policies_quiet();

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let outcome = runtime.block_on(serve(arguments));

    // A thread that hangs must not keep the process from ending.
    runtime.shutdown_background();
    drop(flush);
    outcome
}

async fn serve(arguments: &Arguments) -> Result<(), Failure> {
    let mut signals = Signals::new()?;
    bound_real_time()?;
    if !priority::lock_memory() {
        tracing::debug!("memory is not locked; `parfocal serve --help` says how to allow it");
    }

    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let mut seeded = seeded(arguments)?;
    let mut given = given::look(arguments, &clock, seeded.random()).await?;
    let navigation = given.navigation.take();
    let Given { folder, keys, certificates, calibration, developer, library, rig, dynamics, listener, .. } = given;
    let address = listener.local_addr()?;

    let registry = rig.registry.clone();
    let store = open_store(arguments, folder, &calibration, &registry, clock.as_ref()).await?;
    let settings = certificates.as_ref().map(Certificates::settings).transpose()?;
    keep_in_time(certificates.as_ref(), &clock);

    let mosaics = rig.camera.mosaic_size();
    let frame_period = Duration::from_secs(1) / arguments.fps;

    let (control_loop, control, records) =
        ControlLoop::spawn(LoopSettings { frame_period, telemetry_capacity: TELEMETRY_CAPACITY, dynamics }, rig)?;

    let writer = tokio::spawn(telemetry::run_writer(store.clone(), records));
    log_devices(&store, &clock, &control.status);

    let onlooking = (Eye::new(Reconstructor::new(&calibration)), registry.clone());
    let (live, imaging) = live::start(control.clone(), &developer, largest_size(mosaics), onlooking, &clock)?;

    let conductor = Conductor::open(ConductorParts {
        store: store.clone(),
        control: control.clone(),
        library: library.clone(),
        registry: registry.clone(),
        clock: Arc::clone(&clock),
        random: ChaCha12Rng::try_from_rng(&mut SysRng)?,
        practice_random: seeded,
    })
    .await?;

    let folder = arguments.data_dir.join(recording::FOLDER);
    let reports = Reports::open(&store, Arc::clone(&clock)).await?;
    let player = Player::new(reports.clone(), folder.clone())?;
    let recordings = Recordings::new(recorder::RecorderParts {
        clock: Arc::clone(&clock),
        run: store.run(),
        tap: control.tap.clone(),
        status: control.status.clone(),
        controls: control.camera.clone(),
        live: live.clone(),
        conductor: conductor.clone(),
        folder,
        calibration: Calibration::clone(&calibration),
        size: mosaics,
    });

    let health = HealthWatch::new(Arc::clone(&clock), control.status.clone(), conductor.operator_view(), store.clone());
    let watching = keep_up("what watches the health of the server", &health, HealthWatch::run);

    let mut conducting = tokio::spawn(conductor.clone().run());
    let recording = keep_up("what begins and ends recordings", &recordings, Recordings::run);
    let ending = conductor.clone();
    let (end, shutdown) = watch::channel(false);

    let address = ServerAddress::new(address, certificates);
    let app = Arc::new(App {
        accounts: Accounts::of_server(&store, Arc::clone(&clock), Cost::default()),
        clock,
        study_exports: StudyExports::new(&arguments.data_dir),
        backups: Backups::new(&arguments.data_dir),
        live,
        store: store.clone(),
        health,
        recordings: recordings.clone(),
        player,
        surgeon_view: conductor.surgeon_view(),
        operator_view: conductor.operator_view(),
        conductor,
        reports,
        library,
        registry,
        keys: keys.clone(),
        address: address.clone(),
        equipment: Equipment::new(Arc::clone(&calibration), mosaics),
        tablets: OpenTablets::default(),
        tablet_trials: TabletTrials::default(),
        metrics: http::Metrics::default(),
        shutdown,
        control: control.observer(),
    });

    let linked = link(arguments, navigation, &app, control.status.clone(), developer)?;
    let server = tokio::spawn(http::run(listener, app, settings));

    // A copy: the loop waits for whoever holds its status.
    let status = Arc::clone(&control.status.borrow());
    let announcement = announcement(&address, &keys, &status, &calibration, linked, std::io::stdout().is_terminal());

    // The server serves whether or not anyone reads the announcement.
    let _ = std::io::stdout().write_all(announcement.as_bytes());

    let outcome = end_of_serving(&mut signals, &mut conducting).await;
    tracing::info!("ending");

    // Hold the lens at once, because viewers may take their time to leave.
    control.send(Command::Drive { drive: Drive::Hold { at: None }, segment: None });
    let _ = end.send(true);
    let _ = timeout(GRACE, async { (server.await, end.closed().await) }).await;

    conducting.abort();
    recording.abort();
    watching.abort();
    end_recording_and_devices(&recordings, control_loop, imaging).await;
    let _ = timeout(GRACE, store_the_rest(&store, &ending, writer)).await;

    outcome
}

/// Waits until the server is to end.
///
/// # Errors
/// If `conducting`, which keeps sessions' time limits, has failed. Nobody would notice otherwise, and a service manager
/// starts the server again.
async fn end_of_serving(signals: &mut Signals, conducting: &mut JoinHandle<()>) -> Result<(), Failure> {
    tokio::select! {
        () = signals.any() => Ok(()),
        _ = conducting => Err("what keeps the time limits of sessions has failed; the log says why".into()),
    }
}

/// Gives the picture to OpenIGTLink's clients, if that is on. Returns its address.
fn link(
    arguments: &Arguments,
    listener: Option<TcpListener>,
    app: &Arc<App>,
    status: watch::Receiver<Arc<ControlStatus>>,
    developer: Developer,
) -> std::io::Result<Option<SocketAddr>> {
    let Some(listener) = listener else { return Ok(None) };
    let address = listener.local_addr()?;

    let (live, clock, shutdown) = (app.live.clone(), Arc::clone(&app.clock), app.shutdown.clone());
    let app = Arc::clone(app);
    let blinded = Box::new(move || app.blinded());
    let source = openigtlink::LinkSource { live, status, developer, blinded, clock, shutdown };
    let settings = arguments.navigation.settings();
    tokio::spawn(async move {
        if let Err(error) = openigtlink::run(listener, source, settings).await {
            tracing::error!(%error, "OpenIGTLink is off, because the system has no thread left for it");
        }
    });
    Ok(Some(address))
}

/// Ends the recording, then stops camera and lens.
async fn end_recording_and_devices(
    recordings: &Recordings,
    control_loop: ControlLoop,
    imaging: std::thread::JoinHandle<()>,
) {
    if timeout(RECORDING, recordings.stop()).await.is_err() {
        tracing::error!("the disk does not take the rest of the recording; exiting without it");
    }

    let stopping = tokio::task::spawn_blocking(move || (control_loop.stop(), imaging.join()));
    if timeout(DEVICES, stopping).await.is_err() {
        tracing::error!("the control loop does not stop; exiting without it");
    }
}

/// Waits until the disk has everything that remains to be written, and closes the database.
async fn store_the_rest(store: &Store, conductor: &Conductor, telemetry: JoinHandle<()>) {
    let _ = tokio::join!(telemetry, conductor.record_the_rest());
    if let Ok(head) = store.reader().head().await {
        tracing::info!("the chain of records ends at {head}");
    }
    store.close().await;
}

/// Prevents a thread at real-time priority that never pauses from freezing the machine.
fn bound_real_time() -> std::io::Result<()> {
    let mut overrun = signal(SignalKind::from_raw(priority::OVERRUN))?;
    priority::bound_runs();
    tokio::spawn(async move {
        while overrun.recv().await.is_some() {
            priority::withdraw();
            tracing::error!("a thread kept a processor for seconds; real-time priority is off until the next start");
        }
    });

    Ok(())
}

/// The largest size of pictures of a camera with mosaics of `mosaics` samples, if it delivers any: a colour picture has
/// only one size.
const fn largest_size(mosaics: Option<(usize, usize)>) -> Size {
    if mosaics.is_some() { Size::Full } else { Size::Cell }
}

async fn open_store(
    arguments: &Arguments,
    folder: LockedFolder,
    calibration: &Calibration,
    registry: &Registry,
    clock: &dyn Clock,
) -> Result<Store, Failure> {
    let run = store::ServerRun {
        wall: clock.wall(),
        at: clock.now(),
        camera: arguments.camera.clone(),
        lens: arguments.lens.clone(),
        calibration: calibration.title(),
        blur: arguments.blur,
        weights: registry.weights(),
        seed: arguments.seed,
    };

    let store = Store::open_locked(folder, &run).await?;
    tracing::info!("the chain of records is at {}", store.reader().head().await?);
    Ok(store)
}

/// Renews `certificates` from now on, if there are any.
fn keep_in_time(certificates: Option<&Arc<Certificates>>, clock: &Arc<dyn Clock>) {
    if let Some(certificates) = certificates {
        tokio::spawn(keep_current(Arc::clone(certificates), Arc::clone(clock)));
    }
}

/// Keeps in the database what happens to camera and lens.
fn log_devices(store: &Store, clock: &Arc<dyn Clock>, status: &watch::Receiver<Arc<ControlStatus>>) {
    let of = (store.clone(), Arc::clone(clock), status.clone());
    keep_up("the log of the devices", &of, |(store, clock, status)| device_log::record(store, clock, status));
}

/// A random source that may be predictable; real sessions draw nothing from it.
fn seeded(arguments: &Arguments) -> Result<ChaCha12Rng, Failure> {
    Ok(match arguments.seed {
        Some(seed) => ChaCha12Rng::seed_from_u64(seed),
        None => ChaCha12Rng::try_from_rng(&mut SysRng)?,
    })
}

/// The signals that end the server: Ctrl-C, Ctrl-\, a service manager's stop, and the end of the terminal. Registered
/// before anything is announced, so that no signal is missed.
struct Signals {
    interrupt: Signal,
    terminate: Signal,
    hangup: Signal,
    quit: Signal,
}

impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: signal(SignalKind::hangup())?,
            quit: signal(SignalKind::quit())?,
        })
    }

    async fn any(&mut self) {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hangup.recv() => {}
            _ = self.quit.recv() => {}
        }
    }
}

//! `parfocal serve`: wires camera, lens, loop, trial and pages together and serves them.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use getrandom::SysRng;
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;
use tokio::net::TcpListener;
use tokio::sync::watch;

use super::Failure;
use crate::autofocus::Registry;
use crate::clock::{Clock, SystemClock};
use crate::conductor::{Conductor, Library, Parts};
use crate::http::keys::{Keys, ROLES};
use crate::http::{self, App};
use crate::live;
use crate::store::{self, Store};

/// Arguments of `parfocal serve`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Address to listen on; 0.0.0.0:8080 to be reached from a tablet.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    bind: SocketAddr,
    /// Folder for the database, the keys and what is recorded.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Camera: phantom, footage:PATH, scan:DIR or gige:ID.
    #[arg(long, value_name = "SPEC", default_value = "phantom")]
    camera: String,
    /// Lens: simulated or optotune:DEVICE.
    #[arg(long, value_name = "SPEC", default_value = "simulated")]
    lens: String,
    /// Frames a second to ask of the camera.
    #[arg(long, value_name = "N", default_value_t = 50)]
    fps: u32,
    /// Seed of everything random, so that a trial can be replayed; without it, a fresh one.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Folder of trial protocols beside those that ship.
    #[arg(long, value_name = "DIR")]
    protocols: Option<PathBuf>,
    /// Calibration of the sensor (TOML); without it, that of a typical unit.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
}

/// Open connections get this long to end by themselves.
const GRACE: Duration = Duration::from_secs(1);

/// Serves until Ctrl-C or SIGTERM.
///
/// # Errors
/// When the address is taken, or a folder, camera or lens cannot be used.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    tracing_subscriber::fmt()
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info,sqlx=warn".into()),
        )
        .with_writer(std::io::stderr)
        .init();
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?.block_on(serve(arguments))
}

async fn serve(arguments: &Arguments) -> Result<(), Failure> {
    let listener = TcpListener::bind(arguments.bind).await.map_err(|error| cannot_listen(arguments.bind, &error))?;
    let address = listener.local_addr()?;
    std::fs::create_dir_all(&arguments.data_dir)
        .map_err(|error| format!("cannot make the data folder {}: {error}", arguments.data_dir.display()))?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let store = open_store(arguments, clock.as_ref()).await?;
    let keys = Keys::load_or_create(&arguments.data_dir)?;
    let control = standin::control(Arc::clone(&clock), arguments.fps);
    let registry = Registry::standard();
    let conductor = Conductor::open(Parts {
        library: protocols(arguments, &registry)?,
        store: store.clone(),
        control: control.clone(),
        registry: registry.clone(),
        clock: Arc::clone(&clock),
        random: arguments
            .seed
            .map_or_else(|| ChaCha12Rng::try_from_rng(&mut SysRng), |seed| Ok(ChaCha12Rng::seed_from_u64(seed)))?,
    })
    .await?;
    let conducting = tokio::spawn(conductor.clone().run());
    let (live, imaging) = live::start(control.clone())?;
    let (end, shutdown) = watch::channel(false);
    let app = Arc::new(App {
        clock,
        live,
        surgeon_view: conductor.surgeon_view(),
        operator_view: conductor.operator_view(),
        conductor,
        registry,
        keys: keys.clone(),
        loopback_only: address.ip().is_loopback(),
        metrics: http::Metrics::default(),
        shutdown,
        control: control.clone(),
    });
    for role in ROLES {
        println!("{:<11} http://{address}/enter?key={}", http::error::role_name(role), keys.of(role));
    }
    let mut server = tokio::spawn(http::run(listener, app));
    tokio::select! {
        ended = &mut server => return Ok(ended??),
        () = asked_to_end() => {}
    }
    let _ = end.send(true);
    let _ = tokio::time::timeout(GRACE, async { (server.await, end.closed().await) }).await;
    control.frames.close();
    let _ = imaging.join();
    conducting.abort();
    store.close().await;
    Ok(())
}

async fn open_store(arguments: &Arguments, clock: &dyn Clock) -> Result<Store, Failure> {
    let run = store::Run {
        wall: clock.wall(),
        at: clock.now(),
        camera: arguments.camera.clone(),
        lens: arguments.lens.clone(),
        seed: arguments.seed,
    };
    Ok(Store::open(&arguments.data_dir, &run).await?)
}

/// The shipped protocols and those of the folder asked for, or of `trial-protocols` where there is one.
fn protocols(arguments: &Arguments, registry: &Registry) -> Result<Library, Failure> {
    let beside = Path::new("trial-protocols");
    let folder = arguments.protocols.as_deref().or_else(|| beside.is_dir().then_some(beside));
    let known: Vec<_> = registry.entries().into_iter().map(|entry| entry.name).collect();
    Ok(Library::load(folder, &known)?)
}

fn cannot_listen(address: SocketAddr, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            format!("{address} is in use by another program; stop that one or choose another address with --bind")
        }
        std::io::ErrorKind::AddrNotAvailable => format!("{address} is no address of this machine; see --bind"),
        _ => format!("cannot listen on {address}: {error}; see --bind"),
    }
}

async fn asked_to_end() {
    let terminated = async {
        match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
            Ok(mut signal) => {
                signal.recv().await;
            }
            Err(_) => std::future::pending().await,
        }
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        () = terminated => {}
    }
}

/// Moving bars in place of camera and loop.
mod standin {
    use super::{Arc, Clock, Duration};
    use crate::camera::{CameraHealth, Frame, FrameImage};
    use crate::control::{ControlHandle, ControlStatus, ControlledFrame, LatestSlot, StepRecord};
    use crate::imaging::{ContentArea, PatchArea, RgbImage};
    use crate::lens::{FocalPower, LensHealth};

    pub fn control(clock: Arc<dyn Clock>, fps: u32) -> ControlHandle {
        let status = ControlStatus {
            camera: CameraHealth {
                name: "test bars (simulated)".into(),
                simulated: true,
                working: true,
                message: "no camera is open".into(),
                fps: f64::from(fps),
                lost: 0,
            },
            lens: LensHealth {
                name: "no lens".into(),
                simulated: true,
                working: true,
                message: "no lens is open".into(),
            },
            policy: None,
            focal_power: FocalPower::MIDDLE,
            held: None,
            message: None,
            steps_per_second: f64::from(fps),
            steps: 0,
            telemetry_dropped: 0,
            latency_p50_micros: 0,
            latency_p99_micros: 0,
        };
        let (commands, _) = tokio::sync::mpsc::unbounded_channel();
        let (sender, status) = tokio::sync::watch::channel(Arc::new(status));
        let frames = Arc::new(LatestSlot::default());
        let slot = Arc::clone(&frames);
        std::thread::spawn(move || {
            let _sender = sender;
            for number in 1.. {
                std::thread::sleep(Duration::from_secs(1) / fps);
                slot.put(frame(number, clock.as_ref()));
            }
        });
        ControlHandle { commands, status, frames }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "a test picture")]
    fn frame(number: u64, clock: &dyn Clock) -> ControlledFrame {
        let (width, height) = (512, 272);
        let data = (0..width * height)
            .flat_map(|index| {
                let bar = ((index % width) as u64 + number * 2) as u8;
                [bar, (index / width) as u8, bar.wrapping_mul(3)]
            })
            .collect();
        let wave = (number as f64 / 50.0).sin() / 2.0 + 0.5;
        let image = FrameImage::Rgb(Arc::new(RgbImage { width, height, data }));
        let exposed_at = clock.now();
        ControlledFrame {
            frame: Frame { number, exposed_at, exposure: Duration::ZERO, image, truth: None },
            patch: PatchArea { x: 240, y: 120, width: 32, height: 32 },
            content_area: Some(ContentArea { x: 256.0, y: 136.0, radius: 150.0, confidence: 0.5 }),
            record: StepRecord {
                frame: number,
                exposed_at,
                segment: None,
                policy: None,
                asked: FocalPower::nearest(wave),
                measured: Some(FocalPower::nearest(wave)),
                metric: Some(wave * 10.0),
                policy_micros: 0,
                latency_micros: 0,
                held: None,
                optimal: None,
            },
            belief: None,
        }
    }
}

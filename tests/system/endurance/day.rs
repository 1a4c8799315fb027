//! One long day at 50 frames per second: sessions, viewers that come and go, and devices that are unplugged.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::lens::emulator::{Emulator, Model};
use reqwest::StatusCode;
use serde_json::Value;
use tokio::sync::watch;
use tokio::time::{Instant, interval, sleep, timeout};

use super::course::{Conductor, Pace};
use super::judgement::judge;
use super::sample::{Observer, Sample};
use super::viewers::come_and_go;
use crate::support::{Server, command};

/// Default length of the day, in seconds.
const HOUR: u64 = 3600;
/// Number of samples in a day: one per minute for an hour.
const SAMPLES: u32 = 60;
/// Longest pause between two samples, for days longer than an hour.
const MINUTE: Duration = Duration::from_mins(1);

/// Limit on the growth of the database in an hour at 50 frames per second, in bytes, as stated in docs/operations.md.
const DATABASE_PER_HOUR: f64 = 25e6;

/// Longest time until the loss or return of a device is noticed.
const PATIENCE: Duration = Duration::from_mins(1);

fn length() -> Duration {
    let told = std::env::var("PARFOCAL_ENDURANCE_SECONDS").ok();
    Duration::from_secs(told.map_or(HOUR, |seconds| seconds.parse().expect("a number of seconds")))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes an hour, or what PARFOCAL_ENDURANCE_SECONDS says"]
async fn a_long_day_leaves_memory_descriptors_and_timing_as_they_were() {
    let mut bench = Bench::set_up();
    let server = &bench.server;
    let mut observer = Observer::of(server).await;
    let begun = SystemClock.now();
    let at = || SystemClock.now().since(begun).as_secs_f64();

    // Run everything once, so that everything made at first use exists.
    let (warm, warming) = watch::channel(false);
    let mut conductor = Conductor::new(server).await;
    let pace = Pace { setting: Duration::from_secs(2), comments: 2 };
    tokio::join!(
        async {
            conductor.conduct(pace).await;
            let _ = warm.send(true);
        },
        come_and_go(server, 0, warming.clone()),
        come_and_go(server, 1, warming.clone()),
        come_and_go(server, 2, warming.clone()),
    );
    settle().await;
    let before = observer.look(at()).await;
    println!("at rest before: {before:?}");

    let (end, ending) = watch::channel(false);
    let day = async {
        let (samples, ()) = tokio::join!(sample(&mut observer, &at), sleep(length()));
        let _ = end.send(true);
        samples
    };
    let pace = Pace { setting: Duration::from_secs(8), comments: 4 };
    let sessions = async {
        while !*ending.borrow() {
            conductor.conduct(pace).await;
        }
    };
    let (samples, (), viewers, unplugged, asked) = tokio::join!(
        day,
        sessions,
        async {
            let all = tokio::join!(
                come_and_go(server, 0, ending.clone()),
                come_and_go(server, 1, ending.clone()),
                come_and_go(server, 2, ending.clone())
            );
            all.0 + all.1 + all.2
        },
        bench.devices.come_and_go(server, ending.clone()),
        probe(server, ending.clone()),
    );

    settle().await;
    let after = observer.look(at()).await;
    println!("at rest after: {after:?}");
    println!(
        "{} sessions, {} comments, {viewers} viewers, {unplugged} times a device was unplugged, asked {asked} times \
         how it is",
        conductor.sessions, conductor.comments
    );

    assert_eq!(observer.comments().await, conductor.comments, "every comment that was acknowledged is on the disk");
    let per_hour = (after.database - before.database) as f64 / (after.at - before.at) * 3600.0;
    println!("the database grows by {:.1} MB an hour", per_hour / 1e6);

    let mut complaints = judge(&samples, [before, after]);
    if per_hour > DATABASE_PER_HOUR {
        complaints.push(format!("the database grows by {:.1} MB an hour", per_hour / 1e6));
    }
    observer.close().await;
    assert!(complaints.is_empty(), "{complaints:#?}");
}

/// Samples the server once a minute, or more often to get enough samples. Prints each sample.
async fn sample(observer: &mut Observer, at: &impl Fn() -> f64) -> Vec<Sample> {
    let length = length();
    let every = (length / SAMPLES).min(MINUTE);
    let end = Instant::now() + length;
    let mut ticks = interval(every);
    ticks.tick().await;

    let mut samples = Vec::new();
    while Instant::now() + every <= end {
        ticks.tick().await;
        let sample = observer.look(at()).await;
        println!(
            "{:6.0} s  {:7} KiB  {:3} descriptors  {:3} threads  {:8.1} MB  {:5} steps  p99 {:6} µs",
            sample.at,
            sample.memory,
            sample.descriptors,
            sample.threads,
            sample.database as f64 / 1e6,
            sample.steps,
            sample.p99
        );
        samples.push(sample);
    }
    samples
}

/// Asks for the server's health, as monitoring does. Returns how often.
async fn probe(server: &Server, ending: watch::Receiver<bool>) -> usize {
    let mut asked = 0;
    while !*ending.borrow() {
        let health = server.get("/healthz").send().await.unwrap();
        assert_eq!(health.status(), StatusCode::OK, "{}", health.text().await.unwrap());
        for path in ["/metrics", "/api/operator/checks", "/api/operator/choices"] {
            let answer = server.get_as("operator", path).send().await.unwrap();
            assert_eq!(answer.status(), StatusCode::OK, "{path}");
        }
        asked += 1;
        sleep(Duration::from_secs(5)).await;
    }
    asked
}

/// Waits until abandoned connections are closed and short-lived threads have ended: tokio keeps such a thread for 10
/// seconds, and the server drops a silent connection after as long.
async fn settle() {
    sleep(Duration::from_secs(15)).await;
}

/// The server with its devices.
struct Bench {
    server: Server,
    devices: Devices,
}

/// Devices that can be unplugged.
struct Devices {
    lens: Emulator,
    #[cfg(feature = "aravis")]
    camera: Option<crate::support::fake_camera::Fake>,
}

impl Bench {
    /// Uses an emulated lens driver, and the fake camera if it is available (else the phantom).
    fn set_up() -> Self {
        let lens = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
        #[cfg(feature = "aravis")]
        let camera = crate::support::fake_camera::Fake::start(&[]);
        #[cfg(feature = "aravis")]
        let spec = if camera.is_some() { "gige:Aravis-Fake-TEST?format=Mono8&exposure=5000" } else { "phantom" };
        #[cfg(not(feature = "aravis"))]
        let spec = "phantom";

        let data = Arc::new(tempfile::tempdir().unwrap());
        let protocols = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/system/endurance");
        let lens_spec = format!("optotune:{}", lens.path().display());
        let mut command =
            command(data.path(), &["--bind", "127.0.0.1:0", "--fps", "50", "--camera", spec, "--lens", &lens_spec]);
        command.arg("--protocols").arg(protocols).env("RUST_LOG", "error");

        let devices = Devices {
            lens,
            #[cfg(feature = "aravis")]
            camera,
        };
        Self { server: Server::run(data, command), devices }
    }
}

impl Devices {
    /// Unplugs one device after the other and plugs it in again. Returns how often.
    async fn come_and_go(&mut self, server: &Server, ending: watch::Receiver<bool>) -> usize {
        let mut unplugged = 0;
        while !*ending.borrow() {
            sleep(Duration::from_secs(10)).await;
            self.lens.unplug();
            until(server, "lens", false).await;
            sleep(Duration::from_secs(2)).await;
            self.lens.plug_in().unwrap();
            until(server, "lens", true).await;
            unplugged += 1;

            #[cfg(feature = "aravis")]
            if let Some(camera) = &mut self.camera {
                sleep(Duration::from_secs(10)).await;
                camera.kill();
                until(server, "camera", false).await;
                camera.restart();
                until(server, "camera", true).await;
                unplugged += 1;
            }
        }
        unplugged
    }
}

/// Waits until `/healthz` says that `device` works, or that it does not.
async fn until(server: &Server, device: &str, works: bool) {
    let told = async {
        loop {
            let health: Value = server.get("/healthz").send().await.unwrap().json().await.unwrap();
            if health[device] == works {
                return;
            }
            sleep(Duration::from_millis(100)).await;
        }
    };
    timeout(PATIENCE, told).await.unwrap_or_else(|_| panic!("never: {device} works: {works}"));
}

//! Measures the whole system: the real server in its own process, watched by up to 16 viewers, with pictures of each
//! size, over a slow link, and next to four processes that keep every processor busy, with real-time priority and
//! without.
//!
//! `cargo bench --bench stream`, or `cargo bench --bench stream -- busy` (or `recorded`) for the rows of that name.
//! `-- tap` measures instead how long a tap takes to move the patch. Prints one table. Compare only figures of the same
//! run. Ages are exact: the server's record of each frame's exposure and the viewers' clock are the same monotonic
//! clock.

mod link;
mod process;
mod tap;
mod viewer;

use std::collections::HashMap;
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_recording::Recording;
use process::{Busy, Server, Usage};
use sqlx::{Connection, SqliteConnection};
use viewer::Seen;

/// How long each row is measured, after [`WARM_UP`].
const MEASURED: Duration = Duration::from_secs(10);
const WARM_UP: Duration = Duration::from_secs(3);

/// One row of the table.
struct Scenario {
    name: &'static str,
    /// The simulated camera.
    camera: Camera,
    viewers: usize,
    /// Width of the picture on the first viewer's screen, in pixels. The other viewers' screens show the smallest size.
    screen: u32,
    /// Bits a second of the viewers' link, if it is a slow one.
    link: Option<u64>,
    /// What runs beside the server.
    beside: Beside,
}

/// What else runs on the machine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Beside {
    /// Nothing of ours.
    Nothing,
    /// A recording of every mosaic from a camera at 25 frames a second, for [`RECORDED`].
    Recording,
    /// Processes that keep every processor busy, while a policy drives the lens. `real_time` says whether the server
    /// may have real-time priority, if this user may give it.
    Busy { real_time: bool },
}

#[derive(Clone, Copy)]
enum Camera {
    Phantom,
    /// Colour pictures, which need no development: only JPEG and serving are left.
    Picture,
}

const WITHOUT: Beside = Beside::Busy { real_time: false };
const WITH: Beside = Beside::Busy { real_time: true };

/// How long the row with a recording is measured.
const RECORDED: Duration = Duration::from_mins(1);

/// Number of processes that keep the processors busy.
const BUSY: usize = 4;

/// Bytes of a mosaic whose samples are packed, four of 10 bit into five bytes.
const PACKED: f64 = 2048.0 * 1088.0 * 1.25;

/// Screen widths, in pixels, that each size of the picture fills exactly.
const CELL: u32 = 512;
const HALF: u32 = 1024;
const FULL: u32 = 2048;

/// One viewer of the phantom, on a screen for the smallest size.
const PHANTOM: Scenario = Scenario {
    name: "phantom",
    camera: Camera::Phantom,
    viewers: 1,
    screen: CELL,
    link: None,
    beside: Beside::Nothing,
};
/// The same of a picture.
const PICTURE: Scenario = Scenario { name: "picture", camera: Camera::Picture, ..PHANTOM };
/// Bits a second of a slow link.
const SLOW: Option<u64> = Some(4_000_000);

const SCENARIOS: [Scenario; 16] = [
    Scenario { viewers: 0, ..PHANTOM },
    PHANTOM,
    Scenario { viewers: 4, ..PHANTOM },
    Scenario { viewers: 16, ..PHANTOM },
    Scenario { name: "phantom, half", screen: HALF, ..PHANTOM },
    Scenario { name: "phantom, full", screen: FULL, ..PHANTOM },
    Scenario { name: "full and 3 cell", viewers: 4, screen: FULL, ..PHANTOM },
    Scenario { name: "the same, recorded", viewers: 4, screen: FULL, beside: Beside::Recording, ..PHANTOM },
    Scenario { name: "full, 4 Mbit/s", screen: FULL, link: SLOW, ..PHANTOM },
    PICTURE,
    Scenario { viewers: 16, ..PICTURE },
    Scenario { name: "picture, 4 Mbit/s", link: SLOW, ..PICTURE },
    Scenario { name: "phantom, busy", viewers: 4, beside: WITHOUT, ..PHANTOM },
    Scenario { name: "the same, rt", viewers: 4, beside: WITH, ..PHANTOM },
    Scenario { name: "picture, busy", viewers: 4, beside: WITHOUT, ..PICTURE },
    Scenario { name: "the same, rt", viewers: 4, beside: WITH, ..PICTURE },
];

/// The figures of a row.
struct Row {
    first_answer: Duration,
    usage: Usage,
    frames_a_second: f64,
    bytes: usize,
    ages: Vec<f64>,
    latencies: Vec<f64>,
    recorded: Option<Recorded>,
}

/// The result of a recording.
struct Recorded {
    frames: usize,
    missing: u64,
    seconds: f64,
    bytes: u64,
}

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() {
    // `cargo test --benches` only checks that it starts.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }

    let asks_for = |word: &str| std::env::args().any(|argument| argument == word);
    if asks_for("tap") {
        tap::report().await;
        return;
    }

    println!(
        "{:<18} {:>7} {:>6} {:>6} {:>13} {:>13} {:>26} {:>6} {:>7}",
        "camera", "viewers", "fps", "KB", "age ms", "latency ms", "% of a core", "RSS", "answer"
    );
    println!(
        "{:<18} {:>7} {:>6} {:>6} {:>13} {:>13} {:>26} {:>6} {:>7}",
        "", "", "", "", "p50 / p99", "p50 / p99", "loop / imaging / serving", "MB", "ms"
    );

    let wanted = |beside: Beside| match beside {
        Beside::Nothing => !asks_for("busy") && !asks_for("recorded"),
        Beside::Recording => !asks_for("busy"),
        Beside::Busy { .. } => !asks_for("recorded"),
    };
    for scenario in SCENARIOS.iter().filter(|scenario| wanted(scenario.beside)) {
        report(scenario, &measure(scenario).await);
    }
}

async fn measure(scenario: &Scenario) -> Row {
    let folder = tempfile::tempdir().expect("a folder");
    let camera = match scenario.camera {
        Camera::Phantom => "phantom".to_owned(),
        Camera::Picture => process::picture(&folder),
    };

    let recording = scenario.beside == Beside::Recording;
    let frames_a_second = if recording { 25 } else { 50 };
    let measured = if recording { RECORDED } else { MEASURED };

    let mut server = Server::start(&camera, frames_a_second, scenario.beside != WITHOUT);
    let first_answer = server.first_answer().await;
    let busy = match scenario.beside {
        Beside::Nothing => None,
        Beside::Recording => {
            server.put_in_charge("parfocal").await;
            server.record(true).await;
            None
        }
        Beside::Busy { .. } => {
            server.put_in_charge("mgm-hill-climber").await;
            Some(Busy::start(BUSY))
        }
    };

    let address = match scenario.link {
        Some(bits) => link::slow(server.address, bits).await,
        None => server.address,
    };

    let watch = |number| {
        let screen = if number == 0 { scenario.screen } else { CELL };
        tokio::spawn(viewer::watch(address, server.key.clone(), screen, WARM_UP + measured))
    };
    let viewers: Vec<_> = (0..scenario.viewers).map(watch).collect();

    // What comes while the server warms up is left out of every figure.
    tokio::time::sleep(WARM_UP).await;
    let from = SystemClock.now().as_nanos();
    let before = server.usage();
    tokio::time::sleep(measured).await;
    let to = SystemClock.now().as_nanos();
    let after = server.usage();

    drop(busy);
    let mut seen: Vec<Seen> = Vec::new();
    for viewer in viewers {
        seen.extend(viewer.await.expect("a viewer"));
    }
    seen.retain(|seen| (from..to).contains(&seen.at));

    if recording {
        server.record(false).await;
    }
    let data = server.end();
    let steps = steps(&data).await;
    let during = |exposed: u64| (from..to).contains(&exposed);
    Row {
        first_answer,
        usage: after.since(&before, measured),
        frames_a_second: (seen.len() / scenario.viewers.max(1)) as f64 / measured.as_secs_f64(),
        bytes: seen.iter().map(|seen| seen.bytes).sum::<usize>() / seen.len().max(1),
        ages: sorted(seen.iter().filter_map(|seen| Some((seen.at - steps.get(&seen.frame)?.0) as f64 / 1e6))),
        latencies: sorted(steps.values().filter(|step| during(step.0)).map(|step| step.1 / 1e3)),
        recorded: recording.then(|| recorded(&data)),
    }
}

/// The one recording in a data folder.
fn recorded(data: &tempfile::TempDir) -> Recorded {
    let mut folders = std::fs::read_dir(data.path().join("recordings")).expect("recordings");
    let folder = folders.next().expect("a recording").expect("its name").path();
    let recording = Recording::open(&folder).expect("a whole recording");
    Recorded {
        frames: recording.rows().len(),
        missing: recording.missing(),
        seconds: recording.seconds(),
        bytes: recording.bytes(),
    }
}

/// End of exposure (nanoseconds) and latency (microseconds) of each frame, from the server's own records.
async fn steps(data: &tempfile::TempDir) -> HashMap<u64, (u64, f64)> {
    let address = format!("sqlite://{}", data.path().join("parfocal.db").display());
    let mut database = SqliteConnection::connect(&address).await.expect("the database");
    let rows: Vec<(i64, i64, i64)> = sqlx::query_as("SELECT frame, exposed_ns, latency_micros FROM telemetry")
        .fetch_all(&mut database)
        .await
        .expect("the telemetry");
    rows.into_iter().map(|(frame, exposed, latency)| (frame as u64, (exposed as u64, latency as f64))).collect()
}

fn report(scenario: &Scenario, row: &Row) {
    let pair = |values: &[f64]| match values {
        [] => "-".to_owned(),
        _ => format!("{:.2} / {:.2}", quantile(values, 0.5), quantile(values, 0.99)),
    };
    let cores = &row.usage;
    println!(
        "{:<18} {:>7} {:>6.1} {:>6.1} {:>13} {:>13} {:>26} {:>6} {:>7}",
        scenario.name,
        scenario.viewers,
        row.frames_a_second,
        row.bytes as f64 / 1e3,
        pair(&row.ages),
        pair(&row.latencies),
        format!("{:.1} / {:.1} / {:.1}", cores.control, cores.imaging, cores.serving),
        cores.resident_mb,
        row.first_answer.as_millis(),
    );
    if let Some(Recorded { frames, missing, seconds, bytes }) = row.recorded {
        let share = bytes as f64 / (PACKED * frames as f64);
        println!(
            "  recorded {frames} frames in {seconds:.1} s, {missing} missing, {:.1} MB/s, {share:.2} of packed 10 bit",
            bytes as f64 / seconds / 1e6
        );
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

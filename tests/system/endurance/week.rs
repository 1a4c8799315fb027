//! A working week in fast motion: as many sessions as in a week, one after another, while frames come as fast as the
//! camera makes them.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use image::{Rgb, RgbImage};
use parfocal_base::clock::{Clock, SystemClock};

use super::course::{Conductor, Pace};
use super::judgement::judge;
use super::sample::Observer;
use crate::support::{Server, command};

/// Sessions in a week: eight on each of five days.
const SESSIONS: usize = 40;
/// Frames per second: ten times as many as in a theatre.
const FPS: &str = "500";

/// A picture with detail to focus on, small enough for many frames per second.
fn picture(folder: &Path) -> std::path::PathBuf {
    let file = folder.join("footage.png");
    let checked =
        |x: u32, y: u32| if (x / 6 + y / 6).is_multiple_of(2) { Rgb([190, 120, 110]) } else { Rgb([90, 40, 40]) };
    RgbImage::from_fn(160, 120, checked).save(&file).unwrap();
    file
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "takes minutes"]
async fn a_working_week_of_sessions_leaves_memory_and_descriptors_as_they_were() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let footage = tempfile::tempdir().unwrap();
    let camera = format!("footage:{}", picture(footage.path()).display());
    let protocols = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/system/endurance");
    let mut serve = command(data.path(), &["--bind", "127.0.0.1:0", "--fps", FPS, "--camera", &camera]);
    serve.arg("--protocols").arg(protocols).env("RUST_LOG", "error");
    let server = Server::run(data, serve);

    let mut conductor = Conductor::new(&server).await;
    let mut observer = Observer::of(&server).await;
    let pace = Pace { setting: Duration::from_millis(200), comments: 4 };
    let begun = SystemClock.now();
    let at = || SystemClock.now().since(begun).as_secs_f64();

    let mut samples = Vec::new();
    for session in 1..=SESSIONS {
        conductor.conduct(pace).await;
        let sample = observer.look(at()).await;
        println!(
            "session {session:2} {:6.0} s  {:7} KiB  {:3} descriptors  {:8.1} MB  {:5} steps",
            sample.at,
            sample.memory,
            sample.descriptors,
            sample.database as f64 / 1e6,
            sample.steps
        );
        samples.push(sample);
    }

    assert_eq!(observer.comments().await, conductor.comments, "every comment that was acknowledged is on the disk");
    // Between two sessions nobody is there, so these two samples are taken at rest.
    let complaints = judge(&samples, [samples[SESSIONS / 4], samples[SESSIONS - 1]]);
    observer.close().await;
    assert!(complaints.is_empty(), "{complaints:#?}");
}

//! From a tap to the first step on the patch that it chose, over loopback.

use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use serde_json::json;
use sqlx::{Connection, SqliteConnection};
use tempfile::TempDir;

use super::process::Server;
use super::{WARM_UP, quantile, sorted};

const TAPS: usize = 100;

/// Between two taps: long enough for the step that follows, and no multiple of the camera's 20 ms.
const BETWEEN: Duration = Duration::from_millis(87);

/// Two places by turns, in mosaic cells, far enough apart that their patches differ.
const PLACES: [(f64, f64); 2] = [(180.0, 120.0), (300.0, 150.0)];

/// A frame's step: end of its exposure in monotonic nanoseconds, and the place of its patch.
type Step = (i64, i64, i64);

/// Prints how many frames were exposed after a tap before the first one with the new patch, and how long it took until
/// that one's exposure had ended.
pub async fn report() {
    let mut server = Server::start("phantom", 50, true);
    server.put_in_charge("parfocal").await;
    tokio::time::sleep(WARM_UP).await;

    let mut taps = Vec::new();
    for tap in 0..TAPS {
        let (x, y) = PLACES[tap % PLACES.len()];
        taps.push(SystemClock.now().as_nanos() as i64);
        server.order("patch", &json!({ "frame": 1, "at": { "x": x, "y": y } })).await;
        tokio::time::sleep(BETWEEN).await;
    }

    let steps = steps(&server.end()).await;
    let waits: Vec<_> = taps.iter().filter_map(|&tap| wait(&steps, tap)).collect();
    let frames = sorted(waits.iter().map(|wait| wait.0 as f64));
    let times = sorted(waits.iter().map(|wait| wait.1 as f64 / 1e6));
    println!(
        "{} of {TAPS} taps: the first step on the new patch was with frame {} / {} after the tap (p50 / most), whose \
         exposure ended {:.1} / {:.1} ms after it",
        waits.len(),
        quantile(&frames, 0.5),
        quantile(&frames, 1.0),
        quantile(&times, 0.5),
        quantile(&times, 1.0),
    );
}

/// The number of the first frame with another patch, counted from the first whose exposure ended after `tap`, and the
/// time from the tap to its end of exposure in nanoseconds.
fn wait(steps: &[Step], tap: i64) -> Option<(usize, i64)> {
    let next = steps.partition_point(|step| step.0 < tap);
    let before = steps.get(next.checked_sub(1)?)?;
    let moved = steps[next..].iter().position(|step| (step.1, step.2) != (before.1, before.2))?;
    Some((moved + 1, steps[next + moved].0 - tap))
}

/// All steps in order.
async fn steps(data: &TempDir) -> Vec<Step> {
    let address = format!("sqlite://{}", data.path().join("parfocal.db").display());
    let mut database = SqliteConnection::connect(&address).await.expect("the database");
    sqlx::query_as("SELECT exposed_ns, patch_x, patch_y FROM telemetry ORDER BY exposed_ns")
        .fetch_all(&mut database)
        .await
        .expect("the telemetry")
}

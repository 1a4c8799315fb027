//! Measures how much time and memory the pages and commands take on the data of a whole study: the list of sessions, a
//! session's timeline, the study's export, its analysis.
//!
//! `cargo bench --bench study_size` makes a small study; `cargo bench --bench study_size -- 100 100000` makes one of
//! 100 sessions of 100,000 steps of telemetry each, in a temporary folder (`TMPDIR`) that needs about 4 GB. That takes
//! minutes. Goals are for that size. The analysis's goal is the longest that a page may take to answer. An export lets
//! everything else go first, so measure it on a machine that does nothing else.

mod measuring;
mod study;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_records::store::export::verify::Verdict;
use parfocal_results::analysis::analyse;
use parfocal_results::study_export::{ExportProgress, export_study};
use parfocal_trial::role::Role;

use measuring::{Measured, measured};
use study::STUDY;

/// Points of a setting's focal path that the researcher's page requests.
const POINTS: u32 = 600;

fn main() {
    // Cargo adds `--bench`.
    let mut numbers = std::env::args().skip(1).filter_map(|argument| argument.parse().ok());
    let sessions = numbers.next().unwrap_or(6);
    let steps = numbers.next().unwrap_or(5_000);

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
    runtime.expect("threads can be started").block_on(bench(sessions, steps));
}

async fn bench(sessions: usize, steps: usize) {
    let data = tempfile::tempdir().expect("there is a temporary folder");
    println!("making a study of {sessions} sessions of {steps} steps of telemetry");
    let begun = SystemClock.now();
    let made = study::make(data.path(), sessions, steps).await;
    println!("made in {:.0} s, {:.0} MB", SystemClock.now().since(begun).as_secs_f64(), size_mb(data.path()));

    let reports = &made.trial.reports;
    let reader = made.trial.store.reader();
    println!("\n| what | goal | took | memory, peak |\n|---|---:|---:|---:|");

    let list = measured(async || reader.sessions(false).await.expect("the database can be read").len()).await;
    row("list of sessions", "0.2 s", &list);
    assert_eq!(list.value, sessions);

    let longest = made.sessions[sessions / 2];
    let timeline = measured(async || reports.timeline(Role::Researcher, longest, POINTS).await).await;
    row("a session's timeline", "1 s", &timeline);
    assert!(!timeline.value.expect("the session is there").points.is_empty());

    let analysis = measured(async || analyse(reader, STUDY).await).await;
    row("analysis", "20 s", &analysis);
    assert!(!analysis.value.expect("the study is unblinded").protocols.is_empty());
    let again = measured(async || analyse(reader, STUDY).await).await;
    row("analysis, again", "1 s", &again);

    for unblinded in [false, true] {
        export(&made, data.path(), unblinded).await;
    }
}

async fn export(made: &study::Made, data: &std::path::Path, unblinded: bool) {
    let what = if unblinded { "export with policies" } else { "export without policies" };
    let out = data.join(if unblinded { "unblinded" } else { "blinded" });
    let recorder = made.trial.access_log();

    // When the last session was exported, in nanoseconds from the start.
    let begun = SystemClock.now();
    let exported_after = Arc::new(AtomicU64::new(0));
    let heard = Arc::clone(&exported_after);
    let told = move |progress: ExportProgress| {
        if progress.steps == 0 {
            heard.store(SystemClock.now().since(begun).as_nanos() as u64, Ordering::Relaxed);
        }
    };

    let exported = measured(async || export_study(&recorder, STUDY, unblinded, &out, Arc::new(told)).await).await;
    row(what, "60 s", &exported);
    assert_eq!(exported.value.as_ref().expect("the study can be exported").summary.sessions, made.sessions.len());

    let sessions = Duration::from_nanos(exported_after.load(Ordering::Relaxed));
    let joining = exported.took.saturating_sub(sessions);
    println!(
        "| of these, sessions and then joining | | {:.2} s + {:.2} s | |",
        sessions.as_secs_f64(),
        joining.as_secs_f64()
    );
    println!("| its size | | {:.0} MB | |", size_mb(&out));

    // Only one session is verified, as `parfocal verify` does: all of them take as long as the export.
    let session = out.join("sessions").join(made.sessions[0].to_string());
    let checks = parfocal_records::store::export::verify::verify(&session, None);
    assert!(checks.iter().all(|check| !matches!(check.verdict, Verdict::Failed(_))), "{checks:?}");
    std::fs::remove_dir_all(&out).expect("it was just written");
}

fn row<T>(what: &str, goal: &str, measured: &Measured<T>) {
    let Measured { took, peak_mb, .. } = measured;
    println!("| {what} | {goal} | {:.3} s | {peak_mb:.0} MB |", took.as_secs_f64());
}

/// The size of everything below `folder`, in MB.
fn size_mb(folder: &std::path::Path) -> f64 {
    let entries = std::fs::read_dir(folder).expect("a folder can be read").flatten();
    let sizes = entries.map(|entry| {
        let path = entry.path();
        let bytes = entry.metadata().map_or(0, |metadata| metadata.len());
        if path.is_dir() { size_mb(&path) } else { bytes as f64 / 1e6 }
    });
    sizes.sum()
}

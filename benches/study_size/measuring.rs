//! Time and memory of a piece of work.

use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};

/// Result and cost of a piece of work.
pub struct Measured<T> {
    /// The work's result.
    pub value: T,
    /// How long the work took.
    pub took: Duration,
    /// Peak memory of the process meanwhile, in MB: its own and that of the files it maps.
    pub peak_mb: f64,
}

/// Does `work` and measures it.
pub async fn measured<T>(work: impl AsyncFnOnce() -> T) -> Measured<T> {
    // Makes the kernel count the peak from now on.
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux lets a process do so");

    let begun = SystemClock.now();
    let value = work().await;
    let took = SystemClock.now().since(begun);
    Measured { value, took, peak_mb: peak_mb() }
}

fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux tells of a process");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix("kB")).expect("it tells the peak");
    kilobytes.trim().parse::<f64>().expect("it is a number") * 1024.0 / 1e6
}

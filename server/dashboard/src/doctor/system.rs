//! Checks the machine itself: its clock, what the system allows the server, and the programs that the server calls.

use std::process::{Command, Stdio};

use super::finding::Finding;
use parfocal_base::clock::Clock;
use parfocal_base::priority::{may_lock_memory, may_run_first};

const CLOCK: &str = "clock";
const REAL_TIME: &str = "real-time priority";
const MEMORY: &str = "locked memory";
const VIDEOS: &str = "videos";

/// Whether a time server keeps the clock: events of several machines are compared by their clocks.
pub fn clock(clock: &dyn Clock) -> Finding {
    let asked = Command::new("timedatectl").args(["show", "--property=NTPSynchronized", "--value"]).output();
    let answer = asked.ok().filter(|output| output.status.success());
    let answer = answer.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    let now = clock.wall().strftime("%F %T UTC").to_string();

    match answer.as_deref() {
        Some("yes") => Finding::well(CLOCK, format!("It is {now}, kept by a time server.")),
        Some("no") => Finding::advice(
            CLOCK,
            format!("It is {now}, and no time server keeps the clock."),
            "Compare it with a clock that is right; `timedatectl set-ntp true` asks a time server.",
        ),
        _ => Finding::advice(
            CLOCK,
            format!("It is {now}; the system does not report whether a time server keeps the clock."),
            "Compare it with a clock that is right.",
        ),
    }
}

/// Whether the threads from camera to lens may have real-time priority.
pub fn real_time() -> Finding {
    if may_run_first() {
        return Finding::well(REAL_TIME, "Other programs cannot delay the focus.");
    }
    Finding::advice(
        REAL_TIME,
        "Other programs can delay the focus.",
        "Allow it; the end of `parfocal serve --help` says how. The service of the Debian package is allowed.",
    )
}

/// Whether the server may lock its memory against being swapped out.
pub fn memory() -> Finding {
    if may_lock_memory() {
        return Finding::well(MEMORY, "The server's memory stays in the machine's memory.");
    }
    Finding::advice(
        MEMORY,
        "The system may move the server's memory to disk, which delays the focus.",
        "Allow it; the end of `parfocal serve --help` says how. The service of the Debian package is allowed.",
    )
}

/// Whether videos can be read and written: this needs ffmpeg.
pub fn videos() -> Finding {
    let mut ffmpeg = Command::new("ffmpeg");
    let asked = ffmpeg.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();

    if asked.is_ok_and(|status| status.success()) {
        return Finding::well(VIDEOS, "The program ffmpeg is there.");
    }
    Finding::advice(VIDEOS, "The program ffmpeg is missing.", "Videos need it: apt-get install ffmpeg")
}

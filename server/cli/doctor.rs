//! `parfocal doctor`: whether this machine is ready for a trial.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::tz::TimeZone;

use super::output::{Failure, print, wait_for};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_dashboard::doctor::{Finding, Verdict, calibration, database, lens, machine, unreadable_calibration};
use parfocal_devices::camera::calibration::read;
use parfocal_devices::lens::open;
use parfocal_imaging::SENSOR_SIZE;
use parfocal_records::store::look_at_database;

/// Arguments of `parfocal doctor`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the server's database and keys.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Also check this lens: optotune:auto or optotune:DEVICE. No server may be using it.
    #[arg(long, value_name = "SPEC")]
    lens: Option<String>,
    /// Also check this calibration: a TOML file, or a folder of `parfocal calibrate`.
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints every finding on standard output.
///
/// # Errors
/// If something must be fixed before a trial, or standard output cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let data = &arguments.data_dir;
    let mut findings = machine(data, &SystemClock, false);
    findings.extend(database(data, wait_for(look_at_database(data))?));
    if let Some(spec) = &arguments.lens {
        super::interrupt::let_lenses_go_first()?;
        let asked = open(spec, Arc::new(SystemClock)).and_then(|mut opened| opened.info());
        findings.push(lens(asked));
    }
    if let Some(path) = &arguments.calibration {
        findings.push(calibration_in(path));
    }

    let text = if arguments.json { serde_json::to_string_pretty(&findings)? + "\n" } else { written(&findings) };
    print(&text)?;

    let wrong = findings.iter().filter(|finding| finding.verdict == Verdict::Wrong).count();
    match wrong {
        0 => Ok(()),
        1 => Err("fix one thing before a trial".into()),
        _ => Err(format!("fix {wrong} things before a trial").into()),
    }
}

/// Checks the calibration at `path` for a camera whose size is that of its references.
fn calibration_in(path: &Path) -> Finding {
    let today = SystemClock.wall().to_zoned(TimeZone::system()).date();
    match read(path) {
        Ok(read) => calibration(&read, Some(read.size().unwrap_or(SENSOR_SIZE)), false, today),
        Err(fault) => unreadable_calibration(&fault),
    }
}

/// One line per finding, with the advice below it.
fn written(findings: &[Finding]) -> String {
    let width = findings.iter().map(|finding| finding.subject.len()).max().unwrap_or(0);
    let mut text = String::new();

    for Finding { subject, verdict, found, advice } in findings {
        let mark = match verdict {
            Verdict::Well => "ok   ",
            Verdict::Advice => "look ",
            Verdict::Wrong => "WRONG",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{mark}  {subject:width$}  {found}");
        if let Some(advice) = advice {
            let _ = writeln!(text, "{:7}{:width$}  {advice}", "", "");
        }
    }
    text
}

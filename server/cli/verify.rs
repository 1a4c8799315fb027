//! `parfocal verify`: whether a trial's export is whole, unchanged and true to its commitment.

use std::path::PathBuf;

use clap::Args;

use super::output::{Failure, print};
use crate::store::export::verify::{Check, Verdict, verify};

/// Arguments of `parfocal verify`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Folder that `parfocal export` wrote.
    dir: PathBuf,
    /// Print the verdicts as JSON.
    #[arg(long)]
    json: bool,
}

/// Prints a verdict for each check.
///
/// # Errors
/// When one failed.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if !arguments.dir.is_dir() {
        let folder = arguments.dir.display();
        return Err(format!("{folder} is not a folder; give one that `parfocal export` wrote").into());
    }

    let checks = verify(&arguments.dir);
    print(&if arguments.json { serde_json::to_string(&checks)? + "\n" } else { checks.iter().map(line).collect() })?;

    let failed = checks.iter().filter(|check| matches!(check.verdict, Verdict::Failed(_))).count();
    if failed == 0 {
        return Ok(());
    }
    Err(format!("{failed} of {} checks failed: do not rely on this export", checks.len()).into())
}

fn line(check: &Check) -> String {
    let (verdict, detail) = match &check.verdict {
        Verdict::Passed(detail) => ("passed", detail),
        Verdict::Failed(detail) => ("FAILED", detail),
        Verdict::NotChecked(detail) => ("not checked", detail),
    };
    format!("{:<11} {verdict:<11} {detail}\n", check.name)
}

//! `parfocal verify`: whether a trial's export is whole, unchanged and true to its commitment.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use crate::store::export::verify::{Verdict, verify};

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
        return Err(format!("{} is no folder; name one that `parfocal export` wrote", arguments.dir.display()).into());
    }
    let checks = verify(&arguments.dir);
    if arguments.json {
        println!("{}", serde_json::to_string(&checks)?);
    } else {
        for check in &checks {
            let (verdict, detail) = match &check.verdict {
                Verdict::Passed(detail) => ("passed", detail),
                Verdict::Failed(detail) => ("FAILED", detail),
                Verdict::NotChecked(detail) => ("not checked", detail),
            };
            println!("{:<11} {verdict:<11} {detail}", check.name);
        }
    }
    let failed = checks.iter().filter(|check| matches!(check.verdict, Verdict::Failed(_))).count();
    if failed == 0 {
        return Ok(());
    }
    Err(format!("{failed} of {} checks failed: do not rely on this export", checks.len()).into())
}

//! `parfocal verify`: whether a trial's export, or a whole database, is complete, unchanged, and matches its
//! commitments.

use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{Failure, print_result, wait_for, word};
use parfocal_records::store::export::verify::{Check, Verdict, is_export, verify};
use parfocal_records::store::{Head, StoreError, verify_database};
use parfocal_results::package::{check, is_package};

/// Arguments of `parfocal verify`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Folder that `parfocal export` or `parfocal study merge` wrote, a server's data folder, or a database file such
    /// as a backup.
    path: PathBuf,
    /// A head of the chain that was printed, mailed or published: checks that the history up to it is the same.
    #[arg(long, value_name = "NUMBER:HASH")]
    head: Option<Head>,
    /// Print the verdicts as JSON.
    #[arg(long)]
    json: bool,
}

/// Prints a verdict for each check.
///
/// # Errors
/// If a check failed.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let path = &arguments.path;
    look_at(path)?;

    if begins_with(path, b"PK\x03\x04") {
        bail!(
            "{} is a ZIP file: unpack it, for example with `unzip {}`, and verify the folder that was in it",
            path.display(),
            word(path)
        );
    }

    let (what, checks) = if is_package(path) {
        ("package", check(path, arguments.head.as_ref()))
    } else if is_export(path) {
        ("export", verify(path, arguments.head.as_ref()))
    } else {
        let verified = wait_for(verify_database(path, arguments.head.clone()))?;
        ("database", verified.map_err(|error| unopened(path, error))?)
    };

    print_result(arguments.json, &checks, || checks.iter().map(line).collect())?;

    let failed = checks.iter().filter(|check| matches!(check.verdict, Verdict::Failed(_))).count();
    if failed == 0 {
        return Ok(());
    }
    Err(format!("{failed} of {} checks failed: do not rely on this {what}", checks.len()).into())
}

/// Fails if there is nothing at `path`, or if it is a folder that this account may not read: an export is its owner's
/// alone.
fn look_at(path: &Path) -> Result<(), Failure> {
    let seen = fs::metadata(path).and_then(|about| if about.is_dir() { fs::read_dir(path).map(drop) } else { Ok(()) });
    seen.map_err(|error| {
        let path = path.display();
        match error.kind() {
            ErrorKind::NotFound => format!("{path} does not exist; give an export, a data folder or a database").into(),
            _ => format!("cannot read {path}: {error}").into(),
        }
    })
}

/// Why the database at `path` was not verified.
fn unopened(path: &Path, error: StoreError) -> Failure {
    match error {
        StoreError::Missing(_) => {
            let path = path.display();
            format!("{path} is neither an export nor a data folder; if it was one, copy it again, whole").into()
        }
        StoreError::Damaged(_) if path.is_file() && !begins_with(path, b"SQLite format 3\0") => {
            let path = path.display();
            format!("{path} is not a database; name an export's folder, or copy the database again, if it was one")
                .into()
        }
        // It would speak of a data folder, and the file may be a backup.
        StoreError::Damaged(problem) if path.is_file() => {
            let path = path.display();
            format!("{path} is damaged or cut short ({problem}); copy it again, if it is a copy, and keep this one")
                .into()
        }
        error => error.into(),
    }
}

/// Whether `path` is a file that begins with `bytes`, as files of a kind do.
fn begins_with<const N: usize>(path: &Path, bytes: &[u8; N]) -> bool {
    let mut start = [0; N];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == *bytes
}

fn line(check: &Check) -> String {
    let (verdict, detail) = match &check.verdict {
        Verdict::Passed(detail) => ("passed", detail),
        Verdict::Failed(detail) => ("FAILED", detail),
        Verdict::NotChecked(detail) => ("not checked", detail),
    };
    format!("{:<11} {verdict:<11} {detail}\n", check.name)
}

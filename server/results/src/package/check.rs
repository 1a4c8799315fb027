//! Verifies a package: its checksums, each export in it, and that its tables are those of the exports.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::PackageError;
use super::source::{PackageSource, SESSIONS, exports_of, left_out};
use super::writing::{Sessions, sums, write};
use parfocal_records::store::Head;
use parfocal_records::store::export::verify::{Check, Verdict, not_part};
use parfocal_records::store::export::{ExportFiles, SUMS};

/// Whether `path` looks like a package: it has a folder with sessions.
pub fn is_package(path: &Path) -> bool {
    path.join(SESSIONS).is_dir()
}

/// Checks the package in `folder` and returns every check, in order. With `expected`, a head known from elsewhere, it
/// also checks that the history up to it is unchanged at the site where the head was noted.
pub fn check(folder: &Path, expected: Option<&Head>) -> Vec<Check> {
    let verdict = |outcome: Result<Verdict, String>| outcome.unwrap_or_else(Verdict::Failed);
    let checksums = Check { name: "checksums", verdict: verdict(checksums(folder)) };
    let (sources, sessions) = match sources(folder) {
        Ok(sources) => {
            let passed = Verdict::Passed(format!("{} exports are as they were exported", sources.len()));
            (sources, passed)
        }
        Err(error) => (Vec::new(), Verdict::Failed(error.to_string())),
    };
    let sessions = Check { name: "sessions", verdict: sessions };

    let unverified = || Verdict::NotChecked("the exports do not verify".to_owned());
    let verified = !matches!(sessions.verdict, Verdict::Failed(_));
    let tables = if verified { verdict(tables(folder, &sources)) } else { unverified() };
    let head = expected.map(|expected| if verified { verdict(head(&sources, expected)) } else { unverified() });

    let head = head.map(|verdict| Check { name: "head", verdict });
    [checksums, sessions].into_iter().chain(head).chain([Check { name: "tables", verdict: tables }]).collect()
}

/// Looks for the row of the chain that `expected` names. Each site has its own chain, and each export contains its
/// site's chain up to the export.
fn head(sources: &[PackageSource], expected: &Head) -> Result<Verdict, String> {
    for source in sources {
        let export = ExportFiles::of(&source.folder);
        let hashes = export.cells("chain.csv", "hash")?;
        let numbers = export.cells("chain.csv", "number")?;
        let row = numbers.iter().position(|number| number.parse() == Ok(expected.number));
        if row.is_some_and(|row| expected.is(expected.number, &hashes[row])) {
            let same = format!("the history of site '{}' up to {expected} is the same", source.site);
            return Ok(Verdict::Passed(same));
        }
    }
    Err(format!(
        "no export in it has the row {expected}: it was noted after the last export or elsewhere, or the history \
         before it was changed"
    ))
}

/// The exports of a package, verified.
fn sources(folder: &Path) -> Result<Vec<PackageSource>, PackageError> {
    exports_of(folder)?.iter().map(|export| PackageSource::open(export)).collect()
}

fn checksums(folder: &Path) -> Result<Verdict, String> {
    let listed = std::fs::read_to_string(folder.join(SUMS)).map_err(|error| format!("{SUMS}: {error}"))?;
    let found = sums(folder).map_err(|error| error.to_string())?;
    compare(&listed, &found)?;
    let beside = not_part(folder)?;
    Ok(Verdict::Passed(format!("{} files are as they were written{beside}", listed.lines().count())))
}

/// Joins the exports again, and compares every file.
fn tables(folder: &Path, sources: &[PackageSource]) -> Result<Verdict, String> {
    let package = ExportFiles::of(folder).json("datapackage.json")?;
    let described = &package["parfocal"];
    let version = described["version"].as_str().unwrap_or_default();
    if version != env!("CARGO_PKG_VERSION") {
        return Ok(Verdict::NotChecked(format!("parfocal {version} joined them; verify with that version")));
    }

    let left_out = left_out(folder).map_err(|error| error.to_string())?;
    let temporary = tempfile::tempdir().map_err(|error| format!("a temporary folder: {error}"))?;
    let again = temporary.path().join("package");
    write(sources, Sessions::Linked, &left_out, &again, &mut |_, _| ()).map_err(|error| error.to_string())?;

    let listed = std::fs::read_to_string(folder.join(SUMS)).map_err(|error| format!("{SUMS}: {error}"))?;
    let joined = std::fs::read_to_string(again.join(SUMS)).map_err(|error| format!("{SUMS}: {error}"))?;
    compare(&listed, &joined)?;
    Ok(Verdict::Passed("joining the exports again makes the same tables".to_owned()))
}

/// Fails with the name of the first file in which two lists of checksums differ.
fn compare(listed: &str, found: &str) -> Result<(), String> {
    let by_file = |sums: &str| -> BTreeMap<String, String> {
        sums.lines().filter_map(|line| line.split_once("  ")).map(|(sum, file)| (file.into(), sum.into())).collect()
    };
    let listed = by_file(listed);
    let found = by_file(found);

    for (file, sum) in &listed {
        match found.get(file) {
            None => return Err(format!("{file} is missing")),
            Some(other) if other != sum => return Err(format!("{file} was changed")),
            Some(_) => (),
        }
    }
    match found.keys().find(|file| !listed.contains_key(*file)) {
        Some(file) => Err(format!("{file} was added")),
        None => Ok(()),
    }
}

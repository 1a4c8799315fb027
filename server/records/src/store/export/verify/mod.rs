//! Verification of an export: what anyone can check without a database and without trust in the server.

mod allocation;
mod chain;
mod files;
mod motions;
mod study;
mod verdict;
mod voice;

use std::collections::BTreeSet;
use std::path::Path;

use ::csv::StringRecord;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};

pub use files::ExportFiles;
use files::is_long;
pub use study::Outline;
pub use verdict::Verdict;

use crate::store::Head;
use crate::store::export::description::ALL;
use crate::store::export::folder::SUMS;
use crate::store::export::table::Table;
use crate::store::export::voice::FOLDER as RECORDINGS;
use allocation::{commitment, schedule};
use chain::chain;
use parfocal_base::files::{is_systems_own, systems_own_below};
use study::study;
use verdict::Outcome;
use voice::voice;

/// A check and its verdict.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// Name of the check.
    pub name: &'static str,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// Whether `path` looks like an export: it has at least one of the files that every export has.
pub fn is_export(path: &Path) -> bool {
    [SUMS, "datapackage.json", "sessions.csv"].iter().any(|file| path.join(file).exists())
}

/// Runs every check on the export in `folder`, in order. If `expected`, a head known from elsewhere, is given, also
/// checks that the chain has this head in it.
pub fn verify(folder: &Path, expected: Option<&Head>) -> Vec<Check> {
    verify_files(&ExportFiles::of(folder), expected)
}

/// The same as `verify`, for the export whose files are `export`.
pub fn verify_files(export: &ExportFiles, expected: Option<&Head>) -> Vec<Check> {
    let check =
        |name, outcome: Result<Verdict, String>| Check { name, verdict: outcome.unwrap_or_else(Verdict::Failed) };
    vec![
        check("checksums", checksums(export)),
        check("columns", columns(export)),
        check("events", events(export)),
        check("said", said(export)),
        check("voice", voice(export)),
        check("copies", copies(export)),
        check("references", references(export)),
        check("protocol", protocol(export)),
        check("commitment", commitment(export)),
        check("schedule", schedule(export)),
        check("study", study(export)),
        check("chain", chain(export, expected)),
    ]
}

fn checksums(export: &ExportFiles) -> Outcome {
    let mut listed = BTreeSet::from([SUMS.to_owned()]);
    for line in export.text(SUMS)?.lines() {
        let (sum, file) = line.split_once("  ").ok_or_else(|| format!("{SUMS}: no checksum in '{line}'"))?;
        let within = file.strip_prefix(RECORDINGS).and_then(|rest| rest.strip_prefix('/')).unwrap_or(file);
        if within.contains('/') || within.starts_with("..") {
            return Err(format!("{SUMS}: '{file}' is not a file of the folder"));
        }

        let content = std::fs::read(export.folder().join(file)).map_err(|error| format!("{file}: {error}"))?;
        if hex::encode(Sha256::digest(&content)) != sum {
            return Err(format!("{file} was changed since it was exported"));
        }
        listed.insert(file.to_owned());
    }

    for name in file_names(export.folder())? {
        if !listed.contains(&name) {
            return Err(format!("{name} was added since it was exported"));
        }
    }

    let beside = not_part(export.folder())?;
    Ok(Verdict::Passed(format!("{} files are as they were exported{beside}", listed.len() - 1)))
}

/// Names the files in `folder` that operating systems left there, in words to add to a verdict; empty if there are none.
///
/// # Errors
/// If a folder cannot be read.
pub fn not_part(folder: &Path) -> Result<String, String> {
    let found = systems_own_below(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    if found.is_empty() {
        return Ok(String::new());
    }
    let names: Vec<String> = found.iter().map(|name| name.display().to_string()).collect();
    Ok(format!("; not part of it, and not checked: {}", names.join(", ")))
}

/// The files of an export, including those in its folder of voice recordings.
fn file_names(folder: &Path) -> Result<Vec<String>, String> {
    let names = |folder: &Path, before: &str| -> Result<Vec<String>, String> {
        let entries = std::fs::read_dir(folder).map_err(|error| error.to_string())?;
        let mut found = Vec::new();
        for entry in entries {
            let name = entry.map_err(|error| error.to_string())?.file_name();
            if !is_systems_own(&name) {
                found.push(format!("{before}{}", name.to_string_lossy()));
            }
        }
        Ok(found)
    };

    let mut found = names(folder, "")?;
    if folder.join(RECORDINGS).is_dir() {
        found.retain(|name| name != RECORDINGS);
        found.extend(names(&folder.join(RECORDINGS), &format!("{RECORDINGS}/"))?);
    }
    Ok(found)
}

fn columns(export: &ExportFiles) -> Outcome {
    export.check_format()?;
    let mut rows = 0;
    for table in ALL {
        let file = table.file();
        let withheld = !export.has(&file) && UNBLINDED.contains(&file.as_str());
        if withheld {
            continue;
        }

        if !export.headers(&file)?.iter().eq(table.header()) {
            return Err(format!("{file}: its columns are not those described"));
        }

        let mut line = 1;
        export.each_row(&file, |row| {
            line += 1;
            rows += 1;
            let mut cells = table.columns.iter().zip(row);
            match cells.find(|(column, cell)| !column.kind.accepts(cell)) {
                Some((column, cell)) => Err(format!("{file}, row {line}: '{cell}' is not a valid {}", column.name)),
                None => Ok(()),
            }
        })?;
    }

    Ok(Verdict::Passed(format!("{rows} rows are as described")))
}

fn events(export: &ExportFiles) -> Outcome {
    let count = numbered(export, "events.csv")?;
    let kinds = export.cells("events.csv", "kind")?;
    if kinds.first().map(String::as_str) != Some("created") {
        return Err("events.csv: the first event is not 'created'".to_owned());
    }
    Ok(Verdict::Passed(format!("{count} events without a gap")))
}

fn said(export: &ExportFiles) -> Outcome {
    let comments = numbered(export, "comments.csv")?;
    let answers = numbered(export, "answers.csv")?;
    let counted = export.session_cell("comments")?;
    if counted != comments.to_string() {
        return Err(format!("comments.csv holds {comments} comments, but sessions.csv counts {counted}"));
    }
    counting(export)?;
    Ok(Verdict::Passed(format!("{comments} comments and {answers} answers without a gap")))
}

/// Checks that at most one answer to each question counts, and no answer that is late.
fn counting(export: &ExportFiles) -> Result<(), String> {
    let column = |name| export.cells("answers.csv", name);
    let segments = column("segment")?;
    let questions = column("question")?;
    let counts = column("counts")?;
    let late = column("late")?;

    let mut counted = BTreeSet::new();
    for place in (0..counts.len()).filter(|&place| counts[place] == "true") {
        let number = place + 1;
        if late[place] == "true" {
            return Err(format!("answers.csv: answer {number} counts although it is late"));
        }
        if !counted.insert((&segments[place], &questions[place])) {
            return Err(format!("answers.csv: answer {number} is the second to its question that counts"));
        }
    }

    Ok(())
}

/// The number of rows of `file`, whose column `number` must count them from 1.
fn numbered(export: &ExportFiles, file: &str) -> Result<usize, String> {
    let numbers = export.cells(file, "number")?;
    match numbers.iter().zip(1..).find(|(found, expected)| **found != format!("{expected}")) {
        Some((found, expected)) => Err(format!("{file}: number {expected} is missing; '{found}' was found instead")),
        None => Ok(numbers.len()),
    }
}

/// Files that an unblinded export has and a blinded one must not have.
const UNBLINDED: [&str; 5] =
    ["allocation.csv", "allocation.json", "weights.csv", "policy_steps.csv", "chain_salts.csv"];

/// The tables that session.json repeats: all but the long ones, and those that only an unblinded export has.
fn copied() -> impl Iterator<Item = Table> {
    ALL.into_iter().filter(|table| !is_long(&table.file()) && !UNBLINDED.contains(&table.file().as_str()))
}

fn copies(export: &ExportFiles) -> Outcome {
    let package = export.json("datapackage.json")?;
    let blinded =
        package["parfocal"]["blinded"].as_bool().ok_or("datapackage.json does not say whether it is blinded")?;
    if let Some(file) = UNBLINDED.into_iter().find(|file| export.has(file) == blinded) {
        let (is, has) = if blinded { ("", "there") } else { ("un", "missing") };
        return Err(format!("datapackage.json says that the export is {is}blinded, and {file} is {has}"));
    }

    let session = export.json("session.json")?;
    for table in copied() {
        let file = table.file();
        let differs = || format!("session.json and {file} disagree");
        let objects = session[table.name].as_array().ok_or_else(differs)?;
        let same = |object: &Value, row: &StringRecord| {
            row.len() == table.columns.len()
                && table.columns.iter().zip(row).all(|(column, cell)| cell == column.csv(&object[column.name]))
        };

        let mut objects = objects.iter();
        export.each_row(&file, |row| match objects.next() {
            Some(object) if same(object, row) => Ok(()),
            _ => Err(differs()),
        })?;
        if objects.next().is_some() {
            return Err(differs());
        }
    }

    // Nothing else either: what is not compared could say anything.
    let compared = |name: &str| copied().any(|table| table.name == name);
    let tables = session.as_object().ok_or("session.json is not an object")?;
    if let Some(name) = tables.keys().find(|name| !compared(name)) {
        return Err(format!("session.json has '{name}', which is not a table of this format"));
    }

    Ok(Verdict::Passed("session.json and the tables agree".to_owned()))
}

fn references(export: &ExportFiles) -> Outcome {
    let segments: BTreeSet<String> = export.cells("segments.csv", "segment")?.into_iter().collect();
    let settings: BTreeSet<String> = export.cells("segments.csv", "setting")?.into_iter().collect();
    for file in ["comments.csv", "answers.csv", "events.csv"] {
        let unknown = export.cells(file, "segment")?.into_iter().find(|s| !s.is_empty() && !segments.contains(s));
        if let Some(segment) = unknown {
            return Err(format!("{file}: segment {segment} is not in segments.csv"));
        }
    }

    for file in ["telemetry.csv", "policy_steps.csv"].into_iter().filter(|file| export.has(file)) {
        let place = export.place(file, "setting")?;
        export.each_row(file, |row| match row.get(place).unwrap_or_default() {
            setting if settings.contains(setting) => Ok(()),
            setting => Err(format!("{file}: setting {setting} is not in segments.csv")),
        })?;
    }

    Ok(Verdict::Passed(format!("everything belongs to one of {} settings", settings.len())))
}

fn protocol(export: &ExportFiles) -> Outcome {
    let found = hex::encode(Sha256::digest(export.text("protocol.toml")?));
    let expected = export.session_cell("protocol_sha256")?;
    if found == expected {
        Ok(Verdict::Passed("protocol.toml is the one that the session was made with".to_owned()))
    } else {
        Err("protocol.toml is not the one that the session was made with".to_owned())
    }
}

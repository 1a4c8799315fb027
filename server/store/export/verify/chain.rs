//! Verification of the chain that an export tells: every row follows the row before, and the session's rows are
//! those of
//! the records in the tables.

use std::collections::BTreeMap;
use std::path::Path;

use ::csv::StringRecord;
use serde_json::Value;

use super::files::{cells, csv, json, session_cell};
use super::verdict::{Outcome, Verdict};
use crate::store::chain::check::{BlockToCheck, Found, FoundRow, Walk};
use crate::store::chain::{
    Entry, Fields, Head, KINDS, Kind, OPEN, Record, SEALED, UNBLINDED, begin_open, begin_sealed,
};
use crate::store::export::description::ALL;

/// A row of a table: its cells by column, as they were recorded.
type Cells = BTreeMap<String, String>;

/// Checks the chain of the export in `folder`, which is of this format; `expected` is a head known from elsewhere.
pub(super) fn chain(folder: &Path, format: u64, expected: Option<&Head>) -> Outcome {
    let salts = salts(folder)?;
    let mut walk = Walk::new(records(folder, format)?, expected.cloned());
    let steps = Steps::read(folder)?;
    let mut last = None;

    for row in rows(folder, "chain")? {
        let row = found(row, &salts)?;
        if let Some(block) = walk.row(&row)?
            && !steps.check(&block)?
        {
            walk.withhold();
        }
        last = Some(row.entry);
    }

    ends_with_itself(folder, last, walk.last())?;
    let unchained = steps.beyond(&walk);
    if unchained > 0 && session_cell(folder, "status")? != "under-way" {
        return Err(format!(
            "telemetry: {unchained} steps were inserted at the end: no row of the chain tells of them"
        ));
    }
    Ok(Verdict::Passed(walk.end()?))
}

/// Checks that the chain ends where the export says, with the record of the export itself.
fn ends_with_itself(folder: &Path, last: Option<Found>, head: &Head) -> Result<(), String> {
    let told = &json(folder, "datapackage.json")?["parfocal"]["chain"];
    let same = told["number"].as_i64() == Some(head.number) && told["hash"].as_str() == Some(head.hash.as_str());
    if !same {
        return Err(format!("chain: it ends at {head}, which is not the head that datapackage.json tells"));
    }

    let exports = rows(folder, "accesses")?;
    let is_export = |key: &str| exports.iter().any(|row| row["number"] == key && row["kind"] == "exported");
    match last {
        Some(Found::Whole(entry, _)) if entry.kind == "access" && is_export(&entry.key) => Ok(()),
        _ => Err("chain: its last row is not that of an export: what came after it was cut off".to_owned()),
    }
}

fn found(mut row: Cells, salts: &BTreeMap<String, String>) -> Result<FoundRow, String> {
    let mut take = |column: &str| row.remove(column).unwrap_or_default();
    let number = take("number");
    let hash = take("hash");
    let hashed = take("entry");
    let entry = Entry {
        wall: take("wall"),
        kind: take("kind"),
        key: take("key"),
        session: take("session"),
        place: take("place").parse().ok(),
        adopted: take("adopted") == "true",
        salt: take("salt"),
        sealed: take("sealed"),
        content: take("content"),
    };

    let sealed_salt = Some(take("sealed_salt")).filter(|salt| !salt.is_empty()).or_else(|| salts.get(&number).cloned());
    if entry.kind.is_empty() {
        return Ok(FoundRow { number, previous: None, entry: Found::Hash(hashed), hash });
    }

    if entry.hash() != hashed {
        return Err(format!(
            "chain: row {number} ({} {}) was changed: its entry has another hash",
            entry.kind, entry.key
        ));
    }
    Ok(FoundRow { number, previous: None, entry: Found::Whole(entry, sealed_salt), hash })
}

/// The salts that an unblinded export adds.
fn salts(folder: &Path) -> Result<BTreeMap<String, String>, String> {
    if !folder.join("chain_salts.csv").exists() {
        return Ok(BTreeMap::new());
    }
    let pair = |mut row: Cells| (row.remove("number").unwrap_or_default(), row.remove("salt").unwrap_or_default());
    Ok(rows(folder, "chain_salts")?.into_iter().map(pair).collect())
}

/// The rows of table `name`.
fn rows(folder: &Path, name: &str) -> Result<Vec<Cells>, String> {
    let file = format!("{name}.csv");
    let table = ALL.iter().find(|table| table.name == name);
    let mut reader = csv(folder, &file)?;
    let headers: Vec<String> =
        reader.headers().map_err(|error| format!("{file}: {error}"))?.iter().map(str::to_owned).collect();

    let read = |(name, cell): (&String, &str)| {
        let column = table.and_then(|table| table.columns.iter().find(|column| column.name == name));
        (name.clone(), column.map_or_else(|| cell.to_owned(), |column| column.read(cell)))
    };
    let cells = |row: StringRecord| headers.iter().zip(&row).map(read).collect();
    reader.records().map(|row| row.map(cells).map_err(|error| format!("{file}: {error}"))).collect()
}

/// The records of the tables that exports of this format have, by kind and key.
fn records(folder: &Path, format: u64) -> Result<BTreeMap<(&'static str, String), Record>, String> {
    let unblinded = folder.join("allocation.json").exists();
    let unblinding = if unblinded { json(folder, "allocation.json")?["unblinding_reason"].take() } else { Value::Null };
    let unblinding = unblinding.as_str();

    let mut found = BTreeMap::new();
    // An export tells of no participant but by the session's code.
    let told = |kind: &&Kind| ALL.iter().any(|table| table.name == kind.table && table.since() <= format);
    for kind in KINDS.iter().filter(told) {
        for mut row in rows(folder, kind.table)? {
            let cell = |row: &Cells, column: &str| row.get(column).cloned().unwrap_or_default();
            let key = match kind.name {
                "run" => cell(&row, "run"),
                "session" | "study-session" => cell(&row, "session"),
                "event" => format!("{}/{}", cell(&row, "session"), cell(&row, "number")),
                "device" | "access" | "correction" | "consent" | "erasure" | "actor" | "voice-piece" => {
                    cell(&row, "number")
                }
                "study" => cell(&row, "study"),
                "study-event" => format!("{}/{}", cell(&row, "study"), cell(&row, "number")),
                _ => cell(&row, "key"),
            };

            if kind.name == "session" {
                row.insert("segments".to_owned(), cells(folder, "segments.csv", "segment")?.join(","));
            }
            let mut withheld = kind.name == "run";
            if kind.name == "event" && cell(&row, "kind") == UNBLINDED {
                withheld = unblinding.is_none();
                row.insert("reason".to_owned(), unblinding.unwrap_or_default().to_owned());
            }

            let all = |columns: &[&str]| columns.iter().map(|column| cell(&row, column)).collect();
            let session = if matches!(kind.name, "run" | "device") { String::new() } else { cell(&row, "session") };
            let record = Record {
                session,
                order: cell(&row, "number").parse().unwrap_or_default(),
                open: all(kind.open),
                sealed: (!withheld).then(|| all(kind.sealed)),
            };
            if found.insert((kind.name, key.clone()), record).is_some() {
                return Err(format!("{}: {} {key} stands there twice", kind.table, kind.name));
            }
        }
    }
    Ok(found)
}

/// The steps of telemetry of each segment, in order.
struct Steps {
    open: BTreeMap<String, Vec<Vec<String>>>,
    /// None in a blinded export.
    sealed: Option<BTreeMap<String, Vec<Vec<String>>>>,
}

impl Steps {
    fn read(folder: &Path) -> Result<Self, String> {
        let settings = cells(folder, "segments.csv", "setting")?;
        let segments = cells(folder, "segments.csv", "segment")?;
        let segments: BTreeMap<String, String> = settings.into_iter().zip(segments).collect();
        let blinded = !folder.join("policy_steps.csv").exists();
        Ok(Self {
            open: by_segment(folder, "telemetry.csv", &OPEN, &segments)?,
            sealed: if blinded { None } else { Some(by_segment(folder, "policy_steps.csv", &SEALED, &segments)?) },
        })
    }

    /// Checks `block`: whether its sealed columns could be checked, too.
    fn check(&self, block: &BlockToCheck) -> Result<bool, String> {
        let (steps, open) = hashed(&self.open, block, begin_open());
        let Some(sealed) = &self.sealed else {
            block.check(steps, &open, None)?;
            return Ok(false);
        };

        let salt = block.sealed_salt.as_deref();
        let salt = salt.ok_or_else(|| format!("chain_salts.csv: the salt of block {} is missing", block.entry.key))?;
        let (sealed_steps, sealed) = hashed(sealed, block, begin_sealed(salt));
        block.check(steps.min(sealed_steps), &open, Some(&sealed))?;
        Ok(true)
    }

    /// Steps that no row tells of.
    fn beyond(&self, walk: &Walk) -> i64 {
        let tables = std::iter::once(&self.open).chain(&self.sealed);
        let beyond = tables.flatten().map(|(segment, steps)| steps.len() as i64 - walk.steps(segment));
        beyond.filter(|steps| *steps > 0).sum()
    }
}

fn hashed(steps: &BTreeMap<String, Vec<Vec<String>>>, block: &BlockToCheck, mut list: Fields) -> (i64, String) {
    let block = &block.block;
    let all = steps.get(&block.segment).map_or(&[][..], Vec::as_slice);
    let skipped = usize::try_from(block.first - 1).unwrap_or(usize::MAX);
    let wanted = usize::try_from(block.steps()).unwrap_or_default();

    let mut count = 0;
    for step in all.iter().skip(skipped).take(wanted) {
        count += 1;
        for cell in step {
            list.add(cell);
        }
    }
    (count, list.hex())
}

fn by_segment(
    folder: &Path,
    file: &str,
    columns: &[&str],
    segments: &BTreeMap<String, String>,
) -> Result<BTreeMap<String, Vec<Vec<String>>>, String> {
    let mut reader = csv(folder, file)?;
    let headers = reader.headers().map_err(|error| format!("{file}: {error}"))?.clone();
    let place = |column: &str| {
        headers.iter().position(|name| name == column).ok_or_else(|| format!("{file} has no column {column}"))
    };
    let setting = place("setting")?;
    let places: Vec<usize> = columns.iter().map(|column| place(column)).collect::<Result<_, _>>()?;

    let mut found: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
    for row in reader.records() {
        let row = row.map_err(|error| format!("{file}: {error}"))?;
        let cell = |place: usize| row.get(place).unwrap_or_default();
        let segment = segments.get(cell(setting)).cloned().unwrap_or_default();
        found.entry(segment).or_default().push(places.iter().map(|&place| cell(place).to_owned()).collect());
    }
    Ok(found)
}

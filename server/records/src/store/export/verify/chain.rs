//! Checks the chain in an export: every row follows the row before, and the session's rows belong to the records in the
//! tables.

use std::collections::BTreeMap;
use std::rc::Rc;

use ::csv::StringRecord;
use serde_json::Value;

use super::files::{ExportFiles, place_among};
use super::verdict::{Outcome, Verdict};
use crate::store::chain::check::{BlockToCheck, ChainCheck, FoundEntry, FoundRow};
use crate::store::chain::{
    Block, Entry, Fields, Head, OPEN, Record, RecordKind, SEALED, UNBLINDED, begin_open, begin_sealed, kinds, netstring,
};
use crate::store::export::description::{ALL, ChainRow};
use crate::store::export::table::Row;

/// A row of a table: its cells by column, as they were recorded.
type Cells = BTreeMap<String, String>;

/// Checks the chain of an export; `expected` is a head known from elsewhere.
pub(super) fn chain(export: &ExportFiles, expected: Option<&Head>) -> Outcome {
    let salts = salts(export)?;
    let mut walk = ChainCheck::new(records(export)?, expected.cloned());
    let steps = Steps::read(export)?;
    let mut last = None;

    let columns = ChainColumns::of(export)?;
    export.each_row(&ChainRow::TABLE.file(), |row| {
        let row = columns.read(row, &salts)?;
        if let Some(block) = walk.row(&row)?
            && !steps.check(&block)?
        {
            walk.withhold();
        }
        last = Some(row.entry);
        Ok(())
    })?;

    ends_with_itself(export, last, walk.last())?;
    let unchained = steps.beyond(&walk);
    if unchained > 0 && export.session_cell("status")? != "under-way" {
        return Err(format!("telemetry: {unchained} steps were inserted at the end: no row of the chain covers them"));
    }
    Ok(Verdict::Passed(walk.end()?))
}

/// Checks that the chain ends where the export says, with the record of the export itself.
fn ends_with_itself(export: &ExportFiles, last: Option<FoundEntry>, head: &Head) -> Result<(), String> {
    let package = export.json("datapackage.json")?;
    let described = &package["parfocal"]["chain"];
    let same =
        described["number"].as_i64() == Some(head.number) && described["hash"].as_str() == Some(head.hash.as_str());
    if !same {
        return Err(format!("chain: it ends at {head}, which is not the head in datapackage.json"));
    }

    let exports = rows(export, "accesses")?;
    let has = |row: &Cells, column: &str, value: &str| row.get(column).is_some_and(|cell| cell == value);
    let is_export = |key: &str| exports.iter().any(|row| has(row, "number", key) && has(row, "kind", "exported"));
    match last {
        Some(FoundEntry::Whole(entry, _)) if entry.kind == "access" && is_export(&entry.key) => Ok(()),
        _ => Err("chain: its last row is not that of an export: what came after it was cut off".to_owned()),
    }
}

/// Positions of the columns of `CHAIN` in chain.csv; `None` for a column that is missing. Each export has the whole
/// chain, but only the hashes of other sessions' rows.
struct ChainColumns([Option<usize>; CHAIN.len()]);

/// The columns of chain.csv that are read.
const CHAIN: [&str; 12] =
    ["number", "hash", "entry", "wall", "kind", "key", "session", "place", "salt", "sealed", "content", "sealed_salt"];

impl ChainColumns {
    fn of(export: &ExportFiles) -> Result<Self, String> {
        let headers = export.headers(&ChainRow::TABLE.file())?;
        Ok(Self(CHAIN.map(|column| headers.iter().position(|name| name == column))))
    }

    fn read(&self, row: &StringRecord, salts: &BTreeMap<String, String>) -> Result<FoundRow, String> {
        let cells = self.0.map(|place| place.and_then(|place| row.get(place)).unwrap_or_default());
        let [number, hash, hashed, wall, kind, key, session, place, salt, sealed, content, sealed_salt] = cells;
        if kind.is_empty() {
            let entry = FoundEntry::Hash(hashed.to_owned());
            return Ok(FoundRow { number: number.to_owned(), previous: None, entry, hash: hash.to_owned() });
        }

        let entry = Entry {
            wall: as_recorded("wall", wall),
            kind: as_recorded("kind", kind),
            key: as_recorded("key", key),
            session: as_recorded("session", session),
            place: place.parse().ok(),
            salt: as_recorded("salt", salt),
            sealed: as_recorded("sealed", sealed),
            content: as_recorded("content", content),
        };
        if entry.hash() != hashed {
            return Err(format!(
                "chain: row {number} ({} {}) was changed: its entry has another hash",
                entry.kind, entry.key
            ));
        }

        let in_export = Some(sealed_salt).filter(|salt| !salt.is_empty()).map(str::to_owned);
        let sealed_salt = in_export.or_else(|| salts.get(number).cloned());
        let entry = FoundEntry::Whole(entry, sealed_salt);
        Ok(FoundRow { number: number.to_owned(), previous: None, entry, hash: hash.to_owned() })
    }
}

/// A text of chain.csv as it was recorded.
fn as_recorded(column: &str, cell: &str) -> String {
    let column = ChainRow::TABLE.columns.iter().find(|known| known.name == column);
    column.map_or(cell, |column| column.read(cell)).to_owned()
}

/// The salts that an unblinded export adds, by number of the row.
fn salts(export: &ExportFiles) -> Result<BTreeMap<String, String>, String> {
    if !export.has("chain_salts.csv") {
        return Ok(BTreeMap::new());
    }
    let pair = |mut row: Cells| (row.remove("number").unwrap_or_default(), row.remove("salt").unwrap_or_default());
    Ok(rows(export, "chain_salts")?.into_iter().map(pair).collect())
}

/// The rows of table `name`.
fn rows(export: &ExportFiles, name: &str) -> Result<Vec<Cells>, String> {
    let file = format!("{name}.csv");
    let table = ALL.iter().find(|table| table.name == name);
    let headers = export.headers(&file)?;
    let read = |(name, cell): (&str, &str)| {
        let column = table.and_then(|table| table.columns.iter().find(|column| column.name == name));
        (name.to_owned(), column.map_or(cell, |column| column.read(cell)).to_owned())
    };

    let mut rows = Vec::new();
    export.each_row(&file, |row| {
        rows.push(headers.iter().zip(row).map(read).collect());
        Ok(())
    })?;
    Ok(rows)
}

/// The records of the tables of an export, by kind and key.
fn records(export: &ExportFiles) -> Result<BTreeMap<(&'static str, String), Record>, String> {
    let unblinded = export.has("allocation.json");
    let allocation = if unblinded { export.json("allocation.json")? } else { Rc::new(Value::Null) };
    let unblinding = allocation.get("unblinding_reason").and_then(Value::as_str);

    let mut found = BTreeMap::new();
    // Some kinds have no table in exports: of participants, an export has only the session's code.
    let is_exported = |kind: &&RecordKind| ALL.iter().any(|table| table.name == kind.table);
    for kind in kinds().iter().filter(is_exported) {
        for mut row in rows(export, kind.table)? {
            let cell = |row: &Cells, column: &str| row.get(column).cloned().unwrap_or_default();
            let key: Vec<String> = kind.key.iter().map(|column| cell(&row, column)).collect();
            let key = key.join("/");

            if kind.name == "session" {
                row.insert("segments".to_owned(), export.cells("segments.csv", "segment")?.join(","));
            }
            let mut withheld = kind.name == "run";
            if kind.name == "event" && cell(&row, "kind") == UNBLINDED {
                withheld = unblinding.is_none();
                row.insert("reason".to_owned(), unblinding.unwrap_or_default().to_owned());
            }

            let all = |columns: &[&str]| columns.iter().map(|column| cell(&row, column)).collect();
            let session = if kind.of_session { cell(&row, "session") } else { String::new() };
            let record = Record {
                session,
                order: cell(&row, "number").parse().unwrap_or_default(),
                open: all(&kind.open),
                sealed: (!withheld).then(|| all(&kind.sealed)),
            };
            if found.insert((kind.name, key.clone()), record).is_some() {
                return Err(format!("{}: {} {key} appears twice", kind.table, kind.name));
            }
        }
    }
    Ok(found)
}

/// The steps of telemetry of each segment, in order.
struct Steps {
    open: BTreeMap<String, Netstrings>,
    /// `None` in a blinded export.
    sealed: Option<BTreeMap<String, Netstrings>>,
}

/// The cells of a segment's steps as they are hashed, one after another in one buffer, because an hour of a session has
/// 200,000 steps.
#[derive(Default)]
struct Netstrings {
    bytes: Vec<u8>,
    /// Where each step ends in `bytes`.
    ends: Vec<usize>,
}

impl Netstrings {
    /// Adds a step.
    fn step<'a>(&mut self, cells: impl Iterator<Item = &'a str>) {
        for cell in cells {
            netstring(cell, &mut self.bytes);
        }
        self.ends.push(self.bytes.len());
    }

    /// The steps of `block` that were found: how many, and their bytes.
    fn of(&self, block: &Block) -> (i64, &[u8]) {
        let count = self.ends.len();
        let first = usize::try_from(block.first - 1).unwrap_or(usize::MAX).min(count);
        let wanted = usize::try_from(block.steps()).unwrap_or_default();
        let last = first.saturating_add(wanted).min(count);

        let end_of = |steps: usize| steps.checked_sub(1).map_or(0, |step| self.ends[step]);
        let steps = last - first;
        (steps as i64, &self.bytes[end_of(first)..end_of(last)])
    }
}

impl Steps {
    fn read(export: &ExportFiles) -> Result<Self, String> {
        let settings = export.cells("segments.csv", "setting")?;
        let segments = export.cells("segments.csv", "segment")?;
        let segments: BTreeMap<String, String> = settings.into_iter().zip(segments).collect();
        let blinded = !export.has("policy_steps.csv");
        Ok(Self {
            open: by_segment(export, "telemetry.csv", &OPEN, &segments)?,
            sealed: if blinded { None } else { Some(by_segment(export, "policy_steps.csv", &SEALED, &segments)?) },
        })
    }

    /// Checks `block`. Returns whether its sealed columns could be checked too.
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

    /// Number of steps that no row of the chain covers.
    fn beyond(&self, walk: &ChainCheck) -> i64 {
        let tables = std::iter::once(&self.open).chain(&self.sealed);
        let beyond = tables.flatten().map(|(segment, steps)| steps.ends.len() as i64 - walk.steps(segment));
        beyond.filter(|steps| *steps > 0).sum()
    }
}

fn hashed(steps: &BTreeMap<String, Netstrings>, block: &BlockToCheck, mut list: Fields) -> (i64, String) {
    let Some(steps) = steps.get(&block.block.segment) else { return (0, list.hex()) };
    let (count, bytes) = steps.of(&block.block);
    list.add_netstrings(bytes);
    (count, list.hex())
}

fn by_segment(
    export: &ExportFiles,
    file: &str,
    columns: &[&str],
    segments: &BTreeMap<String, String>,
) -> Result<BTreeMap<String, Netstrings>, String> {
    let headers = export.headers(file)?;
    let place = |column: &str| place_among(&headers, file, column);
    let setting = place("setting")?;
    let places: Vec<usize> = columns.iter().map(|column| place(column)).collect::<Result<_, _>>()?;

    let mut found: BTreeMap<String, Netstrings> = BTreeMap::new();
    export.each_row(file, |row| {
        let cell = |place: usize| row.get(place).unwrap_or_default();
        let segment = segments.get(cell(setting)).map(String::as_str).unwrap_or_default();
        // An export has only a few segments, so each name is copied once.
        if !found.contains_key(segment) {
            found.insert(segment.to_owned(), Netstrings::default());
        }
        if let Some(steps) = found.get_mut(segment) {
            steps.step(places.iter().map(|&place| cell(place)));
        }
        Ok(())
    })?;
    Ok(found)
}

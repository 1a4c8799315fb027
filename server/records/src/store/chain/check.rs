//! Computes the chain again, row by row, and compares it with the records. Names the first row that is not as it was
//! written.

use std::collections::{BTreeMap, BTreeSet};

use super::form::{Entry, Head, link, sealed};
use super::kinds::{ERASED, TELEMETRY, kind};
use super::records::Record;
use super::telemetry::Block;

/// A row of the chain as it was found.
#[derive(Debug, Clone)]
pub struct FoundRow {
    /// Its number, as it is written in the row.
    pub number: String,
    /// Hash of the row before, as stored in this row; `None` in an export, which does not repeat it.
    pub previous: Option<String>,
    /// Its entry. For the rows of other sessions, an export has only the entry's hash.
    pub entry: FoundEntry,
    /// Its hash, as it is written in the row.
    pub hash: String,
}

/// What a row says about its record.
#[derive(Debug, Clone)]
pub enum FoundEntry {
    /// The whole entry, and the salt of the sealed columns; `None` if the salt is withheld or erased.
    Whole(Entry, Option<String>),
    /// Only the hash of the entry.
    Hash(String),
}

/// The state of a check.
#[derive(Default)]
pub struct ChainCheck {
    /// Records whose row has not come yet, by kind and key.
    records: BTreeMap<(&'static str, String), Record>,
    expected: Option<Head>,
    last: Head,
    /// Rows with a whole entry.
    whole: usize,
    /// Records whose sealed columns could not be checked.
    withheld: usize,
    /// The records whose sealed columns were erased, by kind and key.
    erased: BTreeSet<(String, String)>,
    /// Rows of erased records seen so far.
    erased_rows: usize,
    /// Rows seen so far, per session.
    places: BTreeMap<String, i64>,
    /// Order of the latest record, per kind and session.
    orders: BTreeMap<(&'static str, String), i64>,
    /// Steps in the blocks seen so far, per segment.
    steps: BTreeMap<String, i64>,
}

/// A block of telemetry, which the caller checks because it has the steps.
pub struct BlockToCheck {
    /// The segment and the range of its steps.
    pub block: Block,
    /// The row's entry.
    pub entry: Entry,
    /// Salt of its sealed columns; `None` if it is withheld.
    pub sealed_salt: Option<String>,
}

impl ChainCheck {
    /// Begins a check. `records` are all records except telemetry. `expected` is a head known from elsewhere.
    pub fn new(records: BTreeMap<(&'static str, String), Record>, expected: Option<Head>) -> Self {
        Self { erased: erased(&records), records, expected, ..Self::default() }
    }

    /// Checks the next row and its record. Returns a block of telemetry, whose steps the caller has to check.
    ///
    /// # Errors
    /// If something is wrong. The text says what.
    pub fn row(&mut self, row: &FoundRow) -> Result<Option<BlockToCheck>, String> {
        self.link(row)?;
        match &row.entry {
            FoundEntry::Hash(_) => Ok(None),
            FoundEntry::Whole(entry, salt) => self.record(entry, salt.as_ref()),
        }
    }

    fn link(&mut self, row: &FoundRow) -> Result<(), String> {
        let number = self.last.number + 1;
        if row.number != number.to_string() {
            return Err(format!("chain: row {number} is missing; row {} was found instead", row.number));
        }

        let (named, entry) = match &row.entry {
            FoundEntry::Whole(entry, _) => (format!(" ({} {})", entry.kind, entry.key), entry.hash()),
            FoundEntry::Hash(hash) => (String::new(), hash.clone()),
        };

        if row.previous.as_ref().is_some_and(|previous| *previous != self.last.hash) {
            return Err(format!("chain: row {number}{named} does not follow the row before: one of them was changed"));
        }
        if link(number, &self.last.hash, &entry) != row.hash {
            return Err(format!("chain: row {number}{named} was changed or put in another place"));
        }

        self.last = Head { number, hash: row.hash.clone() };
        match &self.expected {
            Some(expected) if expected.number == number && !expected.is(number, &row.hash) => Err(format!(
                "chain: row {number} is {}, not {expected}: the history up to it is not the one of that head",
                self.last
            )),
            _ => Ok(()),
        }
    }

    fn record(&mut self, entry: &Entry, salt: Option<&String>) -> Result<Option<BlockToCheck>, String> {
        let number = self.last.number;
        self.whole += 1;

        if !entry.session.is_empty() {
            let place = self.places.entry(entry.session.clone()).or_default();
            *place += 1;
            if entry.place != Some(*place) {
                let session = &entry.session;
                return Err(format!("chain: before row {number} the {place}. row of session {session} is missing"));
            }
        }

        if entry.kind == TELEMETRY {
            return self.block(entry, salt).map(Some);
        }

        let kind =
            kind(&entry.kind).ok_or_else(|| format!("chain: row {number} has the unknown kind {}", entry.kind))?;
        let key = (kind.name, entry.key.clone());
        let named = format!("{}: {} {}", kind.table, kind.name, entry.key);
        let record = self
            .records
            .remove(&key)
            .ok_or_else(|| format!("{named} is missing, but row {number} of the chain is about it"))?;

        let changed = || Err(format!("{named} was changed since row {number} of the chain was written"));
        if record.session != entry.session || record.content(kind, &entry.sealed) != entry.content {
            return changed();
        }

        match (&record.sealed, salt) {
            _ if kind.sealed.is_empty() => {}
            (None, _) => self.withheld += 1,
            // The erasure is a record of its own, which must have its own row in the chain.
            (Some(columns), None) if self.erased.contains(&(entry.kind.clone(), entry.key.clone())) => {
                if columns.iter().any(|column| !matches!(column.as_str(), "" | EMPTY_TEXT)) {
                    return Err(format!("{named} was erased, but has words"));
                }
                self.erased_rows += 1;
            }
            (Some(_), None) => return Err(format!("{named}: its salt is missing, so it cannot be checked")),
            (Some(columns), Some(salt)) => {
                if sealed(salt, columns.iter().map(String::as_str)) != entry.sealed {
                    return changed();
                }
            }
        }

        let latest = self.orders.entry((kind.name, record.session)).or_insert(record.order);
        if record.order < *latest {
            return Err(format!("{named} is not in the order in which it was kept"));
        }
        *latest = record.order;
        Ok(None)
    }

    fn block(&mut self, entry: &Entry, salt: Option<&String>) -> Result<BlockToCheck, String> {
        let number = self.last.number;
        let block = Block::of(&entry.key)
            .ok_or_else(|| format!("chain: row {number} names no block of telemetry: {}", entry.key))?;

        let steps = self.steps.entry(block.segment.clone()).or_default();
        if block.first != *steps + 1 {
            let missing = *steps + 1;
            return Err(format!("chain: step {missing} of segment {} is missing from row {number}", block.segment));
        }
        *steps = block.last;
        Ok(BlockToCheck { block, entry: entry.clone(), sealed_salt: salt.cloned() })
    }

    /// Steps of `segment` in the blocks seen so far.
    pub fn steps(&self, segment: &str) -> i64 {
        self.steps.get(segment).copied().unwrap_or(0)
    }

    /// The latest row checked.
    pub const fn last(&self) -> &Head {
        &self.last
    }

    /// Counts a block whose sealed columns could not be checked.
    pub const fn withhold(&mut self) {
        self.withheld += 1;
    }

    /// Ends the check: no record may be left without a row, and the expected head must have come. Returns what was
    /// found, in words.
    ///
    /// # Errors
    /// If something is wrong. The text says what.
    pub fn end(self) -> Result<String, String> {
        if let Some(((name, key), _)) = self.records.first_key_value() {
            let table = kind(name).map_or(*name, |kind| kind.table);
            return Err(format!("{table}: {name} {key} was inserted: the chain has no row for it"));
        }
        if let Some(expected) = self.expected.filter(|expected| expected.number > self.last.number) {
            return Err(format!(
                "the chain ends at row {}, before {expected}: what came after it was cut off, or is not in here",
                self.last.number
            ));
        }

        let mut parts = vec![format!("{} rows, {} of them whole; head {}", self.last.number, self.whole, self.last)];
        if self.erased_rows > 0 {
            parts.push(format!("{} have erased words", self.erased_rows));
        }
        if self.withheld > 0 {
            parts.push(format!("{} are withheld in part", self.withheld));
        }
        Ok(parts.join("; "))
    }
}

/// The value of an erased answer: an empty text, as JSON.
const EMPTY_TEXT: &str = "\"\"";

/// The records that were erased, by kind and key: those that the erasures among `records` name.
fn erased(records: &BTreeMap<(&'static str, String), Record>) -> BTreeSet<(String, String)> {
    let Some(kind) = kind(ERASED) else { return BTreeSet::new() };
    let place = |column: &str| kind.open.iter().position(|name| *name == column);
    let named = |record: &Record| {
        let subject = record.open.get(place("subject")?)?.clone();
        Some((subject, record.open.get(place("record")?)?.clone()))
    };
    let erasures = records.iter().filter(|((kind, _), _)| *kind == ERASED);
    erasures.filter_map(|(_, record)| named(record)).collect()
}

impl BlockToCheck {
    /// Checks the block's steps: their number, the hash of their open columns, and the hash of their sealed columns.
    /// `sealed` is `None` if an export withholds these.
    ///
    /// # Errors
    /// If something is wrong. The text says what.
    pub fn check(&self, steps: i64, open: &str, sealed: Option<&str>) -> Result<(), String> {
        let Block { segment, first, last } = &self.block;
        let named = format!("telemetry: steps {first} to {last} of segment {segment}");
        if steps != self.block.steps() {
            return Err(format!("{named}: {steps} are there; the others are missing"));
        }

        let unchanged = self.block.content(open, &self.entry.sealed) == self.entry.content
            && sealed.is_none_or(|sealed| sealed == self.entry.sealed);
        if unchanged { Ok(()) } else { Err(format!("{named}: one was changed, inserted, removed or put elsewhere")) }
    }
}

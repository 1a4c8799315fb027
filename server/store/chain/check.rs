//! The chain computed again, row by row, against the records: the first row that is not as it was written is named.

use std::collections::{BTreeMap, BTreeSet};

use super::form::{Entry, Head, link, sealed};
use super::kinds::{ERASED, TELEMETRY, kind};
use super::records::Record;
use super::telemetry::Block;

/// A row of the chain as it was found.
#[derive(Debug, Clone)]
pub struct FoundRow {
    /// Its number.
    pub number: String,
    /// The hash of the row before, where the row says so itself.
    pub previous: Option<String>,
    /// What it says of its record; of another session's row the hash of that alone.
    pub entry: Found,
    /// Its hash.
    pub hash: String,
}

/// What a row tells of its record.
#[derive(Debug, Clone)]
pub enum Found {
    /// All, and the salt of the sealed columns where it is not withheld.
    Whole(Entry, Option<String>),
    /// Its hash alone.
    Hash(String),
}

/// The check under way.
pub struct Walk {
    /// The records that no row has come for.
    records: BTreeMap<(&'static str, String), Record>,
    expected: Option<Head>,
    last: Head,
    adopted: usize,
    /// Rows told whole.
    whole: usize,
    /// Records with sealed columns that could not be checked.
    withheld: usize,
    /// The records whose sealed columns were erased, by kind and key.
    erased: BTreeSet<(String, String)>,
    /// How many of them came.
    erased_rows: usize,
    /// Of each session the rows so far.
    places: BTreeMap<String, i64>,
    /// Of each kind and session the place of the latest record.
    orders: BTreeMap<(&'static str, String), i64>,
    /// Of each segment the steps in blocks.
    steps: BTreeMap<String, i64>,
}

/// A block of telemetry to be checked by whoever has its steps.
pub struct BlockToCheck {
    /// Which.
    pub block: Block,
    /// What the row says.
    pub entry: Entry,
    /// The salt of its sealed columns, if it is told.
    pub sealed_salt: Option<String>,
}

impl Walk {
    /// Begins, with every record but telemetry. `expected` is a head known from elsewhere.
    pub fn new(records: BTreeMap<(&'static str, String), Record>, expected: Option<Head>) -> Self {
        Self {
            erased: erased(&records),
            records,
            expected,
            last: Head::none(),
            adopted: 0,
            whole: 0,
            withheld: 0,
            erased_rows: 0,
            places: BTreeMap::new(),
            orders: BTreeMap::new(),
            steps: BTreeMap::new(),
        }
    }

    /// Checks the next row and its record. A block of telemetry comes back for its steps to be checked.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn row(&mut self, row: &FoundRow) -> Result<Option<BlockToCheck>, String> {
        self.link(row)?;
        match &row.entry {
            Found::Hash(_) => Ok(None),
            Found::Whole(entry, salt) => self.record(entry, salt.as_ref()),
        }
    }

    fn link(&mut self, row: &FoundRow) -> Result<(), String> {
        let number = self.last.number + 1;
        if row.number != number.to_string() {
            return Err(format!("chain: row {number} is missing; row {} stands in its place", row.number));
        }

        let (named, entry) = match &row.entry {
            Found::Whole(entry, _) => (format!(" ({} {})", entry.kind, entry.key), entry.hash()),
            Found::Hash(hash) => (String::new(), hash.clone()),
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
        self.adopted += usize::from(entry.adopted);

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
            .ok_or_else(|| format!("{named} is missing; row {number} of the chain tells of it"))?;

        let changed = || Err(format!("{named} was changed since row {number} of the chain was written"));
        if record.session != entry.session || record.content(kind, &entry.sealed) != entry.content {
            return changed();
        }

        match (&record.sealed, salt) {
            _ if kind.sealed.is_empty() => {}
            (None, _) => self.withheld += 1,
            // That it was erased is a record of its own, which has to have its row.
            (Some(columns), None) if self.erased.contains(&(entry.kind.clone(), entry.key.clone())) => {
                if columns.iter().any(|column| !matches!(column.as_str(), "" | EMPTY_TEXT)) {
                    return Err(format!("{named} was erased, but has words"));
                }
                self.erased_rows += 1;
            }
            (Some(_), None) => return Err(format!("{named}: its salt is missing, without which nothing proves it")),
            (Some(columns), Some(salt)) => {
                if sealed(salt, columns.iter().map(String::as_str)) != entry.sealed {
                    return changed();
                }
            }
        }

        let latest = self.orders.entry((kind.name, record.session)).or_insert(record.order);
        if record.order < *latest {
            return Err(format!("{named} stands in another order than it was kept in"));
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
            return Err(format!("chain: row {number} holds no step {missing} of segment {}", block.segment));
        }
        *steps = block.last;
        Ok(BlockToCheck { block, entry: entry.clone(), sealed_salt: salt.cloned() })
    }

    /// Steps of `segment` that the rows so far hold.
    pub fn steps(&self, segment: &str) -> i64 {
        self.steps.get(segment).copied().unwrap_or(0)
    }

    /// The latest row.
    pub const fn last(&self) -> &Head {
        &self.last
    }

    /// Counts a block whose sealed columns could not be checked.
    pub const fn withhold(&mut self) {
        self.withheld += 1;
    }

    /// Ends the check: nothing may be left over, and the expected head must have come. What was found, in words.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn end(self) -> Result<String, String> {
        if let Some(((name, key), _)) = self.records.first_key_value() {
            let table = kind(name).map_or(*name, |kind| kind.table);
            return Err(format!("{table}: {name} {key} was inserted: no row of the chain tells of it"));
        }
        if let Some(expected) = self.expected.filter(|expected| expected.number > self.last.number) {
            return Err(format!(
                "the chain ends at row {}, before {expected}: what came after it was cut off, or is not in here",
                self.last.number
            ));
        }

        let mut said = vec![format!("{} rows, {} of them whole; head {}", self.last.number, self.whole, self.last)];
        if self.adopted > 0 {
            said.push(format!("{} were recorded before there was a chain", self.adopted));
        }
        if self.erased_rows > 0 {
            said.push(format!("of {} the words were erased", self.erased_rows));
        }
        if self.withheld > 0 {
            said.push(format!("of {} a part is withheld here", self.withheld));
        }
        Ok(said.join("; "))
    }
}

/// An answer without words, as JSON.
const EMPTY_TEXT: &str = "\"\"";

/// The records that erasures among `records` name, by kind and key.
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
    /// Checks the block's steps by their hashes: how many there are, that of the open columns, and that of the sealed
    /// ones where they are told.
    ///
    /// # Errors
    /// What is wrong, in words.
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

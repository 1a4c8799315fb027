//! What is hashed, byte for byte. `docs/evidence.md` describes the same for readers; a test computes it from there.

use std::fmt;
use std::io::Write;
use std::str::FromStr;

use sha2::{Digest, Sha256};

/// Stands in the first row for the hash of the row before.
pub const GENESIS: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// A field of every entry, kept free for a later version.
const RESERVED: &str = "false";

/// Hexadecimal digits of a hash that are shown to people: 128 bits, enough that nobody can forge a match.
const SHOWN: usize = 32;

/// Fewest hexadecimal digits of a hash that a person may give.
const FEWEST: usize = 16;

/// A hash over a list of fields, each as a netstring: its length in bytes, a colon, its bytes, a comma. So two
/// different lists never have the same bytes.
#[derive(Clone)]
pub struct Fields(Sha256);

impl Fields {
    /// Begins a list with `domain`, which says what is hashed.
    pub fn of(domain: &str) -> Self {
        Self(Sha256::new()).and(domain)
    }

    /// The same list with `field` at its end.
    pub fn and(mut self, field: &str) -> Self {
        self.add(field);
        self
    }

    /// Adds `field` at the end.
    pub fn add(&mut self, field: &str) {
        let mut bytes = Vec::with_capacity(field.len() + 8);
        netstring(field, &mut bytes);
        self.0.update(bytes);
    }

    /// Adds fields that are netstrings already.
    pub fn add_netstrings(&mut self, netstrings: &[u8]) {
        self.0.update(netstrings);
    }

    /// The SHA-256, in hexadecimal.
    pub fn hex(self) -> String {
        hex::encode(self.0.finalize())
    }
}

/// Adds `field` to `bytes` as a netstring.
pub fn netstring(field: &str, bytes: &mut Vec<u8>) {
    // Writing into memory does not fail.
    let _ = write!(bytes, "{}:", field.len());
    bytes.extend_from_slice(field.as_bytes());
    bytes.push(b',');
}

/// The hash of a record's sealed columns, which can be withheld or erased. Without the salt, nobody can test guesses of
/// what they hold.
pub fn sealed<'a>(salt: &str, fields: impl IntoIterator<Item = &'a str>) -> String {
    let mut list = begin_sealed(salt);
    for field in fields {
        list.add(field);
    }
    list.hex()
}

/// Begins the hash of sealed columns, for fields that are added one by one.
pub fn begin_sealed(salt: &str) -> Fields {
    Fields::of("parfocal-sealed-1").and(salt)
}

/// The hash of a record: its kind, its open columns by name, and the hash of its sealed ones.
pub fn content<'a>(kind: &str, columns: impl IntoIterator<Item = (&'a str, &'a str)>, sealed: &str) -> String {
    let mut list = Fields::of("parfocal-record-1").and(kind);
    for (name, value) in columns {
        list.add(name);
        list.add(value);
    }
    list.and(sealed).hex()
}

/// What a row of the chain says about its record: everything except its number and the two hashes that link it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// When the row was written, by the wall clock.
    pub wall: String,
    /// Kind of the record.
    pub kind: String,
    /// The record's key within its kind.
    pub key: String,
    /// The record's session; empty if it has none.
    pub session: String,
    /// Number of the row among those of its session, from 1; `None` without a session.
    pub place: Option<i64>,
    /// Random. Keeps an entry that is shown only as a hash from being guessed.
    pub salt: String,
    /// Hash of the record's sealed columns; empty if its kind has none.
    pub sealed: String,
    /// Hash of the record.
    pub content: String,
}

impl Entry {
    /// Hash of the entry. An export shows only this for the rows of other sessions.
    pub fn hash(&self) -> String {
        let place = self.place.map_or_else(String::new, |place| place.to_string());
        Fields::of("parfocal-entry-1")
            .and(&self.salt)
            .and(&self.wall)
            .and(&self.kind)
            .and(&self.key)
            .and(&self.session)
            .and(&place)
            .and(RESERVED)
            .and(&self.sealed)
            .and(&self.content)
            .hex()
    }
}

/// The hash of row `number`. `entry` is the hash of its entry, `previous` the hash of the row before.
pub fn link(number: i64, previous: &str, entry: &str) -> String {
    Fields::of("parfocal-chain-1").and(&number.to_string()).and(previous).and(entry).hex()
}

/// The latest row of a chain. A person who noted it can tell later whether anything before it was changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Number of the row, from 1; 0 for a chain without a row.
    pub number: i64,
    /// Hash of the row, hexadecimal; only its beginning if a person gave it.
    pub hash: String,
}

/// The head of a chain without a row.
impl Default for Head {
    fn default() -> Self {
        Self { number: 0, hash: GENESIS.to_owned() }
    }
}

impl Head {
    /// Whether it is the row `number` with this hash.
    pub fn is(&self, number: i64, hash: &str) -> bool {
        self.number == number && hash.starts_with(&self.hash)
    }
}

impl fmt::Display for Head {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.number, self.hash.get(..SHOWN).unwrap_or(&self.hash))
    }
}

impl FromStr for Head {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("'{text}' is not a head; give NUMBER:HASH as it was printed, such as 1234:9f86d081884c7d65");
        let (number, hash) = text.trim().split_once(':').ok_or_else(wrong)?;
        let number = number.parse().ok().filter(|&number: &i64| number >= 0).ok_or_else(wrong)?;
        let hash = hash.to_ascii_lowercase();
        let long_enough = (FEWEST..=GENESIS.len()).contains(&hash.len());
        if !long_enough || !hash.bytes().all(|digit| digit.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        Ok(Self { number, hash })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_hashed_as_netstrings() {
        // printf '1:a,0:,4:\xc3\xa9\xc3\xa9,' | sha256sum
        let expected = "ba2e3028a89e02ecfa949c6f1fd9bc9355290f9834c02fd26db19abacbf2e99c";
        assert_eq!(Fields::of("a").and("").and("éé").hex(), expected);
    }

    #[test]
    fn a_head_is_read_as_it_is_shown_and_anything_else_is_refused() {
        let head = Head { number: 12, hash: "ab".repeat(32) };
        let read: Head = head.to_string().parse().unwrap();
        assert!(read.is(12, &head.hash));
        assert!(!read.is(13, &head.hash) && !read.is(12, &"ac".repeat(32)));
        for wrong in ["", "12", "12:", "12:abc", "x:9f86d081884c7d65", "12:9f86d081884c7d6g", "-1:9f86d081884c7d65"] {
            assert!(wrong.parse::<Head>().unwrap_err().contains("NUMBER:HASH"), "{wrong}");
        }
    }
}

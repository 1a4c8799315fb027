//! The directories of a TIFF or `BigTIFF`: one for each page, with the fields that describe it.
//!
//! Source: *TIFF Revision 6.0*, Adobe, 1992; for 64-bit offsets "The `BigTIFF` File Format" of libtiff.

use std::collections::HashSet;

use super::super::picture::DecodeError;

/// Most directories that are followed. A chain that is longer is taken for damaged.
const MOST: usize = 65_536;

/// The bytes of a file, and how its numbers are written.
pub(super) struct Container {
    bytes: Vec<u8>,
    little: bool,
    big_offsets: bool,
}

/// The fields of one page.
pub(super) struct Directory {
    fields: Vec<Field>,
}

/// A field: `count` values at `place`.
struct Field {
    tag: u16,
    kind: u16,
    count: u64,
    place: u64,
}

impl Container {
    /// Reads the header and every directory.
    pub(super) fn open(bytes: Vec<u8>) -> Result<(Self, Vec<Directory>), DecodeError> {
        let big_offsets = matches!(bytes.get(..4), Some([_, _, 43, 0] | [_, _, 0, 43]));
        let container = Self { little: bytes.starts_with(b"II"), bytes, big_offsets };

        let mut next = if big_offsets { container.number(8, 8) } else { container.number(4, 4) };
        let mut directories = Vec::new();
        let mut seen = HashSet::new();
        while let Some(at) = next.filter(|&at| at != 0) {
            if directories.len() == MOST || !seen.insert(at) {
                return Err(DecodeError::Damaged("its chain of pages has no end".to_owned()));
            }
            let (directory, following) = container.directory(at)?;
            directories.push(directory);
            next = Some(following);
        }

        if next.is_none() || directories.is_empty() {
            return Err(DecodeError::Damaged("it holds no picture".to_owned()));
        }
        Ok((container, directories))
    }

    /// Whether multi-byte samples have their low byte first.
    pub(super) fn little(&self) -> bool {
        self.little
    }

    /// The directory at `at`, and the place of the one that follows it.
    fn directory(&self, at: u64) -> Result<(Directory, u64), DecodeError> {
        // A field is a tag, a kind, a count, and a place or the values themselves.
        let (counter, offset) = if self.big_offsets { (8, 8) } else { (2, 4) };
        let step = 4 + 2 * offset;
        let cut = || DecodeError::Damaged("the description of a page is cut short".to_owned());

        let count = self.number(at, counter).ok_or_else(cut)?;
        let begin = at.saturating_add(counter);
        let mut fields = Vec::new();
        for index in 0..count.min(0xFFFF) {
            let at = begin.saturating_add(index * step);
            let kind = self.number(at.saturating_add(2), 2).ok_or_else(cut)? as u16;
            let count = self.number(at.saturating_add(4), offset).ok_or_else(cut)?;
            let inside = at.saturating_add(4 + offset);
            let within = count.saturating_mul(size_of(kind)) <= offset;
            let place = if within { inside } else { self.number(inside, offset).ok_or_else(cut)? };
            fields.push(Field { tag: self.number(at, 2).ok_or_else(cut)? as u16, kind, count, place });
        }

        let following = self.number(begin.saturating_add(count.saturating_mul(step)), offset).ok_or_else(cut)?;
        Ok((Directory { fields }, following))
    }

    /// `length` bytes at `at`, if the file has them.
    pub(super) fn slice(&self, at: u64, length: u64) -> Option<&[u8]> {
        let end = at.checked_add(length)?;
        self.bytes.get(usize::try_from(at).ok()?..usize::try_from(end).ok()?)
    }

    /// All bytes from `at`.
    pub(super) fn rest(&self, at: u64) -> Option<&[u8]> {
        self.bytes.get(usize::try_from(at).ok()?..)
    }

    /// The whole number of `length` bytes at `at`.
    fn number(&self, at: u64, length: u64) -> Option<u64> {
        let bytes = self.slice(at, length)?;
        let join = |number: u64, &byte: &u8| number << 8 | u64::from(byte);
        Some(if self.little { bytes.iter().rev().fold(0, join) } else { bytes.iter().fold(0, join) })
    }
}

impl Directory {
    /// The whole numbers of a field; empty if there is no such field.
    pub(super) fn numbers(&self, container: &Container, tag: u16) -> Vec<u64> {
        let Some(field) = self.fields.iter().find(|field| field.tag == tag) else { return Vec::new() };
        let size = size_of(field.kind);
        let whole = matches!(field.kind, 1 | 3 | 4 | 13 | 16 | 18);
        // The file must have them all, so a count that is too large takes no memory.
        if !whole || container.slice(field.place, field.count.saturating_mul(size)).is_none() {
            return Vec::new();
        }
        (0..field.count).filter_map(|index| container.number(field.place + index * size, size)).collect()
    }

    /// The first whole number of a field.
    pub(super) fn number(&self, container: &Container, tag: u16) -> Option<u64> {
        self.numbers(container, tag).first().copied()
    }

    /// The bytes of a field.
    pub(super) fn bytes<'a>(&self, container: &'a Container, tag: u16) -> Option<&'a [u8]> {
        let field = self.fields.iter().find(|field| field.tag == tag)?;
        container.slice(field.place, field.count.saturating_mul(size_of(field.kind)))
    }
}

/// Bytes of a value of this kind.
fn size_of(kind: u16) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => 1,
    }
}

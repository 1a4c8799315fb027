//! A joined table as an SPSS system file (`.sav`): uncompressed, in UTF-8, little-endian, with the meaning of each
//! column as its label.
//!
//! The layout follows "System File Format" in the PSPP developers' guide, whose authors reverse-engineered it; SPSS has
//! not published one.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use jiff::Timestamp;

use super::error::PackageError;
use super::join::rows;
use super::source::PackageSource;
use super::table::{JoinedTable, label};
use parfocal_records::store::export::{Column, Type};

/// Bytes per element of a case; an element is a number or eight characters.
const ELEMENT: usize = 8;

/// A string wider than this is stored as several variables, called segments, of this width.
const SEGMENT: usize = 255;

/// Bytes that each segment except the last adds to the width of the string, by the format's rule.
const SEGMENT_COUNTS: usize = 252;

/// The widest possible string, in bytes.
const WIDEST: usize = 32_767;

/// Longest label, in bytes.
const LABEL: usize = 255;

/// Seconds from the beginning of the Gregorian calendar, 14 October 1582, to 1970.
const GREGORIAN: f64 = 12_219_379_200.0;

/// The value of an empty number cell: the lowest finite number.
const MISSING: f64 = -f64::MAX;

/// A variable: a column of the table with its width.
struct Variable {
    column: Column,
    /// Bytes of the longest text; 0 for a number.
    width: usize,
    /// Number of its first segment among all segments, from 1.
    first: usize,
}

/// Writes the file `path` with the rows of `table`.
pub fn write(path: &Path, table: &JoinedTable, sources: &[PackageSource]) -> Result<(), PackageError> {
    let (variables, cases) = variables(table, sources)?;
    let file = File::create(path).map_err(PackageError::unwritable(path))?;
    let mut out = BufWriter::new(file);
    out.write_all(&dictionary(table, &variables, cases)).map_err(PackageError::unwritable(path))?;

    let mut case = Vec::new();
    rows(table, sources, |cells| {
        case.clear();
        for (variable, cell) in variables.iter().zip(cells) {
            variable.value(cell, &mut case);
        }
        out.write_all(&case).map_err(PackageError::unwritable(path))
    })?;

    let file = out.into_inner().map_err(|error| PackageError::unwritable(path)(error.into_error()))?;
    file.sync_data().map_err(PackageError::unwritable(path))
}

/// The variables of `table`, as wide as their longest text, and the number of rows.
fn variables(table: &JoinedTable, sources: &[PackageSource]) -> Result<(Vec<Variable>, usize), PackageError> {
    let columns: Vec<Column> = table.columns().copied().collect();
    let mut widths = vec![1; columns.len()];
    let mut cases = 0;
    rows(table, sources, |cells| {
        cases += 1;
        for ((column, width), cell) in columns.iter().zip(&mut widths).zip(cells) {
            *width = (*width).max(column.read(cell).len()).min(WIDEST);
        }
        Ok(())
    })?;

    let mut first = 1;
    let mut variables = Vec::new();
    for (column, width) in columns.into_iter().zip(widths) {
        let width = if column.kind == Type::String { width } else { 0 };
        let variable = Variable { column, width, first };
        first += variable.segments().len();
        variables.push(variable);
    }
    Ok((variables, cases))
}

impl Variable {
    /// The widths of its segments; 0 for a number.
    fn segments(&self) -> Vec<usize> {
        if self.width <= SEGMENT {
            return vec![self.width];
        }
        let count = self.width.div_ceil(SEGMENT_COUNTS);
        let mut widths = vec![SEGMENT; count - 1];
        widths.push(self.width - (count - 1) * SEGMENT_COUNTS);
        widths
    }

    /// The short name by which the parts of the dictionary refer to the variable.
    fn short_name(&self) -> String {
        format!("V{}", self.first)
    }

    /// Format for printing: type, width and decimals in one number.
    fn format(&self, segment: usize) -> i32 {
        let (kind, width, decimals) = match self.column.kind {
            Type::String => (1, segment, 0),
            Type::Integer => (5, 20, 0),
            Type::Boolean => (5, 1, 0),
            Type::Number => (5, 20, 6),
            // A day, a time and three decimals have 24 characters. SPSS shows a number where the width is less.
            Type::Datetime => (22, 24, 3),
        };
        (kind << 16) | ((width as i32) << 8) | decimals
    }

    /// Adds `cell`, as it is in the CSV files, to a case.
    fn value(&self, cell: &str, case: &mut Vec<u8>) {
        if self.width > 0 {
            return self.text(self.column.read(cell), case);
        }
        let number = match self.column.kind {
            Type::Boolean => (!cell.is_empty()).then(|| f64::from(u8::from(cell == "true"))),
            Type::Datetime => cell.parse::<Timestamp>().ok().map(|time| GREGORIAN + time.as_microsecond() as f64 / 1e6),
            _ => cell.parse().ok(),
        };
        case.extend(number.unwrap_or(MISSING).to_le_bytes());
    }

    /// Adds `text`, segment by segment. Each segment except the last holds 255 bytes, and each fills whole elements.
    fn text(&self, text: &str, case: &mut Vec<u8>) {
        let mut rest = cut(text, self.width).as_bytes();
        for width in self.segments() {
            let (own, left) = rest.split_at(rest.len().min(width));
            rest = left;
            let filled = case.len() + width.div_ceil(ELEMENT) * ELEMENT;
            case.extend(own);
            case.resize(filled, b' ');
        }
    }
}

/// Everything before the cases.
fn dictionary(table: &JoinedTable, variables: &[Variable], cases: usize) -> Vec<u8> {
    let elements = |variable: &Variable| -> usize { variable.segments().iter().map(|&width| elements_of(width)).sum() };
    let case_size: usize = variables.iter().map(elements).sum();

    let mut out = Vec::new();
    header(&mut out, table, case_size, cases);
    for variable in variables {
        variable_records(&mut out, variable);
    }
    boolean_labels(&mut out, variables);

    // Version 1.0.0; any machine; IEEE 754; the compression code, always 1; little-endian; UTF-8.
    let machine = [1_i32, 0, 0, -1, 1, 1, 2, 65_001];
    extension(&mut out, 3, 4, &machine.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
    // The missing value, the highest value, and the lowest, which is next to the missing value.
    let lowest = f64::from_bits(MISSING.to_bits() - 1);
    extension(&mut out, 4, 8, &[MISSING, f64::MAX, lowest].map(f64::to_le_bytes).concat());

    let names: Vec<String> =
        variables.iter().map(|variable| format!("{}={}", variable.short_name(), variable.column.name)).collect();
    extension(&mut out, 13, 1, names.join("\t").as_bytes());

    let long = variables.iter().filter(|variable| variable.width > SEGMENT);
    let widths: Vec<String> =
        long.map(|variable| format!("{}={:05}\0\t", variable.short_name(), variable.width)).collect();
    let widths = widths.concat();
    if !widths.is_empty() {
        extension(&mut out, 14, 1, widths.as_bytes());
    }

    extension(&mut out, 20, 1, b"UTF-8");
    integer(&mut out, 999);
    integer(&mut out, 0);
    out
}

/// The file's header. Its date is fixed, so that the same exports always make the same file.
fn header(out: &mut Vec<u8>, table: &JoinedTable, case_size: usize, cases: usize) {
    out.extend(b"$FL2");
    padded(out, concat!("@(#) SPSS DATA FILE - parfocal ", env!("CARGO_PKG_VERSION")), 60);
    integer(out, 2);
    integer(out, case_size);
    // Neither compressed nor weighted.
    integer(out, 0);
    integer(out, 0);
    integer(out, cases);
    out.extend(100.0_f64.to_le_bytes());
    padded(out, "01 Jan 70", 9);
    padded(out, "00:00:00", 8);
    padded(out, cut(table.table.name, 64), 64);
    padded(out, "", 3);
}

/// The records of a variable: one per segment, with a placeholder for each element after its first.
fn variable_records(out: &mut Vec<u8>, variable: &Variable) {
    for (number, width) in variable.segments().into_iter().enumerate() {
        let label = label(&variable.column);
        let label = cut(&label, LABEL);
        let labelled = number == 0;

        integer(out, 2);
        integer(out, width);
        integer(out, usize::from(labelled));
        integer(out, 0);
        let format = variable.format(width);
        out.extend(format.to_le_bytes());
        out.extend(format.to_le_bytes());
        padded(out, &format!("V{}", variable.first + number), 8);
        if labelled {
            integer(out, label.len());
            padded(out, label, label.len().next_multiple_of(4));
        }

        for _ in 1..elements_of(width) {
            integer(out, 2);
            out.extend((-1_i32).to_le_bytes());
            out.extend([0; 16]);
            padded(out, "", 8);
        }
    }
}

/// Value labels for Booleans: 0 is "no", 1 is "yes".
fn boolean_labels(out: &mut Vec<u8>, variables: &[Variable]) {
    let mut index = 1;
    let mut booleans = Vec::new();
    for variable in variables {
        if variable.column.kind == Type::Boolean {
            booleans.push(index);
        }
        index += variable.segments().into_iter().map(elements_of).sum::<usize>();
    }
    if booleans.is_empty() {
        return;
    }

    integer(out, 3);
    integer(out, 2);
    for (value, label) in [(0.0_f64, "no"), (1.0, "yes")] {
        out.extend(value.to_le_bytes());
        out.push(label.len() as u8);
        padded(out, label, ELEMENT - 1);
    }
    integer(out, 4);
    integer(out, booleans.len());
    for index in booleans {
        integer(out, index);
    }
}

/// Number of elements that a segment of `width` bytes fills; a number, of width 0, fills one.
const fn elements_of(width: usize) -> usize {
    if width == 0 { 1 } else { width.div_ceil(ELEMENT) }
}

/// A record that readers may skip if they do not know it: `data` in pieces of `size` bytes.
fn extension(out: &mut Vec<u8>, subtype: usize, size: usize, data: &[u8]) {
    integer(out, 7);
    integer(out, subtype);
    integer(out, size);
    integer(out, data.len() / size);
    out.extend(data);
}

fn integer(out: &mut Vec<u8>, value: usize) {
    out.extend((value as i32).to_le_bytes());
}

/// `text` cut to at most `bytes` bytes, between two characters.
fn cut(text: &str, bytes: usize) -> &str {
    &text[..text.floor_char_boundary(bytes)]
}

/// `text`, padded with spaces to `bytes` bytes.
fn padded(out: &mut Vec<u8>, text: &str, bytes: usize) {
    let end = out.len() + bytes;
    out.extend(text.as_bytes());
    out.resize(end, b' ');
}

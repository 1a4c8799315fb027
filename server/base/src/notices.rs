//! Notices to people on standard error, beside a command's result.

use std::fmt::Display;
use std::io::Write;

/// Writes `text` as a line to standard error. Errors are ignored: a training must not end when the reader
/// of its log does.
pub fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

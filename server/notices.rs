//! What people are told on standard error beside a command's result.

use std::fmt::Display;
use std::io::Write;

/// Tells `text` in a line of its own, and goes on where nobody reads it: a training must not end with its log's reader.
pub fn tell(text: impl Display) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

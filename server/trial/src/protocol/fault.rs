//! Errors in a protocol, with their place: file, line and key.

use std::ops::Range;

/// An error in a protocol or in a study's definition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}, line {line}: {}{message}", .key.as_ref().map(|key| format!("key '{key}': ")).unwrap_or_default())]
pub struct ProtocolError {
    /// Name of the file.
    pub file: String,
    /// Line number, from 1.
    pub line: usize,
    /// The faulty key; none if it is not known.
    pub key: Option<String>,
    /// Description of the fault.
    pub message: String,
}

/// A fault at a place in the text.
pub(crate) struct Fault {
    /// Byte range of the faulty text.
    pub span: Range<usize>,
    /// The faulty key, if it is already known.
    pub key: Option<String>,
    /// Description of the fault.
    pub message: String,
}

impl Fault {
    /// A fault of `key` at `span`.
    pub fn new(span: Range<usize>, key: &str, message: impl Into<String>) -> Self {
        Self { span, key: Some(key.to_owned()), message: message.into() }
    }

    /// The fault as an error with file name, line and key.
    pub fn in_file(self, file: &str, source: &str) -> ProtocolError {
        let start = source.floor_char_boundary(self.span.start);
        let line = source[..start].bytes().filter(|&byte| byte == b'\n').count() + 1;
        let key = self.key.or_else(|| key_at(source, line));
        ProtocolError { file: file.to_owned(), line, key, message: self.message }
    }
}

impl From<toml::de::Error> for Fault {
    fn from(error: toml::de::Error) -> Self {
        let message = error.message().trim().replace('\n', "; ");
        // A missing key has no place in the text, so its name is taken from the message.
        let missing = message.strip_prefix("missing field `").and_then(|rest| rest.split('`').next());
        let key = missing.map(str::to_owned);
        Self { span: error.span().unwrap_or(0..0), key, message }
    }
}

/// The key whose value is on line `line` (from 1): the nearest `key =` at or above it in the same table.
fn key_at(source: &str, line: usize) -> Option<String> {
    let above: Vec<&str> = source.lines().take(line).collect();
    above
        .iter()
        .rev()
        .map_while(|text| if text.trim_start().starts_with('[') { None } else { Some(key_of(text)) })
        .flatten()
        .next()
}

fn key_of(line: &str) -> Option<String> {
    let (key, _) = line.split_once('=')?;
    let key = key.trim();
    let bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    bare.then(|| key.to_owned())
}

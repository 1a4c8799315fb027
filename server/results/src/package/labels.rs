//! Labels that programs for statistics show for a column.

use parfocal_records::store::export::Column;

/// The column's meaning and unit in one line.
pub fn label(column: &Column) -> String {
    let words: Vec<&str> = column.description.split_whitespace().collect();
    let description = words.join(" ");
    if column.unit.is_empty() { description } else { format!("{description} ({})", column.unit) }
}

/// `text` cut to at most `bytes` bytes, between two characters.
pub fn cut(text: &str, bytes: usize) -> &str {
    let mut end = text.len().min(bytes);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

//! Where the pictures of a focal stack were in focus: from a list, or from their names.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use crate::LearningError;

/// The file's name, for people.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Names and positions from a list of `name,position`; a first line without a number is a heading.
pub(super) fn listed(list: &Path) -> Result<Vec<(String, f64)>, LearningError> {
    let unreadable = |error| LearningError::of(list, format!("cannot read the list: {error}"));
    let text = std::fs::read_to_string(list).map_err(unreadable)?;
    let mut placed = Vec::new();

    // Spreadsheets put a mark of UTF-8 before the first name.
    let text = text.trim_start_matches('\u{feff}');
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let entry = line.rsplit_once(',').map(|(name, position)| (name.trim(), position.trim().parse::<f64>()));
        match entry {
            Some((name, Ok(position))) if position.is_finite() => placed.push((name.to_owned(), position)),
            Some((_, Err(_))) if number == 1 => {}
            _ => {
                let wrong = format!("line {number} must be a file's name, a comma and a position");
                return Err(LearningError::of(list, wrong));
            }
        }
    }

    Ok(placed)
}

/// Files and positions from the names: the one number in which they differ; else places in natural order.
pub(super) fn named(mut files: Vec<PathBuf>) -> Vec<(PathBuf, f64)> {
    files.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
    let numbers: Vec<Vec<f64>> = files.iter().map(|file| numbers(&stem(file))).collect();

    let count = numbers.iter().map(Vec::len).min().unwrap_or(0);
    let alike = numbers.iter().all(|found| found.len() == count);
    let differs = |which: &usize| numbers.iter().any(|found| (found[*which] - numbers[0][*which]).abs() > 0.0);
    let differing: Vec<usize> = if alike { (0..count).filter(differs).collect() } else { Vec::new() };

    match differing[..] {
        [one] => files.into_iter().zip(&numbers).map(|(file, found)| (file, found[one])).collect(),
        _ => files.into_iter().zip(0..).map(|(file, place)| (file, f64::from(place))).collect(),
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The pieces of a name: numbers, which are digits with at most one point, and what lies between them.
fn pieces(name: &str) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digit = first.is_ascii_digit();
        let mut points = 0;
        let end = rest
            .char_indices()
            .find(|&(index, char)| {
                let followed = rest[index + char.len_utf8()..].starts_with(|next: char| next.is_ascii_digit());
                let point = digit && char == '.' && points == 0 && followed;
                points += usize::from(point);
                char.is_ascii_digit() != digit && !point
            })
            .map_or(rest.len(), |(index, _)| index);

        let (piece, after) = rest.split_at(end);
        pieces.push(piece);
        rest = after;
    }
    pieces
}

/// The numbers in `name`. A minus counts as a sign if no letter or digit stands before it.
fn numbers(name: &str) -> Vec<f64> {
    let pieces = pieces(name);
    let number = |(index, piece): (usize, &&str)| {
        let value: f64 = piece.parse().ok()?;
        let before = index.checked_sub(1).map_or("", |before| pieces[before]);
        // A lone minus between two numbers separates them.
        let alone = before == "-" && index > 1;
        let sign = before.strip_suffix('-').is_some_and(|before| !before.ends_with(char::is_alphanumeric));
        Some(if sign && !alone { -value } else { value })
    };

    let pieces_with_place = pieces.iter().enumerate();
    pieces_with_place
        .filter(|(_, piece)| piece.starts_with(|char: char| char.is_ascii_digit()))
        .filter_map(number)
        .collect()
}

/// Orders names as people do: numbers by value.
fn natural(a: &str, b: &str) -> Ordering {
    let a_pieces = pieces(a);
    let b_pieces = pieces(b);

    for (a, b) in a_pieces.iter().zip(&b_pieces) {
        let order = match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => a.total_cmp(&b),
            _ => a.cmp(b),
        };
        if order != Ordering::Equal {
            return order;
        }
    }

    a_pieces.len().cmp(&b_pieces.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(names: &[&str]) -> Vec<(String, f64)> {
        let files = names.iter().map(PathBuf::from).collect();
        named(files).into_iter().map(|(file, position)| (file_name(&file), position)).collect()
    }

    #[test]
    fn a_list_is_read_as_spreadsheets_save_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("list.csv");
        for heading in ["", "name,position\r\n"] {
            std::fs::write(&file, format!("\u{feff}{heading}far.png,2.5\r\nnear.png,0\r\n")).unwrap();
            let expected = [("far.png".to_owned(), 2.5), ("near.png".to_owned(), 0.0)];
            assert_eq!(listed(&file).unwrap(), expected, "{heading}");
        }
    }

    #[test]
    fn the_one_number_in_which_names_differ_is_the_position() {
        let pairs = |expected: &[(&str, f64)]| expected.iter().map(|(n, p)| ((*n).to_owned(), *p)).collect::<Vec<_>>();
        assert_eq!(
            placed(&["9.png", "10.png", "12.png"]),
            pairs(&[("9.png", 9.0), ("10.png", 10.0), ("12.png", 12.0)])
        );
        assert_eq!(
            placed(&["pose0001_f0.500.png", "pose0001_f0.050.png"]),
            pairs(&[("pose0001_f0.050.png", 0.05), ("pose0001_f0.500.png", 0.5)])
        );
        assert_eq!(placed(&["z_-2.5um.tif", "z_3um.tif"])[1], ("z_-2.5um.tif".to_owned(), -2.5));
        assert_eq!(placed(&["stack-3.png", "stack-11.png"])[0], ("stack-3.png".to_owned(), 3.0));
        // Two numbers differ, so only the order of the names is used.
        assert_eq!(placed(&["b10_1.png", "b9_2.png"]), pairs(&[("b9_2.png", 0.0), ("b10_1.png", 1.0)]));
        assert_eq!(placed(&["far.png", "near.png"]), pairs(&[("far.png", 0.0), ("near.png", 1.0)]));
    }
}

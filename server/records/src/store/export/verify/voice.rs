//! Checks the recordings in an export: each file consists of its pieces, one after another, with the hashes that the
//! chain has.

use std::collections::{BTreeMap, BTreeSet};

use sha2::{Digest, Sha256};

use super::files::ExportFiles;
use super::verdict::{Outcome, Verdict};
use crate::store::export::voice::{FOLDER, file_name};
use crate::store::voice::erased_words;
use parfocal_base::files::is_systems_own;
use parfocal_trial::voice::MediaType;

/// A piece, as the tables describe it.
struct Piece {
    place: u32,
    bytes: usize,
    sha256: String,
}

/// Checks the recordings of an export.
pub(super) fn voice(export: &ExportFiles) -> Outcome {
    let pieces = pieces(export)?;
    let erased = erased(export)?;
    let files = export.cells("voice.csv", "file")?;
    let types = export.cells("voice.csv", "media_type")?;
    let comments = export.cells("voice.csv", "comment")?;
    same_comments(export, &comments, &pieces)?;

    let mut known = BTreeSet::new();
    let mut checked = 0;
    let mut gone = 0;
    for ((comment, file), media_type) in comments.iter().zip(&files).zip(&types) {
        let pieces = pieces.get(comment).map_or(&[][..], Vec::as_slice);
        if file.is_empty() {
            if !pieces.is_empty() && !erased.contains(comment) {
                return Err(format!("voice.csv: comment {comment} has no file, and nobody erased it"));
            }
            gone += pieces.len();
            continue;
        }

        let expected = MediaType::named(media_type).map(|media_type| file_name(comment, media_type));
        if expected.as_ref() != Some(file) {
            return Err(format!("voice.csv: '{file}' is not the name of the file of comment {comment}"));
        }
        if erased.contains(comment) {
            return Err(format!("{file}: comment {comment} was erased, but has sound"));
        }
        let sound = std::fs::read(export.folder().join(file)).map_err(|error| format!("{file}: {error}"))?;
        check_pieces(file, &sound, pieces)?;
        checked += pieces.len();
        known.insert(file.clone());
    }

    no_others(export, &known)?;
    Ok(Verdict::Passed(format!("{checked} pieces of recordings are as they were sent{}", erased_words(gone))))
}

/// The pieces of each comment, in order.
fn pieces(export: &ExportFiles) -> Result<BTreeMap<String, Vec<Piece>>, String> {
    let column = |name| export.cells("voice_pieces.csv", name);
    let comments = column("comment")?;
    let places = column("piece")?;
    let lengths = column("bytes")?;
    let hashes = column("sha256")?;

    let mut pieces: BTreeMap<String, Vec<Piece>> = BTreeMap::new();
    for (((comment, place), bytes), sha256) in comments.into_iter().zip(places).zip(lengths).zip(hashes) {
        let wrong = |_| format!("voice_pieces.csv: a piece of comment {comment} has no place or length");
        let piece = Piece { place: place.parse().map_err(wrong)?, bytes: bytes.parse().map_err(wrong)?, sha256 };
        pieces.entry(comment).or_default().push(piece);
    }
    for pieces in pieces.values_mut() {
        pieces.sort_by_key(|piece| piece.place);
    }
    Ok(pieces)
}

/// The comments that were erased.
fn erased(export: &ExportFiles) -> Result<BTreeSet<String>, String> {
    let subjects = export.cells("erasures.csv", "subject")?;
    let records = export.cells("erasures.csv", "record")?;
    let comments = subjects.into_iter().zip(records).filter(|(subject, _)| subject == "comment");
    Ok(comments.map(|(_, record)| record).collect())
}

/// Checks that the voice comments, the recordings and the pieces belong together.
fn same_comments(
    export: &ExportFiles,
    recordings: &[String],
    pieces: &BTreeMap<String, Vec<Piece>>,
) -> Result<(), String> {
    let keys = export.cells("comments.csv", "key")?;
    let kinds = export.cells("comments.csv", "kind")?;
    let spoken = keys.into_iter().zip(kinds).filter(|(_, kind)| kind == "voice").map(|(key, _)| key);
    if !spoken.eq(recordings.iter().cloned()) {
        return Err("voice.csv: its rows are not the voice comments of comments.csv".to_owned());
    }
    match pieces.keys().find(|comment| !recordings.contains(comment)) {
        Some(comment) => Err(format!("voice_pieces.csv: comment {comment} is not a voice comment")),
        None => Ok(()),
    }
}

fn check_pieces(file: &str, sound: &[u8], pieces: &[Piece]) -> Result<(), String> {
    let mut rest = sound;
    for Piece { place, bytes, sha256 } in pieces {
        let Some((piece, after)) = rest.split_at_checked(*bytes) else {
            return Err(format!("{file}: piece {place} is missing or cut short"));
        };
        if hex::encode(Sha256::digest(piece)) != *sha256 {
            return Err(format!("{file}: piece {place} was changed: its sound has another hash"));
        }
        rest = after;
    }
    if rest.is_empty() { Ok(()) } else { Err(format!("{file}: {} bytes were added at its end", rest.len())) }
}

/// Checks that the export's folder of recordings has no other files.
fn no_others(export: &ExportFiles, known: &BTreeSet<String>) -> Result<(), String> {
    let Ok(entries) = std::fs::read_dir(export.folder().join(FOLDER)) else { return Ok(()) };
    for entry in entries {
        let name = entry.map_err(|error| format!("{FOLDER}: {error}"))?.file_name();
        if is_systems_own(&name) {
            continue;
        }
        let name = format!("{FOLDER}/{}", name.to_string_lossy());
        if !known.contains(&name) {
            return Err(format!("{name} belongs to no comment"));
        }
    }
    Ok(())
}

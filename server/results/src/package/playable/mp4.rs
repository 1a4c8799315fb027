//! MP4 in fragments (ISO/IEC 14496-12), as a browser records it: writes the duration into the movie's headers, which
//! have 0 there.

use std::ops::Range;

/// A box: its kind and where its content is.
#[derive(Debug, Clone)]
struct Part {
    kind: [u8; 4],
    content: Range<usize>,
}

/// A header that states a time scale and a duration.
struct Header {
    /// Ticks a second.
    scale: u64,
    /// Where the duration is.
    duration: Range<usize>,
}

/// `file` with its duration; `None` if it states one, has more than one track, or cannot be read.
pub fn with_duration(file: &[u8]) -> Option<Vec<u8>> {
    let top = parts(file, 0..file.len());
    let movie = one(&top, *b"moov")?;
    let in_movie = parts(file, movie.content);
    let track = parts(file, one(&in_movie, *b"trak")?.content);
    let media = parts(file, one(&track, *b"mdia")?.content);

    let of_movie = header(file, &one(&in_movie, *b"mvhd")?, true)?;
    let of_media = header(file, &one(&media, *b"mdhd")?, true)?;
    let of_track = header(file, &one(&track, *b"tkhd")?, false)?;
    let states_one = |header: &Header| file[header.duration.clone()].iter().any(|byte| !matches!(byte, 0 | 0xff));
    if states_one(&of_movie) || states_one(&of_media) || of_media.scale == 0 {
        return None;
    }

    let usual = one(&in_movie, *b"mvex").and_then(|extends| usual_duration(file, extends)).unwrap_or(0);
    let fragments = top.iter().filter(|part| part.kind == *b"moof");
    let ends = fragments.filter_map(|fragment| end_of(file, fragment, usual));
    let ticks = ends.max().filter(|ticks| *ticks > 0)?;

    let mut out = file.to_vec();
    let in_movies_scale = u64::try_from(u128::from(ticks) * u128::from(of_movie.scale) / u128::from(of_media.scale));
    let in_movies_scale = in_movies_scale.ok()?;
    for (header, value) in [(of_movie, in_movies_scale), (of_track, in_movies_scale), (of_media, ticks)] {
        let bytes = value.to_be_bytes();
        let from = 8 - header.duration.len();
        if bytes[..from].iter().any(|byte| *byte != 0) {
            return None;
        }
        out[header.duration].copy_from_slice(&bytes[from..]);
    }
    Some(out)
}

/// The one box of `kind`; `None` if there is none, or more than one.
fn one(parts: &[Part], kind: [u8; 4]) -> Option<Part> {
    let mut of_kind = parts.iter().filter(|part| part.kind == kind);
    of_kind.next().filter(|_| of_kind.next().is_none()).cloned()
}

/// The boxes in `within`, as far as they are whole.
fn parts(file: &[u8], within: Range<usize>) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut at = within.start;
    while let Some(part) = part(file, at).filter(|part| part.content.end <= within.end) {
        at = part.content.end;
        parts.push(part);
    }
    parts
}

fn part(file: &[u8], at: usize) -> Option<Part> {
    let kind = file.get(at + 4..at + 8)?.try_into().ok()?;
    let (size, head) = match number(file, at..at + 4)? {
        0 => (file.len() - at, 8),
        1 => (usize::try_from(number(file, at + 8..at + 16)?).ok()?, 16),
        size => (usize::try_from(size).ok()?, 8),
    };
    let end = at.checked_add(size)?;
    (size >= head && end <= file.len()).then_some(Part { kind, content: at + head..end })
}

fn number(file: &[u8], place: Range<usize>) -> Option<u64> {
    Some(file.get(place)?.iter().fold(0, |number, byte| (number << 8) | u64::from(*byte)))
}

/// The header in `part`: one with a time scale (`mvhd`, `mdhd`), or the track's (`tkhd`), which has an id instead.
fn header(file: &[u8], part: &Part, scaled: bool) -> Option<Header> {
    let start = part.content.start;
    let wide = *file.get(start)? == 1;
    // Version and flags, two times, the scale or the track's id and a reserved field, the duration.
    let scale_at = start + 4 + if wide { 16 } else { 8 };
    let duration_at = scale_at + if scaled { 4 } else { 8 };
    let duration = duration_at..duration_at + if wide { 8 } else { 4 };
    let scale = number(file, scale_at..scale_at + 4)?;
    (duration.end <= part.content.end).then_some(Header { scale, duration })
}

/// How long a sample lasts where a fragment does not say.
fn usual_duration(file: &[u8], extends: Part) -> Option<u64> {
    let of_track = one(&parts(file, extends.content), *b"trex")?;
    // Version and flags, the track's id, the description's number.
    let at = of_track.content.start + 12;
    number(file, at..at + 4)
}

/// Where `fragment` ends, in ticks of the media.
fn end_of(file: &[u8], fragment: &Part, usual: u64) -> Option<u64> {
    let track = parts(file, one(&parts(file, fragment.content.clone()), *b"traf")?.content);
    let head = one(&track, *b"tfhd")?.content.start;
    let flags = number(file, head + 1..head + 4)?;

    // Fields that may stand before the usual duration: the base of offsets, and the description's number.
    let mut at = head + 8;
    at += if flags & 0x01 == 0 { 0 } else { 8 };
    at += if flags & 0x02 == 0 { 0 } else { 4 };
    let usual = if flags & 0x08 == 0 { usual } else { number(file, at..at + 4)? };

    let begin = one(&track, *b"tfdt")?.content.start;
    let wide = *file.get(begin)? == 1;
    let mut end = number(file, begin + 4..begin + if wide { 12 } else { 8 })?;
    for run in track.iter().filter(|part| part.kind == *b"trun") {
        end = end.checked_add(duration_of(file, run, usual)?)?;
    }
    Some(end)
}

/// How long the samples of `run` last together.
fn duration_of(file: &[u8], run: &Part, usual: u64) -> Option<u64> {
    let start = run.content.start;
    let flags = number(file, start + 1..start + 4)?;
    let samples = usize::try_from(number(file, start + 4..start + 8)?).ok()?;
    if flags & 0x100 == 0 {
        return usual.checked_mul(samples as u64);
    }

    // Fields of the run, and of each sample, of which the duration is the first.
    let first = start + 8 + [0x01, 0x04].iter().filter(|bit| flags & **bit != 0).count() * 4;
    let each = [0x100, 0x200, 0x400, 0x800].iter().filter(|bit| flags & **bit != 0).count() * 4;
    if samples.checked_mul(each)? > run.content.end.checked_sub(first)? {
        return None;
    }
    let durations = (0..samples).map(|sample| number(file, first + sample * each..first + sample * each + 4));
    durations.sum()
}

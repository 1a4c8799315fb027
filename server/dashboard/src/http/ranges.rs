//! Answers range requests, as browsers send them during playback (RFC 9110, section 14): one range of bytes.

use std::ops::Range;

use axum::body::Bytes;
use axum::http::header::{ACCEPT_RANGES, CONTENT_RANGE, RANGE};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};

/// The part that a request asks for.
#[derive(Debug, PartialEq, Eq)]
enum RequestedRange {
    /// All of it. Also used for forms that a server may ignore, such as several ranges.
    Whole,
    /// These bytes.
    Part(Range<usize>),
    /// Bytes beyond its end.
    Beyond,
}

/// Answers with the part of `whole` that `headers` ask for, or with all of it.
pub(super) fn answer(headers: &HeaderMap, whole: Vec<u8>) -> Response {
    let length = whole.len();
    let asked = headers.get(RANGE).and_then(|range| range.to_str().ok());
    let whole = Bytes::from(whole);
    let accepts = (ACCEPT_RANGES, "bytes".to_owned());

    match wanted(asked, length) {
        RequestedRange::Whole => ([accepts], whole).into_response(),
        RequestedRange::Part(part) => {
            let content_range = format!("bytes {}-{}/{length}", part.start, part.end - 1);
            (StatusCode::PARTIAL_CONTENT, [accepts, (CONTENT_RANGE, content_range)], whole.slice(part)).into_response()
        }
        RequestedRange::Beyond => {
            let content_range = format!("bytes */{length}");
            (StatusCode::RANGE_NOT_SATISFIABLE, [accepts, (CONTENT_RANGE, content_range)]).into_response()
        }
    }
}

fn wanted(asked: Option<&str>, length: usize) -> RequestedRange {
    let range = asked.and_then(|asked| asked.strip_prefix("bytes=")).and_then(|range| range.split_once('-'));
    let Some((first, last)) = range else { return RequestedRange::Whole };

    let part = match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(first), Ok(last)) if first <= last => first..last.saturating_add(1).min(length),
        (Ok(first), Err(_)) if last.is_empty() => first..length,
        // The last `count` bytes, or all if there are fewer.
        (Err(_), Ok(count)) if first.is_empty() => length.saturating_sub(count)..length,
        _ => return RequestedRange::Whole,
    };
    if part.is_empty() { RequestedRange::Beyond } else { RequestedRange::Part(part) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_read_as_the_standard_says() {
        let asked = |text: &str| wanted(Some(text), 1000);
        assert_eq!(wanted(None, 1000), RequestedRange::Whole);
        assert_eq!(asked("bytes=0-"), RequestedRange::Part(0..1000));
        assert_eq!(asked("bytes=0-499"), RequestedRange::Part(0..500));
        assert_eq!(asked("bytes=500-999"), RequestedRange::Part(500..1000));
        assert_eq!(asked("bytes=900-5000"), RequestedRange::Part(900..1000));
        assert_eq!(asked("bytes=-500"), RequestedRange::Part(500..1000));
        assert_eq!(asked("bytes=-5000"), RequestedRange::Part(0..1000));
        assert_eq!(asked("bytes=1000-"), RequestedRange::Beyond);
        assert_eq!(asked("bytes=-0"), RequestedRange::Beyond);
        for other in ["", "bytes=", "bytes=-", "bytes=5-4", "bytes=0-1,5-6", "lines=0-1", "bytes=a-b"] {
            assert_eq!(asked(other), RequestedRange::Whole, "{other}");
        }
    }
}

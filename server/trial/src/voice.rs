//! Voice comments: a surgeon's speech, sent in pieces while the surgeon speaks. Accepted pieces are kept, whatever
//! state the session is in.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::refusal::Refusal;
use parfocal_base::ids::{IdempotencyKey, SessionId};

/// Maximum size of a piece, in bytes. A second of speech takes about 4,000 in Opus, and 16,000 in AAC.
pub const LARGEST_PIECE: usize = 128 * 1024;

/// Maximum size of a recording, in bytes. The page ends a recording after two minutes, which is less than 1 MiB of
/// speech.
pub const LARGEST_RECORDING: usize = 8 * 1024 * 1024;

/// Maximum number of pieces in a recording. The page sends one piece a second.
pub const MOST_PIECES: u32 = 600;

/// Longest recording that a page may report, milliseconds.
const LONGEST_MS: i64 = 60 * 60 * 1000;

/// A type of sound file that browsers record and play.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MediaType {
    /// Opus in `WebM`: Chromium, Firefox, Safari from 18.4.
    WebmOpus,
    /// AAC in MP4: Safari before 18.4.
    Mp4,
    /// Opus in Ogg: Firefox, if it has no `WebM`.
    OggOpus,
}

impl MediaType {
    const ALL: [Self; 3] = [Self::WebmOpus, Self::Mp4, Self::OggOpus];

    /// The type's name, as in the database, in exports and over HTTP.
    pub const fn name(self) -> &'static str {
        match self {
            Self::WebmOpus => "audio/webm;codecs=opus",
            Self::Mp4 => "audio/mp4",
            Self::OggOpus => "audio/ogg;codecs=opus",
        }
    }

    /// File name extension, without a dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::WebmOpus => "webm",
            Self::Mp4 => "m4a",
            Self::OggOpus => "ogg",
        }
    }

    /// The type that `text` names; none if it is another type. Browsers differ in blanks and in upper and lower case,
    /// and Safari adds its codec.
    pub fn named(text: &str) -> Option<Self> {
        let plain: String = text.chars().filter(|letter| !matches!(letter, ' ' | '"')).collect();
        let plain = plain.to_ascii_lowercase();
        let is_mp4 = plain == "audio/mp4" || plain.starts_with("audio/mp4;codecs=mp4a");
        Self::ALL.into_iter().find(|kind| kind.name() == plain || *kind == Self::Mp4 && is_mp4)
    }
}

/// Why a recording ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// The surgeon released the button.
    Released,
    /// The recording reached the longest time that the page allows.
    Limit,
    /// The browser lost the microphone.
    MicrophoneLost,
    /// The page was hidden or left.
    Left,
}

names!(Ending { Released: "released", Limit: "limit", MicrophoneLost: "microphone-lost", Left: "left" });

/// A piece of a recording as a surgeon's browser sends it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewPiece {
    /// Key of the comment that the piece belongs to.
    pub comment: IdempotencyKey,
    /// Session of the comment.
    pub session: SessionId,
    /// Number of the piece in the recording, from 1.
    pub piece: u32,
    /// Media type of the recording, as the browser names it.
    pub media_type: String,
    /// Length of the recording up to the end of this piece, milliseconds.
    pub through_ms: i64,
    /// Why the recording ended, if this is its last piece.
    pub ended: Option<Ending>,
    /// Bytes of the sound; may be empty in the last piece.
    pub audio: Vec<u8>,
}

/// Checks the piece `new`, and returns its media type.
///
/// # Errors
/// If its type is not one that browsers record, it is too large, or its number or its time is out of range.
pub fn check_piece(new: &NewPiece) -> Result<MediaType, Refusal> {
    let NewPiece { piece, media_type, through_ms, audio, .. } = new;
    let known = MediaType::named(media_type).ok_or_else(|| {
        let types = MediaType::ALL.map(MediaType::name).join(", ");
        Refusal::Invalid(format!("a recording may be {types}, not '{media_type}'"))
    })?;

    if audio.len() > LARGEST_PIECE {
        return Err(Refusal::Invalid(format!(
            "a piece of a recording may have {LARGEST_PIECE} bytes, not {}; send it in smaller pieces",
            audio.len()
        )));
    }
    if !(1..=MOST_PIECES).contains(piece) {
        return Err(Refusal::Invalid(format!("the pieces of a recording are 1 to {MOST_PIECES}, not {piece}")));
    }
    if !(0..=LONGEST_MS).contains(through_ms) {
        return Err(Refusal::Invalid(format!("through_ms must be from 0 to {LONGEST_MS}, not {through_ms}")));
    }
    Ok(known)
}

/// The refusal of a piece that would make its recording too large.
pub fn too_large() -> Refusal {
    Refusal::Invalid(format!("a recording may have {LARGEST_RECORDING} bytes in all; begin another one"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(media_type: &str) -> NewPiece {
        NewPiece {
            comment: IdempotencyKey(uuid::Uuid::nil()),
            session: SessionId(uuid::Uuid::nil()),
            piece: 1,
            media_type: media_type.to_owned(),
            through_ms: 1000,
            ended: None,
            audio: vec![0; 4000],
        }
    }

    #[test]
    fn what_browsers_record_is_accepted_however_they_write_it() {
        let accepted = |text: &str| check_piece(&piece(text)).ok();
        assert_eq!(accepted("audio/webm;codecs=opus"), Some(MediaType::WebmOpus));
        assert_eq!(accepted("audio/webm; codecs=\"opus\""), Some(MediaType::WebmOpus));
        assert_eq!(accepted("audio/mp4"), Some(MediaType::Mp4));
        assert_eq!(accepted("audio/mp4; codecs=mp4a.40.2"), Some(MediaType::Mp4));
        assert_eq!(accepted("audio/ogg; codecs=opus"), Some(MediaType::OggOpus));
        for other in ["", "audio/wav", "video/webm", "text/html", "audio/webm;codecs=opus,vp8", "audio/mp4;codecs=avc1"]
        {
            assert_eq!(accepted(other), None, "{other}");
        }
    }

    #[test]
    fn a_piece_has_a_place_and_a_size() {
        let fits = |change: &dyn Fn(&mut NewPiece)| {
            let mut new = piece("audio/mp4");
            change(&mut new);
            check_piece(&new).is_ok()
        };
        assert!(fits(&|new| new.piece = MOST_PIECES) && fits(&|new| new.audio = vec![0; LARGEST_PIECE]));
        assert!(fits(&|new| new.audio.clear()), "the last piece may be empty");
        assert!(!fits(&|new| new.piece = 0) && !fits(&|new| new.piece = MOST_PIECES + 1));
        assert!(!fits(&|new| new.audio = vec![0; LARGEST_PIECE + 1]));
        assert!(!fits(&|new| new.through_ms = -1) && !fits(&|new| new.through_ms = LONGEST_MS + 1));
    }
}

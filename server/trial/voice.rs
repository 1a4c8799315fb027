//! Voice: what a surgeon says aloud, sent in pieces while it is spoken. What of it is accepted is kept, whatever state
//! the session is in.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::refusal::Refusal;
use crate::ids::{IdempotencyKey, SessionId};

/// Most bytes of a piece. A second of speech has about 4,000 in Opus, and 16,000 in AAC.
pub const LARGEST_PIECE: usize = 128 * 1024;

/// Most bytes of a recording. The page ends one after two minutes, which is less than 1 MiB of speech.
pub const LARGEST_RECORDING: usize = 8 * 1024 * 1024;

/// Most pieces of a recording. The page sends one a second.
pub const MOST_PIECES: u32 = 600;

/// Longest recording that a page may tell of, milliseconds.
const LONGEST_MS: i64 = 60 * 60 * 1000;

/// A kind of sound file that browsers record and play.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MediaType {
    /// Opus in `WebM`: Chromium, Firefox, Safari from 18.4.
    WebmOpus,
    /// AAC in MP4: Safari before.
    Mp4,
    /// Opus in Ogg: Firefox, where it has no `WebM`.
    OggOpus,
}

impl MediaType {
    const ALL: [Self; 3] = [Self::WebmOpus, Self::Mp4, Self::OggOpus];

    /// Its name, as in the database, in exports and over HTTP.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::WebmOpus => "audio/webm;codecs=opus",
            Self::Mp4 => "audio/mp4",
            Self::OggOpus => "audio/ogg;codecs=opus",
        }
    }

    /// The ending of its files' names.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::WebmOpus => "webm",
            Self::Mp4 => "m4a",
            Self::OggOpus => "ogg",
        }
    }

    /// The type that `text` names. Browsers write blanks and letters differently, and Safari adds its codec.
    #[must_use]
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
    /// The surgeon let go.
    Released,
    /// It had lasted as long as the page lets one last.
    Limit,
    /// The microphone was taken away.
    MicrophoneLost,
    /// The page went out of sight.
    Left,
}

impl Ending {
    /// Its name, as in the database and in exports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Released => "released",
            Self::Limit => "limit",
            Self::MicrophoneLost => "microphone-lost",
            Self::Left => "left",
        }
    }

    /// The ending called `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Released, Self::Limit, Self::MicrophoneLost, Self::Left].into_iter().find(|ending| ending.name() == name)
    }
}

/// A piece of a recording as a surgeon's browser sends it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewPiece {
    /// The comment that it belongs to, by its key.
    pub comment: IdempotencyKey,
    /// The session that the comment was said in.
    pub session: SessionId,
    /// Its place in the recording, from 1.
    pub piece: u32,
    /// What it is, as the browser says.
    pub media_type: String,
    /// How far the recording had come at its end, milliseconds.
    pub through_ms: i64,
    /// Why the recording ended, on its last piece.
    pub ended: Option<Ending>,
    /// The sound.
    pub audio: Vec<u8>,
}

/// Whether `new` is accepted: what it is.
///
/// # Errors
/// When it is of another type than browsers record, too large, or has an impossible place.
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

/// The refusal of a piece with which the recording would be too large.
#[must_use]
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

//! What surgeons said aloud. Each piece of a recording is kept once, however often it is sent, and never changed. If
//! the comment is erased, the sound is deleted; each piece's length and hash stay.

use std::collections::BTreeMap;

use futures_util::TryStreamExt;
use jiff::Timestamp;
use sha2::{Digest, Sha256};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::error::Wrong;
use super::insert::Insert;
use super::remarks::is_erased;
use super::values::{named, parsed};
use super::{Reader, Stamp, Store, StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_trial::voice::{Ending, LARGEST_RECORDING, MediaType};

/// A piece of a recording to be kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VoicePiece {
    /// The comment that it belongs to.
    pub comment: IdempotencyKey,
    /// The comment's session.
    pub session: SessionId,
    /// Its place in the recording, from 1.
    pub piece: u32,
    /// Media type of the sound.
    pub media_type: MediaType,
    /// Length of the recording up to the end of this piece, in milliseconds.
    pub through_ms: i64,
    /// Why the recording ended; only on its last piece.
    pub ended: Option<Ending>,
    /// The sound, as the browser encoded it.
    pub audio: Vec<u8>,
    /// When it was kept.
    pub stamp: Stamp,
}

/// The outcome of keeping a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PieceKept {
    /// It is on disk, now or since it was sent before.
    Kept,
    /// Another piece is on disk in its place, or the recording has another media type.
    PlaceTaken,
    /// The session has no such voice comment.
    NoSuchComment,
    /// With it the recording would be too large.
    TooLarge,
}

/// A piece read back, without its sound.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredPiece {
    /// Its place in the recording, from 1.
    pub piece: u32,
    /// Media type of the sound.
    pub media_type: MediaType,
    /// Length of the recording up to the end of this piece, in milliseconds.
    pub through_ms: i64,
    /// Why the recording ended; only on its last piece.
    pub ended: Option<Ending>,
    /// Its length in bytes.
    pub bytes: i64,
}

/// A recording without its sound: its pieces, in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct VoiceRecording {
    /// The pieces that arrived.
    pub pieces: Vec<StoredPiece>,
}

impl VoiceRecording {
    /// Length of all pieces in bytes.
    pub fn bytes(&self) -> i64 {
        self.pieces.iter().map(|piece| piece.bytes).sum()
    }

    /// How long it is, in seconds, as the page reported.
    pub fn seconds(&self) -> f64 {
        let longest = self.pieces.iter().map(|piece| piece.through_ms).max().unwrap_or(0);
        longest as f64 / 1000.0
    }

    /// Media type of its sound; `None` before its first piece.
    pub fn media_type(&self) -> Option<MediaType> {
        self.pieces.first().map(|piece| piece.media_type)
    }

    /// Why it ended; `None` if it was cut off.
    pub fn ended(&self) -> Option<Ending> {
        self.pieces.iter().find_map(|piece| piece.ended)
    }

    /// Pieces that have not arrived, though a later one has.
    pub fn missing(&self) -> usize {
        let last = self.pieces.iter().map(|piece| piece.piece).max().unwrap_or(0);
        (last as usize).saturating_sub(self.pieces.len())
    }
}

/// A voice comment whose sound is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptVoice {
    /// Its session.
    pub session: SessionId,
    /// The session's protocol.
    pub protocol_toml: String,
    /// The comment.
    pub comment: IdempotencyKey,
    /// When the comment was kept, by the server's wall clock.
    pub wall: Timestamp,
}

impl Store {
    /// Keeps a piece of a recording. It is on disk when this returns. If the comment was erased, only the length and
    /// the hash of the piece are kept.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn keep_voice(&self, new: &VoicePiece) -> Result<PieceKept, StoreError> {
        let comment = new.comment.to_string();
        let sha256 = hex::encode(Sha256::digest(&new.audio));

        self.write(async |connection| {
            let known = "SELECT EXISTS (SELECT 1 FROM comments WHERE key = ? AND session = ? AND kind = 'voice')";
            let known: bool = sqlx::query_scalar(known)
                .bind(&comment)
                .bind(new.session.to_string())
                .fetch_one(&mut *connection)
                .await?;
            if !known {
                return Ok(PieceKept::NoSuchComment);
            }

            let before = "SELECT sha256, media_type, ended FROM voice_pieces WHERE comment = ? AND piece = ?";
            let before = sqlx::query(before).bind(&comment).bind(new.piece).fetch_optional(&mut *connection).await?;
            if let Some(row) = before {
                let same = row.try_get::<String, _>("sha256")? == sha256
                    && row.try_get::<String, _>("media_type")? == new.media_type.name()
                    && row.try_get::<Option<String>, _>("ended")?.as_deref() == new.ended.map(Ending::name);
                return Ok(if same { PieceKept::Kept } else { PieceKept::PlaceTaken });
            }

            let (bytes, others): (i64, i64) = sqlx::query_as(
                "SELECT coalesce(sum(bytes), 0), coalesce(sum(media_type <> ?2), 0) FROM voice_pieces
                 WHERE comment = ?1",
            )
            .bind(&comment)
            .bind(new.media_type.name())
            .fetch_one(&mut *connection)
            .await?;
            if others > 0 {
                return Ok(PieceKept::PlaceTaken);
            }
            if usize::try_from(bytes).unwrap_or(usize::MAX).saturating_add(new.audio.len()) > LARGEST_RECORDING {
                return Ok(PieceKept::TooLarge);
            }

            let erased = is_erased(connection, "comment", &comment).await?;
            let number = Insert::into("voice_pieces")
                .set("comment", &comment)
                .set("session", new.session.to_string())
                .set("piece", new.piece)
                .set("media_type", new.media_type.name())
                .set("through_ms", new.through_ms)
                .set("ended", new.ended.map(Ending::name))
                .set("bytes", i64::try_from(new.audio.len()).unwrap_or(i64::MAX))
                .set("sha256", &sha256)
                .set("audio", (!erased).then_some(&new.audio))
                .recorded(self.inner.run, new.stamp)
                .execute(connection)
                .await?;

            chain::append(connection, "voice-piece", &number.to_string(), &new.stamp.wall.to_string()).await?;
            Ok(PieceKept::Kept)
        })
        .await
    }
}

impl Reader {
    /// The recordings of `session` without their sound, by the comment that each belongs to.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn voice(&self, session: SessionId) -> Result<BTreeMap<IdempotencyKey, VoiceRecording>, StoreError> {
        let sql = "SELECT comment, piece, media_type, through_ms, ended, bytes
             FROM voice_pieces WHERE session = ? ORDER BY comment, piece";
        let of_comment = |row: &SqliteRow| Ok((parsed(row, "comment")?, stored(row)?));

        let mut recordings: BTreeMap<IdempotencyKey, VoiceRecording> = BTreeMap::new();
        for (comment, piece) in self.rows(sql, &session, of_comment).await? {
            recordings.entry(comment).or_default().pieces.push(piece);
        }
        Ok(recordings)
    }

    /// Media type and sound of the recording that belongs to `comment` of `session`. The sound is its pieces, one after
    /// another. `None` if there is no sound, or it was erased.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn voice_audio(
        &self,
        session: SessionId,
        comment: IdempotencyKey,
    ) -> Result<Option<(MediaType, Vec<u8>)>, StoreError> {
        let mut rows = sqlx::query(
            "SELECT media_type, audio FROM voice_pieces WHERE session = ? AND comment = ? AND audio IS NOT NULL
             ORDER BY piece",
        )
        .bind(session.to_string())
        .bind(comment.to_string())
        .fetch(self.pool());

        let mut whole: Option<(MediaType, Vec<u8>)> = None;
        while let Some(row) = rows.try_next().await? {
            let audio: Vec<u8> = row.try_get("audio")?;
            match &mut whole {
                Some((_, sound)) => sound.extend(audio),
                None => whole = Some((named(&row, "media_type", "a recording", MediaType::named)?, audio)),
            }
        }
        Ok(whole)
    }

    /// The voice comments that were not erased, oldest first.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn kept_voice(&self) -> Result<Vec<KeptVoice>, StoreError> {
        let rows = sqlx::query(
            "SELECT comments.session, sessions.protocol_toml, comments.key, comments.wall
             FROM comments JOIN sessions USING (session)
             WHERE comments.kind = 'voice'
                 AND NOT EXISTS (SELECT 1 FROM erasures WHERE subject = 'comment' AND record = comments.key)
             ORDER BY comments.number",
        )
        .fetch_all(self.pool())
        .await?;

        let kept = |row: &SqliteRow| {
            Ok(KeptVoice {
                session: parsed(row, "session")?,
                protocol_toml: row.try_get("protocol_toml")?,
                comment: parsed(row, "key")?,
                wall: parsed(row, "wall")?,
            })
        };
        rows.iter().map(kept).collect()
    }

    /// Checks the sound of every recording against the hashes of its pieces. Says what was found, in words. The hashes
    /// themselves are checked with the chain.
    pub(super) async fn check_voice(&self) -> Result<String, Wrong> {
        let mut rows = sqlx::query(
            "SELECT comment, piece, bytes, sha256, audio, EXISTS (
                 SELECT 1 FROM erasures WHERE subject = 'comment' AND record = comment) AS erased
             FROM voice_pieces ORDER BY number",
        )
        .fetch(self.pool());

        let mut checked = 0;
        let mut gone = 0;
        while let Some(row) = rows.try_next().await? {
            let comment: String = row.try_get("comment")?;
            let piece: i64 = row.try_get("piece")?;
            let named = |what: &str| format!("voice: piece {piece} of comment {comment} {what}");
            let audio: Option<Vec<u8>> = row.try_get("audio")?;

            match (audio, row.try_get("erased")?) {
                (None, true) => gone += 1,
                (None, false) => return Err(named("has no sound, and nobody erased it").into()),
                (Some(_), true) => return Err(named("was erased, but has sound").into()),
                (Some(audio), false) => {
                    let whole = i64::try_from(audio.len()) == Ok(row.try_get("bytes")?)
                        && hex::encode(Sha256::digest(&audio)) == row.try_get::<String, _>("sha256")?;
                    if !whole {
                        return Err(named("was changed: its sound has another hash").into());
                    }
                    checked += 1;
                }
            }
        }
        Ok(format!("{checked} pieces of recordings are as they were sent{}", erased_words(gone)))
    }
}

/// How many pieces were erased, as the end of a sentence.
pub(super) fn erased_words(pieces: usize) -> String {
    if pieces == 0 { String::new() } else { format!("; {pieces} were erased") }
}

fn stored(row: &SqliteRow) -> Result<StoredPiece, StoreError> {
    let ended: Option<String> = row.try_get("ended")?;
    let ended = ended.map(|_| named(row, "ended", "a recording", Ending::named));

    Ok(StoredPiece {
        piece: row.try_get("piece")?,
        media_type: named(row, "media_type", "a recording", MediaType::named)?,
        through_ms: row.try_get("through_ms")?,
        ended: ended.transpose()?,
        bytes: row.try_get("bytes")?,
    })
}

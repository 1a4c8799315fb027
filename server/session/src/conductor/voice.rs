//! Voice: stores pieces of recordings as they arrive, and erases recordings when the protocol's retention period is
//! over.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};
use tokio::time::sleep;

use super::remarks::taken;
use super::{ConductError, Conductor, Shared};
use parfocal_base::boxed;
use parfocal_records::store::{Erasure, KeptVoice, PieceKept, VoicePiece};
use parfocal_trial::erasure::Erasable;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::role::Role;
use parfocal_trial::voice::{self, NewPiece};

/// Interval between two searches for recordings whose retention period is over.
const HOURLY: Duration = Duration::from_hours(1);

impl Conductor {
    /// Stores a piece of a recording. It is on disk when this returns. Pieces may come late, and in any order.
    ///
    /// # Errors
    /// If the session has no such voice comment, the piece is not sound or too large, its place is taken by something
    /// else, or the disk failed.
    pub async fn voice_piece(&self, piece: NewPiece) -> Result<(), ConductError> {
        self.to_the_end(|shared| async move { shared.voice_piece(piece).await }).await
    }

    /// Erases recordings whose retention period by their protocol is over, and finishes earlier erasures. Returns how
    /// many recordings.
    ///
    /// # Errors
    /// If a session is under way, or the disk failed.
    pub async fn erase_expired_voice(&self) -> Result<usize, ConductError> {
        self.to_the_end(|shared| async move { shared.erase_expired_voice().await }).await
    }

    /// Erases expired recordings, and finishes erasures, now and then every hour. Never returns; drop it to stop.
    pub async fn keep_voice_no_longer(self) {
        loop {
            match self.erase_expired_voice().await {
                Ok(0) | Err(ConductError::Conflict(_)) => {}
                Ok(erased) => tracing::info!(
                    "{erased} voice comments were erased, because the time that their protocols keep them is over"
                ),
                Err(error) => {
                    tracing::warn!("voice comments whose time is over, or copies of them, may remain: {error}");
                }
            }
            sleep(HOURLY).await;
        }
    }
}

impl Shared {
    #[boxed]
    async fn voice_piece(&self, new: NewPiece) -> Result<(), ConductError> {
        let media_type = voice::check_piece(&new)?;
        let NewPiece { comment, session, piece, media_type: _, through_ms, ended, audio } = new;

        // Does not take the pen: a piece affects no decision, and must not wait for those that are being made.
        let stamp = self.stamp();
        let piece = VoicePiece { comment, session, piece, media_type, through_ms, ended, audio, stamp };
        match self.store.keep_voice(&piece).await? {
            PieceKept::Kept => Ok(()),
            PieceKept::PlaceTaken => Err(taken()),
            PieceKept::TooLarge => Err(voice::too_large().into()),
            PieceKept::NoSuchComment => {
                Err(ConductError::NotFound("this session has no such voice comment; send the comment first".to_owned()))
            }
        }
    }

    #[boxed]
    async fn erase_expired_voice(&self) -> Result<usize, ConductError> {
        let mut pen = self.pen.lock().await;
        self.record_stops(&mut pen).await?;

        let stamp = self.stamp();
        let kept = self.store.reader().kept_voice().await?;
        let erasure = |kept: KeptVoice| {
            let days = days_over(&kept, stamp.wall)?;
            Some(Erasure {
                session: kept.session,
                subject: Erasable::Comment,
                record: kept.comment.to_string(),
                reason: format!("the protocol keeps voice for {days} days"),
                by: Role::System,
                stamp,
            })
        };
        let erasures: Vec<Erasure> = kept.into_iter().filter_map(erasure).collect();

        // Erasing rewrites the whole database, and a surgeon's comments would have to wait for it.
        let under_way = self.live().shown_phase().is_some_and(|phase| !phase.has_ended());
        if under_way && erasures.is_empty() {
            return Ok(0);
        }
        if under_way {
            return Err(ConductError::Conflict("a session is under way; voice is erased once it has ended".to_owned()));
        }
        self.store.erase(&erasures, None).await?;
        Ok(erasures.len())
    }
}

/// The protocol's retention period for this recording in days, if it is over at `now`. If the protocol cannot be read,
/// nothing is erased.
fn days_over(kept: &KeptVoice, now: Timestamp) -> Option<u32> {
    let protocol = Protocol::parse_kept(&kept.protocol_toml, "the protocol kept with the session")
        .inspect_err(|error| tracing::warn!(session = %kept.session, %error, "its voice comments are kept"))
        .ok()?;
    let days = protocol.voice_days?;
    let age = now.duration_since(kept.wall);
    (age >= SignedDuration::from_hours(24 * i64::from(days))).then_some(days)
}

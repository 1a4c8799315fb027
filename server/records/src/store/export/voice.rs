//! What surgeons said aloud, in an export: a file for each recording, and its table.

use sha2::{Digest, Sha256};

use super::ExportError;
use super::blinded::Blinded;
use super::description::VoiceRow;
use super::folder::Folder;
use crate::store::{LatestCorrections, Reader, VoiceRecording};
use parfocal_trial::correction::Subject;
use parfocal_trial::erasure::Erasable;
use parfocal_trial::remark::CommentContent;
use parfocal_trial::voice::{Ending, MediaType};

/// The folder of an export in which the recordings are.
pub const FOLDER: &str = "voice";

/// Path, in an export, of the recording that belongs to `comment`.
pub fn file_name(comment: impl std::fmt::Display, media_type: MediaType) -> String {
    format!("{FOLDER}/{comment}.{}", media_type.extension())
}

impl Blinded {
    /// Writes the recordings, one file each, and returns the rows of their table.
    pub(super) async fn write_voice(&self, reader: &Reader, folder: &mut Folder) -> Result<Vec<VoiceRow>, ExportError> {
        let typed = LatestCorrections::of(&self.corrections);
        let nothing = VoiceRecording::default();
        let comments = self.comments.iter().map(|(_, comment)| comment);
        let mut rows = Vec::new();

        for comment in comments.filter(|comment| comment.said == CommentContent::Voice) {
            let sound = reader.voice_audio(comment.session, comment.key).await?;
            let file = sound.as_ref().map(|(media_type, _)| file_name(comment.key, *media_type));
            if let (Some(name), Some((_, audio))) = (&file, &sound) {
                folder.file(name, audio).await?;
            }

            let recorded = self.voice.get(&comment.key).unwrap_or(&nothing);
            let ended = recorded.ended();
            rows.push(VoiceRow {
                comment: comment.key,
                session: comment.session,
                setting: self.setting(comment.segment),
                file,
                media_type: recorded.media_type().map(MediaType::name),
                seconds: recorded.seconds(),
                pieces: recorded.pieces.len(),
                missing: recorded.missing(),
                bytes: recorded.bytes(),
                sha256: sound.map(|(_, audio)| hex::encode(Sha256::digest(audio))),
                ended: ended.map(Ending::name),
                complete: ended.is_some() && recorded.missing() == 0,
                transcript: typed.note(Subject::Comment, &comment.key).map(str::to_owned),
                erased: self.erased.at(Erasable::Comment, &comment.key),
            });
        }
        Ok(rows)
    }
}

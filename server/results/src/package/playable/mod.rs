//! Recordings of voice as players expect them. A browser writes a recording while it goes on, so the file does not say
//! how long it is, and players show no duration and cannot move in it. The bytes as they arrived stay in the exports,
//! where their hashes prove them; a package and the researcher's page get copies that state their duration.

mod mp4;
mod opus;
mod webm;

use parfocal_trial::voice::MediaType;

/// `sound` with its duration written into it; as it is if it states one, or if its parts cannot be read.
pub fn with_duration(media_type: MediaType, sound: Vec<u8>) -> Vec<u8> {
    let changed = match media_type {
        MediaType::WebmOpus => webm::with_duration(&sound),
        MediaType::Mp4 => mp4::with_duration(&sound),
        // The last page of an Ogg file tells where it ends.
        MediaType::OggOpus => None,
    };
    changed.unwrap_or(sound)
}

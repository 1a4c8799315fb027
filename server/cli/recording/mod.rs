//! `parfocal recording`: records hyperspectral video, checks it, and converts it for other programs.

mod cube;
mod info;
mod record;
mod spectrum;
mod step;
mod video;
mod view_info;

use super::output::Failure;

/// What `parfocal recording` does.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Record every frame of a camera, lossless, until Ctrl-C.
    Record(record::Arguments),
    /// Print what a recording holds, and check every frame against its checksum.
    Info(info::Arguments),
    /// Save a frame as a cube of 16 bands that ENVI and Spectral Python read.
    Cube(cube::Arguments),
    /// Print the spectrum at a place: mean and spread of each band, as counts and reflectance.
    Spectrum(spectrum::Arguments),
    /// Save a recording, or a part of it, as a video or as pictures.
    Video(video::Arguments),
    /// Step a policy over a recording: a table of what it sees in each frame, and what it asks of the lens.
    Step(step::Arguments),
}

/// Does what the arguments say.
///
/// # Errors
/// If a recording cannot be made, read or saved as something else.
pub fn run(action: &Action) -> Result<(), Failure> {
    match action {
        Action::Record(arguments) => record::run(arguments),
        Action::Info(arguments) => info::run(arguments),
        Action::Cube(arguments) => cube::run(arguments),
        Action::Spectrum(arguments) => spectrum::run(arguments),
        Action::Video(arguments) => video::run(arguments),
        Action::Step(arguments) => step::run(arguments),
    }
}

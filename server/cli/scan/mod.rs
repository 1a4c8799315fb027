//! `parfocal scan`: records focal-time scans, checks them, and makes them from pictures.

mod from_stack;
mod import;
mod info;
mod record;

use super::output::Failure;

/// What `parfocal scan` does.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Record a scan: at each pose a picture at every focal power, in random order. Run it again to continue.
    Record(record::Arguments),
    /// Print what a scan holds, and check every picture against its checksum.
    Info(info::Arguments),
    /// Make a scan from a folder of pictures named like `pose0001_f0.350.png`.
    Import(import::Arguments),
    /// Make a scan from a focal stack: pictures of one still scene in order of focus.
    FromStack(from_stack::Arguments),
}

/// Does what the arguments say.
///
/// # Errors
/// If a scan cannot be read, recorded or imported.
pub fn run(action: &Action) -> Result<(), Failure> {
    match action {
        Action::Record(arguments) => record::run(arguments),
        Action::Info(arguments) => info::run(arguments),
        Action::Import(arguments) => import::run(arguments),
        Action::FromStack(arguments) => from_stack::run(arguments),
    }
}

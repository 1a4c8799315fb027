//! The arguments of `parfocal serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::navigation::Navigation;
use crate::cli::encryption::Encryption;
use crate::cli::input::{frame_rate, frame_rate_help};
use parfocal_base::BlurRate;

/// Arguments of `parfocal serve`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Address to listen on; 0.0.0.0:8080 lets a tablet connect, and needs --tls.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:8080")]
    pub(super) bind: SocketAddr,
    #[command(flatten)]
    pub(super) encryption: Encryption,
    /// Folder for the database and the keys.
    #[arg(long, value_name = "DIR", default_value = "data")]
    pub(super) data_dir: PathBuf,
    /// Camera: phantom, footage:PATH, scan:DIR, recording:DIR or gige:ID (gige:list lists them); docs/scripting.md has
    /// their options.
    #[arg(long, value_name = "SPEC", default_value = "phantom")]
    pub(super) camera: String,
    /// Lens: simulated, emulated (an emulated Optotune driver), optotune:auto or optotune:DEVICE.
    #[arg(long, value_name = "SPEC", default_value = "simulated")]
    pub(super) lens: String,
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = frame_rate(), help = frame_rate_help())]
    pub(super) fps: u32,
    /// Seed that repeats simulated devices and practice sessions; random by default. Real sessions always use the
    /// system's random source.
    #[arg(long, value_name = "N")]
    pub(super) seed: Option<u64>,
    /// Folder with more trial protocols; `trial-protocols` by default, if it exists.
    #[arg(long, value_name = "DIR")]
    pub(super) protocols: Option<PathBuf>,
    /// Add a policy from a TorchScript file, or one in another process, which the server starts. Protocols name it as
    /// you do here. May be repeated.
    #[arg(long = "policy", value_name = "file:PATH|exec:COMMAND")]
    pub(super) policies: Vec<String>,
    /// Folder with weights of your own (`NAME.safetensors`) that replace those that ship.
    #[arg(long, value_name = "DIR")]
    pub(super) weights: Option<PathBuf>,
    /// How fast the optic blurs, for the policies that can use it: pixels (standard deviation) for a change of focal
    /// power by 1, as `parfocal scan info` measures them.
    #[arg(long, value_name = "PIXELS")]
    pub(super) blur: Option<BlurRate>,
    /// Calibration of the sensor: a TOML file, or a folder of `parfocal calibrate`; a typical unit's by default.
    #[arg(long, value_name = "PATH")]
    pub(super) calibration: Option<PathBuf>,
    /// How the lens moves: the dynamics.toml of `parfocal lens measure`; typical values by default.
    #[arg(long, value_name = "FILE")]
    pub(super) lens_dynamics: Option<PathBuf>,
    #[command(flatten)]
    pub(super) navigation: Navigation,
}

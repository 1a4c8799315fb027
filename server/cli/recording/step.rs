//! `parfocal recording step`: what a policy sees in a recording, and which focal powers it would have requested.

use std::path::PathBuf;

use crate::cli::library::policies;
use crate::cli::output::{Failure, csv, print, save};
use crate::cli::policy_process;
use parfocal_autofocus::Registry;
use parfocal_base::{BlurRate, PolicyName};
use parfocal_devices::camera::calibration;
use parfocal_recording::Recording;
use parfocal_session::playback::stepping::Stepping;

/// Arguments of `parfocal recording step`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording.
    folder: PathBuf,
    /// The policy: a name of `parfocal policies`, `file:PATH` for a TorchScript file or `exec:COMMAND` for a policy in
    /// another process.
    #[arg(long, value_name = "NAME")]
    policy: String,
    /// The table to write: a row for each frame.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Folder with weights of your own (`NAME.safetensors`) that replace those that ship.
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// How fast the optic blurs, for the policies that can use it: pixels for a change of focal power by 1.
    #[arg(long, value_name = "PIXELS")]
    blur: Option<BlurRate>,
}

/// Writes the table.
///
/// # Errors
/// If there is no such recording or policy, a frame is damaged, or the table cannot be written. No table is left then.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let recording = Recording::open(&arguments.folder)?;
    if recording.rows().is_empty() {
        bail!("{} holds no frame to step a policy over", arguments.folder.display());
    }

    let calibration = calibration::of_recording(&recording)?;
    let name = PolicyName::new(&arguments.policy);
    // It must outlive the policy: a policy in another process ends with it.
    let registry = registry(arguments, &name, recording.rate())?;
    let policy = registry.build(&name)?;

    let steps = Stepping::new(&recording, &calibration, policy);
    save(&arguments.out, &csv(steps.map(|step| step.map_err(Failure::from)))?)?;
    print(&format!("{} steps of {name} in {}\n", recording.rows().len(), arguments.out.display()))
}

/// All policies, `name` among them. A policy in another process gets frames at the recording's `rate`.
fn registry(arguments: &Arguments, name: &PolicyName, rate: Option<f64>) -> Result<Registry, Failure> {
    let registry = policies(arguments.weights.as_deref(), arguments.blur)?;
    Ok(policy_process::with_outside(registry, name, &policy_process::for_evaluation(rate)))
}

//! Policies in other processes: how long each command waits for them, and the hidden command that turns into one.

use std::os::fd::{AsFd, IntoRawFd};
use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use rustix::process::{Signal, getppid, set_parent_process_death_signal};

use super::output::Failure;
use parfocal_autofocus::exec::{ProcessSettings, Times};
use parfocal_autofocus::{Registry, exec, scripted};
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::notices::tell;

/// This program, also after its file was replaced by a newer one.
const SELF: &str = "/proc/self/exe";
/// Time for a process to start, and then for its first answer: it may load a large model.
const START: Duration = Duration::from_mins(1);

/// Arguments of the hidden command.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Number of the process that started this one.
    parent: i32,
    /// The command to turn into.
    #[arg(required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    command: Vec<String>,
}

/// For a server: the control loop never waits, and a process that hangs is ended soon after the loop gave it up.
pub fn for_serving(clock: &Arc<dyn Clock>) -> ProcessSettings {
    ProcessSettings {
        launcher: SELF.into(),
        clock: Arc::clone(clock),
        start: START,
        answer: Duration::from_millis(300),
        build: Duration::from_millis(300),
        many: false,
        times: Times::Clock,
        // The operator of a blinded session may read the log, and only such a policy prints.
        say: |line| tracing::debug!(target: "policy", "{line}"),
    }
}

/// Adds the policy of a file or a command to `registry`, if `name` is one.
pub fn with_outside(registry: Registry, name: &PolicyName, settings: &ProcessSettings) -> Registry {
    exec::with_command(scripted::with_file(registry, name), name, settings)
}

/// For an evaluation, which nobody waits for, and which has `rate` frames a second, or else 25.
pub fn for_evaluation(rate: Option<f64>) -> ProcessSettings {
    let period = rate.and_then(|rate| Duration::try_from_secs_f64(rate.recip()).ok());
    ProcessSettings {
        launcher: SELF.into(),
        clock: Arc::new(SystemClock),
        start: START,
        answer: Duration::from_secs(10),
        build: START,
        many: true,
        times: Times::Every(period.unwrap_or(Duration::from_millis(40))),
        say: |line| tell(format_args!("policy: {line}")),
    }
}

/// Turns into the policy's process. Standard input is its socket and standard error the shared memory: both get numbers
/// of their own, which the environment names, and standard error becomes standard output, which the program reads.
///
/// # Errors
/// If the command cannot be run.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    // The kernel ends this process with the program, however that ends.
    set_parent_process_death_signal(Some(Signal::KILL))?;
    if getppid().is_none_or(|parent| parent.as_raw_nonzero().get() != arguments.parent) {
        bail!("the program that started this policy has ended");
    }

    let socket = rustix::io::dup(std::io::stdin().as_fd())?.into_raw_fd();
    let memory = rustix::io::dup(std::io::stderr().as_fd())?.into_raw_fd();
    let output = std::io::stdout().as_fd().try_clone_to_owned()?;

    let mut command = Command::new(&arguments.command[0]);
    command.args(&arguments.command[1..]).env("PARFOCAL_POLICY_SOCKET", socket.to_string());
    command.env("PARFOCAL_POLICY_MEMORY", memory.to_string());
    let error = command.stdin(Stdio::null()).stderr(output).exec();

    // Standard error is still the shared memory here.
    super::output::print(&format!("{}: {error}\n", arguments.command[0]))?;
    std::process::exit(127);
}

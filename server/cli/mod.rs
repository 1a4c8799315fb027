//! The command line: one file per command; wires the rooms together.

mod account;
mod announce;
mod backup;
mod calibrate;
mod doctor;
mod encryption;
mod environment;
mod evaluate;
mod export;
mod input;
mod inspect;
mod interrupt;
mod lens;
mod library;
mod output;
mod policies;
mod policy_process;
mod recording;
mod restore;
mod scan;
mod serve;
mod study;
mod study_analysis;
mod train;
mod verify;

use std::io::Write;

use clap::{Parser, Subcommand};

use output::Failure;
use parfocal_autofocus::exec;
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_base::notices::tell;

/// Keeps a hyperspectral video exoscope in focus and runs blinded trials of its autofocus policies.
#[derive(Debug, Parser)]
#[command(version, about, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make and change the personal accounts of the people in studies.
    #[command(subcommand)]
    Account(account::Action),
    /// Copy the database, verified, while the server runs or not.
    Backup(backup::Arguments),
    /// Calibrate a sensor: take its dark and white references, or import its maker's tables.
    #[command(subcommand)]
    Calibrate(calibrate::Action),
    /// Check whether this machine is ready for a trial, and say what to do if it is not.
    Doctor(doctor::Arguments),
    /// Simulated scans for a training in another program, as Python's `parfocal.FocusEnv` uses them.
    Environment(environment::Arguments),
    /// Write a session's data as a folder of CSV and JSON.
    Export(export::Arguments),
    /// Show content area, patch and focus metrics of pictures and mosaics.
    Inspect(inspect::Arguments),
    /// Look at a lens, move it, sweep it, measure it, or emulate one.
    #[command(subcommand)]
    Lens(lens::Action),
    /// Compare policies on focal-time scans or photographed focal stacks.
    Evaluate(evaluate::Arguments),
    /// List the autofocus policies and whether each can run.
    Policies(policies::Arguments),
    /// Turn into a policy's process; the program starts itself so.
    #[command(name = exec::LAUNCH, hide = true)]
    PolicyProcess(policy_process::Arguments),
    /// Replace the database by a backup, and keep the old one.
    Restore(restore::Arguments),
    /// Record hyperspectral video, and get cubes, video and pictures out of it.
    #[command(subcommand)]
    Recording(recording::Action),
    /// Record, import and check focal-time scans.
    #[command(subcommand)]
    Scan(scan::Action),
    /// Start the server: the live view, the control loop and the trial.
    #[command(after_help = serve::REAL_TIME)]
    Serve(serve::Arguments),
    /// Plan a study of many sessions, open, close and lock it, show where it stands, and analyse it.
    #[command(subcommand)]
    Study(study::Action),
    /// Train a learned policy, or compare trainings.
    Train(train::Arguments),
    /// Check that an export, a data folder or a backup is complete, unchanged, and matches its commitments.
    Verify(verify::Arguments),
}

/// Runs the command that the process's arguments name, and ends the process. Exit code 0 success, 1 failure, 2 wrong
/// usage.
pub fn main() -> ! {
    let arguments = Arguments::parse();
    // Weights are read on this thread. On a busy machine, threads that share so little work wait for one another.
    compute_on_this_thread();
    let outcome = run(arguments.command);
    // A thread that hangs may still hold a lens.
    parfocal_devices::lens::let_go_of_all();
    if let Err(failure) = &outcome {
        tell(format_args!("parfocal: {failure}"));
    }
    end(i32::from(outcome.is_err()))
}

/// Ends the process at once. Otherwise libtorch would first take itself apart, which takes a tenth of a second, and
/// threads that are left may still use it.
#[allow(unsafe_code, reason = "the standard library has no such end")]
fn end(code: i32) -> ! {
    // Nobody else does it then. Each command has already done so for what it must not lose.
    let _ = std::io::stdout().flush();
    // SAFETY: the call takes a number and does not return.
    unsafe { libc::_exit(code) }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Account(action) => account::run(&action),
        Command::Backup(arguments) => backup::run(&arguments),
        Command::Calibrate(action) => calibrate::run(&action),
        Command::Doctor(arguments) => doctor::run(&arguments),
        Command::Environment(arguments) => environment::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Lens(action) => lens::run(&action),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Policies(arguments) => policies::run(&arguments),
        Command::PolicyProcess(arguments) => policy_process::run(&arguments),
        Command::Restore(arguments) => restore::run(&arguments),
        Command::Recording(action) => recording::run(&action),
        Command::Scan(action) => scan::run(&action),
        Command::Serve(arguments) => serve::run(&arguments),
        Command::Study(action) => study::run(&action),
        Command::Train(arguments) => train::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
    }
}

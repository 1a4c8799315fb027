//! Runs the program as people and scripts do. Several tests have this module.

#![allow(dead_code, reason = "no test uses all of it")]

use std::path::Path;
use std::process::{Command, Output, Stdio};

/// `parfocal` with `arguments`, which nobody answers.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(arguments).stdin(Stdio::null());
    command
}

/// Runs `parfocal` with `arguments`.
pub fn parfocal(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// What a command that succeeds prints.
pub fn done(arguments: &[&str]) -> String {
    let output = parfocal(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a command that is refused says on standard error.
pub fn refused(arguments: &[&str]) -> String {
    let output = parfocal(arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", said(&output));
    String::from_utf8(output.stderr).unwrap()
}

/// What a command has printed.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The one sentence with which a failing command ends.
pub fn complaint(output: &Output) -> String {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{}{error}", said(output));
    error.lines().find(|line| line.starts_with("parfocal: ")).unwrap_or_else(|| panic!("{error}")).to_owned()
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

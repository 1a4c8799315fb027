//! `parfocal doctor`, as a person uses it who sets up a machine.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::{emulator, quick};

/// Runs `parfocal doctor`. Returns whether it succeeded, its findings, and its standard error.
fn doctor(data: &Path, more: &[&str]) -> (bool, Vec<Value>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    let output = command.args(["doctor", "--json", "--data-dir"]).arg(data).args(more).output().unwrap();
    let findings = serde_json::from_slice(&output.stdout).unwrap();
    (output.status.success(), findings, String::from_utf8(output.stderr).unwrap())
}

fn about<'a>(findings: &'a [Value], subject: &str) -> &'a Value {
    findings.iter().find(|finding| finding["subject"] == subject).expect("it looks at this")
}

#[test]
fn it_looks_at_the_machine_and_names_the_lens_with_its_firmware() {
    let emulator = emulator(quick());
    let data = tempfile::tempdir().unwrap();
    let (content, findings, errors) =
        doctor(data.path(), &["--lens", &format!("optotune:{}", emulator.path().display())]);

    assert!(content, "{errors} {findings:?}");
    for subject in ["disk", "data folder", "clock", "network", "real-time priority", "locked memory", "videos"] {
        let finding = about(&findings, subject);
        assert_eq!(finding["advice"].is_null(), finding["verdict"] == "well", "what is not well has advice: {finding}");
    }

    let lens = about(&findings, "lens");
    assert_eq!(lens["verdict"], "well");
    assert!(lens["found"].as_str().unwrap().contains("firmware type A, version 1.8.3.1"), "{lens}");
}

#[test]
fn a_lens_without_its_head_and_a_file_for_a_folder_must_be_put_right() {
    let emulator = emulator(quick());
    emulator.set_lens_present(false);
    let file = tempfile::NamedTempFile::new().unwrap();
    let (content, findings, errors) =
        doctor(file.path(), &["--lens", &format!("optotune:{}", emulator.path().display())]);

    assert!(!content);
    assert!(errors.contains("fix 2 things before a trial"), "{errors}");
    assert_eq!(about(&findings, "data folder")["verdict"], "wrong");
    assert_eq!(about(&findings, "lens")["verdict"], "wrong");
}

#[test]
fn a_file_that_is_not_a_database_must_be_fixed() {
    let data = tempfile::tempdir().unwrap();
    std::fs::write(data.path().join("parfocal.db"), "not a database").unwrap();
    let (content, findings, errors) = doctor(data.path(), &[]);

    assert!(!content && errors.contains("fix one thing"), "{errors}");
    let database = about(&findings, "database");
    assert_eq!(database["verdict"], "wrong");
    assert!(database["advice"].as_str().unwrap().contains("parfocal restore"), "{database}");
}

#[test]
fn people_read_a_line_a_finding_and_what_to_do() {
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args(["doctor", "--data-dir", "/nowhere/at/all", "--lens", "optotune:/dev/null"])
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();

    assert!(!output.status.success());
    assert!(text.contains("There is no folder /nowhere/at/all yet."), "{text}");
    let lens = text.lines().position(|line| line.starts_with("WRONG  lens")).expect("a line for the lens");
    assert!(text.lines().nth(lens + 1).unwrap().contains("Check its cable and power"), "{text}");
}

#[test]
fn a_calibrations_age_is_reported_and_an_unreadable_one_must_be_fixed() {
    let data = tempfile::tempdir().unwrap();
    let file = data.path().join("calibration.toml");
    std::fs::write(&file, "unit = \"0815\"\nversion = \"2\"\ndate = \"2020-01-01\"\n").unwrap();
    let (content, findings, errors) = doctor(data.path(), &["--calibration", file.to_str().unwrap()]);
    assert!(content, "{errors} {findings:?}");
    let calibration = about(&findings, "calibration");
    assert_eq!(calibration["verdict"], "advice");
    assert!(
        calibration["found"].as_str().unwrap().contains("unit 0815") && calibration.to_string().contains("days old")
    );

    let (content, findings, errors) = doctor(data.path(), &["--calibration", "/nowhere/at/all.toml"]);
    assert!(!content && errors.contains("fix one thing"), "{errors}");
    assert_eq!(about(&findings, "calibration")["verdict"], "wrong");
}

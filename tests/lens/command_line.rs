//! `parfocal lens` as people and scripts use it.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::Arc;

use parfocal::clock::SystemClock;
use parfocal::lens;

use super::{emulator, last_command, quick};

fn command_line(arguments: &[&str]) -> (bool, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal")).arg("lens").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn the_command_line_speaks_the_contracted_json() {
    let emulator = emulator(quick());
    let spec = format!("optotune:{}", emulator.path().display());
    let json = |arguments: &[&str]| -> serde_json::Value {
        let (success, output, errors) = command_line(arguments);
        assert!(success, "{errors}");
        serde_json::from_str(&output).unwrap()
    };
    let info = json(&["info", "--lens", &spec, "--json"]);
    let expected = serde_json::json!({
        "driver": "Optotune Lens Driver 4", "firmware": "type A, version 1.8.3.1", "serial": "EMUL0001",
        "min_dioptre": 5.0, "max_dioptre": 10.0, "temperature_celsius": 25.5, "mode": "focal power", "status": [],
    });
    assert_eq!(info, expected);
    assert_eq!(
        json(&["set", "0.3", "--lens", &spec, "--json"]),
        serde_json::json!({"focal_power": 0.3, "dioptre": 6.5})
    );
    assert_eq!((last_command(&emulator), emulator.mode_and_current().0), (Some(2300), 5), "it stays where it was set");
    let sweep = json(&["sweep", "--steps", "3", "--lens", &spec, "--json"]);
    let asked: Vec<_> = sweep.as_array().unwrap().iter().map(|stop| stop["asked"].as_f64().unwrap()).collect();
    assert_eq!(asked, [0.0, 0.5, 1.0, 1.0, 0.5, 0.0]);
    assert_eq!(sweep[1]["read_back_dioptre"], 7.5);
}

#[test]
fn the_command_line_fails_with_one_sentence() {
    let (success, output, errors) = command_line(&["info", "--lens", "optotune:/dev/null", "--json"]);
    assert!(!success && output.is_empty());
    assert_eq!(errors, "parfocal: the lens does not answer: /dev/null: this is not a serial port\n");
}

#[test]
fn an_emulated_driver_can_be_started_from_the_command_line() {
    let mut process = Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args(["lens", "emulate", "--serial", "42"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut name = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut name).unwrap();
    let name = name.trim_end();
    assert!(name.ends_with("usb-Optotune_LD_Optotune_LD_EMUL0042-if00"));
    let spec = format!("optotune:{name}");
    assert_eq!(lens::open(&spec, Arc::new(SystemClock)).unwrap().info().unwrap().serial, "EMUL0042");

    rustix::process::kill_process(rustix::process::Pid::from_child(&process), rustix::process::Signal::INT).unwrap();
    assert!(process.wait().unwrap().success());
    assert!(!std::path::Path::new(name).exists(), "nothing is left behind");
}

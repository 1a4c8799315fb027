//! A serial line that damages or delays replies, or adds noise: requests are repeated, and every error is counted.

use std::process::Command;

use parfocal_devices::lens::emulator::{Fault, Glitch};

use super::{emulator, last_command, open, power, quick, until};

/// Number of replies during the opening of a lens, and a few more.
const OPENING: usize = 16;

#[test]
fn no_single_glitch_keeps_a_lens_from_opening() {
    for glitch in [Glitch::Noise, Glitch::Checksum, Glitch::Late] {
        for spared in 0..OPENING {
            let emulator = emulator(quick());
            emulator.glitch(glitch, spared, 1);
            let mut lens = open(&emulator, "").unwrap_or_else(|error| panic!("{glitch:?} after {spared}: {error}"));
            assert_eq!(lens.info().unwrap().serial, "EMUL0001");
        }
    }
}

#[test]
fn two_glitches_in_a_row_are_survived_by_every_request() {
    for glitch in [Glitch::Noise, Glitch::Checksum] {
        for spared in 0..OPENING {
            let emulator = emulator(quick());
            emulator.glitch(glitch, spared, 2);
            let mut lens = open(&emulator, "").unwrap_or_else(|error| panic!("{glitch:?} after {spared}: {error}"));
            assert!(lens.info().unwrap().line_errors > 0, "{glitch:?} after {spared}");
        }
    }
}

#[test]
fn errors_on_the_line_are_counted_and_told() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    assert_eq!((lens.info().unwrap().line_errors, lens.health().line_errors), (0, 0));
    assert!(!lens.health().message.contains("line"), "{}", lens.health().message);

    emulator.glitch(Glitch::Checksum, 0, 1);
    assert_eq!(lens.info().unwrap().line_errors, 1);
    emulator.glitch(Glitch::Noise, 0, 1);
    assert!(lens.info().is_ok());
    let health = lens.health();
    assert!(health.working);
    assert!(health.message.contains("on its line"), "{}", health.message);
}

#[test]
fn a_noisy_line_neither_loses_the_lens_nor_a_command() {
    let emulator = emulator(quick());
    emulator.set_fault(Fault::NoisyLine);
    let mut lens = open(&emulator, "").unwrap();
    for step in 0..20_u32 {
        let target = power(f64::from(step % 2));
        lens.set(target).unwrap();
        assert_eq!(lens.read_back().unwrap(), target, "at step {step}");
        assert!(lens.health().working, "{}", lens.health().message);
    }

    until("errors are counted", || lens.health().line_errors > 0);
    assert_eq!(last_command(&emulator), Some(3000));
}

#[test]
fn the_command_line_survives_a_noisy_line_and_tells_its_errors() {
    let emulator = emulator(quick());
    emulator.set_fault(Fault::NoisyLine);
    let spec = format!("optotune:{}", emulator.path().display());
    let parfocal = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_parfocal")).args(arguments).args(["--lens", &spec]).output();
        let output = output.unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };

    let json: serde_json::Value = serde_json::from_str(&parfocal(&["lens", "info", "--json"])).unwrap();
    assert!(json["line_errors"].as_u64().unwrap() > 0, "{json}");
    let told = parfocal(&["lens", "info"]);
    assert!(told.lines().any(|line| line.starts_with("line errors")), "{told}");
    let set: serde_json::Value = serde_json::from_str(&parfocal(&["lens", "set", "0.3", "--json"])).unwrap();
    assert_eq!(set["dioptre"], 6.5);
}

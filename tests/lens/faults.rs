//! Faults of line, driver and lens: each is noticed, reported in words, and recovered from.

use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::sync::Arc;

use parfocal_base::FocalPower;
use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Fault, Model};
use parfocal_devices::lens::{self, LensError};

use super::{emulator, last_command, open, power, quick, refused, until};

#[test]
fn unplugged_and_plugged_in_again_it_continues_where_it_was() {
    let mut emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    lens.set(power(0.25)).unwrap();
    until("the command arrives", || last_command(&emulator) == Some(2250));
    let sent = emulator.commands().len();
    emulator.unplug();
    until("the loss is noticed", || !lens.health().working);
    assert!(matches!(lens.set(power(0.9)), Err(LensError::Gone(_))));
    assert_eq!(lens.measured(), None);
    until("the reason is in words", || lens.health().message.contains("is the driver plugged in?; trying again"));
    emulator.plug_in().unwrap();
    until("it works again", || lens.health().working);
    until("focal power is restored", || emulator.commands().len() > sent);
    assert_eq!(last_command(&emulator), Some(2250), "the last command that was taken, not the refused one");
    assert_eq!(emulator.mode_and_current().0, 5);
}

#[test]
fn a_driver_that_restarts_is_set_up_again() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    lens.set(power(0.5)).unwrap();
    until("the command arrives", || last_command(&emulator) == Some(2500));
    let sent = emulator.commands().len();
    emulator.restart();
    until("mode and focal power are restored", || emulator.commands().len() > sent);
    assert_eq!(last_command(&emulator), Some(2500));
    until("it works again", || lens.health().working);
}

#[test]
fn every_fault_of_the_line_is_noticed_in_words_and_heals() {
    for (fault, words) in [
        (Fault::Silent, "silent"),
        (Fault::Garbage, "unreadable"),
        (Fault::WrongChecksum, "checksum"),
        (Fault::Errors, "does not know this command"),
    ] {
        let emulator = emulator(quick());
        let mut lens = open(&emulator, "").unwrap();
        lens.set(power(0.75)).unwrap();
        until("the command arrives", || last_command(&emulator) == Some(2750));
        emulator.set_fault(fault);
        let mut seen = String::new();
        until("the fault is noticed", || {
            // Read at once: between two looks the lens's health may change.
            let health = lens.health();
            seen = health.message.to_string();
            !health.working
        });

        assert!(seen.contains(words), "{fault:?}: {seen}");
        let sent = emulator.commands().len();
        emulator.set_fault(Fault::None);
        let healed = until("it works again", || lens.health().working);
        println!("{fault:?}: back after {healed:?}");
        until("focal power is restored", || emulator.commands().len() > sent);
        assert_eq!(last_command(&emulator), Some(2750));
    }
}

#[test]
fn a_focal_power_that_cannot_be_read_is_noticed_and_no_old_value_is_reported() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    lens.set(power(0.25)).unwrap();
    until("the command arrives", || last_command(&emulator) == Some(2250));
    emulator.set_fault(Fault::WrongReadBack);
    lens.set(power(0.75)).unwrap();
    assert!(lens.read_back().is_err(), "status and temperature are read as ever");
    until("the fault is noticed", || !lens.health().working);
    assert!(lens.health().message.contains("checksum"), "{}", lens.health().message);
    emulator.set_fault(Fault::None);
    until("it works again", || lens.health().working);
    assert_eq!(lens.read_back().unwrap(), power(0.75));
}

#[test]
fn commands_that_get_lost_are_sent_again_and_then_called_refused() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    emulator.set_fault(Fault::DropsCommands);
    lens.set(FocalPower::MAX).unwrap();
    until("the loss is noticed", || !lens.health().working);
    assert!(lens.health().message.contains("does not go where it is sent"), "{}", lens.health().message);
    assert!(matches!(lens.set(FocalPower::MAX), Err(LensError::Refused(_))));
    emulator.set_fault(Fault::None);
    until("the command arrives after all", || last_command(&emulator) == Some(3000));
    until("it works again", || lens.health().working);
}

#[test]
fn a_hot_lens_follows_but_says_that_it_cannot_be_relied_on() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    emulator.set_temperature(47.0);
    assert_eq!(lens.info().unwrap().status, ["outside the temperature limits set"]);
    let health = lens.health();
    assert!(health.working);
    assert!(health.message.contains("at 47.0 °C") && health.message.contains("between 20 and 40 °C"), "{health:?}");
    emulator.set_temperature(30.0);
    until("it is well again", || lens.health().message.contains("follows commands between"));
}

#[test]
fn a_driver_that_is_not_there_yet_is_looked_for() {
    let mut emulator = emulator(quick());
    let spec = format!("optotune:{}", emulator.path().display());
    emulator.unplug();
    assert!(matches!(lens::open(&spec, Arc::new(SystemClock)), Err(LensError::Gone(_))), "where it must be there now");

    let mut lens = lens::open_or_await(&spec, Arc::new(SystemClock)).unwrap();
    let health = lens.health();
    assert!(!health.working && health.message.ends_with("trying again"), "{health:?}");
    assert!(matches!(lens.set(FocalPower::MAX), Err(LensError::Gone(_))));

    emulator.plug_in().unwrap();
    until("it is found", || lens.health().working);
    assert!(lens.health().simulated, "it is known by now that there is no glass");
    lens.set(FocalPower::MAX).unwrap();
    until("it follows", || last_command(&emulator) == Some(3000));
}

#[test]
fn only_a_driver_that_does_not_answer_is_waited_for() {
    let emulator = emulator(quick());
    emulator.set_fault(Fault::Stranger);
    let spec = format!("optotune:{}", emulator.path().display());
    assert!(matches!(lens::open_or_await(&spec, Arc::new(SystemClock)), Err(LensError::Refused(_))));
}

#[test]
fn a_lens_pulled_from_its_driver_is_said_and_comes_back() {
    let emulator = emulator(quick());
    let lens = open(&emulator, "").unwrap();
    emulator.set_lens_present(false);
    until("the reason is in words", || lens.health().message.contains("no lens is connected"));
    emulator.set_lens_present(true);
    until("it works again", || lens.health().working);
}

#[test]
fn a_device_that_is_not_a_lens_driver_is_refused_with_the_reason() {
    let emulator = emulator(quick());
    emulator.set_fault(Fault::Stranger);
    assert!(refused(open(&emulator, "")).contains("not as an Optotune Lens Driver 4: is this the right port?"));
    emulator.set_fault(Fault::Silent);
    assert!(refused(open(&emulator, "")).contains("nothing answers at"));
}

#[test]
fn old_firmware_and_binary_error_numbers_are_understood() {
    for model in [Model { old: true, ..quick() }, Model { ascii_errors: false, ..quick() }] {
        let emulator = emulator(model);
        let lens = open(&emulator, "").unwrap();
        emulator.set_fault(Fault::Errors);
        until("the error is noticed", || !lens.health().working);
        assert!(lens.health().message.contains("does not know this command"));
    }
}

#[test]
fn a_port_in_use_is_refused_until_it_is_closed() {
    let emulator = emulator(quick());
    let first = open(&emulator, "").unwrap();
    assert!(refused(open(&emulator, "")).contains("another program uses it"));
    drop(first);
    open(&emulator, "").unwrap();
}

/// Runs `parfocal lens info` in another process, as `user` if given, and returns its standard error.
fn another_process(port: &str, user: Option<u32>) -> std::io::Result<String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(["lens", "info", "--lens", &format!("optotune:{port}")]);
    if let Some(user) = user {
        command.uid(user).gid(user);
    }
    let output = command.output()?;
    assert!(!output.status.success());
    Ok(String::from_utf8(output.stderr).unwrap())
}

#[test]
fn two_processes_do_not_share_a_port() {
    let emulator = emulator(quick());
    let _held = open(&emulator, "").unwrap();
    let said = another_process(emulator.path().to_str().unwrap(), None).unwrap();
    assert!(said.contains("another program uses it: close that program first"), "{said}");
}

#[test]
fn a_user_who_may_not_open_the_port_learns_the_group() {
    const NOBODY: u32 = 65_534;
    const DIALOUT: u32 = 20;
    let emulator = emulator(quick());
    let port = std::fs::read_link(emulator.path()).unwrap();
    let set = |mode| std::fs::set_permissions(&port, std::fs::Permissions::from_mode(mode)).unwrap();
    // Root may open everything, so root needs another user for this test. All others can take their own permission
    // away.
    let root = rustix::process::geteuid().is_root();
    if root {
        chown(&port, None, Some(DIALOUT)).unwrap();
        set(0o660);
    } else {
        set(0);
    }

    match another_process(port.to_str().unwrap(), root.then_some(NOBODY)) {
        Ok(said) if said.contains("permission denied") => {
            assert!(said.contains(if root { "usermod -aG dialout $USER" } else { "usermod -aG" }), "{said}");
        }
        // Here the user `nobody` cannot even reach the program or its libraries.
        other => println!("skipped: the program cannot be run as another user: {other:?}"),
    }
}

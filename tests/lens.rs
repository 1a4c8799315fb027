//! The Optotune driver against an emulated Lens Driver 4 behind a pseudo-terminal.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use parfocal::clock::{Clock, SystemClock};
use parfocal::lens::emulator::{Emulator, Fault, Model};
use parfocal::lens::{self, FocalPower, Lens, LensError, LensInfo, Optics};

fn emulator(model: Model) -> Emulator {
    Emulator::start(model, Arc::new(SystemClock)).unwrap()
}

fn quick() -> Model {
    Model { latency: Duration::ZERO, ..Model::default() }
}

fn open(emulator: &Emulator, options: &str) -> Result<Box<dyn Lens>, LensError> {
    lens::open(&format!("optotune:{}{options}", emulator.path().display()), Arc::new(SystemClock))
}

fn refused(outcome: Result<Box<dyn Lens>, LensError>) -> String {
    outcome.err().expect("it must not open").to_string()
}

fn power(value: f64) -> FocalPower {
    FocalPower::new(value).unwrap()
}

/// Looks again and again until `condition` holds; how long that took. Fails after ten seconds.
fn until(what: &str, mut condition: impl FnMut() -> bool) -> Duration {
    let begun = SystemClock.now();
    while !condition() {
        assert!(SystemClock.now().since(begun) < Duration::from_secs(10), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
    SystemClock.now().since(begun)
}

fn last_command(emulator: &Emulator) -> Option<i16> {
    emulator.commands().last().map(|&(_, raw)| raw)
}

#[test]
fn says_what_it_is_and_goes_where_it_is_sent() {
    let emulator = emulator(Model::default());
    let mut lens = open(&emulator, "").unwrap();
    let expected = LensInfo {
        driver: "Optotune Lens Driver 4".into(),
        firmware: "type A, version 1.8.3.1".into(),
        serial: "EMUL0001".into(),
        min_dioptre: 5.0,
        max_dioptre: 10.0,
        temperature_celsius: Some(25.5),
        mode: "focal power".into(),
        status: Vec::new(),
    };
    assert_eq!(lens.info(), Ok(expected));

    lens.set(power(0.8)).unwrap();
    until("the command arrives", || last_command(&emulator).is_some());
    // 9 dpt, in the units of firmware A: (9 + 5) * 200.
    assert_eq!(last_command(&emulator), Some(2800));
    assert_eq!(lens.read_back(), Ok(power(0.8)));
    let health = lens.health();
    assert!(health.working && health.simulated, "an emulated unit is no real lens");
    assert_eq!(&*health.message, "follows commands between 5.00 and 10.00 dpt, at 25.5 °C");
}

#[test]
fn a_unit_that_is_not_emulated_is_taken_for_real() {
    let emulator = emulator(Model { serial: *b"AREA0042", ..quick() });
    assert!(!open(&emulator, "").unwrap().health().simulated);
}

#[test]
fn other_firmware_counts_dioptres_without_an_offset() {
    let emulator = emulator(Model { firmware: b'C', ..quick() });
    let mut lens = open(&emulator, "").unwrap();
    lens.set(FocalPower::MAX).unwrap();
    until("the command arrives", || last_command(&emulator).is_some());
    assert_eq!(last_command(&emulator), Some(2000), "10 dpt");
}

#[test]
fn a_configured_part_of_the_range_is_kept_to() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "?min=6&max=99").unwrap();
    let info = lens.info().unwrap();
    assert!((info.min_dioptre - 6.0).abs() < 1e-9 && (info.max_dioptre - 10.0).abs() < 1e-9);
    lens.set(FocalPower::MIN).unwrap();
    until("the command arrives", || last_command(&emulator).is_some());
    assert_eq!(last_command(&emulator), Some(2200), "6 dpt");
    drop(lens);
    assert!(refused(open(&emulator, "?min=12")).contains("5.00 to 10.00 dpt"));
    assert!(refused(open(&emulator, "?size=3")).contains("min, max, low, high"));
}

#[test]
fn wider_temperature_limits_narrow_the_range_that_the_device_reports() {
    let emulator = emulator(quick());
    let info = open(&emulator, "?low=10&high=50").unwrap().info().unwrap();
    // The emulated lens gives up 0.02 dpt at each end for each degree beyond a span of 20.
    assert!((info.min_dioptre - 5.4).abs() < 1e-9 && (info.max_dioptre - 9.6).abs() < 1e-9, "{info:?}");
}

#[test]
fn the_latest_command_wins_and_none_waits_for_the_port() {
    let emulator = emulator(Model { latency: Duration::from_millis(20), ..Model::default() });
    let mut lens = open(&emulator, "").unwrap();
    for step in 0..2000_u32 {
        lens.set(power(f64::from(step) / 1999.0)).unwrap();
    }
    until("the last command arrives", || last_command(&emulator) == Some(3000));
    assert!(emulator.commands().len() < 2000, "commands that were overtaken are not sent");
}

#[test]
fn the_modelled_glass_follows_the_true_one() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    let begun = SystemClock.now();
    for target in [0.3, 0.9, 0.2] {
        lens.set(power(target)).unwrap();
        std::thread::sleep(Duration::from_millis(20));
    }
    until("the last command arrives", || last_command(&emulator) == Some(2200));
    let (model, glass) = (lens.optics(), emulator.glass());
    let moments = || (0..200).map(|millis| begun + Duration::from_millis(millis));
    let apart = moments().map(|at| model.focal_power_at(at).distance(glass.focal_power_at(at))).sum::<f64>() / 200.0;
    // A model that stood still would be 0.3 away on average; a busy machine may delay either side by some milliseconds.
    assert!(apart < 0.15, "{apart} away on average");
    let later = SystemClock.now() + Duration::from_secs(1);
    assert!(model.focal_power_at(later).distance(glass.focal_power_at(later)) < 0.005, "the play of the emulated lens");
}

#[test]
fn unplugged_and_plugged_in_again_it_goes_on_where_it_was() {
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
            seen = lens.health().message.to_string();
            !lens.health().working
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
fn commands_that_get_lost_are_sent_again_and_then_called_refused() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    emulator.set_fault(Fault::DropsCommands);
    lens.set(FocalPower::MAX).unwrap();
    until("the loss is noticed", || !lens.health().working);
    assert!(lens.health().message.contains("sent to 10.00 dpt but stays at"), "{}", lens.health().message);
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
fn a_lens_pulled_from_its_driver_is_said_and_comes_back() {
    let emulator = emulator(quick());
    let lens = open(&emulator, "").unwrap();
    emulator.set_lens_present(false);
    until("the reason is in words", || lens.health().message.contains("no lens is connected"));
    emulator.set_lens_present(true);
    until("it works again", || lens.health().working);
}

#[test]
fn what_is_no_lens_driver_is_refused_with_the_reason() {
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

#[test]
fn on_closing_the_lens_is_left_without_current() {
    let emulator = emulator(quick());
    let mut lens = open(&emulator, "").unwrap();
    lens.set(FocalPower::MAX).unwrap();
    until("the command arrives", || last_command(&emulator) == Some(3000));
    assert_eq!(emulator.mode_and_current().0, 5);
    drop(lens);
    assert_eq!(emulator.mode_and_current(), (1, 0));
}

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

/// Prints the time from `set` to the emulated driver's end of the wire at 50 commands a second, with everything else
/// that the driver's thread does going on. A measurement, not a test: `cargo test --test lens -- --ignored --nocapture`.
#[test]
#[ignore = "measures"]
fn measure_set_to_wire() {
    let emulator = emulator(Model::default());
    let mut lens = open(&emulator, "").unwrap();
    let mut latencies: Vec<_> = (0..500)
        .map(|step: u32| {
            let asked = SystemClock.now();
            lens.set(power(f64::from(step % 2))).unwrap();
            std::thread::sleep(Duration::from_millis(20));
            emulator.commands().last().unwrap().0.since(asked)
        })
        .collect();
    latencies.sort_unstable();
    println!("set to wire: p50 {:?}, p99 {:?}, worst {:?}", latencies[250], latencies[495], latencies[499]);
}

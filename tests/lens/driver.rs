//! The Optotune driver without faults.

use std::sync::Arc;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::lens::emulator::Model;
use parfocal_devices::lens::{self, LensInfo, Optics};

use super::{emulator, last_command, open, power, quick, refused, until};

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
        line_errors: 0,
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

/// The flat cable of the lens leads to another one: the driver's port stays.
#[test]
fn health_says_which_lens_is_there_now() {
    let mut first = emulator(Model { serial: *b"AREA0042", ..quick() });
    let second = emulator(Model { serial: *b"AREA0043", ..quick() });
    let folder = tempfile::tempdir().unwrap();
    let port = folder.path().join("port");
    std::os::unix::fs::symlink(first.path(), &port).unwrap();
    let lens = lens::open(&format!("optotune:{}", port.display()), Arc::new(SystemClock)).unwrap();
    let serial = || lens.health().info.map(|info| info.serial);
    assert_eq!(serial().as_deref(), Some("AREA0042"));

    first.unplug();
    until("the loss is noticed", || serial().is_none());
    std::fs::remove_file(&port).unwrap();
    std::os::unix::fs::symlink(second.path(), &port).unwrap();
    until("the other lens is there", || serial().as_deref() == Some("AREA0043"));
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
    // The emulated lens loses 0.02 dpt at each end for each degree beyond a span of 20.
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
    let model = lens.optics();
    let glass = emulator.glass();
    let moments = || (0..200).map(|millis| begun + Duration::from_millis(millis));
    let apart = moments().map(|at| model.focal_power_at(at).distance(glass.focal_power_at(at))).sum::<f64>() / 200.0;
    // A model that stood still would be 0.3 away on average. A busy machine may delay either side by some milliseconds.
    assert!(apart < 0.15, "{apart} away on average");
    let later = SystemClock.now() + Duration::from_secs(1);
    assert!(model.focal_power_at(later).distance(glass.focal_power_at(later)) < 0.005, "the play of the emulated lens");
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

/// Prints the time from `set` to the emulated unit's end of the wire, at 50 commands per second and with all other work
/// of the driver's thread. A measurement, not a test: `cargo test --test lens -- --ignored --nocapture`.
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

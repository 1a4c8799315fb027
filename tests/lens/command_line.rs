//! `parfocal lens` as people and scripts use it.

use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens;

use super::{emulator, last_command, quick, until};

fn command_line(arguments: &[&str]) -> (bool, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal")).arg("lens").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn the_command_line_speaks_the_promised_json() {
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
        "line_errors": 0,
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
fn a_plot_that_cannot_be_saved_costs_no_measurement() {
    let plot = ["--plot", "/dev/null/sweep.svg"];
    let sweep = ["sweep", "--steps", "2", "--lens", "simulated", "--json"];
    let (success, output, errors) = command_line(&[&sweep[..], &plot].concat());
    let stops: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert_eq!(stops.as_array().unwrap().len(), 4);
    assert!(!success && errors.contains("cannot save the plot to /dev/null/sweep.svg"), "{errors}");
}

/// A running `parfocal lens emulate`, into which the test types commands.
struct Emulated {
    process: Child,
    port: String,
    answers: Lines<BufReader<ChildStderr>>,
}

impl Emulated {
    fn start(options: &[&str]) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_parfocal"))
            .args(["lens", "emulate"])
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();

        let mut port = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut port).unwrap();
        let mut answers = BufReader::new(process.stderr.take().unwrap()).lines();
        assert!(answers.any(|line| line.unwrap().starts_with("Ctrl-C")), "says what can be typed");
        Self { process, port: port.trim_end().to_owned(), answers }
    }

    /// Types `line` and returns the answer.
    fn types(&mut self, line: &str) -> String {
        writeln!(self.process.stdin.as_ref().unwrap(), "{line}").unwrap();
        self.answers.next().unwrap().unwrap()
    }

    /// The true focal power of the lens, which no driver can read.
    fn glass(&mut self) -> f64 {
        let answer = self.types("glass");
        answer.strip_prefix("glass at ").unwrap().split(',').next().unwrap().parse().unwrap()
    }

    fn spec(&self) -> String {
        format!("optotune:{}", self.port)
    }

    /// `parfocal lens set`.
    fn set(&self, focal_power: &str) {
        let (success, _, errors) = command_line(&["set", focal_power, "--lens", &self.spec()]);
        assert!(success, "{errors}");
    }

    /// `parfocal lens info --json`.
    fn info(&self) -> Result<serde_json::Value, String> {
        let (success, output, errors) = command_line(&["info", "--lens", &self.spec(), "--json"]);
        if success { Ok(serde_json::from_str(&output).unwrap()) } else { Err(errors) }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn an_emulated_driver_can_be_started_from_the_command_line() {
    let mut emulated = Emulated::start(&["--serial", "42", "--firmware", "C"]);
    assert!(emulated.port.ends_with("usb-Optotune_LD_Optotune_LD_EMUL0042-if00"));
    let info = lens::open(&emulated.spec(), Arc::new(SystemClock)).unwrap().info().unwrap();
    assert_eq!((info.serial.as_str(), info.firmware.as_str()), ("EMUL0042", "type C, version 1.8.3.1"));

    // A letter that is not UTF-8 is no command, and what is typed after it is one.
    emulated.process.stdin.as_ref().unwrap().write_all(b"\xe4\n").unwrap();
    assert!(emulated.answers.any(|line| line.unwrap().starts_with("Ctrl-C")), "says again what can be typed");
    assert_eq!(emulated.types("plug-in"), "done");

    let process = rustix::process::Pid::from_child(&emulated.process);
    rustix::process::kill_process(process, rustix::process::Signal::INT).unwrap();
    assert!(emulated.process.wait().unwrap().success());
    assert!(!std::path::Path::new(&emulated.port).exists(), "nothing is left behind");
}

#[test]
fn its_glass_waits_out_the_delay_settles_and_has_hysteresis() {
    // Moves at once, with a hysteresis of 1 of 5 dioptres: on the way up the lens stops 0.1 below the command, on the
    // way down 0.1 above it.
    let mut quick = Emulated::start(&["--delay", "0", "--settling", "0", "--hysteresis", "1"]);
    for (focal_power, glass) in [("0.5", 0.4), ("1", 0.9), ("0.5", 0.6)] {
        quick.set(focal_power);
        assert!((quick.glass() - glass).abs() < 1e-3, "sent to {focal_power} it stands at {}", quick.glass());
    }

    // Ten seconds of dead time: the command has arrived, but the lens has not moved.
    let mut late = Emulated::start(&["--delay", "10000", "--settling", "0"]);
    late.set("1");
    assert!(late.glass() < 1e-3, "{}", late.glass());
    // Ten seconds until 5 % of the step remain: the lens is moving and far from its destination.
    let mut slow = Emulated::start(&["--delay", "0", "--settling", "10000", "--hysteresis", "0"]);
    slow.set("1");
    let seen = slow.glass();
    assert!(0.0 < seen && seen < 0.9, "{seen}");
    until("it goes on", || slow.glass() > seen);
}

#[test]
fn its_temperature_faults_and_latency_can_be_chosen_and_changed() {
    let mut hot = Emulated::start(&["--temperature", "47", "--fault", "silent"]);
    assert!(hot.info().unwrap_err().contains("nothing answers at"));
    assert_eq!(hot.types("fault none"), "done");
    let info = hot.info().unwrap();
    assert_eq!(info["temperature_celsius"], 47.0);
    assert_eq!(info["status"], serde_json::json!(["outside the temperature limits set"]));
    assert_eq!(hot.types("temperature 25"), "done");
    assert_eq!(hot.info().unwrap()["status"], serde_json::json!([]));
    assert_eq!(hot.types("latency 5000"), "done");
    assert!(hot.info().unwrap_err().contains("nothing answers at"), "later than anyone waits");
    assert!(hot.types("temperature hot").contains("must be a number from -100 to 200"));
    assert!(hot.types("fault fire").contains("choose from none, garbage"));
    drop(hot);
    assert!(Emulated::start(&["--latency", "5000"]).info().unwrap_err().contains("nothing answers at"));
    for bad in [["--settling", "20000"], ["--hysteresis", "6"], ["--firmware", "G"], ["--fault", "fire"]] {
        let (success, _, errors) = command_line(&["emulate", bad[0], bad[1]]);
        assert!(!success && errors.contains(bad[0]), "{errors}");
    }
}

#[test]
fn an_emulated_lens_is_measured_through_its_driver() {
    // Far from the 2 ms and 15 ms that the driver assumes, to show that the emulated lens is measured.
    let lens = "emulated?delay=40&settling=120&hysteresis=0.2";
    let camera = "phantom:still";
    let (success, output, errors) =
        command_line(&["measure", "--lens", lens, "--camera", camera, "--fps", "20", "--repeats", "3", "--json"]);
    assert!(success, "{errors}");
    let report: serde_json::Value = serde_json::from_str(&output).unwrap();
    let figure = |key: &str| report[key].as_f64().unwrap();
    println!("40 ms and 120 ms were measured as {:.1} ms and {:.1} ms", figure("delay_ms"), figure("settling_ms"));
    assert!((25.0..60.0).contains(&figure("delay_ms")) && (80.0..170.0).contains(&figure("settling_ms")), "{report}");
    assert!((0.1..0.3).contains(&figure("hysteresis_dioptre")), "{report}");
    assert!(report["serial"].as_str().unwrap().starts_with("EMUL"));
}

//! However the driver ends, the last command to the lens removes its current.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, Moment, SystemClock};
use parfocal_devices::lens;
use parfocal_devices::lens::emulator::{Emulator, Fault, Glitch, LensCommand, Model};
use rustix::process::{Pid, Signal, kill_process};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};

use super::{emulator, last_command, open, quick, refused, until};

/// Mode and current of a lens at rest: control by current, and zero current.
const AT_REST: (u8, i16) = (1, 0);

/// Opens the lens and sends it to the end of its range.
fn driven(emulator: &Emulator) -> Box<dyn lens::Lens> {
    let mut lens = open(emulator, "").unwrap();
    lens.set(FocalPower::MAX).unwrap();
    until("the command arrives", || last_command(emulator) == Some(3000));
    lens
}

#[test]
fn a_reply_that_is_outstanding_does_not_keep_the_lens_under_current() {
    // Nearly as long as the driver waits, so that a reply is outstanding whenever the lens is closed.
    let emulator = emulator(Model { latency: Duration::from_millis(120), ..Model::default() });
    for round in 0..4 {
        let lens = driven(&emulator);
        let asked = emulator.requests();
        until("something is asked", || emulator.requests() > asked);
        drop(lens);
        assert_eq!(emulator.mode_and_current(), AT_REST, "in round {round}");
        assert_eq!(emulator.orders().last(), Some(&LensCommand::Current(0)));
    }
}

#[test]
fn replies_that_never_come_or_cannot_be_read_do_not_keep_it_under_current() {
    for fault in [Fault::Garbage, Fault::WrongChecksum, Fault::NoisyLine] {
        let emulator = emulator(quick());
        let lens = driven(&emulator);
        emulator.set_fault(fault);
        drop(lens);
        assert_eq!(emulator.mode_and_current(), AT_REST, "{fault:?} begins as it ends");

        emulator.set_fault(Fault::None);
        let lens = driven(&emulator);
        emulator.set_fault(fault);
        if fault != Fault::NoisyLine {
            until("the connection is given up", || !lens.health().working);
        }
        drop(lens);
        assert_eq!(emulator.mode_and_current(), AT_REST, "{fault:?} has broken the connection");
    }
    let emulator = emulator(quick());
    let lens = driven(&emulator);
    emulator.glitch(Glitch::Late, 0, 100);
    drop(lens);
    until("the orders are read", || emulator.mode_and_current() == AT_REST);
}

#[test]
fn a_lens_that_is_refused_once_its_driver_answered_is_let_go() {
    let emulator = emulator(quick());
    assert!(refused(open(&emulator, "?min=12")).contains("5.00 to 10.00 dpt"));
    assert!(emulator.orders().contains(&LensCommand::FocalPowerMode));
    assert_eq!(emulator.mode_and_current(), AT_REST);
}

/// A clock that panics once in the lens's thread when the test asks for it.
#[derive(Default)]
struct FailingClock(AtomicBool);

impl Clock for FailingClock {
    fn now(&self) -> Moment {
        let in_driver = std::thread::current().name() == Some("lens");
        assert!(!(in_driver && self.0.swap(false, Ordering::Relaxed)), "the clock fails, as the test asked");
        SystemClock.now()
    }

    fn wall(&self) -> jiff::Timestamp {
        SystemClock.wall()
    }
}

#[test]
fn a_panic_of_the_driver_ends_neither_its_work_nor_its_duty() {
    let emulator = emulator(quick());
    let clock = Arc::new(FailingClock::default());
    let spec = format!("optotune:{}", emulator.path().display());
    let mut lens = lens::open(&spec, Arc::clone(&clock) as _).unwrap();
    lens.set(FocalPower::MAX).unwrap();
    until("the command arrives", || last_command(&emulator) == Some(3000));
    let sent = emulator.commands().len();
    clock.0.store(true, Ordering::Relaxed);
    until("focal power is restored", || emulator.commands().len() > sent);
    until("it works again", || lens.health().working);
    clock.0.store(true, Ordering::Relaxed);
    drop(lens);
    assert_eq!(emulator.mode_and_current(), AT_REST);
}

/// Starts `parfocal` with these arguments on the emulated lens.
fn parfocal(emulator: &Emulator, arguments: &[&str]) -> Child {
    let lens = format!("optotune:{}", emulator.path().display());
    Command::new(env!("CARGO_BIN_EXE_parfocal"))
        .args(arguments)
        .args(["--lens", &lens])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .env("RUST_LOG", "off")
        .spawn()
        .unwrap()
}

fn end(mut process: Child, signal: Signal) -> std::process::ExitStatus {
    kill_process(Pid::from_child(&process), signal).unwrap();
    process.wait().unwrap()
}

const SIGNALS: [Signal; 4] = [Signal::INT, Signal::TERM, Signal::HUP, Signal::QUIT];

#[test]
fn a_signal_in_the_middle_of_a_command_lets_the_lens_go() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("scan");
    let sweep = ["lens", "sweep", "--steps", "1001"].as_slice();
    let measure = ["lens", "measure", "--camera", "phantom:still", "--repeats", "1000"].as_slice();
    let record = ["scan", "record", "--camera", "phantom", "--stepper", "true", "--out", out.to_str().unwrap()];
    for (command, signals) in [(sweep, SIGNALS.as_slice()), (measure, &[Signal::TERM]), (&record, &[Signal::TERM])] {
        for &signal in signals {
            let emulator = emulator(quick());
            let process = parfocal(&emulator, command);
            until("the lens is under control", || emulator.mode_and_current().0 == 5);
            end(process, signal);
            assert_eq!(emulator.mode_and_current(), AT_REST, "{command:?} ended by {signal:?}");
        }
    }
}

/// Starts a server with data folder `data`, and waits until it drives the lens.
fn server(emulator: &Emulator, data: &std::path::Path) -> Child {
    let mut process = parfocal(emulator, &["serve", "--bind", "127.0.0.1:0", "--data-dir", data.to_str().unwrap()]);
    let mut lines = BufReader::new(process.stdout.as_mut().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().starts_with("Ctrl-C")), "it starts");
    drop(lines);
    until("the lens is driven", || emulator.mode_and_current().0 == 5 && !emulator.commands().is_empty());
    process
}

#[test]
fn a_server_releases_the_lens_on_every_signal() {
    for signal in SIGNALS {
        let emulator = emulator(quick());
        let data = tempfile::tempdir().unwrap();
        assert!(end(server(&emulator, data.path()), signal).success());
        assert_eq!(emulator.mode_and_current(), AT_REST, "{signal:?}");
        assert_eq!(emulator.orders().last(), Some(&LensCommand::Current(0)));
    }
}

#[test]
fn after_a_kill_the_next_start_begins_without_current() {
    let emulator = emulator(quick());
    let data = tempfile::tempdir().unwrap();
    end(server(&emulator, data.path()), Signal::KILL);
    assert_eq!(emulator.mode_and_current().0, 5, "nobody could tell it");
    let before = emulator.orders().len();
    let lens = open(&emulator, "").unwrap();
    assert_eq!(
        emulator.orders()[before..],
        [LensCommand::CurrentMode, LensCommand::Current(0), LensCommand::FocalPowerMode],
        "then it is under control again"
    );

    drop(lens);
    assert_eq!(emulator.mode_and_current(), AT_REST);
}

#[test]
fn a_server_that_fails_with_its_loop_running_lets_the_lens_go() {
    // A slow unit, so that the exchange at the end takes a while.
    let emulator = emulator(Model { latency: Duration::from_millis(30), ..Model::default() });
    let data = tempfile::tempdir().unwrap();
    end(server(&emulator, data.path()), Signal::KILL);
    break_sessions(data.path());
    let before = emulator.orders().len();
    let status = parfocal(&emulator, &["serve", "--bind", "127.0.0.1:0", "--data-dir", data.path().to_str().unwrap()])
        .wait()
        .unwrap();
    assert_eq!(status.code(), Some(1));
    assert!(emulator.orders()[before..].contains(&LensCommand::FocalPowerMode), "it had come so far");
    assert_eq!(emulator.mode_and_current(), AT_REST);
    assert_eq!(emulator.orders().last(), Some(&LensCommand::Current(0)));
}

/// Adds a running session to the database that no version can read.
fn break_sessions(data: &std::path::Path) {
    let change = "INSERT INTO participants VALUES ('P1', '2026-01-01T00:00:00Z');
        INSERT INTO sessions (session, run, wall, monotonic_ns, participant, protocol, protocol_toml, protocol_sha256,
            practice, algorithm, seed, set_index, commitment)
        VALUES ('00000000-0000-4000-8000-000000000000', 1, '2026-01-01T00:00:00Z', 0, 'P1', 'none', 'nonsense', '',
            1, '', '', 0, '')";
    let path = data.join("parfocal.db");
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(async {
        let options = SqliteConnectOptions::new().filename(path);
        let mut database = SqliteConnection::connect_with(&options).await.unwrap();
        sqlx::raw_sql(change).execute(&mut database).await.unwrap();
        database.close().await.unwrap();
    });
}

//! `parfocal lens emulate`: an Optotune Lens Driver 4 that is not there, and what can befall it.

use std::io::BufRead;
use std::sync::Arc;

use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;

use super::{Failure, print};
use crate::clock::SystemClock;
use crate::lens::emulator::{Emulator, Fault, Model};

const HELP: &str = "type what shall befall it, then Enter:
  unplug | plug-in | restart       its USB cable, its power
  lens out | lens in               the lens's own cable
  temperature CELSIUS              of the lens
  fault NAME                       none, garbage, wrong-checksum, silent, errors, drops-commands, stranger
Ctrl-C ends it";

/// Arguments of `parfocal lens emulate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Serial number: one to four letters and digits, which follow on EMUL.
    #[arg(long, default_value = "0001", value_parser = parse_serial)]
    serial: [u8; 8],
}

/// Serves an emulated driver until Ctrl-C or an order to end.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let model = Model { serial: arguments.serial, ..Model::default() };
    let mut emulator = Emulator::start(model, Arc::new(SystemClock))?;
    print(&format!("{}\n", emulator.path().display()))?;
    eprintln!("{HELP}");
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(serve(&mut emulator))
}

async fn serve(emulator: &mut Emulator) -> Result<(), Failure> {
    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    let mut lines = typed_lines();
    loop {
        tokio::select! {
            _ = interrupt.recv() => return Ok(()),
            _ = terminate.recv() => return Ok(()),
            Some(line) = lines.recv() => {
                let answer = befall(emulator, &line).map_or_else(|problem| problem, |()| "done".into());
                eprintln!("{answer}");
            }
        }
    }
}

/// Lines typed, until the terminal is closed. Its thread ends with the process: reading a terminal cannot be cut short.
fn typed_lines() -> mpsc::UnboundedReceiver<String> {
    let (sender, lines) = mpsc::unbounded_channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    lines
}

fn befall(emulator: &mut Emulator, line: &str) -> Result<(), String> {
    let words: Vec<_> = line.split_whitespace().collect();
    match words.as_slice() {
        [] => {}
        ["unplug"] => emulator.unplug(),
        ["plug-in"] => emulator.plug_in().map_err(|error| error.to_string())?,
        ["restart"] => emulator.restart(),
        ["lens", "out"] => emulator.set_lens_present(false),
        ["lens", "in"] => emulator.set_lens_present(true),
        ["temperature", celsius] => {
            emulator.set_temperature(celsius.parse().map_err(|_| format!("'{celsius}' is no temperature"))?);
        }
        ["fault", name] => emulator.set_fault(name.parse::<Fault>()?),
        _ => return Err(HELP.into()),
    }
    Ok(())
}

/// The number behind the prefix that marks an emulated unit.
fn parse_serial(text: &str) -> Result<[u8; 8], String> {
    if text.is_empty() || text.len() > 4 || !text.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
        return Err("must be one to four letters and digits".into());
    }
    let mut serial = *b"EMUL0000";
    serial.iter_mut().rev().zip(text.bytes().rev()).for_each(|(place, byte)| *place = byte);
    Ok(serial)
}

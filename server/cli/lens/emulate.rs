//! `parfocal lens emulate`: emulates an Optotune Lens Driver 4, and its faults on request.

use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;

use crate::cli::input::{hear_lines, number};
use crate::cli::output::{Failure, print, wait_for};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::notices::tell;
use parfocal_devices::lens::emulator::{Emulator, Fault, Glitch, LENS_DIOPTRES, Model};
use parfocal_devices::lens::{LensDynamics, Optics};

/// Temperatures that can be set, °C.
const TEMPERATURES: RangeInclusive<f64> = -100.0..=200.0;

const HELP: &str = "type what should happen, then Enter:
  unplug | plug-in | restart       pull its USB cable, plug it in, cut its power for a moment
  lens out | lens in               pull the lens's own cable, plug it in
  temperature CELSIUS              set the lens's temperature
  latency MS                       set the time until it answers a request
  fault NAME                       a lasting fault: none, garbage, wrong-checksum, wrong-read-back, silent, errors,
                                   drops-commands, stranger, noisy-line
  glitch NAME [N]                  spoil the next reply, or the next N: noise, checksum, late
  glass                            print the glass's focal power, which no driver can read
Ctrl-C stops it";

/// Arguments of `parfocal lens emulate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// End of its serial number, after EMUL: one to four letters and digits.
    #[arg(long, default_value = "0001", value_parser = parse_serial)]
    serial: [u8; 8],
    /// Type of its firmware, A to F; type A counts dioptres with an offset of 5.
    #[arg(long, value_name = "LETTER", default_value = "A", value_parser = parse_firmware)]
    firmware: u8,
    /// Milliseconds until it answers a request.
    #[arg(long, value_name = "MS", default_value = "1", value_parser = parse_millis)]
    latency: Duration,
    /// Milliseconds from a command to the first movement of the glass.
    #[arg(long, value_name = "MS", default_value = "1", value_parser = parse_millis)]
    delay: Duration,
    /// Milliseconds from the first movement to within 5 % of the step.
    #[arg(long, value_name = "MS", default_value = "15", value_parser = parse_millis)]
    settling: Duration,
    /// Dioptres between the positions of the glass after a step up and after a step down.
    #[arg(long, value_name = "DPT", default_value = "0.04", value_parser = parse_play)]
    hysteresis: f64,
    /// Temperature of the lens in °C.
    #[arg(
        long,
        value_name = "CELSIUS",
        default_value = "25.5",
        value_parser = number(TEMPERATURES),
        allow_negative_numbers = true
    )]
    temperature: f64,
    /// Fault that it has from the start: none, garbage, wrong-checksum, wrong-read-back, silent, errors,
    /// drops-commands, stranger or noisy-line.
    #[arg(long, value_name = "NAME", default_value = "none")]
    fault: Fault,
}

impl Arguments {
    fn model(&self) -> Model {
        Model {
            serial: self.serial,
            firmware: self.firmware,
            latency: self.latency,
            glass: LensDynamics { delay: self.delay, settling: self.settling },
            play: self.hysteresis,
            ..Model::default()
        }
    }
}

/// Serves an emulated driver until Ctrl-C or SIGTERM.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut emulator = Emulator::start(arguments.model(), Arc::new(SystemClock))?;
    emulator.set_temperature(arguments.temperature);
    emulator.set_fault(arguments.fault);

    print(&format!("{}\n", emulator.path().display()))?;
    tell(HELP);

    wait_for(serve(&mut emulator))?
}

async fn serve(emulator: &mut Emulator) -> Result<(), Failure> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    let (sender, mut lines) = mpsc::unbounded_channel();
    hear_lines(move |line| sender.send(line).is_ok());

    loop {
        tokio::select! {
            _ = interrupt.recv() => return Ok(()),
            _ = terminate.recv() => return Ok(()),
            Some(line) = lines.recv() => {
                let answer = befall(emulator, &line).unwrap_or_else(|problem| problem);
                tell(answer);
            }
        }
    }
}

/// Carries out the command in `line`. Returns the answer, or the reason why it was not done.
fn befall(emulator: &mut Emulator, line: &str) -> Result<String, String> {
    let words: Vec<_> = line.split_whitespace().collect();
    match words.as_slice() {
        ["unplug"] => emulator.unplug(),
        ["plug-in"] => emulator.plug_in().map_err(|error| error.to_string())?,
        ["restart"] => emulator.restart(),
        ["lens", "out"] => emulator.set_lens_present(false),
        ["lens", "in"] => emulator.set_lens_present(true),
        ["temperature", celsius] => emulator.set_temperature(number(TEMPERATURES)(celsius)?),
        ["latency", millis] => emulator.set_latency(parse_millis(millis)?),
        ["fault", name] => emulator.set_fault(name.parse::<Fault>()?),
        ["glitch", name] => emulator.glitch(name.parse::<Glitch>()?, 0, 1),
        ["glitch", name, replies] => emulator.glitch(name.parse::<Glitch>()?, 0, parse_replies(replies)?),
        ["glass"] => return Ok(glass(emulator)),
        _ => return Err(HELP.into()),
    }

    Ok("done".into())
}

fn glass(emulator: &Emulator) -> String {
    let power = emulator.glass().focal_power_at(SystemClock.now()).get();
    let (least, most) = LENS_DIOPTRES;
    format!("glass at {power:.4}, {:.3} dpt", least + power * (most - least))
}

/// The serial number: the prefix that marks an emulated unit, then `text`.
fn parse_serial(text: &str) -> Result<[u8; 8], String> {
    if text.is_empty() || text.len() > 4 || !text.bytes().all(|byte| byte.is_ascii_alphanumeric()) {
        bail!("must be one to four letters and digits");
    }

    let mut serial = *b"EMUL0000";
    serial.iter_mut().rev().zip(text.bytes().rev()).for_each(|(place, byte)| *place = byte);
    Ok(serial)
}

fn parse_firmware(text: &str) -> Result<u8, String> {
    match text.as_bytes() {
        &[letter @ b'A'..=b'F'] => Ok(letter),
        _ => Err("must be a letter from A to F".into()),
    }
}

fn parse_millis(text: &str) -> Result<Duration, String> {
    Ok(Duration::from_secs_f64(number(0.0..=10_000.0)(text)? / 1000.0))
}

/// A hysteresis given in dioptres, in the unit of [`Model`].
fn parse_play(text: &str) -> Result<f64, String> {
    let play = text.parse().ok().and_then(Model::play_of);
    play.ok_or_else(|| format!("must be a number from 0 to {}", LENS_DIOPTRES.1 - LENS_DIOPTRES.0))
}

fn parse_replies(text: &str) -> Result<usize, String> {
    let replies = text.parse().ok().filter(|replies| (1..=1000).contains(replies));
    replies.ok_or_else(|| format!("must be a number of replies from 1 to 1000, not '{text}'"))
}

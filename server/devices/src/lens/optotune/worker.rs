//! The thread that talks to the driver: connects, sends commands, takes readings between them, and reconnects.

use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::codec;
use super::handshake::{self, DriverSettings};
use super::link::{Link, SentCommand};
use super::port::{Address, Port};
use super::shared::{Device, Shared};
use crate::lens::LensError;
use parfocal_base::clock::Moment;
use parfocal_base::guarded;

/// Wait before the first attempt to reconnect. It doubles up to [`BACKOFF_MOST`].
const BACKOFF_FIRST: Duration = Duration::from_millis(50);
/// Longest wait between attempts: short enough that the lens is usable within a second after its recovery.
const BACKOFF_MOST: Duration = Duration::from_millis(400);
/// Time between two readings. Each value is read every third time.
const READING_EVERY: Duration = Duration::from_millis(200);
/// The values read in turn.
const READINGS: [Reading; 3] = [Reading::Status, Reading::FocalPower, Reading::Temperature];
/// All values, in the order in which a refresh reads them.
const KINDS: [Reading; 4] = [Reading::Status, Reading::Mode, Reading::Temperature, Reading::FocalPower];
/// How long a due reading waits for a command. If it is made right after a command, its reply arrives before the next
/// command.
const GAP_PATIENCE: Duration = Duration::from_millis(60);
/// Longest time after a command that counts as right after it.
const GAP: Duration = Duration::from_millis(5);
/// How often a command is sent again before it counts as refused.
const RESENDS: u32 = 2;

/// A value that is read again and again.
#[derive(Debug, Clone, Copy)]
enum Reading {
    Status,
    Mode,
    Temperature,
    FocalPower,
}

/// Serves the device at `address` until it must stop. Then removes the lens's current.
pub fn run(shared: &Shared, address: &Address, settings: &DriverSettings) {
    let mut backoff = BACKOFF_FIRST;
    // Once a port is found it stays the same, so that no other driver takes this one's place.
    let mut found = None;
    loop {
        let mut link = None;
        let attempt = || attend(shared, &located(address, &mut found)?, settings, &mut link, &mut backoff);
        match guarded(attempt) {
            Ok(Err(trouble)) => shared.lost(trouble),
            Err(_) => shared.lost(LensError::Gone("its driver failed".into())),
        }

        // If the end was requested while the port was open, the open connection is used to remove the current.
        if shared.stop_within(Duration::ZERO) {
            return let_go(shared, found.as_deref(), settings, link);
        }

        // Close the port, so that others and the next attempt can open it.
        drop(link);
        if shared.stop_within(backoff) {
            return let_go(shared, found.as_deref(), settings, None);
        }

        backoff = (backoff * 2).min(BACKOFF_MOST);
    }
}

/// The port at `address`, which is kept in `found`.
fn located(address: &Address, found: &mut Option<PathBuf>) -> Result<PathBuf, LensError> {
    let path = found.take().map_or_else(|| address.path(), Ok)?;
    Ok(found.insert(path).clone())
}

/// Connects, sends commands and takes readings until that fails. Leaves the connection in `link`.
fn attend<'a>(
    shared: &'a Shared,
    path: &Path,
    settings: &DriverSettings,
    link: &mut Option<Link<'a>>,
    backoff: &mut Duration,
) -> Result<Infallible, LensError> {
    let link = link.insert(Link::new(Port::open(path)?, shared));
    let mut session = connect(shared, path, settings, link)?;
    *backoff = BACKOFF_FIRST;
    loop {
        session.step()?;
    }
}

/// Sets zero current at the end, unless the lens must stay where it is. `link` is the connection, if it is still open.
fn let_go(shared: &Shared, path: Option<&Path>, settings: &DriverSettings, link: Option<Link>) {
    // Never send anything to a device that is not a lens driver.
    if settings.keep || !shared.state().greeted {
        return;
    }
    if link.is_some_and(|link| close(link).is_ok()) {
        return;
    }

    let Some(path) = path else { return };
    // A new connection may still work, and the lens may still be under current.
    let afresh = Port::open(path).map_err(|error| error.to_string());
    if let Err(error) = afresh.and_then(|port| close(Link::new(port, shared))) {
        tracing::warn!(error, "could not confirm that the lens is without current after closing");
    }
}

fn close(mut link: Link) -> Result<(), String> {
    match guarded(|| link.close()) {
        Ok(told) => told.map_err(|error| error.to_string()),
        Err(_) => Err("its driver failed".to_owned()),
    }
}

fn connect<'a, 'b>(
    shared: &'a Shared,
    path: &Path,
    settings: &'b DriverSettings,
    link: &'b mut Link<'a>,
) -> Result<Session<'a, 'b>, LensError> {
    let mut device = handshake::perform(link, settings, path)?;

    // After a reconnection the lens goes to the latest command. A new lens stays where it is.
    let last = shared.state().last;
    match last {
        Some(power) => {
            device.read_back = device.range.raw(power);
            link.send_focal_power(device.range, device.read_back);
        }
        None => shared.response.command(shared.clock.now(), device.range.focal_power(device.read_back)),
    }

    link.follow_commands(device.range);
    shared.connected(device.clone(), words(&device, settings, shared.line_errors()));

    let next_reading = shared.clock.now() + READING_EVERY;
    Ok(Session { shared, settings, link, device, next_reading, turn: 0, unmet: 0 })
}

/// A working connection.
struct Session<'a, 'b> {
    shared: &'a Shared,
    settings: &'b DriverSettings,
    link: &'b mut Link<'a>,
    device: Device,
    next_reading: Moment,
    turn: usize,
    /// How many times in a row the read-back differed from the command.
    unmet: u32,
}

impl Session<'_, '_> {
    /// Sends commands until a reading is due, and takes it.
    fn step(&mut self) -> Result<(), LensError> {
        let now = self.shared.clock.now();
        let due = now >= self.next_reading;
        self.link.pump(if due { self.next_reading + GAP_PATIENCE } else { self.next_reading })?;

        if self.shared.state().refresh {
            return self.read_everything();
        }

        let now = self.shared.clock.now();
        let behind_command = self.link.sent().is_some_and(|sent| now.since(sent.at) < GAP);
        if now >= self.next_reading + GAP_PATIENCE || (now >= self.next_reading && behind_command) {
            self.next_reading = now + READING_EVERY;
            self.turn = (self.turn + 1) % READINGS.len();
            self.read(READINGS[self.turn])?;
            self.publish();
        }
        Ok(())
    }

    fn read_everything(&mut self) -> Result<(), LensError> {
        for reading in KINDS {
            self.read(reading)?;
        }

        self.publish();
        self.shared.refreshed();
        Ok(())
    }

    /// Reads a value. If the lens is gone, or the driver lost its settings, the connection ends.
    fn read(&mut self, reading: Reading) -> Result<(), LensError> {
        let sent = self.link.sent();
        if let Some(error) = self.link.stray_error() {
            tracing::warn!(%error, "the lens driver did not accept a command");
        }

        match reading {
            Reading::Status => self.device.status.0 = self.link.ask(codec::STATUS)?,
            Reading::Mode => self.device.mode = self.link.ask(codec::MODE)?,
            Reading::Temperature => self.device.temperature = f64::from(self.link.ask(codec::TEMPERATURE)?) / 16.0,
            Reading::FocalPower => {
                self.device.read_back = self.link.ask(codec::FOCAL_POWER)?;
                self.compare(sent, self.device.read_back);
            }
        }

        if self.device.status.without_lens() || self.device.status.restarted() {
            let why = "the driver lost its lens or was restarted, and is being set up again";
            return Err(LensError::Gone(why.into()));
        }
        Ok(())
    }

    /// Sends the last command again if the device did not accept it.
    fn compare(&mut self, sent: Option<SentCommand>, read_back: i16) {
        // A command sent in the meantime makes the comparison meaningless.
        let Some(last) = self.link.sent().filter(|&last| Some(last) == sent) else { return };
        if last.raw == read_back {
            self.unmet = 0;
        } else {
            self.unmet += 1;
            // The next reading is the status, which may say why. Then the focal power is read again.
            self.turn = READINGS.len() - 1;
            self.link.send_focal_power(self.device.range, last.raw);
        }
    }

    fn publish(&self) {
        // No dioptres here: they would show the operator of a blinded session how the policy moves.
        let refusal = (self.unmet > RESENDS)
            .then(|| Arc::from("it does not go where it is sent: restart the driver or check the lens"));

        let mut state = self.shared.state();
        state.device = Ok(self.device.clone());
        state.message = words(&self.device, self.settings, self.shared.line_errors());
        state.refusal = refusal;
    }
}

/// Describes the state of a connected device in one sentence.
fn words(device: &Device, settings: &DriverSettings, line_errors: u64) -> Arc<str> {
    let Device { status, temperature, range, .. } = device;
    let line = match line_errors {
        0 => String::new(),
        1 => "; 1 error on its line so far".to_owned(),
        many => format!("; {many} errors on its line so far: if they continue, check its USB cable"),
    };

    let (low, high) = settings.temperatures;
    if status.doubtful() {
        return Arc::from(format!(
            "follows commands, but at {temperature:.1} °C the focal power is unreliable ({}): let the lens get \
             between {low:.0} and {high:.0} °C{line}",
            status.words().join("; ")
        ));
    }

    let min = range.min_dioptre();
    let max = range.max_dioptre();
    Arc::from(format!("follows commands between {min:.2} and {max:.2} dpt, at {temperature:.1} °C{line}"))
}

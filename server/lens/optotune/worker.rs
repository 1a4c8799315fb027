//! The thread that talks to the driver: connects, follows commands, looks after the lens in the gaps, comes back.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::codec::{Reply, Request, WireError};
use super::handshake::{self, Settings};
use super::link::{Link, LinkError, Sent};
use super::port::Port;
use super::shared::{Device, Ending, Shared};
use crate::clock::Moment;
use crate::lens::LensError;

/// Wait before the first new attempt; doubles up to [`BACKOFF_MOST`].
const BACKOFF_FIRST: Duration = Duration::from_millis(50);
/// Short enough that the lens is back within a second of the end of its trouble.
const BACKOFF_MOST: Duration = Duration::from_millis(400);
/// Between two readings; each is read every third time.
const READING_EVERY: Duration = Duration::from_millis(200);
/// What is read, in turn.
const READINGS: [Request; 3] = [Request::Status, Request::FocalPower, Request::Temperature];
/// All that is read, in the order in which it is asked for at once.
const KINDS: [Request; 4] = [Request::Status, Request::Mode, Request::Temperature, Request::FocalPower];
/// How long a reading that is due waits for a command, so as to be made right behind one: then the reply is in before
/// the next command comes.
const GAP_PATIENCE: Duration = Duration::from_millis(60);
/// A reading made this soon after a command is in its gap.
const GAP: Duration = Duration::from_millis(5);
/// Failed readings of a kind in a row before the connection is given up.
const FAILURES: u32 = 3;
/// Times that a command is sent again before it is called refused.
const RESENDS: u32 = 2;

/// Serves the device at `path` until told to stop.
pub fn run(shared: &Shared, path: &Path, settings: &Settings) {
    let mut backoff = BACKOFF_FIRST;
    loop {
        let trouble = match connect(shared, path, settings) {
            Ok(mut session) => {
                backoff = BACKOFF_FIRST;
                session.serve()
            }
            Err(trouble) => trouble,
        };
        if let Trouble::Stopped = trouble {
            return shared.lost(LensError::Gone("closed".into()));
        }
        shared.lost(trouble.into());
        if shared.stop_within(backoff) {
            return;
        }
        backoff = (backoff * 2).min(BACKOFF_MOST);
    }
}

/// What ends a connection.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The thread is to end.
    #[error("closing")]
    Stopped,
    /// The device cannot be used.
    #[error(transparent)]
    Lens(#[from] LensError),
}

impl From<Trouble> for LensError {
    fn from(trouble: Trouble) -> Self {
        match trouble {
            Trouble::Stopped => Self::Gone("closed".into()),
            Trouble::Lens(error) => error,
        }
    }
}

impl From<LinkError> for Trouble {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Stopped => Self::Stopped,
            LinkError::Wire(WireError::Device(error)) => Self::Lens(LensError::Refused(error.to_string())),
            other => Self::Lens(LensError::Gone(other.to_string())),
        }
    }
}

fn connect<'a>(shared: &'a Shared, path: &Path, settings: &'a Settings) -> Result<Session<'a>, Trouble> {
    let mut link = Link::new(Port::open(path)?, shared);
    let mut device = handshake::perform(&mut link, settings, path)?;
    let last = shared.state().last;
    match last {
        Some(power) => {
            device.read_back = device.range.raw(power);
            link.send_focal_power(device.range, device.read_back);
        }
        None => shared.response.command(shared.clock.now(), device.range.focal_power(device.read_back)),
    }
    link.follow_commands(device.range);
    shared.connected(device.clone(), words(&device, settings));
    let next_reading = shared.clock.now() + READING_EVERY;
    Ok(Session { shared, settings, link, device, next_reading, turn: 0, failures: [0; KINDS.len()], unmet: 0 })
}

/// The place of `request` in [`KINDS`].
fn kind(request: Request) -> usize {
    KINDS.iter().position(|&kind| kind == request).unwrap_or(0)
}

/// A connection that works.
struct Session<'a> {
    shared: &'a Shared,
    settings: &'a Settings,
    link: Link<'a>,
    device: Device,
    next_reading: Moment,
    turn: usize,
    /// Failed readings in a row, by kind: one that never works must not hide among those that do.
    failures: [u32; KINDS.len()],
    /// Times in a row that the read-back was not what was sent.
    unmet: u32,
}

impl Session<'_> {
    /// Follows commands until the connection ends.
    fn serve(&mut self) -> Trouble {
        loop {
            match self.step() {
                Ok(()) => {}
                Err(Trouble::Stopped) => {
                    self.relax();
                    return Trouble::Stopped;
                }
                Err(trouble) => return trouble,
            }
        }
    }

    fn step(&mut self) -> Result<(), Trouble> {
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
            let request = READINGS[self.turn];
            let outcome = self.read(request);
            self.forgive(request, outcome)?;
            self.publish();
        }
        Ok(())
    }

    fn read_everything(&mut self) -> Result<(), Trouble> {
        let mut complete = true;
        for request in KINDS {
            // Asked for by someone who waits: worth a second attempt at once.
            let outcome = match self.read(request) {
                Err(LinkError::Wire(_) | LinkError::Silent) => self.read(request),
                outcome => outcome,
            };
            complete &= outcome.is_ok();
            self.forgive(request, outcome)?;
        }
        self.publish();
        // Else it is tried again: nothing old is handed out as new.
        if complete {
            self.shared.refreshed();
        }
        Ok(())
    }

    fn read(&mut self, request: Request) -> Result<(), LinkError> {
        let sent = self.link.sent();
        if let Some(error) = self.link.stray_error() {
            tracing::warn!(%error, "the lens driver did not accept a command");
        }
        match self.link.ask(request)? {
            Reply::Status(bits) => self.device.status.0 = bits,
            Reply::Mode(mode) => self.device.mode = mode,
            Reply::Temperature(sixteenths) => self.device.temperature = f64::from(sixteenths) / 16.0,
            Reply::FocalPower(raw) => {
                self.device.read_back = raw;
                self.compare(sent, raw);
            }
            _ => {}
        }
        self.failures[kind(request)] = 0;
        Ok(())
    }

    /// Sends the last command again if the device does not have it.
    fn compare(&mut self, sent: Option<Sent>, read_back: i16) {
        // A command that went out meanwhile makes the comparison void.
        let Some(last) = self.link.sent().filter(|&last| Some(last) == sent) else { return };
        if last.raw == read_back {
            self.unmet = 0;
        } else {
            self.unmet += 1;
            // Next is the status, which may tell why, and then the focal power again.
            self.turn = READINGS.len() - 1;
            self.link.send_focal_power(self.device.range, last.raw);
        }
    }

    /// Lets a few failures in a row pass: one damaged reply is no reason to drop a lens that follows. A lens that is
    /// gone, or a driver that forgot how it was set up, is.
    fn forgive(&mut self, request: Request, outcome: Result<(), LinkError>) -> Result<(), Trouble> {
        let failures = &mut self.failures[kind(request)];
        match outcome {
            Err(LinkError::Wire(_) | LinkError::Silent) if *failures + 1 < FAILURES => {
                *failures += 1;
                self.next_reading = self.shared.clock.now();
            }
            other => other?,
        }
        if self.device.status.without_lens() || self.device.status.restarted() {
            let why = "the driver lost its lens or was restarted, and is being set up again";
            return Err(LensError::Gone(why.into()).into());
        }
        Ok(())
    }

    fn publish(&self) {
        // Without the dioptres: they would tell the operator of a blinded session how the policy moves.
        let refusal = (self.unmet > RESENDS)
            .then(|| Arc::from("it does not go where it is sent: restart the driver or check the lens"));
        let mut state = self.shared.state();
        state.device = Ok(self.device.clone());
        state.message = words(&self.device, self.settings);
        state.refusal = refusal;
    }

    /// Leaves the lens without current: it rests, and warms nobody. Nothing can be done about a device that fails now.
    fn relax(&mut self) {
        if self.shared.state().ending == Some(Ending::AsItIs) {
            return;
        }
        let relaxed = self
            .link
            .ask(Request::CurrentMode)
            .and_then(|_| self.link.tell(Request::SetCurrent(0)))
            .and_then(|()| self.link.ask(Request::Current));
        if let Err(error) = relaxed {
            tracing::warn!(%error, "the lens could not be relaxed on closing");
        }
    }
}

/// How a connected device does, in a sentence.
fn words(device: &Device, settings: &Settings) -> Arc<str> {
    let Device { status, temperature, range, .. } = device;
    let (low, high) = settings.temperatures;
    if status.doubtful() {
        return Arc::from(format!(
            "follows commands, but at {temperature:.1} °C the focal power cannot be relied on ({}): let the lens get \
             between {low:.0} and {high:.0} °C",
            status.words().join("; ")
        ));
    }
    let (min, max) = (range.min_dioptre(), range.max_dioptre());
    Arc::from(format!("follows commands between {min:.2} and {max:.2} dpt, at {temperature:.1} °C"))
}

//! One connection to the driver. Commands from the slot are sent at once, even while it waits for a reply.

use std::io::{self, ErrorKind, Read, Write};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::codec::{self, DeviceError, Order, READY, Request, START, WireError};
use super::port::Port;
use super::range::Range;
use super::shared::Shared;
use crate::lens::LensError;
use parfocal_base::clock::Moment;

/// Longest wait for a reply. A driver answers within a few milliseconds; USB hubs add some.
const REPLY_TIMEOUT: Duration = Duration::from_millis(150);
/// Least time between two commands: the time that a command's ten bytes take over the wire. A command sent earlier
/// would wait in the port, where a newer one could not replace it.
const ON_THE_WIRE: Duration = Duration::from_millis(1);
/// How often a request is made before it counts as failed. Every request with a reply can be repeated, because it only
/// reads, or sets the same value again.
const ATTEMPTS: u32 = 3;
/// After the line has been quiet for this long, no more bytes of an earlier reply are expected.
const QUIET: Duration = Duration::from_millis(10);
/// Longest wait for the line to become quiet.
const DRAINING: Duration = Duration::from_millis(200);

/// A port with a lens driver behind it.
pub struct Link<'a> {
    port: Port,
    shared: &'a Shared,
    /// The device's range, once known. From then on commands are taken from the slot.
    range: Option<Range>,
    sent: Option<SentCommand>,
    /// Whether a reply to an earlier request may still come.
    awaiting: bool,
    /// Whether the lens's current is being removed at the end. Nothing may interrupt this.
    closing: bool,
    outgoing: Vec<u8>,
    incoming: Vec<u8>,
}

/// The last command sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SentCommand {
    /// Focal power in the driver's own units.
    pub raw: i16,
    /// Time at which it was sent.
    pub at: Moment,
}

/// Why communication with the driver failed.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port failed or is gone.
    #[error("its port failed ({0}): plug its USB cable in")]
    Port(#[from] io::Error),
    /// No bytes came back in time.
    #[error("it is silent: check its power and cable")]
    Silent,
    /// The bytes that came back are not a reply.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The thread was asked to end.
    #[error("closing")]
    Stopped,
}

impl LinkError {
    /// Whether the line may be the cause, so that the same request may succeed next time. A driver that reports an
    /// unknown request may have received a damaged one.
    const fn is_of_the_line(&self) -> bool {
        match self {
            Self::Silent | Self::Wire(WireError::Checksum | WireError::Garbage) => true,
            Self::Wire(WireError::Device(error)) => matches!(error, DeviceError::Checksum | DeviceError::Unknown),
            Self::Port(_) | Self::Stopped => false,
        }
    }
}

impl From<LinkError> for LensError {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Wire(WireError::Device(error)) => Self::Refused(error.to_string()),
            other => Self::Gone(other.to_string()),
        }
    }
}

impl<'a> Link<'a> {
    /// A connection over `port`.
    pub const fn new(port: Port, shared: &'a Shared) -> Self {
        Self {
            port,
            shared,
            range: None,
            sent: None,
            awaiting: false,
            closing: false,
            outgoing: Vec::new(),
            incoming: Vec::new(),
        }
    }

    /// From now on, takes commands from the slot and sends them, scaled to `range`.
    pub const fn follow_commands(&mut self, range: Range) {
        self.range = Some(range);
    }

    /// Whether a lens driver has been connected on this port before.
    pub fn is_known(&self) -> bool {
        self.shared.state().was_connected()
    }

    /// The last command sent.
    pub const fn sent(&self) -> Option<SentCommand> {
        self.sent
    }

    /// Queues the command to go to `raw`.
    pub fn send_focal_power(&mut self, range: Range, raw: i16) {
        let now = self.shared.clock.now();
        self.outgoing.extend(codec::set_focal_power(raw).encode());
        self.shared.response.command(now, range.focal_power(raw));
        self.sent = Some(SentCommand { raw, at: now });
    }

    /// Greets the driver, at most three times: the first greeting may only complete a request that another program left
    /// half sent. Returns whether the reply was a lens driver's greeting.
    pub fn greet(&mut self) -> Result<bool, LinkError> {
        let mut heard = false;
        for _ in 0..ATTEMPTS {
            if self.greet_once()? {
                self.note_noise(!self.incoming.starts_with(READY));
                self.shared.state().greeted = true;
                return Ok(true);
            }

            heard |= !self.incoming.is_empty();
            self.shared.count_line_error();
            self.drain()?;
        }

        if heard { Ok(false) } else { Err(LinkError::Silent) }
    }

    fn greet_once(&mut self) -> Result<bool, LinkError> {
        self.incoming.clear();
        self.outgoing.extend(START);

        let end = self.shared.clock.now() + REPLY_TIMEOUT;
        while self.shared.clock.now() < end {
            self.pump(end)?;
            if self.incoming.windows(READY.len()).any(|bytes| bytes == READY) {
                return Ok(true);
            }
        }

        Ok(false)
    }

    /// Makes `request` and waits for its reply. If the line lost or damaged it, repeats the request, up to three times
    /// in all.
    pub fn ask<T: Copy>(&mut self, request: Request<T>) -> Result<T, LinkError> {
        let mut attempt = 1;

        loop {
            let error = match self.ask_once(request) {
                Err(error) if error.is_of_the_line() => error,
                outcome => return outcome,
            };

            self.shared.count_line_error();

            if attempt == ATTEMPTS {
                return Err(error);
            }

            attempt += 1;
            self.drain()?;
        }
    }

    fn ask_once<T: Copy>(&mut self, request: Request<T>) -> Result<T, LinkError> {
        self.receive()?;
        self.incoming.clear();
        self.outgoing.extend(request.order.encode());
        self.awaiting = true;

        let end = self.shared.clock.now() + REPLY_TIMEOUT;
        loop {
            self.pump(end)?;

            let outcome = self.find_reply(request);
            if matches!(outcome, Ok(_) | Err(LinkError::Wire(WireError::Device(_)))) {
                self.awaiting = false;
                return outcome;
            }

            if self.shared.clock.now() >= end {
                return outcome;
            }
        }
    }

    /// Finds the reply to `request` in the bytes received. Noise, or a late reply to another request, may come before
    /// it.
    fn find_reply<T: Copy>(&self, request: Request<T>) -> Result<T, LinkError> {
        let mut failure = if self.incoming.is_empty() { LinkError::Silent } else { WireError::Garbage.into() };

        for start in 0..self.incoming.len() {
            match request.reply(self.incoming.get(start..).unwrap_or_default()) {
                Ok(Some(reply)) => {
                    self.note_noise(start > 0);
                    return Ok(reply);
                }
                Err(error) if start == 0 => failure = error.into(),
                _ => {}
            }
        }

        Err(failure)
    }

    /// Counts a line error if other bytes came `before` a reply.
    fn note_noise(&self, before: bool) {
        if before {
            self.shared.count_line_error();
        }
    }

    /// Waits until the line is quiet, and drops the bytes received. If a reply is due and no byte of it has come yet,
    /// waits as long as a reply may take.
    fn drain(&mut self) -> Result<(), LinkError> {
        let begun = self.shared.clock.now();
        let end = begun + DRAINING;
        let late = self.awaiting && self.incoming.is_empty();
        let mut quiet_at = begun + if late { REPLY_TIMEOUT } else { QUIET };
        self.awaiting = false;

        loop {
            self.incoming.clear();
            self.pump(quiet_at.min(end))?;

            let now = self.shared.clock.now();
            if !self.incoming.is_empty() {
                quiet_at = now + QUIET;
            }

            if now >= quiet_at.min(end) {
                self.incoming.clear();
                return Ok(());
            }
        }
    }

    /// Leaves the lens without current, so that it rests and does not warm up. Sends the commands whatever the driver
    /// answers, and then asks whether it obeyed.
    pub fn relax(&mut self) -> Result<(), LinkError> {
        let mut attempt = 1;
        loop {
            self.drain()?;

            let outcome = self.relax_once();
            match outcome {
                Err(error) if error.is_of_the_line() && attempt < ATTEMPTS => self.shared.count_line_error(),
                outcome => return outcome,
            }
            attempt += 1;
        }
    }

    fn relax_once(&mut self) -> Result<(), LinkError> {
        let by_current = self.ask_once(codec::CURRENT_MODE);
        // The current is set even if the change of mode was not confirmed: the lens must come to rest.
        self.tell(codec::set_current(0))?;
        by_current?;
        match self.ask_once(codec::CURRENT)? {
            0 => Ok(()),
            _ => Err(WireError::Garbage.into()),
        }
    }

    /// The last operation on the lens: stops taking commands, and leaves the lens without current.
    pub fn close(&mut self) -> Result<(), LinkError> {
        self.closing = true;
        self.range = None;
        self.relax()
    }

    /// Sends an order that has no reply, or whose reply is not needed.
    pub fn tell(&mut self, order: Order) -> Result<(), LinkError> {
        self.outgoing.extend(order.encode());
        self.flush()?;
        Ok(())
    }

    /// An error that the driver sent on its own. It does so if it did not accept a command.
    pub fn stray_error(&mut self) -> Option<DeviceError> {
        let stray = std::mem::take(&mut self.incoming);
        let error = codec::error_reply(&stray);
        if error == Some(DeviceError::Checksum) {
            self.shared.count_line_error();
        }
        error
    }

    /// Sends the bytes that wait. Then waits until bytes come, the slot is filled, the thread is asked to end, or
    /// `until`.
    pub fn pump(&mut self, until: Moment) -> Result<(), LinkError> {
        self.take_command();
        self.flush()?;

        let until = self.command_due().map_or(until, |due| due.min(until));
        let left = Timespec::try_from(until.since(self.shared.clock.now())).unwrap_or_default();
        let wanted = if self.outgoing.is_empty() { PollFlags::IN } else { PollFlags::IN | PollFlags::OUT };
        let mut watched = [PollFd::new(self.port.file(), wanted), PollFd::new(&self.shared.wake, PollFlags::IN)];

        match poll(&mut watched, Some(&left)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(io::Error::from(error).into()),
        }

        let [port, wake] = watched.map(|one| one.revents());
        if wake.contains(PollFlags::IN) {
            let _ = rustix::io::read(&self.shared.wake, &mut [0; 8]);
            if !self.closing && self.shared.state().ending() {
                return Err(LinkError::Stopped);
            }
        }

        self.take_command();
        self.flush()?;
        if port.intersects(PollFlags::IN | PollFlags::HUP | PollFlags::ERR) { self.receive() } else { Ok(()) }
    }

    /// Earliest time for sending the command that waits in the slot; `None` if it may be sent at once, or not at all.
    fn command_due(&self) -> Option<Moment> {
        let free = self.range.is_some() && self.outgoing.is_empty();
        let sent = self.sent.filter(|_| free && self.shared.has_command())?;
        Some(sent.at + ON_THE_WIRE)
    }

    /// Sends the command in the slot, unless an older one is still on the wire.
    fn take_command(&mut self) {
        let Some(range) = self.range.filter(|_| self.outgoing.is_empty()) else { return };
        if self.command_due().is_some_and(|due| self.shared.clock.now() < due) {
            return;
        }

        if let Some(target) = self.shared.take_command() {
            self.send_focal_power(range, range.raw(target));
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        while !self.outgoing.is_empty() {
            match self.port.file().write(&self.outgoing) {
                Ok(written) => drop(self.outgoing.drain(..written)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }

        Ok(())
    }

    fn receive(&mut self) -> Result<(), LinkError> {
        let mut bytes = [0; 256];
        match self.port.file().read(&mut bytes) {
            Ok(0) => Err(io::Error::from(ErrorKind::UnexpectedEof).into()),
            Ok(read) => {
                self.incoming.extend(bytes.iter().take(read));
                // A device that never stops sending must not fill the memory.
                self.incoming.truncate(4096);
                Ok(())
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

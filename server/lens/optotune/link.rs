//! One connection to the driver: commands from the slot go out at once, also while a reply is awaited.

use std::io::{self, ErrorKind, Read, Write};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::codec::{self, DeviceError, READY, Reply, Request, START, WireError};
use super::port::Port;
use super::range::Range;
use super::shared::Shared;
use crate::clock::Moment;

/// A driver answers within a few milliseconds; USB hubs add some.
const REPLY_TIMEOUT: Duration = Duration::from_millis(150);

/// A port with a lens driver behind it.
pub struct Link<'a> {
    port: Port,
    shared: &'a Shared,
    /// Once known, commands are taken from the slot.
    range: Option<Range>,
    sent: Option<Sent>,
    outgoing: Vec<u8>,
    incoming: Vec<u8>,
}

/// The last command that went out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sent {
    /// In the driver's own units.
    pub raw: i16,
    /// When.
    pub at: Moment,
}

/// Why the driver could not be talked to.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The port failed or vanished.
    #[error("its port failed ({0}): plug its USB cable in")]
    Port(#[from] io::Error),
    /// Nothing came back in time.
    #[error("it is silent: check its power and cable")]
    Silent,
    /// What came back is no reply.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The thread is to end.
    #[error("closing")]
    Stopped,
}

impl<'a> Link<'a> {
    /// A connection over `port`.
    pub const fn new(port: Port, shared: &'a Shared) -> Self {
        Self { port, shared, range: None, sent: None, outgoing: Vec::new(), incoming: Vec::new() }
    }

    /// From now on takes commands from the slot and sends them within `range`.
    pub const fn follow_commands(&mut self, range: Range) {
        self.range = Some(range);
    }

    /// Whether this is known to be the port of a lens driver.
    pub fn is_known(&self) -> bool {
        self.shared.state().was_connected()
    }

    /// The last command that went out.
    pub const fn sent(&self) -> Option<Sent> {
        self.sent
    }

    /// Queues the command to go to `raw`.
    pub fn send_focal_power(&mut self, range: Range, raw: i16) {
        let now = self.shared.clock.now();
        self.outgoing.extend(Request::SetFocalPower(raw).encode());
        self.shared.response.command(now, range.focal_power(raw));
        self.sent = Some(Sent { raw, at: now });
    }

    /// Greets the driver; whether it greeted back as a lens driver does.
    pub fn greet(&mut self) -> Result<bool, LinkError> {
        self.incoming.clear();
        self.outgoing.extend(START);
        let end = self.shared.clock.now() + REPLY_TIMEOUT;
        while self.shared.clock.now() < end {
            self.pump(end)?;
            if self.incoming.ends_with(READY) {
                return Ok(true);
            }
        }
        if self.incoming.is_empty() { Err(LinkError::Silent) } else { Ok(false) }
    }

    /// Asks `request` and waits for its reply.
    pub fn ask(&mut self, request: Request) -> Result<Reply, LinkError> {
        self.receive()?;
        self.incoming.clear();
        self.outgoing.extend(request.encode());
        let end = self.shared.clock.now() + REPLY_TIMEOUT;
        loop {
            self.pump(end)?;
            if let Some(reply) = request.reply(&self.incoming)? {
                return Ok(reply);
            }
            if self.shared.clock.now() >= end {
                return Err(if self.incoming.is_empty() { LinkError::Silent } else { WireError::Garbage.into() });
            }
        }
    }

    /// Sends a request that gets no reply, or whose reply nobody needs.
    pub fn tell(&mut self, request: Request) -> Result<(), LinkError> {
        self.outgoing.extend(request.encode());
        self.flush()?;
        Ok(())
    }

    /// An error that the driver sent unasked, which is how it answers a command that it did not accept.
    pub fn stray_error(&mut self) -> Option<DeviceError> {
        let stray = std::mem::take(&mut self.incoming);
        codec::error_reply(&stray)
    }

    /// Sends what waits to be sent, and waits until something happens or `until`: bytes came, the slot was filled, or
    /// the thread is to end.
    pub fn pump(&mut self, until: Moment) -> Result<(), LinkError> {
        self.take_command();
        self.flush()?;
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
            if self.shared.state().ending.is_some() {
                return Err(LinkError::Stopped);
            }
            self.take_command();
        }
        self.flush()?;
        if port.intersects(PollFlags::IN | PollFlags::HUP | PollFlags::ERR) { self.receive() } else { Ok(()) }
    }

    /// Moves the command from the slot onto the wire, unless an older one is not even out.
    fn take_command(&mut self) {
        let Some(range) = self.range.filter(|_| self.outgoing.is_empty()) else { return };
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
                // A line that babbles is noticed by its length; it must not fill the memory.
                self.incoming.truncate(4096);
                Ok(())
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }
}

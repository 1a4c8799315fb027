//! The emulated unit's end of a pseudo-terminal, and the thread that serves it.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::firmware::Firmware;
use parfocal_base::clock::Clock;
use parfocal_base::priority::{self, ThreadRole};

/// Interval for checking whether a program has opened the port: until then there is no event to wait for.
const UNOPENED: Duration = Duration::from_millis(5);

/// A pseudo-terminal with an emulated unit behind it. Closed when dropped.
pub struct Pty {
    path: PathBuf,
    stop: Arc<OwnedFd>,
    thread: Option<JoinHandle<()>>,
}

impl Pty {
    /// Opens a pseudo-terminal and serves `firmware` on it.
    ///
    /// # Errors
    /// If the system has no pseudo-terminal, event descriptor or thread left.
    pub fn open(firmware: Arc<Mutex<Firmware>>, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let driver = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&driver)?;
        unlockpt(&driver)?;

        let path = PathBuf::from(OsStr::from_bytes(ptsname(&driver, Vec::new())?.as_bytes()));

        // Replies that nobody reads are lost, as on a real line. Waiting for a reader could last forever.
        let flags = fcntl_getfl(&driver)?;
        fcntl_setfl(&driver, flags | OFlags::NONBLOCK)?;

        // A serial port neither echoes nor changes line ends.
        let mut settings = tcgetattr(&driver)?;
        settings.make_raw();
        tcsetattr(&driver, OptionalActions::Now, &settings)?;

        let stop = Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?);
        let server = Server { port: File::from(driver), stop: stop.clone(), firmware, clock };
        let thread = std::thread::Builder::new().name("lens-emulator".into()).spawn(move || {
            // A real unit has its own processor.
            priority::raise(ThreadRole::Wire);
            server.run();
        })?;

        Ok(Self { path, stop, thread: Some(thread) })
    }

    /// Name of the port.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        let _ = rustix::io::write(&*self.stop, &1_u64.to_ne_bytes());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Server {
    port: File,
    stop: Arc<OwnedFd>,
    firmware: Arc<Mutex<Firmware>>,
    clock: Arc<dyn Clock>,
}

impl Server {
    fn run(mut self) {
        let mut bytes = [0; 256];
        while let Some(port) = self.wait() {
            if !port.contains(PollFlags::IN) {
                if self.stopped_within(UNOPENED) {
                    return;
                }
                continue;
            }

            let Ok(read) = self.port.read(&mut bytes) else { continue };
            let received = bytes.get(..read).unwrap_or_default();

            let answers = {
                let mut firmware = self.firmware.lock().unwrap_or_else(PoisonError::into_inner);
                firmware.receive(received, self.clock.now())
            };

            for answer in answers {
                if self.stopped_within(answer.takes) {
                    return;
                }
                // The other side may have closed the port, or read nothing for long.
                let _ = self.port.write_all(&answer.bytes);
            }
        }
    }

    /// Waits for events on the port and returns them; `None` if the thread must stop.
    fn wait(&self) -> Option<PollFlags> {
        let mut watched = [PollFd::new(&self.port, PollFlags::IN), PollFd::new(&*self.stop, PollFlags::IN)];
        let _ = poll(&mut watched, None);

        let [port, stop] = watched.map(|one| one.revents());
        stop.is_empty().then_some(port)
    }

    fn stopped_within(&self, time: Duration) -> bool {
        let time = Timespec::try_from(time).unwrap_or_default();
        poll(&mut [PollFd::new(&*self.stop, PollFlags::IN)], Some(&time)).is_ok_and(|ready| ready > 0)
    }
}

#[cfg(test)]
mod tests {
    use rustix::fs::Mode;

    use super::*;
    use crate::lens::emulator::Model;
    use parfocal_base::clock::SystemClock;

    #[test]
    fn a_client_that_reads_nothing_does_not_keep_the_unit_from_ending() {
        let model = Model { latency: Duration::ZERO, ..Model::default() };
        let firmware = Arc::new(Mutex::new(Firmware::new(model)));
        let pty = Pty::open(firmware.clone(), Arc::new(SystemClock)).unwrap();
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK;
        let mut client = File::from(rustix::fs::open(pty.path(), flags, Mode::empty()).unwrap());

        // Each reply has nine bytes: together they are more than a terminal holds.
        let temperature = hex::decode("544341B0D0").unwrap();
        while firmware.lock().unwrap().requests < 20_000 {
            let _ = client.write_all(&temperature);
            std::thread::yield_now();
        }
        drop(pty);
    }
}

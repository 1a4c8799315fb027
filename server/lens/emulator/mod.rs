//! An emulated Optotune Lens Driver 4 behind a pseudo-terminal: for tests, and for trying the real driver
//! without a bench (`parfocal lens emulate`).
//!
//! It shares no code with the driver's codec, not even the checksum: it was written from the protocol's
//! description alone, so that one misreading cannot hide in both. Serial numbers begin with `EMUL`; they
//! tell the driver that no glass moves, which every page then says.

mod firmware;
mod pty;
mod unit;
mod wire;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

pub use firmware::Order;
pub use unit::{Fault, Glitch, LENS_DIOPTRES, Model};

use super::Response;
use crate::clock::{Clock, Moment};
use firmware::Firmware;
use pty::Pty;

/// An emulated driver with its lens. Gone when dropped.
pub struct Emulator {
    firmware: Arc<Mutex<Firmware>>,
    clock: Arc<dyn Clock>,
    folder: tempfile::TempDir,
    link: PathBuf,
    pty: Option<Pty>,
}

impl Emulator {
    /// Plugs a new unit in.
    ///
    /// # Errors
    /// When the system has no pseudo-terminal left, or no room for temporary files.
    pub fn start(model: Model, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix("parfocal-lens-").tempdir()?;
        let serial = String::from_utf8_lossy(&model.serial).into_owned();
        let link = folder.path().join(format!("usb-Optotune_LD_Optotune_LD_{serial}-if00"));
        let firmware = Arc::new(Mutex::new(Firmware::new(model)));

        let mut emulator = Self { firmware, clock, folder, link, pty: None };
        emulator.plug_in()?;

        Ok(emulator)
    }

    /// Name of the serial port; stays the same over unplugging, as a name in `/dev/serial/by-id` does.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.link
    }

    /// The folder that stands for `/dev/serial/by-id`.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Pulls the USB cable.
    pub fn unplug(&mut self) {
        self.pty = None;
        let _ = std::fs::remove_file(&self.link);
    }

    /// Plugs the USB cable in, which also restarts the unit.
    ///
    /// # Errors
    /// When the system has no pseudo-terminal left.
    pub fn plug_in(&mut self) -> io::Result<()> {
        self.unplug();
        self.restart();

        let pty = Pty::open(self.firmware.clone(), self.clock.clone())?;
        std::os::unix::fs::symlink(pty.path(), &self.link)?;
        self.pty = Some(pty);
        Ok(())
    }

    /// Restarts the unit without an interruption of its USB connection.
    pub fn restart(&self) {
        let now = self.clock.now();
        self.firmware().power_cycle(now);
    }

    /// Sets `fault`, from the next request on.
    pub fn set_fault(&self, fault: Fault) {
        self.firmware().fault = fault;
    }

    /// Schedules `glitch` for `replies` replies, after `spared` good ones; both come after all replies
    /// for which glitches are already scheduled.
    pub fn glitch(&self, glitch: Glitch, spared: usize, replies: usize) {
        let befalls = std::iter::repeat_n(None, spared).chain(std::iter::repeat_n(Some(glitch), replies));
        self.firmware().glitches.extend(befalls);
    }

    /// Sets the time the unit takes to answer a request, from the next one on.
    pub fn set_latency(&self, latency: Duration) {
        self.firmware().model.latency = latency;
    }

    /// Heats or cools the lens.
    pub fn set_temperature(&self, celsius: f64) {
        self.firmware().temperature = celsius;
    }

    /// Plugs the lens into the driver, or unplugs it.
    pub fn set_lens_present(&self, present: bool) {
        self.firmware().lens_present = present;
    }

    /// Focal power commands carried out so far, in the driver's units, each with the moment it was read
    /// from the wire.
    #[must_use]
    pub fn commands(&self) -> Vec<(Moment, i16)> {
        self.firmware().commands.iter().copied().collect()
    }

    /// Every order that the unit received so far, carried out or not.
    #[must_use]
    pub fn orders(&self) -> Vec<Order> {
        self.firmware().orders.iter().copied().collect()
    }

    /// Whole requests that have arrived so far; the reply to the latest may still be on its way.
    #[must_use]
    pub fn requests(&self) -> u64 {
        self.firmware().requests
    }

    /// Mode of control, by the driver's number, and the current in counts.
    #[must_use]
    pub fn mode_and_current(&self) -> (u8, i16) {
        self.firmware().mode_and_current()
    }

    /// The glass; 0..=1 stands for the whole range of the lens.
    #[must_use]
    pub fn glass(&self) -> Arc<Response> {
        self.firmware().glass()
    }

    fn firmware(&self) -> MutexGuard<'_, Firmware> {
        self.firmware.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

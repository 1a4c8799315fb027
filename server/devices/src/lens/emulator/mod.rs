//! An emulated Optotune Lens Driver 4 behind a pseudo-terminal, for tests and for trying the driver without a bench
//! (`parfocal lens emulate`).
//!
//! It shares no code with the driver's codec, not even the checksum. It was written only from the protocol's
//! description, so that the same misreading cannot be in both. Its serial numbers begin with `EMUL`. By them the driver
//! knows that there is no real lens, and every page then says so.

mod firmware;
mod pty;
mod unit;
mod wire;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

pub use firmware::LensCommand;
pub use unit::{Fault, Glitch, LENS_DIOPTRES, Model};

use super::Response;
use firmware::Firmware;
use parfocal_base::clock::{Clock, Moment};
use pty::Pty;

/// An emulated driver with its lens. Its port vanishes when it is dropped.
pub struct Emulator {
    firmware: Arc<Mutex<Firmware>>,
    clock: Arc<dyn Clock>,
    folder: tempfile::TempDir,
    link: PathBuf,
    pty: Option<Pty>,
}

impl Emulator {
    /// Starts a new unit and plugs it in.
    ///
    /// # Errors
    /// If the system has no pseudo-terminal left, or no room for temporary files.
    pub fn start(model: Model, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix("parfocal-lens-").tempdir()?;
        let serial = String::from_utf8_lossy(&model.serial).into_owned();
        let link = folder.path().join(format!("usb-Optotune_LD_Optotune_LD_{serial}-if00"));
        let firmware = Arc::new(Mutex::new(Firmware::new(model)));

        let mut emulator = Self { firmware, clock, folder, link, pty: None };
        emulator.plug_in()?;

        Ok(emulator)
    }

    /// Path of the serial port. Unplugging does not change it, like a name in `/dev/serial/by-id`.
    pub fn path(&self) -> &Path {
        &self.link
    }

    /// The folder that replaces `/dev/serial/by-id`.
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
    /// If the system has no pseudo-terminal left.
    pub fn plug_in(&mut self) -> io::Result<()> {
        self.unplug();
        self.restart();

        let pty = Pty::open(self.firmware.clone(), self.clock.clone())?;
        std::os::unix::fs::symlink(pty.path(), &self.link)?;
        self.pty = Some(pty);
        Ok(())
    }

    /// Restarts the unit without interrupting its USB connection.
    pub fn restart(&self) {
        let now = self.clock.now();
        self.firmware().power_cycle(now);
    }

    /// Sets `fault`, from the next request on.
    pub fn set_fault(&self, fault: Fault) {
        self.firmware().fault = fault;
    }

    /// Schedules `glitch` for `replies` replies after `spared` good ones. Both follow the replies that are already
    /// scheduled.
    pub fn glitch(&self, glitch: Glitch, spared: usize, replies: usize) {
        let befalls = std::iter::repeat_n(None, spared).chain(std::iter::repeat_n(Some(glitch), replies));
        self.firmware().glitches.extend(befalls);
    }

    /// Sets the time that the unit takes to answer a request, from the next one on.
    pub fn set_latency(&self, latency: Duration) {
        self.firmware().model.latency = latency;
    }

    /// Sets the temperature of the lens.
    pub fn set_temperature(&self, celsius: f64) {
        self.firmware().temperature = celsius;
    }

    /// Plugs the lens into the driver, or unplugs it.
    pub fn set_lens_present(&self, present: bool) {
        self.firmware().lens_present = present;
    }

    /// Focal power commands carried out, in the driver's units, each with the time it was read from the wire. Only the
    /// latest few thousand are kept.
    pub fn commands(&self) -> Vec<(Moment, i16)> {
        self.firmware().commands.iter().copied().collect()
    }

    /// Orders that the unit received, carried out or not. Only the latest few thousand are kept.
    pub fn orders(&self) -> Vec<LensCommand> {
        self.firmware().orders.iter().copied().collect()
    }

    /// Number of whole requests that have arrived so far. The reply to the latest may not have been sent yet.
    pub fn requests(&self) -> u64 {
        self.firmware().requests
    }

    /// Mode of control, by the driver's number, and the current, in counts.
    pub fn mode_and_current(&self) -> (u8, i16) {
        self.firmware().mode_and_current()
    }

    /// The true focal power; 0..=1 is the whole range of the lens.
    pub fn glass(&self) -> Arc<Response> {
        self.firmware().glass()
    }

    fn firmware(&self) -> MutexGuard<'_, Firmware> {
        self.firmware.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

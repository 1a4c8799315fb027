//! The lens driver's serial port: finds it, opens it exclusively for this process, and explains errors in words.

use std::fs::{File, TryLockError};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr,
};

use crate::lens::LensError;
use parfocal_base::files::LockedFile;

/// Folder where Linux lists serial ports by the USB names of their devices.
pub const BY_ID: &str = "/dev/serial/by-id";
/// Prefix of the USB name of a Lens Driver 4. The serial number follows.
const USB_NAME: &str = "usb-Optotune_LD_";
const BAUD: u32 = 115_200;

/// An open port: 115200 baud, 8 bits, no parity, no flow control, non-blocking, and exclusive until dropped.
#[derive(Debug)]
pub struct Port(LockedFile);

impl Port {
    /// Opens the port at `path`.
    ///
    /// # Errors
    /// If the port does not exist, is in use, is not a serial port, or access is denied. The error says what to do.
    pub fn open(path: &Path) -> Result<Self, LensError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let fd = rustix::fs::open(path, flags, Mode::empty()).map_err(|error| open_error(path, error))?;

        // The lock keeps out parfocal processes of all users. Exclusive mode keeps out all programs except root's.
        let port = Self(LockedFile::of(File::from(fd)).map_err(|error| match error {
            TryLockError::WouldBlock => open_error(path, Errno::BUSY),
            TryLockError::Error(error) => gone(path, &error.to_string()),
        })?);

        port.configure().map_err(|error| open_error(path, error))?;
        Ok(port)
    }

    fn configure(&self) -> Result<(), Errno> {
        let mut settings = tcgetattr(&*self.0)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
        settings.control_modes -= ControlModes::CRTSCTS | ControlModes::CSTOPB;
        settings.set_speed(BAUD)?;

        ioctl_tiocexcl(&*self.0)?;
        tcsetattr(&*self.0, OptionalActions::Now, &settings)?;
        tcflush(&*self.0, QueueSelector::IOFlush)
    }

    /// The file to read, write and poll.
    pub fn file(&self) -> &File {
        &self.0
    }
}

impl Drop for Port {
    fn drop(&mut self) {
        // Without the flush, closing a port would wait half a minute for a device that accepts no bytes. Exclusive mode
        // would outlast this process if another one has the port open too.
        let _ = tcflush(&*self.0, QueueSelector::OFlush);
        let _ = ioctl_tiocnxcl(&*self.0);
    }
}

/// Where a lens driver is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// At this port.
    Port(PathBuf),
    /// At whatever port the one driver is that is plugged in.
    Any,
}

impl Address {
    /// The port at which the driver is now.
    ///
    /// # Errors
    /// If any port will do, and there is no driver, or more than one.
    pub fn path(&self) -> Result<PathBuf, LensError> {
        match self {
            Self::Port(path) => Ok(path.clone()),
            Self::Any => find(Path::new(BY_ID)),
        }
    }
}

/// The one lens driver listed in `folder` (usually [`BY_ID`]).
///
/// # Errors
/// If there is none, or more than one.
pub fn find(folder: &Path) -> Result<PathBuf, LensError> {
    let mut found = drivers(folder);
    match (found.pop(), found.as_slice()) {
        (Some(only), []) => Ok(only),
        (Some(last), more) => Err(LensError::BadSpec(format!(
            "there is more than one lens driver: name one of {}, {}",
            last.display(),
            more.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
        ))),
        (None, _) => Err(LensError::Gone(
            "no Optotune driver is plugged in: check its USB cable, or name its port, as in optotune:/dev/ttyACM0"
                .into(),
        )),
    }
}

fn drivers(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<_> =
        entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(USB_NAME)).map(|e| e.path()).collect();

    found.sort_unstable();
    found
}

fn gone(path: &Path, why: &str) -> LensError {
    LensError::Gone(format!("{}: {why}", path.display()))
}

fn open_error(path: &Path, error: Errno) -> LensError {
    let why = match error {
        Errno::NOENT | Errno::NODEV | Errno::NXIO => {
            let others: Vec<_> = drivers(Path::new(BY_ID)).iter().map(|path| path.display().to_string()).collect();
            match others.as_slice() {
                [] => "there is no such device: is the driver plugged in?".into(),
                _ => format!("there is no such device; there is {}", others.join(", ")),
            }
        }
        Errno::ACCESS | Errno::PERM => format!(
            "permission denied: add yourself to its group with 'sudo usermod -aG {} $USER', then log in again",
            group_of(path)
        ),
        Errno::BUSY => "another program uses it: close that program first".into(),
        Errno::NOTTY | Errno::INVAL | Errno::ISDIR => "this is not a serial port".into(),
        other => std::io::Error::from(other).to_string(),
    };

    gone(path, &why)
}

/// Name of the group of the device at `path`; `dialout` if unknown, as for serial ports on Debian.
fn group_of(path: &Path) -> String {
    let named = || {
        let id = std::fs::metadata(path).ok()?.gid().to_string();
        let groups = std::fs::read_to_string("/etc/group").ok()?;
        let line = groups.lines().find(|line| line.split(':').nth(2) == Some(&id))?;
        line.split(':').next().map(str::to_owned)
    };
    named().unwrap_or_else(|| "dialout".into())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parfocal_base::clock::SystemClock;

    use super::*;
    use crate::lens::emulator::{Emulator, Model};

    #[test]
    fn a_port_is_free_at_once_though_a_program_that_is_just_starting_still_has_it() {
        let emulator = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
        let port = Port::open(emulator.path()).unwrap();
        assert!(Port::open(emulator.path()).unwrap_err().to_string().contains("another program uses it"));
        // Between fork and exec a child shares the open file, as this copy does.
        let shared = port.file().try_clone().unwrap();
        drop(port);
        Port::open(emulator.path()).unwrap();
        drop(shared);
    }

    #[test]
    fn finds_the_one_driver_by_its_usb_name() {
        let folder = tempfile::tempdir().unwrap();
        let create = |name: &str| File::create(folder.path().join(name)).map(drop).unwrap();
        create("usb-FTDI_Serial_A1-if00");
        assert!(find(folder.path()).unwrap_err().to_string().contains("no Optotune driver is plugged in"));
        create("usb-Optotune_LD_Optotune_LD_0042-if00");
        assert!(find(folder.path()).unwrap().ends_with("usb-Optotune_LD_Optotune_LD_0042-if00"));
        create("usb-Optotune_LD_Optotune_LD_0043-if00");
        assert!(find(folder.path()).unwrap_err().to_string().contains("0042-if00"));
    }

    #[test]
    fn what_cannot_be_opened_says_why() {
        let message = |path: &str| Port::open(Path::new(path)).unwrap_err().to_string();
        assert!(message("/dev/nothing-here").contains("/dev/nothing-here: there is no such device"));
        assert!(message("/dev/null").contains("not a serial port"));
        assert!(message("/dev").contains("not a serial port"));
        assert!(open_error(Path::new("/dev/null"), Errno::ACCESS).to_string().contains("usermod -aG root"));
    }
}

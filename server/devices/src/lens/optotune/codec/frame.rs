//! The frame around every reply's payload, and error replies.

use crc::{CRC_16_ARC, Crc, Table};

pub(super) const CHECKSUM: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_ARC);

/// Reply of old firmware, which has no error codes, to a damaged request.
const OLD_CRC_ERROR: &[u8] = b"N\r\n";
/// Bytes of checksum and line end after a reply's payload.
pub(super) const TRAILER: usize = 4;
/// Bytes of an error reply: `E`, its number, trailer.
const ERROR_LENGTH: usize = 2 + TRAILER;

/// Why bytes are not a valid reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The checksum is wrong.
    #[error("a reply's checksum is wrong")]
    Checksum,
    /// The bytes do not have the form of a reply to this request.
    #[error("a reply is unreadable")]
    Garbage,
    /// The driver answered with an error.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// An error that the driver itself reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// Error 1, or `N` from old firmware: wrong checksum.
    #[error("the driver received a damaged command")]
    Checksum,
    /// Error 2: command not in the firmware.
    #[error("the driver's firmware does not have this command: update it")]
    NotInFirmware,
    /// Error 3: unknown command.
    #[error("the driver does not know this command")]
    Unknown,
    /// Error 4: incompatible lens.
    #[error("the lens is not compatible with the driver: plug in a compatible one")]
    LensIncompatible,
    /// Any other error number.
    #[error("the driver reports error {0}")]
    Other(u8),
}

/// The error reply at the start of `bytes`, if there is one. Firmware sends the error's number as a digit or as a byte.
pub fn error_reply(bytes: &[u8]) -> Option<DeviceError> {
    if bytes.starts_with(OLD_CRC_ERROR) {
        return Some(DeviceError::Checksum);
    }

    let &[b'E', number] = checked(bytes.get(..ERROR_LENGTH)?)? else { return None };
    Some(match number.checked_sub(b'0').unwrap_or(number) {
        1 => DeviceError::Checksum,
        2 => DeviceError::NotInFirmware,
        3 => DeviceError::Unknown,
        4 => DeviceError::LensIncompatible,
        other => DeviceError::Other(other),
    })
}

/// The payload of a whole reply; `None` if line end or checksum are wrong.
pub(super) fn checked(reply: &[u8]) -> Option<&[u8]> {
    let (payload, checksum) = reply.strip_suffix(b"\r\n")?.split_last_chunk::<2>()?;
    (CHECKSUM.checksum(payload) == u16::from_le_bytes(*checksum)).then_some(payload)
}

//! The wire format of the Optotune Lens Driver 4/4i: requests, replies, checksums. Does no input or output.
//!
//! A request is a payload and its CRC-16/ARC, low byte first. A reply is the same followed by `\r\n`. The length of a
//! reply follows from its request, because `\r\n` can also occur inside a reply. Integers are big-endian. Formats:
//! Optotune, *Lens Driver 4 manual*.

mod frame;

use frame::{CHECKSUM, TRAILER, checked};
pub use frame::{DeviceError, WireError, error_reply};

/// The greeting. It has no checksum.
pub const START: &[u8] = b"Start";
/// Answer to [`START`].
pub const READY: &[u8] = b"Ready\r\n";

/// A request to the driver. Temperatures in 1/16 °C, focal power in the driver's own units (see
/// [`super::range::Scale`]).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Letter of the firmware's type.
    FirmwareType,
    /// Version of the firmware.
    FirmwareVersion,
    /// Serial number of the lens.
    Serial,
    /// The largest current.
    MaxCurrent,
    /// Go to a current, in counts of `mA * 4095 / largest current`. Gets no reply.
    SetCurrent(i16),
    /// The current, in counts.
    Current,
    /// Control by current.
    CurrentMode,
    /// Control by focal power. Needs temperature limits.
    FocalPowerMode,
    /// The mode of control.
    Mode,
    /// Sets the temperatures between which focal power must be held. They determine the range of focal power.
    TemperatureLimits {
        /// Upper limit.
        high: i16,
        /// Lower limit.
        low: i16,
    },
    /// Go to a focal power. Gets no reply.
    SetFocalPower(i16),
    /// The focal power set.
    FocalPower,
    /// Temperature of the lens.
    Temperature,
    /// Status bits.
    Status,
}

/// A reply of the driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reply {
    /// Letter of the firmware's type, `A` to `F`.
    FirmwareType(u8),
    /// Firmware's version: major, minor, build, revision.
    FirmwareVersion(u8, u8, u16, u16),
    /// Serial number, usually ASCII.
    Serial([u8; 8]),
    /// The largest current, in 1/100 mA.
    MaxCurrent(u16),
    /// The current, in counts.
    Current(i16),
    /// The driver controls current from now on.
    CurrentMode,
    /// The driver controls focal power from now on.
    FocalPowerMode(Limits),
    /// Mode of control: 1 current, 2 sine, 3 triangle, 4 square, 5 focal power, 6 analog, 7 position.
    Mode(u8),
    /// The temperature limits are set.
    TemperatureLimits(Limits),
    /// The focal power set, in the driver's own units.
    FocalPower(i16),
    /// Temperature of the lens, in 1/16 °C.
    Temperature(i16),
    /// Status bits; see [`super::status::Status`].
    Status(u32),
}

/// The range of focal power that the lens can hold between the temperature limits, in the driver's own units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The eight status bits.
    pub status: u8,
    /// Greatest focal power.
    pub max: i16,
    /// Least focal power.
    pub min: i16,
}

/// The beginning of a reply's payload, and the payload's length in bytes.
type ReplyForm = (&'static [u8], usize);

impl Request {
    /// The bytes that go over the wire.
    pub fn encode(self) -> Vec<u8> {
        let mut bytes = self.payload();
        let checksum = CHECKSUM.checksum(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    fn payload(self) -> Vec<u8> {
        let (name, used, _) = self.form();
        let values = match self {
            Self::SetCurrent(value) | Self::SetFocalPower(value) => [value, 0],
            Self::TemperatureLimits { high, low } => [high, low],
            _ => [0, 0],
        };
        name.iter().copied().chain(values.into_iter().flat_map(i16::to_be_bytes).take(used)).collect()
    }

    /// The request's name, the number of bytes after it, and the form of the reply; `None` for a request without a reply.
    const fn form(self) -> (&'static [u8], usize, Option<ReplyForm>) {
        match self {
            Self::FirmwareType => (b"H", 0, Some((b"H", 2))),
            Self::FirmwareVersion => (b"V", 1, Some((b"V", 7))),
            Self::Serial => (b"X", 0, Some((b"X", 9))),
            Self::MaxCurrent => (b"CrMA", 2, Some((b"CMA", 5))),
            Self::SetCurrent(_) => (b"Aw", 2, None),
            Self::Current => (b"Ar", 2, Some((b"A", 3))),
            Self::CurrentMode => (b"MwDA", 0, Some((b"MDA", 3))),
            Self::FocalPowerMode => (b"MwCA", 0, Some((b"M", 8))),
            Self::Mode => (b"MMA", 0, Some((b"MMA", 4))),
            Self::TemperatureLimits { .. } => (b"PwTA", 4, Some((b"", 7))),
            Self::SetFocalPower(_) => (b"PwDA", 4, None),
            Self::FocalPower => (b"PrDA", 4, Some((b"", 4))),
            Self::Temperature => (b"TCA", 0, Some((b"TCA", 5))),
            Self::Status => (b"Sr", 0, Some((b"S", 5))),
        }
    }

    /// Parses the reply to this request at the start of `bytes`; `None` while bytes are missing.
    ///
    /// # Errors
    /// If the driver reports an error, or the bytes are not such a reply.
    pub fn reply(self, bytes: &[u8]) -> Result<Option<Reply>, WireError> {
        let (_, _, Some((name, length))) = self.form() else { return Err(WireError::Garbage) };

        let whole = bytes.get(..length + TRAILER);
        let values = whole.and_then(checked).and_then(|payload| payload.strip_prefix(name));

        if let Some(reply) = values.and_then(|values| self.decode(values)) {
            return Ok(Some(reply));
        }

        if let Some(error) = error_reply(bytes) {
            return Err(error.into());
        }

        // A reply with the right name and length but a wrong checksum was damaged on the line.
        match whole {
            None => Ok(None),
            Some(whole) if whole.starts_with(name) && whole.ends_with(b"\r\n") && checked(whole).is_none() => {
                Err(WireError::Checksum)
            }
            Some(_) => Err(WireError::Garbage),
        }
    }

    /// Decodes the values after the name, in a reply of the right length.
    fn decode(self, values: &[u8]) -> Option<Reply> {
        let word = |at: usize| values.get(at..at + 2)?.try_into().ok().map(u16::from_be_bytes);
        let signed = |at: usize| word(at).map(u16::cast_signed);
        let limits = |at: usize| Some(Limits { status: *values.get(at)?, max: signed(at + 1)?, min: signed(at + 3)? });

        match self {
            Self::SetCurrent(_) | Self::SetFocalPower(_) => None,
            Self::FirmwareType => values.first().copied().map(Reply::FirmwareType),
            Self::FirmwareVersion => {
                Some(Reply::FirmwareVersion(*values.first()?, *values.get(1)?, word(2)?, word(4)?))
            }
            Self::Serial => values.try_into().ok().map(Reply::Serial),
            Self::MaxCurrent => word(0).map(Reply::MaxCurrent),
            Self::Current => signed(0).map(Reply::Current),
            Self::CurrentMode => Some(Reply::CurrentMode),
            Self::FocalPowerMode => limits(2).map(Reply::FocalPowerMode),
            Self::Mode => values.first().copied().map(Reply::Mode),
            Self::TemperatureLimits { .. } => limits(2).map(Reply::TemperatureLimits),
            Self::FocalPower => signed(2).map(Reply::FocalPower),
            Self::Temperature => signed(0).map(Reply::Temperature),
            Self::Status => values.try_into().ok().map(u32::from_be_bytes).map(Reply::Status),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The checksum, computed bit by bit from its definition: reflected polynomial 0xA001, start 0.
    fn bitwise(bytes: &[u8]) -> u16 {
        bytes.iter().fold(0, |crc, &byte| {
            (0..8).fold(crc ^ u16::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 })
        })
    }

    fn framed(payload: &[u8]) -> Vec<u8> {
        [payload, &bitwise(payload).to_le_bytes(), b"\r\n"].concat()
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        assert_eq!(CHECKSUM.checksum(b"123456789"), 0xBB3D);
    }

    #[test]
    fn requests_are_the_published_bytes() {
        let vectors: [(Request, &str); 14] = [
            (Request::Temperature, "544341B0D0"),
            (Request::CurrentMode, "4D7744415446"),
            (Request::FocalPowerMode, "4D7743415676"),
            (Request::Mode, "4D4D416577"),
            (Request::Current, "41720000B427"),
            (Request::Status, "5372BCD5"),
            (Request::FirmwareType, "480036"),
            (Request::Serial, "5801FA"),
            (Request::FirmwareVersion, "56003FA0"),
            (Request::MaxCurrent, "43724D4100007180"),
            (Request::SetCurrent(0), "41770000A426"),
            (Request::TemperatureLimits { high: 40 * 16, low: 20 * 16 }, "5077544102800140 33D0"),
            (Request::SetFocalPower(3000), "507744410BB80000B371"),
            (Request::FocalPower, "50724441000000006470"),
        ];

        for (request, expected) in vectors {
            assert_eq!(hex::encode_upper(request.encode()), expected.replace(' ', ""), "{request:?}");
        }
    }

    #[test]
    fn published_replies_are_understood() {
        let bytes = |text| hex::decode(text).unwrap();
        let reply = |request: Request, text| request.reply(&bytes(text));

        assert_eq!(reply(Request::Temperature, "544341019874660D0A"), Ok(Some(Reply::Temperature(408))));
        assert_eq!(reply(Request::MaxCurrent, "434D41726427FC0D0A"), Ok(Some(Reply::MaxCurrent(29_284))));
        assert_eq!(reply(Request::Mode, "4D4D410577280D0A"), Ok(Some(Reply::Mode(5))));

        for error in ["4531F3440D0A", "4501F3500D0A", "4E0D0A"] {
            assert_eq!(reply(Request::Status, error), Err(WireError::Device(DeviceError::Checksum)), "{error}");
            // Also for a request whose reply is no longer than the error reply.
            assert_eq!(reply(Request::FirmwareType, error), Err(WireError::Device(DeviceError::Checksum)), "{error}");
        }
    }

    #[test]
    fn every_reply_is_taken_apart() {
        let reply = |request: Request, payload: &[u8]| request.reply(&framed(payload)).unwrap().unwrap();
        let limits = Limits { status: 1, max: 3000, min: -2 };
        assert_eq!(reply(Request::FirmwareType, b"HA"), Reply::FirmwareType(b'A'));
        assert_eq!(reply(Request::FirmwareVersion, b"V\x01\x02\x01\x00\x00\x07"), Reply::FirmwareVersion(1, 2, 256, 7));
        assert_eq!(reply(Request::Serial, b"XAREA0042"), Reply::Serial(*b"AREA0042"));
        assert_eq!(reply(Request::Current, b"A\xFF\xFE"), Reply::Current(-2));
        assert_eq!(reply(Request::CurrentMode, b"MDA"), Reply::CurrentMode);
        assert_eq!(reply(Request::FocalPowerMode, b"MCA\x01\x0B\xB8\xFF\xFE"), Reply::FocalPowerMode(limits));
        let temperatures = Request::TemperatureLimits { high: 1, low: 0 };
        assert_eq!(reply(temperatures, b"??\x01\x0B\xB8\xFF\xFE"), Reply::TemperatureLimits(limits));
        assert_eq!(reply(Request::FocalPower, b"??\r\n"), Reply::FocalPower(0x0D0A));
        assert_eq!(reply(Request::Status, b"S\0\0\x01\x80"), Reply::Status(0x180));
    }

    proptest! {
        #[test]
        fn a_reply_is_complete_only_with_its_last_byte(celsius: i16, cut in 0_usize..9) {
            let bytes = framed(&[&b"TCA"[..], &celsius.to_be_bytes()].concat());
            prop_assert_eq!(Request::Temperature.reply(&bytes), Ok(Some(Reply::Temperature(celsius))));
            prop_assert_eq!(Request::Temperature.reply(&bytes[..cut]), Ok(None));
        }

        #[test]
        fn one_flipped_bit_is_always_noticed(status: u32, bit in 0_usize..72) {
            let mut bytes = framed(&[&b"S"[..], &status.to_be_bytes()].concat());
            bytes[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(Request::Status.reply(&bytes).is_err());
        }

        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            for request in [Request::Serial, Request::FocalPower, Request::FocalPowerMode, Request::FirmwareVersion] {
                let _ = request.reply(&bytes);
            }
        }
    }
}

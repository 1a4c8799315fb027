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

/// What is sent to the driver: a name and up to two numbers.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    name: &'static [u8],
    values: [i16; 2],
    /// How many bytes of `values` are sent.
    used: usize,
}

impl Order {
    /// The bytes that go over the wire.
    pub fn encode(self) -> Vec<u8> {
        let values = self.values.into_iter().flat_map(i16::to_be_bytes).take(self.used);
        let mut bytes: Vec<u8> = self.name.iter().copied().chain(values).collect();

        let checksum = CHECKSUM.checksum(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }
}

/// Go to a current, in counts of `mA * 4095 / largest current`. Gets no reply.
pub const fn set_current(counts: i16) -> Order {
    Order { name: b"Aw", values: [counts, 0], used: 2 }
}

/// Go to a focal power, in the driver's own units (see [`super::range::Scale`]). Gets no reply.
pub const fn set_focal_power(raw: i16) -> Order {
    Order { name: b"PwDA", values: [raw, 0], used: 4 }
}

/// A request to the driver, which it answers with a `T`.
#[derive(Debug, Clone, Copy)]
pub struct Request<T> {
    /// What is sent.
    pub order: Order,
    /// The beginning of the reply's payload.
    name: &'static [u8],
    /// Bytes of the reply's payload.
    length: usize,
    /// Decodes what follows the name in a payload of that length.
    decode: fn(&[u8]) -> Option<T>,
}

/// Letter of the firmware's type, `A` to `F`.
pub const FIRMWARE_TYPE: Request<u8> = asking(b"H", 0, b"H", 2, byte);
/// Firmware's version: major, minor, build, revision.
pub const FIRMWARE_VERSION: Request<(u8, u8, u16, u16)> = asking(b"V", 1, b"V", 7, version);
/// Serial number of the lens, usually ASCII.
pub const SERIAL: Request<[u8; 8]> = asking(b"X", 0, b"X", 9, |values| values.try_into().ok());
/// The largest current, in 1/100 mA.
pub const MAX_CURRENT: Request<u16> = asking(b"CrMA", 2, b"CMA", 5, |values| word(values, 0));
/// The current, in counts.
pub const CURRENT: Request<i16> = asking(b"Ar", 2, b"A", 3, |values| signed(values, 0));
/// Control by current from now on.
pub const CURRENT_MODE: Request<()> = asking(b"MwDA", 0, b"MDA", 3, |_| Some(()));
/// Control by focal power from now on. Needs temperature limits.
pub const FOCAL_POWER_MODE: Request<Limits> = asking(b"MwCA", 0, b"M", 8, limits);
/// Mode of control: 1 current, 2 sine, 3 triangle, 4 square, 5 focal power, 6 analog, 7 position.
pub const MODE: Request<u8> = asking(b"MMA", 0, b"MMA", 4, byte);
/// The focal power set, in the driver's own units.
pub const FOCAL_POWER: Request<i16> = asking(b"PrDA", 4, b"", 4, |values| signed(values, 2));
/// Temperature of the lens, in 1/16 °C.
pub const TEMPERATURE: Request<i16> = asking(b"TCA", 0, b"TCA", 5, |values| signed(values, 0));
/// Status bits; see [`super::status::Status`].
pub const STATUS: Request<u32> = asking(b"Sr", 0, b"S", 5, |values| values.try_into().ok().map(u32::from_be_bytes));

/// Sets the temperatures between which focal power must be held, in 1/16 °C. They determine the range of focal power.
pub const fn temperature_limits(high: i16, low: i16) -> Request<Limits> {
    let order = Order { name: b"PwTA", values: [high, low], used: 4 };
    Request { order, name: b"", length: 7, decode: limits }
}

/// The request `sent`, followed by `zeros`, whose reply begins with `name` and has a payload of `length` bytes.
const fn asking<T>(
    sent: &'static [u8],
    zeros: usize,
    name: &'static [u8],
    length: usize,
    decode: fn(&[u8]) -> Option<T>,
) -> Request<T> {
    Request { order: Order { name: sent, values: [0, 0], used: zeros }, name, length, decode }
}

fn byte(values: &[u8]) -> Option<u8> {
    values.first().copied()
}

fn word(values: &[u8], at: usize) -> Option<u16> {
    values.get(at..at + 2)?.try_into().ok().map(u16::from_be_bytes)
}

fn signed(values: &[u8], at: usize) -> Option<i16> {
    word(values, at).map(u16::cast_signed)
}

fn version(values: &[u8]) -> Option<(u8, u8, u16, u16)> {
    Some((*values.first()?, *values.get(1)?, word(values, 2)?, word(values, 4)?))
}

fn limits(values: &[u8]) -> Option<Limits> {
    Some(Limits { status: *values.get(2)?, max: signed(values, 3)?, min: signed(values, 5)? })
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

impl<T> Request<T> {
    /// Parses the reply to this request at the start of `bytes`; `None` while bytes are missing.
    ///
    /// # Errors
    /// If the driver reports an error, or the bytes are not such a reply.
    pub fn reply(self, bytes: &[u8]) -> Result<Option<T>, WireError> {
        let name = self.name;
        let whole = bytes.get(..self.length + TRAILER);
        let values = whole.and_then(checked).and_then(|payload| payload.strip_prefix(name));

        if let Some(reply) = values.and_then(self.decode) {
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
        let vectors: [(Order, &str); 14] = [
            (TEMPERATURE.order, "544341B0D0"),
            (CURRENT_MODE.order, "4D7744415446"),
            (FOCAL_POWER_MODE.order, "4D7743415676"),
            (MODE.order, "4D4D416577"),
            (CURRENT.order, "41720000B427"),
            (STATUS.order, "5372BCD5"),
            (FIRMWARE_TYPE.order, "480036"),
            (SERIAL.order, "5801FA"),
            (FIRMWARE_VERSION.order, "56003FA0"),
            (MAX_CURRENT.order, "43724D4100007180"),
            (set_current(0), "41770000A426"),
            (temperature_limits(40 * 16, 20 * 16).order, "5077544102800140 33D0"),
            (set_focal_power(3000), "507744410BB80000B371"),
            (FOCAL_POWER.order, "50724441000000006470"),
        ];

        for (order, expected) in vectors {
            assert_eq!(hex::encode_upper(order.encode()), expected.replace(' ', ""), "{order:?}");
        }
    }

    #[test]
    fn published_replies_are_understood() {
        let bytes = |text| hex::decode(text).unwrap();

        assert_eq!(TEMPERATURE.reply(&bytes("544341019874660D0A")), Ok(Some(408)));
        assert_eq!(MAX_CURRENT.reply(&bytes("434D41726427FC0D0A")), Ok(Some(29_284)));
        assert_eq!(MODE.reply(&bytes("4D4D410577280D0A")), Ok(Some(5)));

        for error in ["4531F3440D0A", "4501F3500D0A", "4E0D0A"] {
            let damaged = WireError::Device(DeviceError::Checksum);
            assert_eq!(STATUS.reply(&bytes(error)), Err(damaged), "{error}");
            // Also for a request whose reply is no longer than the error reply.
            assert_eq!(FIRMWARE_TYPE.reply(&bytes(error)), Err(damaged), "{error}");
        }
    }

    #[test]
    fn every_reply_is_taken_apart() {
        fn reply<T>(request: Request<T>, payload: &[u8]) -> T {
            request.reply(&framed(payload)).unwrap().unwrap()
        }

        let limits = Limits { status: 1, max: 3000, min: -2 };
        assert_eq!(reply(FIRMWARE_TYPE, b"HA"), b'A');
        assert_eq!(reply(FIRMWARE_VERSION, b"V\x01\x02\x01\x00\x00\x07"), (1, 2, 256, 7));
        assert_eq!(reply(SERIAL, b"XAREA0042"), *b"AREA0042");
        assert_eq!(reply(CURRENT, b"A\xFF\xFE"), -2);
        reply(CURRENT_MODE, b"MDA");
        assert_eq!(reply(FOCAL_POWER_MODE, b"MCA\x01\x0B\xB8\xFF\xFE"), limits);
        assert_eq!(reply(temperature_limits(1, 0), b"??\x01\x0B\xB8\xFF\xFE"), limits);
        assert_eq!(reply(FOCAL_POWER, b"??\r\n"), 0x0D0A);
        assert_eq!(reply(STATUS, b"S\0\0\x01\x80"), 0x180);
    }

    proptest! {
        #[test]
        fn a_reply_is_complete_only_with_its_last_byte(celsius: i16, cut in 0_usize..9) {
            let bytes = framed(&[&b"TCA"[..], &celsius.to_be_bytes()].concat());
            prop_assert_eq!(TEMPERATURE.reply(&bytes), Ok(Some(celsius)));
            prop_assert_eq!(TEMPERATURE.reply(&bytes[..cut]), Ok(None));
        }

        #[test]
        fn one_flipped_bit_is_always_noticed(status: u32, bit in 0_usize..72) {
            let mut bytes = framed(&[&b"S"[..], &status.to_be_bytes()].concat());
            bytes[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(STATUS.reply(&bytes).is_err());
        }

        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            let _ = SERIAL.reply(&bytes);
            let _ = FOCAL_POWER.reply(&bytes);
            let _ = FOCAL_POWER_MODE.reply(&bytes);
            let _ = FIRMWARE_VERSION.reply(&bytes);
        }
    }
}

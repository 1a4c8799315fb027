//! The protocol as the emulated unit implements it, independent of the real driver's codec.

/// All requests except the greeting: name, and number of bytes between name and checksum.
pub const REQUESTS: [(&[u8], usize); 17] = [
    (b"H", 0),
    (b"V", 1),
    (b"X", 0),
    (b"CrMA", 2),
    (b"Aw", 2),
    (b"Ar", 2),
    (b"MwDA", 0),
    (b"MwCA", 0),
    (b"MMA", 0),
    (b"PwTA", 4),
    (b"PwDA", 4),
    (b"PwUA", 4),
    (b"PwLA", 4),
    (b"PwFA", 4),
    (b"PrDA", 4),
    (b"TCA", 0),
    (b"Sr", 0),
];

/// `payload` with its checksum and line end.
pub fn framed(payload: &[u8]) -> Vec<u8> {
    [payload, &checksum_of(payload), b"\r\n"].concat()
}

/// CRC-16/ARC bit by bit, low byte first.
pub fn checksum_of(payload: &[u8]) -> [u8; 2] {
    let mut crc = 0_u16;
    for &byte in payload {
        crc ^= u16::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 };
        }
    }

    crc.to_le_bytes()
}

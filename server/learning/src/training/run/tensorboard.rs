//! TensorBoard event files: scalars only. Each record consists of its length, a masked CRC-32C of the length, an
//! `Event` protocol buffer, and a masked CRC-32C of the event (`tensorflow/core/lib/io/record_writer.h`).

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;

use crc::{CRC_32_ISCSI, Crc};

use parfocal_base::clock::Clock;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// An open event file.
#[derive(Debug)]
pub struct EventFile {
    file: File,
}

impl EventFile {
    /// Creates an event file in `folder`. Its name contains the time and `step`, the update at which the curves start.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn create(folder: &Path, clock: &dyn Clock, step: u64) -> io::Result<Self> {
        let now = clock.wall();
        let mut file = File::create(folder.join(format!("events.out.tfevents.{}.{step}", now.as_second())))?;
        let mut event = seconds(clock);
        put_bytes(&mut event, 3, b"brain.Event:2");
        file.write_all(&record(&event))?;
        Ok(Self { file })
    }

    /// Adds the value of curve `tag` at `step`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn scalar(&mut self, clock: &dyn Clock, step: u64, tag: &str, value: f32) -> io::Result<()> {
        let mut entry = Vec::new();
        put_bytes(&mut entry, 1, tag.as_bytes());
        entry.push(2 << 3 | 5);
        entry.extend(value.to_le_bytes());

        let mut summary = Vec::new();
        put_bytes(&mut summary, 1, &entry);

        let mut event = seconds(clock);
        event.push(2 << 3);
        put_varint(&mut event, step);
        put_bytes(&mut event, 5, &summary);
        self.file.write_all(&record(&event))
    }
}

/// The beginning of an event: field 1, the wall clock in seconds.
fn seconds(clock: &dyn Clock) -> Vec<u8> {
    let mut event = vec![1 << 3 | 1];
    event.extend((clock.wall().as_millisecond() as f64 / 1000.0).to_le_bytes());
    event
}

fn put_bytes(message: &mut Vec<u8>, field: u8, bytes: &[u8]) {
    message.push(field << 3 | 2);
    put_varint(message, bytes.len() as u64);
    message.extend_from_slice(bytes);
}

fn put_varint(message: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        message.push(value as u8 | 0x80);
        value >>= 7;
    }
    message.push(value as u8);
}

fn record(event: &[u8]) -> Vec<u8> {
    let length = (event.len() as u64).to_le_bytes();
    let mut record = length.to_vec();
    record.extend(masked(&length).to_le_bytes());
    record.extend_from_slice(event);
    record.extend(masked(event).to_le_bytes());
    record
}

/// `TensorFlow`'s masked checksum: rotated and offset, because a CRC of data that contains its own CRC is weak.
fn masked(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_crc_32c() {
        // RFC 3720, B.4: 32 bytes of zeros.
        assert_eq!(CRC.checksum(&[0; 32]), 0x8a91_36aa);
    }

    #[test]
    fn numbers_are_varints() {
        let mut message = Vec::new();
        put_varint(&mut message, 300);
        assert_eq!(message, [0xac, 0x02]);
    }
}

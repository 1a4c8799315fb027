//! How long a packet of Opus lasts (RFC 6716, section 3.1).

/// Duration of `packet` in nanoseconds; `None` for an empty one.
pub fn nanoseconds(packet: &[u8]) -> Option<u64> {
    let toc = *packet.first()?;
    let configuration = usize::from(toc >> 3);
    let microseconds = match configuration {
        // SILK, hybrid, and CELT.
        0..12 => [10_000, 20_000, 40_000, 60_000][configuration % 4],
        12..16 => [10_000, 20_000][configuration % 2],
        _ => [2_500, 5_000, 10_000, 20_000][configuration % 4],
    };
    let frames = match toc & 3 {
        0 => 1,
        1 | 2 => 2,
        _ => u64::from(packet.get(1)? & 0x3f),
    };
    Some(microseconds * frames * 1000)
}

#[cfg(test)]
mod tests {
    use super::nanoseconds;

    #[test]
    fn packets_last_as_their_first_byte_says() {
        // Examples of RFC 6716, table 2: configurations 1, 15, 16 and 31 with one frame, two, and three.
        assert_eq!(nanoseconds(&[1 << 3]), Some(20_000_000));
        assert_eq!(nanoseconds(&[(15 << 3) | 1]), Some(40_000_000));
        assert_eq!(nanoseconds(&[16 << 3]), Some(2_500_000));
        assert_eq!(nanoseconds(&[(31 << 3) | 3, 3]), Some(60_000_000));
        assert_eq!(nanoseconds(&[]), None);
    }
}

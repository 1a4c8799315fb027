//! The camera's frame numbers: gaps in them are frames lost.

/// GigE Vision counts frames from 1 to this number, and then again from 1.
const LAST_NUMBER: u64 = 65_535;

/// Frames from the camera's number `seen` to `now`; 1 if its counting was interrupted.
pub const fn steps(seen: Option<u64>, now: u64) -> u64 {
    match seen {
        Some(seen) if now > seen => now - seen,
        // The number rolled over, unless that would be an absurd gap.
        Some(seen) if seen <= LAST_NUMBER && now + LAST_NUMBER - seen < 1000 => now + LAST_NUMBER - seen,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cameras_numbers_roll_over_and_leave_gaps() {
        assert_eq!(steps(None, 17), 1);
        assert_eq!(steps(Some(17), 18), 1);
        assert_eq!(steps(Some(17), 20), 3);
        assert_eq!(steps(Some(65_535), 1), 1);
        assert_eq!(steps(Some(65_534), 2), 3);
        assert_eq!(steps(Some(5000), 1), 1, "the camera restarted");
        assert_eq!(steps(Some(1 << 40), 3), 1);
    }
}

//! How much recordings and exports may write: they leave a reserve, so that the trial's own data always has room.

use std::path::Path;

/// The reserve of a large disk, bytes.
const RESERVE: u64 = 1 << 30;
/// The reserve of a small disk is one part in this many of its size.
const PART: u64 = 20;

/// The space on a disk, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// What this program may still write.
    pub available: u64,
    /// What recordings and exports leave free: 1 GiB, or a twentieth of a disk smaller than 20 GiB.
    pub reserve: u64,
}

impl Room {
    /// Bytes that recordings and exports may still take.
    pub const fn spare(self) -> u64 {
        self.available.saturating_sub(self.reserve)
    }
}

/// The room on the disk that holds `path`, or its nearest folder above that exists.
///
/// # Errors
/// If the system does not report it.
pub fn room(path: &Path) -> std::io::Result<Room> {
    let there = path.ancestors().find(|folder| folder.exists()).unwrap_or(Path::new("."));
    let volume = rustix::fs::statvfs(there)?;

    let total = volume.f_blocks.saturating_mul(volume.f_frsize);
    Ok(Room { available: volume.f_bavail.saturating_mul(volume.f_frsize), reserve: RESERVE.min(total / PART) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reserve_is_left() {
        assert_eq!(Room { available: 5000, reserve: 1000 }.spare(), 4000);
        assert_eq!(Room { available: 500, reserve: 1000 }.spare(), 0);
    }
}

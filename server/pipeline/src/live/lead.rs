//! Leading viewers: a recording of the view keeps pictures of the size that they get.

use tokio::sync::watch;

use parfocal_imaging::Size;

/// Number of leading viewers, by the size of their pictures.
pub(super) type Leaders = [u32; Size::ALL.len()];

/// Counts one viewer as leading, until dropped.
#[derive(Debug)]
#[must_use]
pub(super) struct Lead {
    size: Size,
    leaders: watch::Sender<Leaders>,
}

impl Lead {
    /// Counts one more leading viewer of `size`.
    pub(super) fn new(size: Size, leaders: watch::Sender<Leaders>) -> Self {
        leaders.send_modify(|leaders| leaders[size as usize] += 1);
        Self { size, leaders }
    }
}

impl Drop for Lead {
    fn drop(&mut self) {
        self.leaders.send_modify(|leaders| leaders[self.size as usize] -= 1);
    }
}

/// The largest size that any leading viewer gets; the smallest if none leads.
pub(super) fn leading(leaders: &Leaders) -> Size {
    let largest = Size::ALL.into_iter().rev().find(|size| leaders[*size as usize] > 0);
    largest.unwrap_or(Size::Cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_size_leads_until_its_last_viewer_leaves() {
        let leaders = watch::Sender::new(Leaders::default());
        let size = || leading(&leaders.borrow());
        assert_eq!(size(), Size::Cell, "nobody leads");

        let half = Lead::new(Size::Half, leaders.clone());
        let full = Lead::new(Size::Full, leaders.clone());
        let other = Lead::new(Size::Full, leaders.clone());
        assert_eq!(size(), Size::Full);

        drop(full);
        assert_eq!(size(), Size::Full, "another viewer still gets it");
        drop(other);
        assert_eq!(size(), Size::Half);
        drop(half);
        assert_eq!(size(), Size::Cell);
    }
}

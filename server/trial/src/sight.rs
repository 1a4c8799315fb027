//! What the surgeon saw of each setting: the size of the pictures, and how many a second. Both depend on the link and the
//! tablet alone, and may explain what was said of a setting.

use std::collections::BTreeMap;

use crate::event::{EventKind, Seen, per_second};
use parfocal_base::ids::SegmentId;

/// What was seen in a segment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SegmentSight {
    /// Width of the smallest picture, pixels.
    pub least_width: u32,
    /// Sum of width times duration, in pixels and milliseconds.
    width_ms: u64,
    pictures: u64,
    over_ms: u64,
}

impl SegmentSight {
    /// Width of the pictures on average over the time, pixels.
    pub fn mean_width(&self) -> f64 {
        if self.over_ms == 0 { f64::from(self.least_width) } else { self.width_ms as f64 / self.over_ms as f64 }
    }

    /// Pictures a second; 0 for no time.
    pub fn per_second(&self) -> f64 {
        per_second(self.pictures, self.over_ms)
    }

    fn add(&mut self, Seen { size, pictures, over_ms, .. }: Seen) {
        let is_first = self.least_width == 0;
        self.least_width = if is_first { size.width } else { self.least_width.min(size.width) };
        self.width_ms = self.width_ms.saturating_add(u64::from(size.width).saturating_mul(over_ms));
        self.pictures = self.pictures.saturating_add(pictures);
        self.over_ms = self.over_ms.saturating_add(over_ms);
    }
}

/// What was seen of each segment, from a session's events. A segment of which no tablet drew a picture is not listed.
pub fn sights_by_segment<'e>(events: impl IntoIterator<Item = &'e EventKind>) -> BTreeMap<SegmentId, SegmentSight> {
    let mut sights: BTreeMap<SegmentId, SegmentSight> = BTreeMap::new();
    for seen in events.into_iter().filter_map(EventKind::seen) {
        sights.entry(seen.segment).or_default().add(seen);
    }
    sights
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tablet::PictureSize;

    #[test]
    fn a_setting_has_its_smallest_picture_and_means_over_its_time() {
        let segment = SegmentId(uuid::Uuid::nil());
        let seen = |width, pictures, over_ms| {
            let size = PictureSize { width, height: width / 2 };
            EventKind::PicturesSeen(Seen { segment, size, pictures, over_ms })
        };
        let events = [seen(2048, 90, 3000), EventKind::Resumed, seen(512, 10, 1000)];
        let sights = sights_by_segment(&events);
        let sight = sights[&segment];
        assert_eq!(sight.least_width, 512);
        // (3 * 2048 + 512) / 4, and 100 pictures in 4 s.
        assert!((sight.mean_width() - 1664.0).abs() < 1e-9);
        assert!((sight.per_second() - 25.0).abs() < 1e-9);
        assert_eq!(sights_by_segment(&[EventKind::Started]).len(), 0);
    }
}

//! The size of a viewer's pictures: the size that its screen can show, if its link is fast enough for it.
//!
//! The link is judged only by the time from sending a picture to its acknowledgement by the page, less the network's
//! round trip, which a small picture takes as well. That time covers the link and the browser but none of the server's
//! own work, so the size tells nothing about a policy.

use std::time::Duration;

use parfocal_base::clock::Moment;
use parfocal_imaging::Size;

/// A size is kept while its pictures are drawn within this time beyond the round trip, on average. A viewer then gets
/// at least ten a second.
const LIMIT: Duration = Duration::from_millis(100);

/// How many times longer a picture may take than one of the next smaller size: its JPEG has about this many
/// times the bytes.
const GROWTH: u32 = 3;

/// Weight of a new picture's time in the average: a single late one is forgiven.
const WEIGHT: f64 = 0.25;

/// Initial value of the average at a new size. With it, a first picture that takes over 250 ms is too late.
const UNKNOWN: Duration = Duration::from_millis(50);

/// Pictures drawn at a size before a larger one is tried.
const ENOUGH: u32 = 5;

/// How long a size is kept before we try a larger one that failed before or is not expected to be fast enough. We try
/// it because a distant server delays every picture, regardless of its size. Doubles with each failure.
const FIRST_WAIT: Duration = Duration::from_secs(10);
const LONGEST_WAIT: Duration = Duration::from_mins(10);

/// A larger size whose next picture does not come within this time is given up.
pub(super) const PATIENCE: Duration = Duration::from_secs(2);

/// A larger size is wanted if more screen pixels than this show one pixel of the picture; in quarters, so 5 means 1.25.
const STRETCH: u64 = 5;

/// What is known of one viewer's screen and link.
#[derive(Debug)]
pub(super) struct Link {
    /// The largest size of the camera's pictures.
    largest: Size,
    /// The size that the screen can show.
    wanted: Size,
    /// The largest size for which the link has been fast enough so far.
    carried: Size,
    /// Weighted average of the time from sending a picture to its acknowledgement, less the round trip, at the current
    /// size.
    mean: Duration,
    /// Pictures drawn at the current size.
    drawn: u32,
    /// When `carried` last changed.
    since: Moment,
    /// Whether a larger size has failed.
    failed: bool,
    wait: Duration,
}

impl Link {
    /// The link of a viewer about which nothing is known yet: it gets the smallest size.
    pub(super) const fn new(largest: Size, now: Moment) -> Self {
        Self {
            largest,
            wanted: Size::Cell,
            carried: Size::Cell,
            mean: UNKNOWN,
            drawn: 0,
            since: now,
            failed: false,
            wait: FIRST_WAIT,
        }
    }

    /// The size to send.
    pub(super) fn size(&self) -> Size {
        self.carried.min(self.wanted)
    }

    /// Whether the link is fast enough for the size that the screen can show.
    pub(super) fn carries_all(&self) -> bool {
        self.carried >= self.wanted && self.mean <= LIMIT
    }

    /// Whether the pictures are smaller than the screen can show, because the link is too slow for larger ones.
    pub(super) fn is_reduced(&self) -> bool {
        self.carried < self.wanted
    }

    /// Notes that the whole picture, `cells` wide, covers `width` pixels of the screen, as the page says. The number
    /// need not be trusted: one that is too large gets at most the largest size, and only if the page's own link is
    /// fast enough.
    pub(super) fn screen(&mut self, width: u32, cells: usize) {
        let pixels = |size: Size| (size.per_cell() * cells) as u64;
        let enough = |size: &Size| 4 * u64::from(width) <= STRETCH * pixels(*size);

        let size = Size::ALL.into_iter().find(enough).unwrap_or(Size::Full);
        self.change(|link| link.wanted = size.min(link.largest));
    }

    /// Notes that a picture was drawn; it took `took` longer than the network's round trip.
    pub(super) fn drawn(&mut self, now: Moment, took: Duration) {
        self.mean = self.mean.mul_f64(1.0 - WEIGHT) + took.mul_f64(WEIGHT);
        self.drawn = self.drawn.saturating_add(1);

        if self.mean > LIMIT {
            self.fall(now);
        } else if self.carried < self.wanted && self.drawn >= ENOUGH {
            let expected = !self.failed && self.mean * GROWTH <= LIMIT;
            if expected || now.since(self.since) >= self.wait {
                self.change(|link| link.carried = link.carried.larger());
                self.since = now;
            }
        } else if self.carried >= self.wanted && now.since(self.since) >= self.wait {
            // The link has carried this size for a long time, so earlier failures no longer count.
            self.failed = false;
            self.wait = FIRST_WAIT;
        }
    }

    /// Notes that no picture of the current size came in time.
    pub(super) fn missed(&mut self, now: Moment) {
        self.fall(now);
    }

    fn fall(&mut self, now: Moment) {
        let size = self.size();
        if size == Size::Cell {
            return;
        }

        if self.failed {
            self.wait = (2 * self.wait).min(LONGEST_WAIT);
        }
        self.failed = true;
        self.since = now;
        self.change(|link| link.carried = size.smaller());
    }

    /// Makes a change, and resets the average if it changes the size.
    fn change(&mut self, change: impl FnOnce(&mut Self)) {
        let before = self.size();
        change(self);
        if self.size() != before {
            self.mean = UNKNOWN;
            self.drawn = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Width of a cell picture, pixels.
    const CELLS: usize = 512;

    /// A viewer whose link takes `delay` ms for each picture, plus 1 ms for each `bytes_per_ms` bytes.
    struct Viewer {
        link: Link,
        now: Moment,
        delay: f64,
        bytes_per_ms: f64,
        /// Bytes of a picture of each size.
        bytes: [f64; 3],
        /// Times from sending to drawing, ms, in order.
        took: Vec<f64>,
    }

    impl Viewer {
        fn new(screen: u32, delay: f64, bytes_per_ms: f64) -> Self {
            let now = Moment::from_nanos(0);
            let mut link = Link::new(Size::Full, now);
            link.screen(screen, CELLS);
            Self { link, now, delay, bytes_per_ms, bytes: [20e3, 60e3, 180e3], took: Vec::new() }
        }

        /// Watches for `seconds`; returns the sizes in order, one entry per change.
        fn watch(&mut self, seconds: u64) -> Vec<Size> {
            let end = self.now + Duration::from_secs(seconds);
            let mut sizes = vec![self.link.size()];
            while self.now < end {
                let took = self.delay + self.bytes[self.link.size() as usize] / self.bytes_per_ms;
                self.took.push(took);
                // The next frame comes within 20 ms.
                self.now = self.now + Duration::from_secs_f64(took.max(20.0) / 1e3);
                self.link.drawn(self.now, Duration::from_secs_f64(took / 1e3));
                if sizes.last() != Some(&self.link.size()) {
                    sizes.push(self.link.size());
                }
            }
            sizes
        }
    }

    #[test]
    fn a_good_link_gets_what_the_screen_can_show_within_a_second() {
        let sizes = |screen| Viewer::new(screen, 3.0, 10_000.0).watch(1);
        assert_eq!(sizes(512), [Size::Cell]);
        assert_eq!(sizes(640), [Size::Cell]);
        assert_eq!(sizes(641), [Size::Cell, Size::Half]);
        assert_eq!(sizes(1280), [Size::Cell, Size::Half]);
        assert_eq!(sizes(1281), [Size::Cell, Size::Half, Size::Full]);
    }

    #[test]
    fn a_page_that_lies_about_its_screen_gets_no_more_than_the_largest_size() {
        let mut viewer = Viewer::new(u32::MAX, 3.0, 10_000.0);
        assert_eq!(viewer.watch(1).last(), Some(&Size::Full));
        viewer.link.screen(0, CELLS);
        assert_eq!(viewer.link.size(), Size::Cell);

        let mut link = Link::new(Size::Cell, Moment::from_nanos(0));
        link.screen(u32::MAX, CELLS);
        for second in 0..100 {
            link.drawn(Moment::from_nanos(second * 1_000_000_000), Duration::ZERO);
        }
        assert_eq!(link.size(), Size::Cell, "a colour camera's pictures have one size");
    }

    #[test]
    fn at_four_megabits_the_picture_stays_fresh() {
        // 40 ms for a picture of the cells, 120 at half size, 360 at full.
        let mut viewer = Viewer::new(2048, 2.0, 500.0);
        viewer.watch(600);
        let late = viewer.took.iter().filter(|took| **took > 100.0).count();
        assert!(viewer.took.iter().all(|took| *took < 150.0), "it never tries the full size");
        assert!(late * 200 < viewer.took.len(), "{late} of {}", viewer.took.len());
    }

    #[test]
    fn a_distant_server_is_not_taken_for_a_slow_link() {
        // 70 ms for every picture: the larger sizes are tried in time, and kept.
        let mut viewer = Viewer::new(2048, 70.0, 100_000.0);
        assert_eq!(viewer.watch(5), [Size::Cell]);
        assert_eq!(viewer.watch(60), [Size::Cell, Size::Half, Size::Full]);
    }

    #[test]
    fn a_link_that_gets_worse_steps_down_at_once_and_tries_again_with_growing_waits() {
        let mut viewer = Viewer::new(1024, 3.0, 10_000.0);
        assert_eq!(viewer.watch(60), [Size::Cell, Size::Half]);
        viewer.bytes_per_ms = 300.0;
        assert_eq!(viewer.watch(2), [Size::Half, Size::Cell]);

        // It tries after 10, 30, 70, 150, 310 and 630 seconds, each time for a moment.
        let changes = viewer.watch(900).len() - 1;
        assert_eq!(changes, 12);

        viewer.bytes_per_ms = 10_000.0;
        assert_eq!(viewer.watch(601), [Size::Cell, Size::Half]);
    }

    #[test]
    fn one_late_picture_changes_nothing() {
        let mut viewer = Viewer::new(1024, 3.0, 10_000.0);
        viewer.watch(2);
        viewer.link.drawn(viewer.now, Duration::from_millis(350));
        assert_eq!(viewer.link.size(), Size::Half);
        assert_eq!(viewer.watch(60), [Size::Half]);
    }

    #[test]
    fn a_size_that_does_not_come_is_given_up() {
        let mut viewer = Viewer::new(1024, 3.0, 10_000.0);
        viewer.watch(2);
        viewer.link.missed(viewer.now);
        assert_eq!(viewer.link.size(), Size::Cell);
    }

    #[test]
    fn zooming_out_and_in_again_needs_no_trial() {
        let mut viewer = Viewer::new(2048, 3.0, 10_000.0);
        viewer.watch(2);
        viewer.link.screen(500, CELLS);
        assert_eq!(viewer.watch(1), [Size::Cell]);
        viewer.link.screen(2048, CELLS);
        assert_eq!(viewer.watch(1), [Size::Full]);
    }
}

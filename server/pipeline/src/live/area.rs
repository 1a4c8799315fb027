//! Decides when a content area found in a picture is worth reporting to the loop. The patch should neither tremble
//! with the detection, nor jump because the circle was missed or misplaced in one picture.

use parfocal_imaging::ContentArea;

/// Pixels by which centre or radius must have moved. The detection's own error is about 6 px at
/// 1080x1920, so about a quarter of that at the size of one band.
const MOVED: f64 = 2.0;

/// A circle that differs by more than this many pixels counts only once the next one agrees: up to one detection in ten
/// may be wrong by more than 15 px at 1080x1920 (the method's authors allow for it), about 4 at the size of one band.
const JUMP: f64 = 4.0;

/// After this many detections in a row without a circle, there is no content area.
const MISSES: u32 = 10;

/// The area last reported to the loop, and what has been seen since.
#[derive(Debug, Default)]
pub struct AreaWatch {
    published: Option<ContentArea>,
    /// A circle far from the reported one, which the next detection may confirm.
    doubted: Option<ContentArea>,
    misses: u32,
}

impl AreaWatch {
    /// Takes in a detection; returns what to report to the loop, if anything.
    #[allow(clippy::option_option, reason = "that there is no area is news too")]
    pub fn see(&mut self, found: Option<ContentArea>) -> Option<Option<ContentArea>> {
        self.misses = if found.is_some() { 0 } else { self.misses + 1 };
        let doubted = self.doubted.take();

        let news = match (self.published, found) {
            (None, None) => false,
            (None, Some(_)) => true,
            (Some(_), None) => self.misses >= MISSES,
            (Some(published), Some(found)) if distance(&published, &found) <= JUMP => {
                distance(&published, &found) > MOVED
            }
            (Some(_), Some(found)) => {
                let confirmed = doubted.is_some_and(|doubted| distance(&doubted, &found) <= JUMP);
                self.doubted = (!confirmed).then_some(found);
                confirmed
            }
        };

        news.then(|| {
            self.published = found;
            found
        })
    }
}

fn distance(a: &ContentArea, b: &ContentArea) -> f64 {
    (a.x - b.x).hypot(a.y - b.y).max((a.radius - b.radius).abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[allow(clippy::unnecessary_wraps, reason = "as detections come")]
    fn area(x: f64, radius: f64) -> Option<ContentArea> {
        Some(ContentArea { x, y: 136.0, radius, confidence: 0.5 })
    }

    #[test]
    fn a_trembling_circle_is_reported_once_and_a_moved_one_again() {
        let mut watch = AreaWatch::default();
        assert_eq!(watch.see(area(256.0, 120.0)), Some(area(256.0, 120.0)));
        assert_eq!(watch.see(area(257.5, 119.0)), None);
        assert_eq!(watch.see(area(254.5, 121.5)), None);
        assert_eq!(watch.see(area(260.0, 120.0)), Some(area(260.0, 120.0)));
        assert_eq!(watch.see(area(260.0, 123.0)), Some(area(260.0, 123.0)));
    }

    #[test]
    fn one_wrong_circle_is_ignored_but_two_that_agree_are_not() {
        let mut watch = AreaWatch::default();
        watch.see(area(256.0, 120.0));
        assert_eq!(watch.see(area(290.0, 120.0)), None);
        assert_eq!(watch.see(area(256.0, 120.0)), None);
        assert_eq!(watch.see(area(290.0, 120.0)), None);
        assert_eq!(watch.see(area(200.0, 90.0)), None, "they do not agree");
        assert_eq!(watch.see(area(201.0, 90.0)), Some(area(201.0, 90.0)));
    }

    #[test]
    fn slow_drift_is_followed() {
        let mut watch = AreaWatch::default();
        let told = (0..100).filter(|step| watch.see(area(256.0 + f64::from(*step) / 10.0, 120.0)).is_some()).count();
        // 9.9 px in steps of just over 2 px: the first, then at 2.1, 4.2, 6.3 and 8.4.
        assert_eq!(told, 5);
    }

    #[test]
    fn one_dark_picture_is_ignored_but_ten_are_not() {
        let mut watch = AreaWatch::default();
        assert_eq!(watch.see(None), None);
        watch.see(area(256.0, 120.0));
        assert!((0..9).all(|_| watch.see(None).is_none()));
        assert_eq!(watch.see(area(256.0, 120.0)), None);
        assert!((0..9).all(|_| watch.see(None).is_none()));
        assert_eq!(watch.see(None), Some(None));
        assert_eq!(watch.see(None), None);
        assert_eq!(watch.see(area(256.0, 120.0)), Some(area(256.0, 120.0)));
    }
}

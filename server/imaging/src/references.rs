//! Averages dark and white reference exposures, and refuses those that cannot calibrate a sensor.

pub use super::bad_reference::BadReference;
use super::calibration::BANDS;
use super::content_area;
use super::frame::{CELL, FrameError, GrayImage, MosaicFrame};
use super::geometry::ContentArea;

/// Share of the pixels that may be defective: hot, dead or stuck.
const DEFECTS: f64 = 0.001;
/// Largest mean of a dark exposure, as a share of full scale; a hundredth is usual.
const DARK_MEAN: f64 = 0.1;
/// Least level of the brightest band of a white target, as a share of full scale: below it noise dominates.
const WHITE_LEVEL: f64 = 0.3;
/// Level of the brightest band, as a share of full scale, below which a picture counts as black.
const NOTHING: f64 = 0.05;
/// Least level above dark that every band must have on the white target, as a share of full scale.
const BAND_LEVEL: f64 = 0.02;
/// Share of a band's sorted counts at which its level is read: high, so that a shadow over part of
/// the picture does not lower it.
const LIT: f64 = 0.9;
/// Least ratio of the darkest to the brightest twentieth of a band over the content area. Optics
/// lose a third to the rim.
const EVENNESS: f64 = 0.4;
/// Largest change of the mean between frames: of the light, for white; of full scale, for dark.
const UNSTEADINESS: f64 = 0.02;
/// Part of the content area's radius that is checked: the rim is soft.
const INSIDE: f64 = 0.9;

/// A running sum of frames, to be averaged.
#[derive(Debug, Clone, Default)]
pub struct Average {
    size: (usize, usize),
    sums: Vec<u32>,
    /// Mean of each frame, counts.
    means: Vec<f64>,
    /// Samples at full scale, over all frames.
    saturated: usize,
    /// The largest count a sample can have.
    full_scale: u16,
}

impl Average {
    /// An empty average, for a sensor whose largest count is `full_scale`.
    pub fn new(full_scale: f32) -> Self {
        Self { full_scale: full_scale as u16, ..Self::default() }
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// If its size differs from that of the first frame.
    pub fn add(&mut self, frame: &MosaicFrame) -> Result<(), BadReference> {
        let found = (frame.width(), frame.height());
        if self.means.is_empty() {
            self.size = found;
            self.sums = vec![0; frame.samples().len()];
        }
        check_size(found, "the first frame", self.size)?;

        let mut total = 0_u64;
        for (sum, &sample) in self.sums.iter_mut().zip(frame.samples()) {
            *sum += u32::from(sample);
            total += u64::from(sample);
            self.saturated += usize::from(sample >= self.full_scale);
        }

        self.means.push(total as f64 / frame.samples().len() as f64);
        Ok(())
    }

    /// The mean as a dark reference.
    ///
    /// # Errors
    /// If the frames are unfit for one. The error says why, and what to do.
    pub fn dark(&self) -> Result<MosaicFrame, BadReference> {
        let mean = self.mean()?;
        let full = f64::from(self.full_scale);
        let level = self.level();
        if level > DARK_MEAN * full {
            return Err(BadReference::DarkTooBright(level / full));
        }

        // Twice the mean that is allowed: single hot pixels pass, a lit corner does not.
        let limit = (2.0 * DARK_MEAN * full) as u16;
        let lit = share(mean.samples().iter().filter(|&&sample| sample > limit).count(), self.sums.len());
        if lit > DEFECTS {
            return Err(BadReference::LightLeaks(lit));
        }

        self.check_steady(full)?;
        Ok(mean)
    }

    /// The mean as a white reference that goes with `dark`. Checks only the content area, if there is one.
    ///
    /// # Errors
    /// If the frames are unfit for one. The error says why, and what to do.
    pub fn white(&self, dark: &MosaicFrame) -> Result<MosaicFrame, BadReference> {
        let mean = self.mean()?;
        check_size(self.size, "the dark reference", (dark.width(), dark.height()))?;

        let saturated = share(self.saturated, self.means.len() * self.sums.len());
        if saturated > DEFECTS {
            return Err(BadReference::Saturated(saturated));
        }

        let full = f64::from(self.full_scale);
        let light = Light::new(&mean, dark);
        let bands: [Vec<f64>; BANDS] = std::array::from_fn(|band| light.band(band));
        check_levels(&bands, full)?;
        check_even(&bands)?;

        let all: usize = bands.iter().map(Vec::len).sum();
        let blind = bands.iter().flatten().filter(|&&counts| counts < 1.0).count();
        if share(blind, all) > DEFECTS {
            return Err(BadReference::NotAboveDark(share(blind, all)));
        }

        let dark_level = dark.samples().iter().map(|&sample| f64::from(sample)).sum::<f64>() / self.sums.len() as f64;
        self.check_steady((self.level() - dark_level).max(1.0))?;
        Ok(mean)
    }

    fn mean(&self) -> Result<MosaicFrame, BadReference> {
        let frames = self.means.len() as u32;
        if frames == 0 {
            return Err(BadReference::Nothing);
        }

        let samples = self.sums.iter().map(|sum| ((sum + frames / 2) / frames) as u16).collect();
        let (width, height) = self.size;
        MosaicFrame::new(width, height, samples).map_err(|_: FrameError| BadReference::Nothing)
    }

    /// Mean of all samples of all frames, counts.
    fn level(&self) -> f64 {
        self.means.iter().sum::<f64>() / self.means.len().max(1) as f64
    }

    fn check_steady(&self, of: f64) -> Result<(), BadReference> {
        let least = self.means.iter().copied().fold(f64::INFINITY, f64::min);
        let most = self.means.iter().copied().fold(0.0, f64::max);
        let change = (most - least) / of;
        if change > UNSTEADINESS { Err(BadReference::Unsteady(change)) } else { Ok(()) }
    }
}

fn check_size(found: (usize, usize), expected: &'static str, size: (usize, usize)) -> Result<(), BadReference> {
    if found == size { Ok(()) } else { Err(BadReference::Size { found, expected, size }) }
}

/// Checks that all `bands` (each with its counts sorted) are bright enough.
fn check_levels(bands: &[Vec<f64>; BANDS], full: f64) -> Result<(), BadReference> {
    let levels = bands.each_ref().map(|band| at(band, LIT) / full);
    let brightest = levels.iter().copied().fold(0.0, f64::max);
    if brightest < NOTHING {
        return Err(BadReference::Blind(brightest.max(0.0)));
    }

    if brightest < WHITE_LEVEL {
        return Err(BadReference::WhiteTooDark(brightest));
    }

    match levels.iter().position(|&level| level < BAND_LEVEL) {
        Some(band) => Err(BadReference::BandTooDark { band, level: levels[band].max(0.0) }),
        None => Ok(()),
    }
}

fn check_even(bands: &[Vec<f64>; BANDS]) -> Result<(), BadReference> {
    let evenness = bands.iter().map(|band| at(band, 0.05) / at(band, 0.95)).fold(1.0, f64::min);
    if evenness < EVENNESS { Err(BadReference::Uneven(evenness.max(0.0))) } else { Ok(()) }
}

/// The value below which `part` (0..=1) of the sorted `values` lie; 0 if there are no values.
fn at(values: &[f64], part: f64) -> f64 {
    values.get((part * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0)
}

fn share(part: usize, of: usize) -> f64 {
    part as f64 / of.max(1) as f64
}

/// The light of a white target above dark, and the area in which it is checked.
struct Light<'a> {
    white: &'a MosaicFrame,
    dark: &'a MosaicFrame,
    content: Option<ContentArea>,
}

impl<'a> Light<'a> {
    fn new(white: &'a MosaicFrame, dark: &'a MosaicFrame) -> Self {
        let mut light = Self { white, dark, content: None };
        light.content = content_area::detect(&light.gray());
        light
    }

    /// Counts of a sample above dark.
    fn counts(&self, index: usize) -> f64 {
        f64::from(self.white.samples()[index]) - f64::from(self.dark.samples()[index])
    }

    /// Index of sample `band` of cell (`x`, `y`).
    const fn place(&self, x: usize, y: usize, band: usize) -> usize {
        (CELL * y + band / CELL) * self.white.width() + CELL * x + band % CELL
    }

    /// Mean over the bands, scaled so that the brightest cell is 220.
    fn gray(&self) -> GrayImage {
        let (width, height) = (self.white.band_width(), self.white.band_height());
        let cell = |index: usize| {
            let (x, y) = (index % width, index / width);
            (0..BANDS).map(|band| self.counts(self.place(x, y, band))).sum::<f64>().max(0.0)
        };

        let cells: Vec<f64> = (0..width * height).map(cell).collect();
        let most = cells.iter().copied().fold(1.0, f64::max);
        GrayImage { width, height, data: cells.iter().map(|cell| (220.0 * cell / most) as f32).collect() }
    }

    /// Counts above dark of a band in the checked area, sorted.
    fn band(&self, band: usize) -> Vec<f64> {
        let inside = |x: usize, y: usize| {
            self.content.is_none_or(|area| (x as f64 - area.x).hypot(y as f64 - area.y) < INSIDE * area.radius)
        };

        let places = (0..self.white.band_height()).flat_map(|y| (0..self.white.band_width()).map(move |x| (x, y)));
        let mut counts: Vec<f64> =
            places.filter(|&(x, y)| inside(x, y)).map(|(x, y)| self.counts(self.place(x, y, band))).collect();

        counts.sort_unstable_by(f64::total_cmp);
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (512, 272);

    fn frame(count: impl Fn(usize, usize) -> u16) -> MosaicFrame {
        let samples = (0..SIZE.0 * SIZE.1).map(|i| count(i % SIZE.0, i / SIZE.0)).collect();
        MosaicFrame::new(SIZE.0, SIZE.1, samples).unwrap()
    }

    fn average(frames: &[MosaicFrame]) -> Average {
        let mut average = Average::new(1023.0);
        for frame in frames {
            average.add(frame).unwrap();
        }
        average
    }

    fn white(frames: &[MosaicFrame]) -> Result<MosaicFrame, BadReference> {
        average(frames).white(&frame(|_, _| 10))
    }

    /// Whether the sample lies in a lit circle of radius 240 samples.
    fn circle(x: usize, y: usize) -> bool {
        (x as f64 - 256.0).hypot(y as f64 - 136.0) < 240.0
    }

    #[test]
    fn frames_are_averaged() {
        let dark = average(&[frame(|x, _| 4 + (x % 2) as u16), frame(|_, _| 7)]).dark().unwrap();
        assert_eq!(dark.samples()[..4], [6, 6, 6, 6], "means of 4 and 7, 5 and 7, rounded up");
    }

    #[test]
    fn light_in_a_dark_exposure_is_refused() {
        assert_eq!(average(&[]).dark(), Err(BadReference::Nothing));
        assert_eq!(average(&[frame(|_, _| 400)]).dark(), Err(BadReference::DarkTooBright(400.0 / 1023.0)));

        // A corner of 51 x 27 of 512 x 272 samples.
        let leak = average(&[frame(|x, y| if x < 51 && y < 27 { 500 } else { 8 })]).dark().unwrap_err();
        assert_eq!(leak, BadReference::LightLeaks(51.0 * 27.0 / (512.0 * 272.0)));

        let flicker = average(&[frame(|_, _| 8), frame(|_, _| 60)]).dark().unwrap_err();
        assert_eq!(flicker, BadReference::Unsteady(52.0 / 1023.0));
    }

    #[test]
    fn a_bright_even_circle_is_a_white_reference() {
        assert!(
            white(&[frame(|x, y| if circle(x, y) { 800 } else { 10 })]).is_ok(),
            "black around it is as it should be"
        );
        assert!(white(&[frame(|_, _| 800)]).is_ok(), "a picture without a content area");
    }

    #[test]
    fn a_bad_white_reference_says_what_is_wrong() {
        let refused = |count: &dyn Fn(usize, usize) -> u16| white(&[frame(count)]).unwrap_err();
        assert_eq!(refused(&|x, _| if x % 4 == 0 { 1023 } else { 800 }), BadReference::Saturated(0.25));
        assert!(matches!(refused(&|_, _| 12), BadReference::Blind(_)));
        assert_eq!(refused(&|_, _| 214), BadReference::WhiteTooDark(204.0 / 1023.0));
        assert!(matches!(refused(&|x, _| 10 + (19 * x / 10) as u16), BadReference::Uneven(_)), "a slope");
        assert!(matches!(refused(&|x, _| if x < 256 { 800 } else { 10 }), BadReference::Uneven(_)), "a shadow");

        let band_9 = |x: usize, y: usize| if x % 4 == 1 && y % 4 == 2 { 11 } else { 800 };
        assert_eq!(refused(&band_9), BadReference::BandTooDark { band: 9, level: 1.0 / 1023.0 });

        let dead = |x: usize, y: usize| if x.is_multiple_of(128) && y.is_multiple_of(2) { 3 } else { 800 };
        assert_eq!(refused(&dead), BadReference::NotAboveDark(1.0 / 256.0));

        let flicker = white(&[frame(|_, _| 800), frame(|_, _| 760)]).unwrap_err();
        assert_eq!(flicker, BadReference::Unsteady(40.0 / 770.0));
    }

    #[test]
    fn sizes_must_agree() {
        let small = MosaicFrame::new(8, 8, vec![700; 64]).unwrap();
        assert!(average(&[frame(|_, _| 8)]).add(&small).is_err());
        let error = white(&[small]).unwrap_err().to_string();
        assert_eq!(error, "the picture is 8x8, but the dark reference was taken at 512x272");
    }
}

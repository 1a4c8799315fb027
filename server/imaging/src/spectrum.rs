//! The spectrum at a place: what each band shows in the mosaic cells within a circle, as mean and spread.

use super::calibration::{BANDS, Calibration};
use super::frame::{CELL, MosaicFrame};
use super::white_balance::WhiteBalance;

/// A circle in a mosaic, in samples from the top left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Centre, samples from the left.
    pub x: f64,
    /// Centre, samples from the top.
    pub y: f64,
    /// Radius, samples. A cell counts if its middle is within it; the cell that holds the centre always does.
    pub radius: f64,
}

/// Mean and spread of one band.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Level {
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation over cells and frames: the root of the mean squared distance from the mean.
    pub spread: f64,
}

/// A spectrum. Bands are in the order of the mosaic cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Number of cells within the circle.
    pub cells: usize,
    /// Number of frames.
    pub frames: usize,
    /// Samples at full scale, over all bands and frames. Their true counts are not known, so the spectrum is too low.
    pub saturated: usize,
    /// Counts above none, as the sensor gave them.
    pub counts: [Level; BANDS],
    /// Reflectance: 0 as dark as the dark reference, 1 as bright as the white one, after the spectral correction.
    /// None without a white reference.
    pub reflectance: Option<[Level; BANDS]>,
}

/// A place outside the picture, or a circle that is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct BadCircle(String);

/// Adds up the cells within a circle, frame by frame.
pub struct SpectrumSum<'a> {
    calibration: &'a Calibration,
    balance: WhiteBalance<'a>,
    width: usize,
    full_scale: u16,
    /// Column and row of each cell within the circle.
    cells: Vec<(usize, usize)>,
    frames: usize,
    saturated: usize,
    counts: [Sum; BANDS],
    reflectance: [Sum; BANDS],
}

/// A running mean and sum of squared distances from it, which loses no digits: Welford, Technometrics 1962,
/// doi 10.1080/00401706.1962.10490022.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    number: f64,
    mean: f64,
    squares: f64,
}

impl Sum {
    fn add(&mut self, value: f64) {
        self.number += 1.0;
        let before = value - self.mean;
        self.mean += before / self.number;
        self.squares += before * (value - self.mean);
    }

    fn level(self) -> Level {
        Level { mean: self.mean, spread: (self.squares / self.number.max(1.0)).sqrt() }
    }
}

impl<'a> SpectrumSum<'a> {
    /// An empty sum over `circle` in mosaics of `width` x `height` samples.
    ///
    /// # Errors
    /// If the circle's centre is outside them, or its radius is no length.
    pub fn new(
        calibration: &'a Calibration,
        circle: Circle,
        (width, height): (usize, usize),
    ) -> Result<Self, BadCircle> {
        let Circle { x, y, radius } = circle;
        if !((0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y)) {
            let problem = format!("the place {x},{y} is outside the picture of {width}x{height} samples");
            return Err(BadCircle(problem));
        }
        if !(radius.is_finite() && radius >= 0.0) {
            return Err(BadCircle(format!("a radius must be 0 or more samples, not {radius}")));
        }

        Ok(Self {
            calibration,
            balance: WhiteBalance::new(calibration, width),
            width,
            full_scale: calibration.full_scale() as u16,
            cells: cells(circle, width / CELL, height / CELL),
            frames: 0,
            saturated: 0,
            counts: [Sum::default(); BANDS],
            reflectance: [Sum::default(); BANDS],
        })
    }

    /// Adds a mosaic of the size that was given.
    pub fn add(&mut self, mosaic: &MosaicFrame) {
        self.frames += 1;
        for &(column, row) in &self.cells {
            let mut balanced = [0.0; BANDS];
            for (band, balanced) in balanced.iter_mut().enumerate() {
                let place = (CELL * row + band / CELL) * self.width + CELL * column + band % CELL;
                let count = mosaic.samples()[place];
                let (dark, span) = self.balance.at(place);

                self.saturated += usize::from(count >= self.full_scale);
                self.counts[band].add(f64::from(count));
                *balanced = f64::from((f32::from(count) - dark) / span);
            }

            for (sum, weights) in self.reflectance.iter_mut().zip(&self.calibration.correction) {
                let corrected = weights.iter().zip(balanced).map(|(&weight, value)| f64::from(weight) * value);
                sum.add(corrected.sum());
            }
        }
    }

    /// The spectrum of what was added.
    pub fn spectrum(&self) -> Spectrum {
        let has_white = self.calibration.has_white();
        Spectrum {
            cells: self.cells.len(),
            frames: self.frames,
            saturated: self.saturated,
            counts: self.counts.map(Sum::level),
            reflectance: has_white.then(|| self.reflectance.map(Sum::level)),
        }
    }
}

/// The cells within `circle` of a mosaic of `columns` x `rows` cells, row by row.
fn cells(circle: Circle, columns: usize, rows: usize) -> Vec<(usize, usize)> {
    let side = CELL as f64;
    let middle = |cell: usize| (cell as f64 + 0.5) * side;
    let (centre_column, centre_row) = ((circle.x / side) as usize, (circle.y / side) as usize);

    // A radius may be larger than any number of cells.
    let reach = ((circle.radius / side).ceil() as usize).saturating_add(1);
    let near = |centre: usize, cells: usize| centre.saturating_sub(reach)..centre.saturating_add(reach).min(cells);
    let within = |column: usize, row: usize| {
        let distance = (middle(column) - circle.x).hypot(middle(row) - circle.y);
        distance <= circle.radius || (column, row) == (centre_column, centre_row)
    };
    near(centre_row, rows)
        .flat_map(|row| near(centre_column, columns).map(move |column| (column, row)))
        .filter(|&(column, row)| within(column, row))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Reference;

    /// A mosaic of 16x12 samples; cell (column, row) has 100 * band + 10 * row + column in each band.
    fn mosaic() -> MosaicFrame {
        let sample = |index: usize| {
            let (x, y) = (index % 16, index / 16);
            (100 * (4 * (y % 4) + x % 4) + 10 * (y / 4) + x / 4) as u16
        };
        MosaicFrame::new(16, 12, (0..16 * 12).map(sample).collect()).unwrap()
    }

    fn of(calibration: &Calibration, circle: Circle) -> Spectrum {
        let mut sum = SpectrumSum::new(calibration, circle, (16, 12)).unwrap();
        sum.add(&mosaic());
        sum.spectrum()
    }

    #[test]
    fn a_radius_of_nothing_takes_the_cell_that_holds_the_place() {
        let spectrum = of(&Calibration::default(), Circle { x: 8.0, y: 7.9, radius: 0.0 });
        assert_eq!((spectrum.cells, spectrum.frames), (1, 1));
        assert_eq!(spectrum.counts[3], Level { mean: 312.0, spread: 0.0 });
        assert_eq!(spectrum.reflectance, None, "no white was measured");
    }

    #[test]
    fn mean_and_spread_are_over_the_cells_within_the_circle() {
        // The cell (1, 1) and its four neighbours, whose middles are 4 samples away: 11, 1, 21, 10 and 12.
        let spectrum = of(&Calibration::default(), Circle { x: 6.0, y: 6.0, radius: 4.0 });
        let Level { mean, spread } = spectrum.counts[0];
        assert_eq!(spectrum.cells, 5);
        assert!((mean - 11.0).abs() < 1e-9 && (spread - (202.0_f64 / 5.0).sqrt()).abs() < 1e-9, "{mean} {spread}");
    }

    #[test]
    fn a_circle_beyond_the_rim_takes_what_is_there() {
        for radius in [1e6, f64::MAX] {
            assert_eq!(of(&Calibration::default(), Circle { x: 15.9, y: 11.9, radius }).cells, 12, "{radius}");
        }
        let spectrum = of(&Calibration::default(), Circle { x: 0.0, y: 0.0, radius: 1e6 });
        assert_eq!(spectrum.cells, 12);
        assert_eq!(
            spectrum.saturated,
            5 * 12 + 1,
            "1,023 of 10 bit: in bands 11 to 15, and of band 10 in the last cell"
        );
    }

    #[test]
    fn reflectance_is_white_balanced_and_corrected() {
        let mut calibration = Calibration {
            dark: Reference::PerBand([10.0; BANDS]),
            white: Reference::PerBand([210.0; BANDS]),
            ..Calibration::default()
        };
        // Band 0 is made of bands 0 and 1, half of each.
        calibration.correction[0][0] = 0.5;
        calibration.correction[0][1] = 0.5;
        let spectrum = of(&calibration, Circle { x: 0.0, y: 0.0, radius: 0.0 });
        let reflectance = spectrum.reflectance.unwrap();
        assert!((reflectance[0].mean - (0.5 * -0.05 + 0.5 * 0.45)).abs() < 1e-6, "{reflectance:?}");
        assert!((reflectance[2].mean - 0.95).abs() < 1e-6);
    }

    #[test]
    fn places_outside_the_picture_are_refused() {
        let calibration = Calibration::default();
        for (x, y, radius) in [(16.0, 1.0, 1.0), (-0.1, 1.0, 1.0), (1.0, f64::NAN, 1.0), (1.0, 1.0, -1.0)] {
            assert!(SpectrumSum::new(&calibration, Circle { x, y, radius }, (16, 12)).is_err(), "{x} {y} {radius}");
        }
    }
}

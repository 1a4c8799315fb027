//! The brain phantom: a generated brain surface seen by a hand-held hyperspectral camera, for work
//! without a device.

mod cortex;
mod defocus;
mod field;
mod hand;
mod mosaic;
mod scene;
mod sensor;
pub mod spectra;
mod still;
mod tile;
mod vessels;
mod view;

pub use field::SIDE;
pub use hand::{Hand, Haste, Pose};
pub use scene::Scene;
pub use still::{Still, Trajectory};
pub use tile::Tile;

use defocus::Stack;
use field::Field;
use mosaic::Bands;
use parfocal_base::FocalPower;
use parfocal_imaging::{CELL, Calibration, ContentArea, PATCH_SIDE};
use sensor::{AutoExposure, Sensor};
use view::{Mapping, Optics, Region};

/// Width of the phantom's pictures in samples.
pub const SENSOR_WIDTH: usize = CELL * view::WIDTH;
/// Height of the phantom's pictures in samples.
pub const SENSOR_HEIGHT: usize = CELL * view::HEIGHT;

/// A phantom under its camera. Given the same seed and the same calls, it gives the same samples.
pub struct Phantom {
    stack: Stack,
    relief: Field,
    optics: Optics,
    bands: Bands,
    sensor: Sensor,
    exposure: AutoExposure,
}

impl Phantom {
    /// The phantom of a seed, under a sensor of the default calibration. Takes about a fifth of a second.
    pub fn new(seed: u64) -> Self {
        let scene = Scene::new(seed);
        Self {
            stack: Stack::new(scene.texels, SIDE),
            relief: scene.relief,
            optics: Optics::new(seed),
            bands: Bands::new(&Calibration::default()),
            sensor: Sensor::new(seed, SENSOR_WIDTH, SENSOR_HEIGHT),
            exposure: AutoExposure::new(),
        }
    }

    /// The content area's place and size, in pixels of one band.
    pub fn content_area(&self) -> ContentArea {
        self.optics.content_area()
    }

    /// Takes one exposure: [`SENSOR_WIDTH`] x [`SENSOR_HEIGHT`] 10-bit samples into `samples`, row by
    /// row.
    pub fn expose(&mut self, pose: &Pose, focal_power: FocalPower, samples: &mut [u16]) {
        let noise = self.sensor.fresh_noise();
        self.render((pose, focal_power), self.exposure.gain(), &noise, &Region::WHOLE, samples);
    }

    /// Renders the sensor's samples. `noise` says for each row where in the stored noise it starts. Computes light only
    /// within `region`, and leaves samples above and below it as they were.
    fn render(&self, seen: (&Pose, FocalPower), gain: f32, noise: &[u32], region: &Region, samples: &mut [u16]) {
        let mapping = Mapping::new(&self.optics, seen.0);
        let mut expected = vec![0.0; SENSOR_WIDTH];
        let mut lines = [(); 3].map(|()| view::blank_line());

        let look = |line: &mut _, y: usize| {
            let surface = (&self.stack, &self.relief);
            view::look(line, y, &self.optics, &mapping, surface, seen.1.get() as f32, &region.columns);
        };

        // Three lines are kept in turn: a sensor row mixes its cell row with the one above or below.
        let rows = region.rows.clone();
        if rows.start > 0 {
            look(&mut lines[(rows.start - 1) % 3], rows.start - 1);
        }
        look(&mut lines[rows.start % 3], rows.start);

        let rows_of_samples = samples.chunks_exact_mut(CELL * SENSOR_WIDTH).enumerate();
        for (y, samples) in rows_of_samples.take(rows.end).skip(rows.start) {
            let below = &mut lines[(y + 1) % 3];
            if y + 1 < view::HEIGHT {
                look(below, y + 1);
            } else {
                view::darken(below);
            }

            let lines = [(y + 2) % 3, y % 3, (y + 1) % 3].map(|line| &lines[line]);

            let columns = region.lit(self.optics.span(y));
            let expected = &mut expected[..CELL * columns.len()];

            for (row, out) in samples.chunks_exact_mut(SENSOR_WIDTH).enumerate() {
                self.bands.expose(expected, lines, row, (columns.start, columns.end), gain);
                self.sensor.read_row(out, CELL * y + row, CELL * columns.start, expected, noise[CELL * y + row]);
            }
        }
    }

    /// Adjusts the gain for the next exposure to the brightness of this one.
    pub fn adjust_exposure(&mut self, samples: &[u16]) {
        let rows = samples.chunks_exact(SENSOR_WIDTH).enumerate().skip(2).step_by(13);

        let lit = rows.flat_map(|(y, row)| {
            let lit = self.optics.span((y / CELL).min(view::HEIGHT - 1));
            row[CELL * lit.start..CELL * lit.end].iter().step_by(5).copied()
        });

        self.exposure.adjust(lit);
    }

    /// The focal power at which the patch in the middle of the content area is sharpest: the mean over
    /// the patch of each pixel's sharp focal power, weighted by the pixel's squared contrast.
    pub fn optimal(&self, pose: &Pose) -> FocalPower {
        let mapping = Mapping::new(&self.optics, pose);
        let area = self.content_area();
        let corner = [area.x, area.y].map(|centre| centre.round() as usize - PATCH_SIDE / 2);

        let mut sum = 0.0_f64;
        let mut weights = 1e-9;
        for index in 0..PATCH_SIDE * PATCH_SIDE {
            let x = (corner[0] + index % PATCH_SIDE) as f32;
            let y = (corner[1] + index / PATCH_SIDE) as f32;
            let gray = |x: f32, y: f32| {
                let (u, v) = mapping.place(x, y);
                let abundances = self.stack.at(u, v, 0.0);
                abundances.iter().zip(self.bands.gray()).map(|(abundance, weight)| abundance * weight).sum::<f32>()
            };

            let across = gray(x + 1.0, y) - gray(x - 1.0, y);
            let down = gray(x, y + 1.0) - gray(x, y - 1.0);
            let weight = f64::from(across * across + down * down) + 1e-6;

            let (u, v) = mapping.place(x, y);
            sum += weight * f64::from(mapping.sharp_at(x, y, view::height_at(&self.relief, u, v)));
            weights += weight;
        }

        FocalPower::nearest(sum / weights)
    }
}

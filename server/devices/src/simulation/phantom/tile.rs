//! What the phantom's camera sees instead of the brain while its dark and white references are taken.

use super::sensor::{self, Sensor};
use super::view::Optics;
use super::{SENSOR_HEIGHT, SENSOR_WIDTH};
use parfocal_imaging::CELL;

/// A white tile under even light, or the lens cap, in front of the phantom's camera. No brain is drawn for it.
pub struct Tile {
    optics: Optics,
    sensor: Sensor,
    level: f32,
}

impl Tile {
    /// The tile before the camera of a seed. The light brings the content area's centre to `level` of full scale; 0 is
    /// with the lens cap on.
    pub fn new(seed: u64, level: f32) -> Self {
        Self { optics: Optics::new(seed), sensor: Sensor::new(seed, SENSOR_WIDTH, SENSOR_HEIGHT), level }
    }

    /// Takes one exposure: [`SENSOR_WIDTH`] x [`SENSOR_HEIGHT`] 10-bit samples into `samples`, row by row.
    pub fn expose(&mut self, samples: &mut [u16]) {
        let noise = self.sensor.fresh_noise();

        for (y, row) in samples.chunks_exact_mut(SENSOR_WIDTH).enumerate().take(SENSOR_HEIGHT) {
            let columns = self.optics.span(y / CELL);
            let light = columns.clone().map(|x| self.level * sensor::FULL_SCALE * self.optics.light(x, y / CELL));
            let expected: Vec<f32> = light.flat_map(|counts| [counts; CELL]).collect();
            self.sensor.read_row(row, y, CELL * columns.start, &expected, noise[y]);
        }
    }
}

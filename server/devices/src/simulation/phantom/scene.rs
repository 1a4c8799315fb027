//! A brain's surface in a craniotomy, generated from a seed: the tissues at each texel, and the
//! relief.

use multiversion::multiversion;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::cortex::{Cortex, Folding};
use super::defocus::Texel;
use super::field::{Field, SIDE, Spline, UNIT};
use super::mosaic::Bands;
use super::spectra::{ARTERIAL, ENDMEMBERS, LAMP, PALE, VENOUS, endmembers_in_band};
use super::vessels::{Density, Vessels};
use parfocal_imaging::{Band, Calibration, GrayImage};

/// A brain's surface, sharp and without noise.
pub struct Scene {
    /// `SIDE * SIDE` texels, row by row.
    pub(super) texels: Vec<Texel>,
    /// Height towards the camera of every second texel in both directions, in texels.
    pub(super) relief: Field,
}

/// The traits in which brains differ.
#[derive(Debug, Clone, Copy)]
struct Character {
    folding: Folding,
    density: Density,
    blood: f32,
    saturation: f32,
    mottling: f32,
    wetness: f32,
    roughness: f32,
    lamp: [f32; 2],
}

impl Character {
    fn draw(rng: &mut impl Rng) -> Self {
        let mut between = |low: f32, high: f32| low + (high - low) * rng.random::<f32>();

        let folding = Folding { gyrus: between(62.0, 118.0), alignment: between(0.0, 0.55) };
        let density = Density {
            arteries: between(5.0, 11.0) as usize,
            veins: between(3.0, 7.0) as usize,
            fine: between(450.0, 1000.0) as usize,
        };

        let angle = between(0.0, std::f32::consts::TAU);
        let tilt = between(0.1, 0.3);

        Self {
            folding,
            density,
            blood: between(0.12, 0.34),
            saturation: between(0.55, 0.8),
            mottling: between(0.6, 1.5),
            wetness: between(0.4, 1.3),
            roughness: between(0.6, 1.3),
            lamp: [tilt * angle.cos(), tilt * angle.sin()],
        }
    }
}

impl Scene {
    /// The scene of a seed. The same seed gives the same scene; another seed gives another brain.
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let character = Character::draw(&mut rng);

        let mut cortex = Cortex::fold(SIDE, character.folding, &mut rng);
        let vessels = Vessels::grow(SIDE, character.density, &cortex.crown, &mut rng);

        // The relief that focus follows is taken before roughening: fine bumps only catch the light.
        let relief = Field::from_fn(SIDE / 2, |x, y| cortex.height.data[2 * y * SIDE + 2 * x]);
        roughen(&mut cortex.height, &vessels.bulge, 0.3 * character.roughness, &mut rng);
        Self { texels: paint(&cortex, &vessels, &character, &mut rng), relief }
    }

    /// The middle of the scene as the gray picture a perfect lens would give: `width` x `height` texels
    /// (at most [`SIDE`] each; more is cut), linear in light, on the 0..255 scale, exposed so that 1
    /// pixel in 50 is above 200.
    pub fn sharp_gray(&self, width: usize, height: usize) -> GrayImage {
        let weights = Bands::new(&Calibration::default()).gray();
        let mut picture = self.middle(width, height, |texel| mix(texel, weights));

        let scale = 200.0 / percentile_98(&picture.data).max(1e-6);
        picture.data.iter_mut().for_each(|value| *value = (*value * scale).min(255.0));
        picture
    }

    /// The middle of the scene as `band` sees it through a perfect lens, under the light that gives the
    /// scene's white 255: `width` x `height` texels (at most [`SIDE`] each; more is cut), linear in light.
    pub fn sharp_band(&self, band: &Band, width: usize, height: usize) -> GrayImage {
        let response = endmembers_in_band(band.centre_nm, band.fwhm_nm);
        let weights = response.map(|value| 255.0 * value as f32 / UNIT);
        self.middle(width, height, |texel| mix(texel, weights))
    }

    /// The middle of the scene, with `value` applied to each texel.
    fn middle(&self, width: usize, height: usize, value: impl Fn(Texel) -> f32) -> GrayImage {
        let width = width.min(SIDE);
        let height = height.min(SIDE);
        let left = (SIDE - width) / 2;
        let top = (SIDE - height) / 2;

        let rows = self.texels.chunks_exact(SIDE).skip(top).take(height);
        let data = rows.flat_map(|row| row[left..left + width].iter().map(|&texel| value(texel))).collect();
        GrayImage { width, height, data }
    }
}

/// Adds the vessels' bulge and some fine roughness to the surface.
fn roughen(surface: &mut Field, bulge: &Field, share: f32, rng: &mut impl Rng) {
    let roughness = Spline::noise(SIDE, 7, rng);
    let mut rough = vec![0.0; SIDE];

    for (y, row) in surface.data.chunks_exact_mut(SIDE).enumerate() {
        roughness.row_into(y, &mut rough);
        for ((height, bulge), rough) in row.iter_mut().zip(bulge.row(y)).zip(&rough) {
            *height += bulge + share * rough;
        }
    }
}

/// Paints the whole surface.
fn paint(cortex: &Cortex, vessels: &Vessels, character: &Character, rng: &mut impl Rng) -> Vec<Texel> {
    let noises = [90, 40, 17, 4].map(|cell| Spline::noise(SIDE, cell, rng));
    let mut lines = [(); 4].map(|()| vec![0.0; SIDE]);
    let mut texels = vec![Texel::default(); SIDE * SIDE];

    for (y, out) in texels.chunks_exact_mut(SIDE).enumerate() {
        for (noise, line) in noises.iter().zip(&mut lines) {
            noise.row_into(y, line);
        }

        let rows = Rows {
            surface: [y.saturating_sub(1), y, (y + 1).min(SIDE - 1)].map(|y| cortex.height.row(y)),
            open: cortex.open.row(y),
            rim: cortex.rim.row(y),
            crown: cortex.crown.row(y),
            arteries: vessels.arteries.row(y),
            veins: vessels.veins.row(y),
            noises: [&lines[0], &lines[1], &lines[2], &lines[3]],
        };

        paint_row(out, &rows, character);
    }

    texels
}

/// One row of everything that a texel's look depends on.
struct Rows<'a> {
    surface: [&'a [f32]; 3],
    open: &'a [f32],
    rim: &'a [f32],
    crown: &'a [f32],
    arteries: &'a [f32],
    veins: &'a [f32],
    /// From the widest to the finest.
    noises: [&'a [f32]; 4],
}

/// Paints a row: blood by place, light by slope, the mirrored lamp where the slope meets it.
#[multiversion(targets("x86_64+avx2+fma"))]
fn paint_row(out: &mut [Texel], rows: &Rows<'_>, character: &Character) {
    let side = out.len();
    let [above, here, below] = rows.surface.map(|row| &row[..side]);
    let open = &rows.open[..side];
    let rim = &rows.rim[..side];
    let crown = &rows.crown[..side];
    let arteries = &rows.arteries[..side];
    let veins = &rows.veins[..side];
    let [tint, patches, coarse, fine] = rows.noises.map(|row| &row[..side]);

    for x in 1..side - 1 {
        let slope = [0.5 * (here[x + 1] - here[x - 1]), 0.5 * (below[x] - above[x])];
        let steepness = slope[0] * slope[0] + slope[1] * slope[1];
        let light = open[x] * (0.35 + 0.65 / (1.0 + steepness).sqrt());

        let mottling = character.mottling * (0.05 * coarse[x] + 0.045 * fine[x] + 0.035 * patches[x]);
        let brain = (character.blood * (1.9 - 0.95 * crown[x]) + mottling).clamp(0.02, 0.9);
        let dura = (0.06 + 0.5 * mottling).clamp(0.0, 0.5);
        let blood = brain + rim[x] * (dura - brain);
        let saturation = (character.saturation + 0.05 * tint[x]).clamp(0.3, 0.97);
        let artery = arteries[x] * (1.0 - 0.7 * rim[x]);
        let vein = veins[x] * (1.0 - 0.7 * rim[x]);
        let tissue = (1.0 - artery) * (1.0 - vein);

        let toward = [slope[0] - character.lamp[0], slope[1] - character.lamp[1]];
        let miss = toward[0] * toward[0] + toward[1] * toward[1];
        let wet = character.wetness * (0.4 + 0.55 * patches[x]).clamp(0.0, 1.6) * (1.0 - 0.9 * rim[x]) * open[x];
        let sharp = 1.0 / (1.0 + 45.0 * miss);
        let sheen = 1.0 / (1.0 + 5.0 * miss);

        let mut texel = [0.0; ENDMEMBERS];
        // Light that bounces between the walls of a sulcus takes on the colour of blood.
        let direct = light * open[x];
        texel[PALE] = direct * tissue * (1.0 - blood);
        texel[ARTERIAL] =
            light * (tissue * blood * saturation + artery * (1.0 - vein)) + 0.7 * (light - direct) * tissue;
        texel[VENOUS] = light * (tissue * blood * (1.0 - saturation) + vein);
        texel[LAMP] = wet * (1.7 * sharp * sharp * sharp * sharp + 0.03 * sheen * sheen);

        out[x] = texel.map(|value| (value * UNIT) as i32 as u16);
    }

    out[0] = out[1];
    out[side - 1] = out[side - 2];
}

fn mix(texel: Texel, weights: [f32; ENDMEMBERS]) -> f32 {
    texel.iter().zip(weights).map(|(&abundance, weight)| f32::from(abundance) * weight).sum()
}

/// Value that 1 in 50 exceeds, from every 16th value.
fn percentile_98(values: &[f32]) -> f32 {
    let mut some: Vec<f32> = values.iter().step_by(16).copied().collect();
    if some.is_empty() {
        return 0.0;
    }
    let index = some.len() * 49 / 50;
    *some.select_nth_unstable_by(index, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_one_scene_and_another_seed_another() {
        let one = Scene::new(1);
        let same = Scene::new(1);
        let other = Scene::new(2);
        assert!(one.texels == same.texels);
        let one = one.sharp_gray(512, 272).data;
        let other = other.sharp_gray(512, 272).data;
        assert!(correlation(&one, &other).abs() < 0.3);
    }

    #[test]
    fn a_sharp_picture_uses_the_gray_scale() {
        let picture = Scene::new(3).sharp_gray(512, 272);
        assert_eq!((picture.width, picture.height, picture.data.len()), (512, 272, 512 * 272));
        let above = picture.data.iter().filter(|value| **value > 200.0).count() as f32 / picture.data.len() as f32;
        assert!((0.01..0.03).contains(&above), "{above}");
        assert!(picture.data.iter().all(|value| (0.0..=255.0).contains(value)));
    }

    fn correlation(a: &[f32], b: &[f32]) -> f32 {
        let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
        let mean_a = mean(a);
        let mean_b = mean(b);
        let covariance =
            |x: &[f32], mx, y: &[f32], my| -> f32 { x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum() };
        covariance(a, mean_a, b, mean_b) / (covariance(a, mean_a, a, mean_a) * covariance(b, mean_b, b, mean_b)).sqrt()
    }
}

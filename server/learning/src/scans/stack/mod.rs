//! A focal stack: pictures of one still scene in order of focus, read from a folder and checked.

pub mod check;
pub mod drift;
pub mod optics;
mod pages;
mod plane;
mod positions;
pub mod source;

use std::path::{Path, PathBuf};

use super::mosaics::{RawMosaics, mosaics_in};
use crate::LearningError;
use parfocal_base::notices::tell;
use parfocal_devices::camera::footage::{is_raw, pictures_in, sample_bits};
use parfocal_devices::camera::recorded::HEADER;
use parfocal_imaging::{DecodeError, GrayImage, Picture, PictureFile, PixelFormat, Reconstructor, in_blocks};

pub use plane::{LEAST_PLANES, Plane};
use positions::{file_name, listed, named};

/// Greatest number of positions, including gaps.
const MOST_POSITIONS: usize = 1001;
/// How far a position may be from its place on the regular grid, in steps.
const TOLERANCE: f64 = 0.25;

/// How many times the usual distance two pictures may be apart for planes between them to be interpolated.
const WIDEST: f64 = 2.5;
/// How far from a plane's place a picture may have been taken to be used as it is, in steps.
const NEAR: f64 = 0.05;

/// Pictures of one still scene, of one size, in rising position of focus.
#[derive(Debug, Clone, PartialEq)]
pub struct FocalStack {
    planes: Vec<Plane>,
}

impl FocalStack {
    /// A stack of `planes`, put in order of position.
    ///
    /// # Errors
    /// If there are fewer than [`LEAST_PLANES`], two share a position, or sizes differ.
    pub fn new(mut planes: Vec<Plane>) -> Result<Self, LearningError> {
        planes.sort_by(|a, b| a.position.total_cmp(&b.position));
        if planes.len() < LEAST_PLANES {
            let count = planes.len();
            bail!(
                "a focal stack needs at least {LEAST_PLANES} pictures at different positions, but has {count}; take \
                 more between them"
            );
        }

        for pair in planes.windows(2) {
            let [first, second] = [&pair[0], &pair[1]].map(|plane| &plane.name);
            let [(width, height), other] =
                [&pair[0], &pair[1]].map(|plane| (plane.picture.width, plane.picture.height));
            if (width, height) != other {
                bail!(
                    "{second} is {}x{} pixels, but {first} is {width}x{height}; all pictures of a stack must have one \
                     size",
                    other.0,
                    other.1
                );
            }
            let position = pair[1].position;
            if pair[0].position >= position {
                bail!("{first} and {second} are both at position {position}; leave one out");
            }
        }
        Ok(Self { planes })
    }

    /// Reads the pictures in `folder`, made smaller by blocks of `scale` x `scale` pixels. Positions are
    /// those of `list` (lines of `name,position`), else the one number in which the names differ, else
    /// the natural order of names. `folder` may also be a TIFF with a page for each position, which `list` counts
    /// from 1. Raw mosaics are read in the format `raw`, or if it is `None`, in the one of their length. Samples in
    /// files of 16 bit are numbers of so many `bits`; if it is `None`, of the fewest that hold the largest of all.
    ///
    /// # Errors
    /// If a picture or the list cannot be read, a sample needs more bits, or the pictures are not a stack.
    pub fn load(
        folder: &Path,
        list: Option<&Path>,
        scale: usize,
        raw: Option<PixelFormat>,
        bits: Option<u8>,
    ) -> Result<Self, LearningError> {
        if folder.is_file() && is_raw(folder) {
            let folder = folder.display();
            bail!("{folder} is one raw mosaic; a focal stack is a folder of at least {LEAST_PLANES}");
        }
        if folder.is_file() {
            return Self::new(pages::planes(folder, list, scale, bits)?);
        }

        let files = pictures_or_mosaics_in(folder, raw.is_some())?;
        let placed: Vec<(PathBuf, f64)> = match list {
            Some(list) => listed(list)?.into_iter().map(|(name, at)| (folder.join(name), at)).collect(),
            None => named(files),
        };
        let paths: Vec<PathBuf> = placed.iter().map(|(path, _)| path.clone()).collect();
        let bits_of_samples = sample_bits(folder, &paths, bits)?;

        let are_of_a_scan = are_of_a_scan(folder);
        let mut reconstructor = Reconstructor::default();
        let mut mosaics = RawMosaics::new(raw);
        let read = |(path, position): (PathBuf, f64)| {
            let bytes = std::fs::read(&path).map_err(|error| LearningError::unreadable(&path, &error))?;
            let picture = if is_raw(&path) {
                mosaics.read(&path, &bytes).map(Picture::Mosaic)
            } else {
                let file = PictureFile::open(&bytes).and_then(PictureFile::single);
                let file = file.map(|file| file.with_bits(bits_of_samples));
                file.and_then(|file| if are_of_a_scan { developed(&file) } else { file.read(0, false) })
            };

            let gray = picture.map_err(|error| LearningError::of(&path, error))?.into_gray(&mut reconstructor);
            Ok(Plane { name: file_name(&path), position, picture: in_blocks(&gray, scale) })
        };

        Self::new(placed.into_iter().map(read).collect::<Result<_, LearningError>>()?)
    }

    /// The pictures, in rising position.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Width and height of every picture.
    pub fn size(&self) -> (usize, usize) {
        self.planes.first().map_or((0, 0), |plane| (plane.picture.width, plane.picture.height))
    }

    /// The stack at even distances, and what was done to make it so. Where the positions are on a grid whose step is
    /// the least distance between two pictures, a mix of the two pictures around fills each gap. Otherwise the step is
    /// the usual distance, and planes between two pictures are mixed from them.
    ///
    /// # Errors
    /// If pictures are too far apart to say how sharp it is between them.
    pub fn even(&self) -> Result<(Self, Option<String>), LearningError> {
        self.on_grid().or_else(|uneven| self.interpolated().ok_or(uneven))
    }

    fn on_grid(&self) -> Result<(Self, Option<String>), LearningError> {
        let position = |index: usize| self.planes[index].position;
        let last = self.planes.len() - 1;
        let distances = self.planes.windows(2).map(|pair| pair[1].position - pair[0].position);
        let step = distances.fold(f64::INFINITY, f64::min);
        let steps = (position(last) - position(0)) / step;
        let uneven = |of: usize| {
            LearningError::new(format!(
                "the positions are too uneven: with steps of {step}, the least between two pictures, {} of {of} places \
                 would have a picture; take pictures at even distances",
                last + 1
            ))
        };
        if steps.round() as usize >= MOST_POSITIONS.min(2 * (last + 1)) {
            return Err(uneven(steps.round() as usize + 1));
        }

        let mut planes: Vec<Plane> = Vec::new();
        let mut gaps = 0;
        for pair in self.planes.windows(2) {
            let between = ((pair[1].position - pair[0].position) / step).round() as usize;
            planes.push(pair[0].clone());
            for missing in 1..between {
                planes.push(mixed(&pair[0], &pair[1], missing as f64 / between as f64));
                gaps += 1;
            }
        }
        planes.push(self.planes[last].clone());

        let off_grid = |index: usize| {
            let steps = (planes[index].position - position(0)) / step;
            (steps - index as f64).abs() > TOLERANCE * (1.0 + index as f64 / 20.0)
        };
        if (0..planes.len()).any(off_grid) {
            return Err(uneven(steps.round() as usize + 1));
        }

        let of = planes.len();
        let note = format!("{gaps} of {of} planes are missing and are mixed from their neighbours");
        Ok((Self { planes }, (gaps > 0).then_some(note)))
    }

    /// Planes at the usual distance; `None` if two pictures are too far apart, or fewer than [`LEAST_PLANES`] remain.
    fn interpolated(&self) -> Option<(Self, Option<String>)> {
        let mut distances: Vec<f64> = self.planes.windows(2).map(|pair| pair[1].position - pair[0].position).collect();
        distances.sort_by(f64::total_cmp);
        let step = distances[distances.len() / 2];
        if distances.last().is_none_or(|largest| *largest > WIDEST * step) {
            return None;
        }

        let first = self.planes.first()?.position;
        let range = self.planes.last()?.position - first;
        let count = ((range / step + NEAR) as usize + 1).min(MOST_POSITIONS);
        let mut planes = Vec::new();
        let mut made = 0;
        for index in 0..count {
            let position = first + index as f64 * step;
            let after = self.planes.partition_point(|plane| plane.position < position - NEAR * step);
            let high = self.planes.get(after).or(self.planes.last())?;
            if (high.position - position).abs() <= NEAR * step {
                planes.push(Plane { position, ..high.clone() });
            } else {
                let low = self.planes.get(after.checked_sub(1)?)?;
                planes.push(mixed(low, high, (position - low.position) / (high.position - low.position)));
                made += 1;
            }
        }

        let note = format!(
            "the positions are uneven, so the planes stand {step} apart: {} are pictures as they were taken, {made} \
             are mixed from the two pictures around them",
            count - made
        );
        (count >= LEAST_PLANES).then_some((Self { planes }, Some(note)))
    }
}

fn mixed(low: &Plane, high: &Plane, part: f64) -> Plane {
    let levels = low.picture.data.iter().zip(&high.picture.data);
    let data = levels.map(|(low, high)| low + part as f32 * (high - low)).collect();
    Plane {
        name: format!("between {} and {}", low.name, high.name),
        position: low.position + part * (high.position - low.position),
        picture: GrayImage { data, ..low.picture },
    }
}

/// The part of `picture` of `size` (width and height) with its upper left corner at `(left, top)`.
pub(super) fn cropped(picture: &GrayImage, (left, top): (usize, usize), size: (usize, usize)) -> GrayImage {
    let (width, height) = size;
    let rows = picture.data.chunks_exact(picture.width).skip(top).take(height);
    let data = rows.flat_map(|row| row[left..left + width].iter().copied()).collect();
    GrayImage { width, height, data }
}

/// Whether `folder` holds the pictures of one pose of a recorded scan.
fn are_of_a_scan(folder: &Path) -> bool {
    let folder = folder.canonicalize().ok();
    folder.as_deref().and_then(Path::parent).is_some_and(|scan| scan.join(HEADER).is_file())
}

/// A picture that a scan holds: gray, and never a mosaic, not even at the sensor's size.
fn developed(file: &PictureFile<'_>) -> Result<Picture, DecodeError> {
    let gray = file.read_any(0)?.into_luma8();
    let width = gray.width() as usize;
    let height = gray.height() as usize;
    Ok(Picture::Gray(GrayImage { width, height, data: gray.into_raw().into_iter().map(f32::from).collect() }))
}

/// The pictures in a folder, or if it has none, or `raw` are wanted, its raw mosaics.
fn pictures_or_mosaics_in(folder: &Path, raw: bool) -> Result<Vec<PathBuf>, LearningError> {
    let mosaics = mosaics_in(folder);
    let pictures = match pictures_in(folder) {
        Err(error) if mosaics.is_empty() => return Err(error.into()),
        pictures => pictures.unwrap_or_default(),
    };

    let left_out = |count: usize, kind: &str| {
        if count > 0 {
            tell(format_args!("note: {} also holds {count} {kind}, which are left out", folder.display()));
        }
    };
    if pictures.is_empty() || raw && !mosaics.is_empty() {
        left_out(pictures.len(), "pictures");
        Ok(mosaics)
    } else {
        left_out(mosaics.len(), "raw mosaics");
        Ok(pictures)
    }
}

#[cfg(test)]
mod tests {
    use parfocal_imaging::SENSOR_SIZE;

    use super::*;

    fn plane(position: f64, level: f32) -> Plane {
        let picture = GrayImage { width: 2, height: 2, data: vec![level; 4] };
        Plane { name: format!("{position}.png"), position, picture }
    }

    #[test]
    fn gaps_are_filled_with_a_mix_and_counted() {
        let levels = [(0.0, 10.0), (1.0, 20.0), (2.0, 30.0), (4.0, 50.0), (5.0, 60.0)];
        let stack = FocalStack::new(levels.map(|(position, level)| plane(position, level)).to_vec()).unwrap();
        let (even, note) = stack.even().unwrap();
        let found: Vec<(f64, f32)> = even.planes.iter().map(|plane| (plane.position, plane.picture.data[0])).collect();
        assert_eq!(&found[2..5], &[(2.0, 30.0), (3.0, 40.0), (4.0, 50.0)][..]);
        assert_eq!(note.unwrap(), "1 of 6 planes are missing and are mixed from their neighbours");
        let uneven = [0.0, 1.0, 10.0, 20.0, 21.5].map(|position| plane(position, 0.0)).to_vec();
        assert!(FocalStack::new(uneven).unwrap().even().unwrap_err().to_string().contains("too uneven"));
    }

    #[test]
    fn uneven_positions_are_interpolated_where_pictures_are_near() {
        // The level is ten times the position, so a mix is known.
        let at = |positions: &[f64]| {
            let planes = positions.iter().map(|&position| plane(position, 10.0 * position as f32)).collect();
            FocalStack::new(planes).unwrap().even()
        };
        let (even, note) = at(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.5]).unwrap();
        assert_eq!(even.planes.len(), 6);
        for (plane, position) in even.planes.iter().zip(1_u8..) {
            assert!((plane.position - f64::from(position)).abs() < 1e-9, "{}", plane.position);
            assert!((plane.picture.data[0] - 10.0 * f32::from(position)).abs() < 1e-3, "{}", plane.picture.data[0]);
        }
        let note = note.unwrap();
        assert!(note.contains("stand 1 apart: 5 are pictures as they were taken, 1 are mixed"), "{note}");

        let (even, _) = at(&[0.0, 1.3, 2.1, 3.0, 4.4, 5.0, 6.2]).unwrap();
        assert!(even.planes.iter().all(|plane| (plane.picture.data[0] - 10.0 * plane.position as f32).abs() < 1e-3));
        assert!(at(&[0.0, 1.0, 2.0, 3.0, 7.5, 8.5, 9.25]).is_err(), "nobody knows what lies between 3 and 7.5");
    }

    #[test]
    fn samples_of_twelve_bit_in_files_of_sixteen_keep_their_levels() {
        let folder = tempfile::tempdir().unwrap();
        let levels = || (0..64 * 64).map(|index| (index % 4096) as u16).collect::<Vec<_>>();
        for number in 0..5 {
            let file = folder.path().join(format!("{number}.png"));
            image::ImageBuffer::<image::Luma<u16>, _>::from_raw(64, 64, levels()).unwrap().save(file).unwrap();
        }

        let expected: Vec<f32> = levels().into_iter().map(|sample| 255.0 * f32::from(sample) / 4095.0).collect();
        for plane in FocalStack::load(folder.path(), None, 1, None, None).unwrap().planes() {
            let mut pairs = plane.picture.data.iter().zip(&expected);
            assert!(pairs.all(|(found, expected)| (found - expected).abs() < 1e-2), "{}", plane.name);
        }
    }

    #[test]
    fn pictures_of_a_scan_are_no_mosaics_even_at_the_sensors_size() {
        let (width, height) = SENSOR_SIZE;
        let scan = tempfile::tempdir().unwrap();
        let pose = scan.path().join("pose0001");
        std::fs::create_dir(&pose).unwrap();
        for power in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let gray = image::GrayImage::from_pixel(width as u32, height as u32, image::Luma([90]));
            gray.save(pose.join(format!("pose0001_f{power:.3}.png"))).unwrap();
        }

        let size = || FocalStack::load(&pose, None, 1, None, None).unwrap().size();
        assert_eq!(size(), (width / 4, height / 4));
        std::fs::write(scan.path().join(HEADER), "{}").unwrap();
        assert_eq!(size(), (width, height));
    }

    #[test]
    fn pictures_that_are_not_a_stack_are_refused() {
        let told = |planes: Vec<Plane>| FocalStack::new(planes).unwrap_err().to_string();
        let five = || (0..5).map(|i| plane(f64::from(i), 0.0)).collect::<Vec<_>>();
        assert!(told(five()[..2].to_vec()).contains("at least 5 pictures at different positions, but has 2"));
        assert!(told([five(), vec![plane(2.0, 0.0)]].concat()).contains("both at position 2"));
        let other = Plane { picture: GrayImage { width: 1, height: 4, data: vec![0.0; 4] }, ..plane(9.0, 0.0) };
        assert!(told([five(), vec![other]].concat()).contains("9.png is 1x4 pixels, but 4.png is 2x2"));
    }
}

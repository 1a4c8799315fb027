//! A focal stack: pictures of one still scene in order of focus, read from a folder and checked.

pub mod check;
pub mod drift;
pub mod optics;
mod pages;
pub mod source;

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use parfocal_devices::camera::footage::{self, is_raw, pictures_in, read_picture};
use parfocal_imaging::{DecodeError, GrayImage, Reconstructor, decode, in_blocks};

/// Least number of pictures in which a peak and an order can be recognised.
pub const LEAST_PLANES: usize = 5;
/// Greatest number of positions, including gaps.
const MOST_POSITIONS: usize = 1001;
/// How far a position may be from its place on the regular grid, in steps.
const TOLERANCE: f64 = 0.25;

/// How many times the usual distance two pictures may be apart for planes between them to be interpolated.
const WIDEST: f64 = 2.5;
/// How far from a plane's place a picture may have been taken to be used as it is, in steps.
const NEAR: f64 = 0.05;

/// One picture of a stack.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Its file's name.
    pub name: String,
    /// Position of the focus, in the unit of the names or the list.
    pub position: f64,
    /// The picture, in gray levels.
    pub picture: GrayImage,
}

/// Pictures of one still scene, of one size, in rising position of focus.
#[derive(Debug, Clone, PartialEq)]
pub struct FocalStack {
    planes: Vec<Plane>,
}

/// Why pictures are not a focal stack.
#[derive(Debug, thiserror::Error)]
pub enum StackError {
    /// The folder cannot be read, or has no pictures.
    #[error(transparent)]
    Folder(#[from] footage::FootageError),
    /// A picture cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file is not a picture.
    #[error("{}: {source}", path.display())]
    Picture {
        /// Path of the file.
        path: PathBuf,
        /// Why it cannot be decoded.
        source: DecodeError,
    },
    /// The pages of a file are not a stack.
    #[error("{}: {reason}", path.display())]
    Pages {
        /// Path of the file.
        path: PathBuf,
        /// What is wrong with them.
        reason: String,
    },
    /// The list of positions makes no sense.
    #[error("{}: {reason}", path.display())]
    List {
        /// Path of the list.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Too few pictures.
    #[error(
        "a focal stack needs at least {LEAST_PLANES} pictures at different positions, but has {0}; \
         take more between them"
    )]
    TooFew(usize),
    /// Pictures of different sizes.
    #[error("{other} is {}x{} pixels, but {first} is {}x{}; all pictures of a stack must have one size",
            sizes[1].0, sizes[1].1, sizes[0].0, sizes[0].1)]
    Sizes {
        /// The first picture.
        first: String,
        /// A picture of another size.
        other: String,
        /// Width and height of each, in pixels.
        sizes: [(usize, usize); 2],
    },
    /// Two pictures at one position.
    #[error("{first} and {second} are both at position {position}; leave one out")]
    Twice {
        /// One picture.
        first: String,
        /// The other.
        second: String,
        /// Position of both.
        position: f64,
    },
    /// Positions that do not fit a regular grid.
    #[error(
        "the positions are too uneven: with steps of {step}, the least between two pictures, {found} \
         of {of} places would have a picture; take pictures at even distances"
    )]
    Uneven {
        /// Least distance between two pictures.
        step: f64,
        /// Places with a picture.
        found: usize,
        /// Number of places on the grid.
        of: usize,
    },
    /// The pictures do not show a focal stack.
    #[error("{0}")]
    Unfit(String),
}

impl FocalStack {
    /// A stack of `planes`, put in order of position.
    ///
    /// # Errors
    /// If there are fewer than [`LEAST_PLANES`], two share a position, or sizes differ.
    pub fn new(mut planes: Vec<Plane>) -> Result<Self, StackError> {
        planes.sort_by(|a, b| a.position.total_cmp(&b.position));
        if planes.len() < LEAST_PLANES {
            return Err(StackError::TooFew(planes.len()));
        }

        for pair in planes.windows(2) {
            let [first, second] = [&pair[0], &pair[1]].map(|plane| plane.name.clone());
            let sizes = [&pair[0], &pair[1]].map(|plane| (plane.picture.width, plane.picture.height));
            if sizes[0] != sizes[1] {
                return Err(StackError::Sizes { first, other: second, sizes });
            }
            if pair[0].position >= pair[1].position {
                return Err(StackError::Twice { first, second, position: pair[1].position });
            }
        }
        Ok(Self { planes })
    }

    /// Reads the pictures in `folder`, made smaller by blocks of `scale` x `scale` pixels. Positions are
    /// those of `list` (lines of `name,position`), else the one number in which the names differ, else
    /// the natural order of names. `folder` may also be a TIFF with a page for each position, which `list` counts
    /// from 1.
    ///
    /// # Errors
    /// If a picture or the list cannot be read, or the pictures are not a stack.
    pub fn load(folder: &Path, list: Option<&Path>, scale: usize) -> Result<Self, StackError> {
        if folder.is_file() {
            return Self::new(pages::planes(folder, list, scale)?);
        }

        let files = pictures_or_mosaics_in(folder)?;
        let placed = match list {
            Some(list) => listed(list)?.into_iter().map(|(name, at)| (folder.join(name), at)).collect(),
            None => named(files),
        };

        let mut reconstructor = Reconstructor::default();
        let read = |(path, position): (PathBuf, f64)| {
            let bytes = std::fs::read(&path).map_err(|source| StackError::File { path: path.clone(), source })?;
            let picture = if is_raw(&path) { read_picture(&path, &bytes, false) } else { decode(&bytes, false) };
            let picture = picture.map_err(|source| StackError::Picture { path: path.clone(), source })?;
            let gray = picture.into_gray(&mut reconstructor);
            Ok(Plane { name: file_name(&path), position, picture: in_blocks(&gray, scale) })
        };

        Self::new(placed.into_iter().map(read).collect::<Result<_, StackError>>()?)
    }

    /// The pictures, in rising position.
    #[must_use]
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Width and height of every picture.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.planes.first().map_or((0, 0), |plane| (plane.picture.width, plane.picture.height))
    }

    /// The stack at even distances, and what was done to make it so. Where the positions are on a grid whose step is
    /// the least distance between two pictures, a mix of the two pictures around fills each gap. Otherwise the step is
    /// the usual distance, and planes between two pictures are mixed from them.
    ///
    /// # Errors
    /// If pictures are too far apart to say how sharp it is between them.
    pub fn even(&self) -> Result<(Self, Option<String>), StackError> {
        self.on_grid().or_else(|uneven| self.interpolated().ok_or(uneven))
    }

    fn on_grid(&self) -> Result<(Self, Option<String>), StackError> {
        let position = |index: usize| self.planes[index].position;
        let last = self.planes.len() - 1;
        let distances = self.planes.windows(2).map(|pair| pair[1].position - pair[0].position);
        let step = distances.fold(f64::INFINITY, f64::min);
        let steps = (position(last) - position(0)) / step;
        let uneven = |of| StackError::Uneven { step, found: last + 1, of };
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

/// The pictures in a folder, or if it has none, its raw mosaics.
fn pictures_or_mosaics_in(folder: &Path) -> Result<Vec<PathBuf>, StackError> {
    pictures_in(folder).or_else(|error| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_raw(path)).collect();
        files.sort();
        if files.is_empty() { Err(error.into()) } else { Ok(files) }
    })
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Names and positions from a list of `name,position`; a first line without a number is a heading.
fn listed(list: &Path) -> Result<Vec<(String, f64)>, StackError> {
    let wrong = |reason: String| StackError::List { path: list.to_owned(), reason };
    let text = std::fs::read_to_string(list).map_err(|error| wrong(format!("cannot read the list: {error}")))?;
    let mut placed = Vec::new();

    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let entry = line.rsplit_once(',').map(|(name, position)| (name.trim(), position.trim().parse::<f64>()));
        match entry {
            Some((name, Ok(position))) if position.is_finite() => placed.push((name.to_owned(), position)),
            Some((_, Err(_))) if number == 1 => {}
            _ => return Err(wrong(format!("line {number} must be a file's name, a comma and a position"))),
        }
    }

    Ok(placed)
}

/// Files and positions from the names: the one number in which they differ; else places in natural order.
fn named(mut files: Vec<PathBuf>) -> Vec<(PathBuf, f64)> {
    files.sort_by(|a, b| natural(&file_name(a), &file_name(b)));
    let numbers: Vec<Vec<f64>> = files.iter().map(|file| numbers(&stem(file))).collect();

    let count = numbers.iter().map(Vec::len).min().unwrap_or(0);
    let alike = numbers.iter().all(|found| found.len() == count);
    let differs = |which: &usize| numbers.iter().any(|found| (found[*which] - numbers[0][*which]).abs() > 0.0);
    let differing: Vec<usize> = if alike { (0..count).filter(differs).collect() } else { Vec::new() };

    match differing[..] {
        [one] => files.into_iter().zip(&numbers).map(|(file, found)| (file, found[one])).collect(),
        _ => files.into_iter().zip(0..).map(|(file, place)| (file, f64::from(place))).collect(),
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The pieces of a name: numbers, which are digits with at most one point, and what lies between them.
fn pieces(name: &str) -> Vec<&str> {
    let mut pieces = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digit = first.is_ascii_digit();
        let mut points = 0;
        let end = rest
            .char_indices()
            .find(|&(index, char)| {
                let followed = rest[index + char.len_utf8()..].starts_with(|next: char| next.is_ascii_digit());
                let point = digit && char == '.' && points == 0 && followed;
                points += usize::from(point);
                char.is_ascii_digit() != digit && !point
            })
            .map_or(rest.len(), |(index, _)| index);

        let (piece, after) = rest.split_at(end);
        pieces.push(piece);
        rest = after;
    }
    pieces
}

/// The numbers in `name`. A minus counts as a sign if no letter or digit stands before it.
fn numbers(name: &str) -> Vec<f64> {
    let pieces = pieces(name);
    let number = |(index, piece): (usize, &&str)| {
        let value: f64 = piece.parse().ok()?;
        let before = index.checked_sub(1).map_or("", |before| pieces[before]);
        // A lone minus between two numbers separates them.
        let alone = before == "-" && index > 1;
        let sign = before.strip_suffix('-').is_some_and(|before| !before.ends_with(char::is_alphanumeric));
        Some(if sign && !alone { -value } else { value })
    };

    let pieces_with_place = pieces.iter().enumerate();
    pieces_with_place
        .filter(|(_, piece)| piece.starts_with(|char: char| char.is_ascii_digit()))
        .filter_map(number)
        .collect()
}

/// Orders names as people do: numbers by value.
fn natural(a: &str, b: &str) -> Ordering {
    let a_pieces = pieces(a);
    let b_pieces = pieces(b);

    for (a, b) in a_pieces.iter().zip(&b_pieces) {
        let order = match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => a.total_cmp(&b),
            _ => a.cmp(b),
        };
        if order != Ordering::Equal {
            return order;
        }
    }

    a_pieces.len().cmp(&b_pieces.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(names: &[&str]) -> Vec<(String, f64)> {
        let files = names.iter().map(PathBuf::from).collect();
        named(files).into_iter().map(|(file, position)| (file_name(&file), position)).collect()
    }

    #[test]
    fn the_one_number_in_which_names_differ_is_the_position() {
        let pairs = |expected: &[(&str, f64)]| expected.iter().map(|(n, p)| ((*n).to_owned(), *p)).collect::<Vec<_>>();
        assert_eq!(
            placed(&["9.png", "10.png", "12.png"]),
            pairs(&[("9.png", 9.0), ("10.png", 10.0), ("12.png", 12.0)])
        );
        assert_eq!(
            placed(&["pose0001_f0.500.png", "pose0001_f0.050.png"]),
            pairs(&[("pose0001_f0.050.png", 0.05), ("pose0001_f0.500.png", 0.5)])
        );
        assert_eq!(placed(&["z_-2.5um.tif", "z_3um.tif"])[1], ("z_-2.5um.tif".to_owned(), -2.5));
        assert_eq!(placed(&["stack-3.png", "stack-11.png"])[0], ("stack-3.png".to_owned(), 3.0));
        // Two numbers differ, so only the order of the names is used.
        assert_eq!(placed(&["b10_1.png", "b9_2.png"]), pairs(&[("b9_2.png", 0.0), ("b10_1.png", 1.0)]));
        assert_eq!(placed(&["far.png", "near.png"]), pairs(&[("far.png", 0.0), ("near.png", 1.0)]));
    }

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
    fn pictures_that_are_not_a_stack_are_refused() {
        let told = |planes: Vec<Plane>| FocalStack::new(planes).unwrap_err().to_string();
        let five = || (0..5).map(|i| plane(f64::from(i), 0.0)).collect::<Vec<_>>();
        assert!(told(five()[..2].to_vec()).contains("at least 5 pictures at different positions, but has 2"));
        assert!(told([five(), vec![plane(2.0, 0.0)]].concat()).contains("both at position 2"));
        let other = Plane { picture: GrayImage { width: 1, height: 4, data: vec![0.0; 4] }, ..plane(9.0, 0.0) };
        assert!(told([five(), vec![other]].concat()).contains("9.png is 1x4 pixels, but 4.png is 2x2"));
    }
}

//! Footage to scan: a video (decoded by ffmpeg), an image, or a folder of images, as gray pictures of at most 480
//! lines.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::clip::{Area, Clip};
use crate::LearningError;
use parfocal_base::notices::tell;
use parfocal_devices::camera::footage::{self, SQUARE_PIXELS, cut_off, ffmpeg, is_picture, read_picture, sample_bits};
use parfocal_imaging::{ContentArea, GrayImage, Reconstructor, content_area, reduced};

/// Most lines of a picture: the height the paper's walks are meant for.
const LINES: usize = 480;
/// Most frames taken of one video: a minute at 25 a second.
const FRAMES: usize = 1500;

/// The clips in `paths`: one for a video or an image, or one for each image in a folder. If a video is damaged or
/// longer than 1500 frames, a note on standard error says what is left out.
///
/// # Errors
/// If one cannot be read, holds no picture, or its pictures are too small.
pub fn clips(paths: &[PathBuf]) -> Result<Vec<Arc<Clip>>, LearningError> {
    let clips = paths.par_iter().map(|path| clips_in(path)).collect::<Result<Vec<_>, _>>()?;
    Ok(clips.concat())
}

fn clips_in(path: &Path) -> Result<Vec<Arc<Clip>>, LearningError> {
    let files = if path.is_dir() {
        footage::pictures_in(path)?
    } else if is_picture(path) {
        vec![path.to_owned()]
    } else {
        return Ok(vec![clip(path, video(path)?)?]);
    };

    let bits = sample_bits(path, &files, None)?;
    files.iter().map(|file| clip(file, vec![Arc::new(image(file, bits)?)])).collect()
}

fn unreadable(path: &Path, reason: &str) -> LearningError {
    footage::FootageError::unreadable(path, reason).into()
}

/// A picture whose samples, if they fill 16 bit, are numbers of `bits` bits.
fn image(path: &Path, bits: u8) -> Result<GrayImage, LearningError> {
    let bytes = std::fs::read(path).map_err(|error| unreadable(path, &error.to_string()))?;
    let picture = read_picture(path, &bytes, false, bits).map_err(|error| unreadable(path, &error.to_string()))?;
    let gray = picture.into_gray(&mut Reconstructor::default());

    if gray.height <= LINES {
        return Ok(gray);
    }

    let width = gray.width * LINES / gray.height;
    Ok(reduced(&gray, width, LINES))
}

fn video(path: &Path) -> Result<Vec<Arc<GrayImage>>, LearningError> {
    match std::fs::metadata(path) {
        Ok(about) if about.is_file() => {}
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(unreadable(path, &error.to_string())),
        Ok(_) | Err(_) => return Err(unreadable(path, "there is no such file")),
    }

    let filters = format!("{SQUARE_PIXELS},scale=-2:'min({LINES},ih)'");
    let output = ffmpeg(path)
        // One frame more than is used, to know whether the video is longer.
        .args(["-frames:v", &(FRAMES + 1).to_string(), "-vf", &filters])
        .args(["-f", "image2pipe", "-pix_fmt", "gray", "-c:v", "pgm", "-"])
        .output()
        .map_err(|error| footage::FootageError::no_decoder(&error))?;

    let complaint = String::from_utf8_lossy(&output.stderr);
    let complaint = complaint.lines().last();
    if !output.status.success() {
        return Err(unreadable(path, &format!("ffmpeg: {}", complaint.unwrap_or("failed"))));
    }

    let mut frames: Vec<Arc<GrayImage>> = pictures(&output.stdout).map(Arc::new).collect();
    if frames.is_empty() {
        return Err(unreadable(path, "it holds no frames"));
    }

    let cut = if frames.len() > FRAMES { None } else { cut_off(path) };
    let cut = cut.map_or_else(String::new, |cut| format!("; {cut}"));
    if complaint.is_some() || !cut.is_empty() {
        let why = complaint.map_or_else(|| "cut off".to_owned(), |complaint| format!("damaged (ffmpeg: {complaint})"));
        // How many frames a longer video has is not known.
        let count = match frames.len() {
            count @ ..=FRAMES => format!("; {count} frames of it could be read"),
            _ => String::new(),
        };
        tell(format_args!("note: {} is {why}{count}{cut}", path.display()));
    }

    if frames.len() > FRAMES {
        frames.truncate(FRAMES);
        tell(format_args!(
            "note: only the first {FRAMES} frames of {} are used; cut it into several to use more",
            path.display()
        ));
    }

    Ok(frames)
}

/// The pictures in `stream`, one after another, up to the first incomplete one.
fn pictures(mut stream: &[u8]) -> impl Iterator<Item = GrayImage> + '_ {
    std::iter::from_fn(move || {
        let picture = footage::next_pnm(&mut stream).ok().flatten()?.into_luma8();
        let (width, height) = picture.dimensions();
        let data = picture.into_raw().into_iter().map(f32::from).collect();
        Some(GrayImage { width: width as usize, height: height as usize, data })
    })
}

/// A clip of `frames`, which `path` holds, limited to the content area of the first frame if it has one.
fn clip(path: &Path, frames: Vec<Arc<GrayImage>>) -> Result<Arc<Clip>, LearningError> {
    let area = frames.first().and_then(|frame| content_area::detect(frame)).map(|circle| within(&circle));
    let unusable = |error| LearningError::new(format!("cannot scan {}: {error}", path.display()));
    Clip::new(frames, area).map(Arc::new).map_err(unusable)
}

/// A square that fits into the circle with a little to spare. The clip cuts off any part outside the picture.
fn within(circle: &ContentArea) -> Area {
    let half = 0.68 * circle.radius;
    let pixel = |place: f64| place.max(0.0) as usize;
    Area {
        left: pixel(circle.x - half),
        top: pixel(circle.y - half),
        right: pixel(circle.x + half),
        bottom: pixel(circle.y + half),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_follow_one_another_and_a_cut_one_ends_them() {
        let stream = b"P5\n2 1\n255\n\x01\x02P5 1 2 255 \x03\x04P5\n2 2\n255\n\x00";
        let found: Vec<GrayImage> = pictures(stream).collect();
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].width, found[0].height, &found[0].data[..]), (2, 1, &[1.0, 2.0][..]));
        assert_eq!((found[1].width, found[1].height, &found[1].data[..]), (1, 2, &[3.0, 4.0][..]));
    }

    #[test]
    fn missing_and_empty_footage_is_reported() {
        let folder = tempfile::tempdir().unwrap();
        assert!(clips_in(&folder.path().join("no.mp4")).unwrap_err().to_string().contains("there is no such file"));
        assert!(clips_in(folder.path()).unwrap_err().to_string().contains("there is no picture"));
        let small = folder.path().join("small.png");
        image::GrayImage::new(40, 40).save(&small).unwrap();
        assert!(clips_in(&small).unwrap_err().to_string().contains("at least 64x64"));
    }

    #[test]
    fn a_picture_of_many_lines_is_made_smaller_and_keeps_its_gray_levels() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("large.png");
        // Blocks of 2x2 pixels: each becomes one pixel of the result.
        let gray = |x: u32, y: u32| u8::try_from((7 * (x / 2) + 31 * (y / 2)) % 256).unwrap();
        image::GrayImage::from_fn(1000, 960, |x, y| image::Luma([gray(x, y)])).save(&file).unwrap();
        let clips = clips_in(&file).unwrap();
        let picture = clips[0].at(0);
        assert_eq!((picture.width, picture.height), (500, 480));
        let expected = (0..480).flat_map(|y| (0..500).map(move |x| f32::from(gray(2 * x, 2 * y))));
        assert!(picture.data.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-3));
    }

    #[test]
    fn samples_of_twelve_bit_in_files_of_sixteen_keep_their_levels() {
        let folder = tempfile::tempdir().unwrap();
        let bright = image::ImageBuffer::from_pixel(64, 64, image::Luma([4095_u16]));
        bright.save(folder.path().join("a.png")).unwrap();
        let dark = image::ImageBuffer::from_pixel(64, 64, image::Luma([819_u16]));
        dark.save(folder.path().join("b.png")).unwrap();
        image::GrayImage::from_pixel(64, 64, image::Luma([100])).save(folder.path().join("c.png")).unwrap();

        let clips = clips_in(folder.path()).unwrap();
        let levels: Vec<u8> = clips.iter().map(|clip| clip.at(0).data[0].round() as u8).collect();
        assert_eq!(levels, [255, 51, 100]);
    }

    #[test]
    fn a_mosaic_is_developed_not_taken_for_a_gray_picture() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mosaic.png");
        // An even surface that looks different in each band.
        let bands: Vec<u16> = (0..16).map(|band| 100 + 40 * band).collect();
        let sample = |x: u32, y: u32| image::Luma([bands[(4 * (y % 4) + x % 4) as usize]]);
        image::ImageBuffer::from_fn(2048, 1088, sample).save(&file).unwrap();
        let clips = clips_in(&file).unwrap();
        let picture = clips[0].at(0);
        assert_eq!((picture.width, picture.height), (512, 272), "a pixel for each 4x4 samples");
        let (least, most) = picture.data.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
        assert!(least > 0.0 && most - least < 0.5, "{least} to {most}");
    }

    #[test]
    fn a_picture_is_what_it_holds_whatever_its_name_says() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("is-a-png.jpg");
        image::GrayImage::new(70, 70).save_with_format(&file, image::ImageFormat::Png).unwrap();
        assert_eq!(clips_in(&file).unwrap().len(), 1);
    }
}

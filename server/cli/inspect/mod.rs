//! `parfocal inspect`: content area, patch and focus metrics of pictures and mosaics in files.

mod overlay;
mod report;

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use super::input::without_systems_own;
use super::output::{Failure, print, print_json};
use parfocal_autofocus::{mgm, mlr};
use parfocal_base::files::replace;
use parfocal_base::notices::tell;
use parfocal_devices::camera::calibration;
use parfocal_devices::camera::footage::{is_raw, read_picture};
use parfocal_imaging::{
    Calibration, Developer, GrayImage, PATCH_SIDE, Patch, PatchArea, Picture, PixelFormat, RgbImage, Size,
    content_area, decode_raw, encode_png,
};
use report::{Kind, Report};

/// Arguments of `parfocal inspect`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Pictures (PNG, JPEG or TIFF of 8 or 16 bit) or mosaics (gray pictures of 2048x1088, or .raw or .bin files with
    /// 2048x1088 samples of 8, 10, 12 or 16 bit)
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Print one JSON object per line instead of a table
    #[arg(long)]
    json: bool,
    /// Save each picture into this folder as NAME.overlay.png, with content area, patch and metrics drawn in, and of each
    /// mosaic also NAME.SIZE.png, developed, with nothing drawn in
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Treat gray pictures of any size as mosaics
    #[arg(long)]
    mosaic: bool,
    /// Format of .raw and .bin files: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the one of their
    /// length
    #[arg(long, value_name = "FORMAT")]
    raw: Option<PixelFormat>,
    /// Size of the pictures that --out saves of mosaics: one pixel per mosaic cell, two by two per cell, or one per
    /// sample. Values and lengths are those of the cells at every size
    #[arg(long, value_enum, default_value_t, requires = "out")]
    size: Size,
    /// Calibration of the sensor that took the mosaics: a TOML file, or a folder of `parfocal calibrate`; a typical
    /// unit's by default
    #[arg(long, value_name = "PATH")]
    calibration: Option<PathBuf>,
}

/// Inspects every file. If one cannot be inspected, standard error says so, and the others are still inspected.
///
/// # Errors
/// If a file could not be inspected, the calibration could not be read, or a result could not be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut inspector = Inspector::new(arguments)?;
    let mut reports = Vec::new();
    let mut failed = 0;

    let paths = without_systems_own(&arguments.paths);
    for path in &paths {
        match inspector.inspect(path) {
            Ok(report) if arguments.json => print_json(&report)?,
            Ok(report) => reports.push(report),
            Err(failure) if paths.len() == 1 => return Err(failure),
            Err(failure) => {
                tell(format_args!("parfocal: {failure}"));
                failed += 1;
            }
        }
    }

    print(&report::table(&reports))?;
    if let Some(title) = reports.iter().find_map(|report| report.calibration.as_ref()) {
        print(&format!("mosaics developed with the calibration {title}\n"))?;
    }

    if failed > 0 {
        bail!("cannot inspect {failed} of {} files", paths.len());
    }
    Ok(())
}

/// State kept from file to file.
struct Inspector<'a> {
    mosaic: bool,
    raw: Option<PixelFormat>,
    out: Option<&'a Path>,
    size: Size,
    developer: Developer,
    calibration: Calibration,
    /// The calibration's title, if `--calibration` was given.
    titled: Option<String>,
    /// Names already given to files.
    taken: HashSet<OsString>,
}

/// A decoded picture: `rgb` for the overlay, `gray` for the metrics.
struct DecodedPicture {
    kind: Kind,
    rgb: RgbImage,
    gray: GrayImage,
}

impl<'a> Inspector<'a> {
    fn new(arguments: &'a Arguments) -> Result<Self, Failure> {
        let calibration = calibration::read_or_default(arguments.calibration.as_deref())?;

        if let Some(out) = &arguments.out {
            fs::create_dir_all(out).map_err(|error| format!("cannot make the folder {}: {error}", out.display()))?;
        }

        Ok(Self {
            mosaic: arguments.mosaic,
            raw: arguments.raw,
            out: arguments.out.as_deref(),
            size: arguments.size,
            developer: Developer::new(&calibration),
            titled: arguments.calibration.is_some().then(|| calibration.title()),
            calibration,
            taken: HashSet::new(),
        })
    }

    fn inspect(&mut self, path: &Path) -> Result<Report, Failure> {
        let named = |problem: &dyn std::fmt::Display| format!("{}: {problem}", path.display());
        if path.is_dir() {
            return Err(named(&"this is a folder; name the pictures in it, as with FOLDER/*").into());
        }
        let seen = self.see(path)?;

        let content_area = content_area::detect(&seen.gray);
        let width = seen.gray.width;
        let height = seen.gray.height;
        let area = PatchArea::central(width, height, content_area.as_ref()).map_err(|error| named(&error))?;
        let cut_out = cut(&seen.gray, area);

        let report = Report {
            path: path.display().to_string(),
            width,
            height,
            kind: seen.kind,
            content_area,
            patch: area,
            mgm: mgm(&cut_out),
            mlr: mlr(&cut_out),
            calibration: self.titled.clone().filter(|_| matches!(seen.kind, Kind::Mosaic)),
        };

        if let Some(out) = self.out {
            // A mosaic's picture is for whatever comes next, so nothing is drawn in; what is drawn in lies beside it.
            if matches!(report.kind, Kind::Mosaic) {
                save(path, &out.join(self.name(path, self.size.name())), &seen.rgb)?;
            }
            save(path, &out.join(self.name(path, "overlay")), &overlay::draw(seen.rgb, &report))?;
        }

        Ok(report)
    }

    fn see(&mut self, path: &Path) -> Result<DecodedPicture, Failure> {
        let named = |problem: &dyn std::fmt::Display| format!("{}: {problem}", path.display());
        let bytes = fs::read(path).map_err(|error| named(&format_args!("cannot be read: {error}")))?;

        let picture = match self.raw {
            Some(format) if is_raw(path) => decode_raw(&bytes, Some(format)).map(|(frame, _)| Picture::Mosaic(frame)),
            // As they are stored: levels of several files can be compared.
            _ => read_picture(path, &bytes, self.mosaic, 16),
        };
        let picture = picture.map_err(|error| named(&error))?;
        if self.size != Size::Cell && !matches!(picture, Picture::Mosaic(_)) {
            return Err(named(&"--size is for mosaics, and this is a developed picture; leave it out").into());
        }

        Ok(match picture {
            Picture::Rgb(rgb, gray) => DecodedPicture { kind: Kind::Rgb, rgb, gray },
            Picture::Gray(gray) => DecodedPicture { kind: Kind::Gray, rgb: overlay::from_gray(&gray), gray },
            Picture::Mosaic(frame) => {
                let size = (frame.width(), frame.height());
                calibration::check_size(&self.calibration, &path.display().to_string(), Some(size))?;

                let most = frame.samples().iter().copied().max().unwrap_or(0);
                if f32::from(most) > self.calibration.full_scale() {
                    let limit = self.calibration.full_scale();
                    tell(format_args!(
                        "parfocal: {}",
                        named(&format_args!(
                            "warning: counts reach {most} and are cut at {limit}, the calibration's limit"
                        ))
                    ));
                }

                let mut seen =
                    DecodedPicture { kind: Kind::Mosaic, rgb: RgbImage::default(), gray: GrayImage::default() };
                self.developer.develop(&frame, Size::Cell, &mut seen.rgb, &mut seen.gray);
                if self.size != Size::Cell {
                    // The gray picture stays that of the cells, as policies see it.
                    self.developer.develop(&frame, self.size, &mut seen.rgb, &mut GrayImage::default());
                }
                seen
            }
        })
    }

    /// A file name for the picture `what` of `path` that no other file of this run has.
    fn name(&mut self, path: &Path, what: &str) -> OsString {
        let stem = path.file_name().unwrap_or(path.as_os_str());
        let numbered = |number: u32| {
            let mut name = stem.to_owned();
            name.push(if number == 1 { format!(".{what}.png") } else { format!(".{what}-{number}.png") });
            name
        };

        let mut names = (1..).map(numbered);
        names.find(|name| self.taken.insert(name.clone())).unwrap_or_default()
    }
}

/// Writes `picture`, which was made from `path`, to `target`, as PNG.
fn save(path: &Path, target: &Path, picture: &RgbImage) -> Result<(), Failure> {
    let failed =
        |error: &dyn std::fmt::Display| format!("{}: cannot write {}: {error}", path.display(), target.display());

    let bytes = encode_png(picture).map_err(|error| failed(&error))?;
    Ok(replace(target, &bytes).map_err(|error| failed(&error))?)
}

/// The patch of `gray` at `area`, which lies inside it.
fn cut(gray: &GrayImage, area: PatchArea) -> Patch {
    Patch(std::array::from_fn(|i| gray.data[(area.y + i / PATCH_SIDE) * gray.width + area.x + i % PATCH_SIDE]))
}

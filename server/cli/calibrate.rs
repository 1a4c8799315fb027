//! `parfocal calibrate`: a sensor's own calibration, from its maker's tables and from dark and white references.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::output::{Failure, print};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::notices::tell;
use parfocal_devices::camera::calibration::tables::WavelengthRange;
use parfocal_devices::camera::calibration::{self, maker, tables};
use parfocal_devices::camera::{self, CameraSettings, FrameImage};
use parfocal_devices::lens::{Lens, SimulatedLens};
use parfocal_imaging::{Average, BANDS, Band, Calibration, Reference};

/// Frames skipped before the first that counts, so that settings take effect and automatic controls settle.
const WARM_UP: u32 = 10;
/// Longest wait for a frame.
const PATIENCE: Duration = Duration::from_secs(5);

/// What `parfocal calibrate` does.
#[derive(Debug, clap::Subcommand)]
pub enum Action {
    /// Take the dark reference: lens cap on, at the exposure and gain that you will use.
    Dark(Capture),
    /// Take the white reference: an even white target fills the picture, out of focus, in the light that you will use.
    White(Capture),
    /// Import the maker's measurements of this unit: band centres and widths, responses, spectral correction.
    Import(Import),
}

#[derive(Debug, clap::Args)]
pub struct Capture {
    /// Camera, for example `gige:ID?exposure=8000&gain=0`; try it with `phantom:dark` and `phantom:white`.
    #[arg(long, value_name = "SPEC")]
    camera: String,
    #[command(flatten)]
    to: Destination,
    /// Frames to average.
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: u32,
    /// Frame rate to request from the camera, per second.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: u32,
}

#[derive(Debug, clap::Args)]
pub struct Import {
    /// A calibration as TOML: any of `name`, `unit`, `bit_depth`, `centre_nm`, `fwhm_nm`, `dark`,
    /// `white`, `spectral_correction`. What it leaves out stays as it is.
    #[arg(value_name = "FILE")]
    from: Option<PathBuf>,
    /// The responses of the bands: the maker's own XML file of the sensor, or a CSV file with a line per wavelength, nm
    /// and 16 responses.
    #[arg(long, value_name = "XML|CSV")]
    responses: Option<PathBuf>,
    /// Wavelengths in nm between which the sensor is used. A band is its highest peak between them.
    #[arg(long, value_name = "FROM-TO", default_value = "460-600", value_parser = parse_range, requires = "responses")]
    range: WavelengthRange,
    /// The spectral correction as CSV: 16 lines of 16.
    #[arg(long, value_name = "CSV")]
    correction: Option<PathBuf>,
    #[command(flatten)]
    to: Destination,
}

#[derive(Debug, clap::Args)]
struct Destination {
    /// Folder of the calibration; a calibration that it already holds gets a new version.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Name of the calibration.
    #[arg(long)]
    name: Option<String>,
    /// Serial number of the sensor's unit.
    #[arg(long)]
    unit: Option<String>,
}

/// Does what the arguments say.
///
/// # Errors
/// If the camera fails, a reference cannot be used, or a file cannot be read or written.
pub fn run(action: &Action) -> Result<(), Failure> {
    match action {
        Action::Dark(capture) => dark(capture),
        Action::White(capture) => white(capture),
        Action::Import(arguments) => import(arguments),
    }
}

fn dark(capture: &Capture) -> Result<(), Failure> {
    let mut calibration = calibration::begun(&capture.to.out)?;
    let dark = take(capture, &calibration)?.dark().map_err(|error| refused("dark", &error))?;

    let size = (dark.width(), dark.height());
    if calibration.size().is_some_and(|before| before != size) {
        // A white reference of another size cannot be used per pixel any more; keep its band means.
        calibration.white = Reference::PerBand(calibration.white.band_means());
    }
    calibration.dark = Reference::PerPixel(dark);
    capture.to.save(calibration, &["dark"])
}

fn white(capture: &Capture) -> Result<(), Failure> {
    let mut calibration = calibration::begun(&capture.to.out)?;
    let Reference::PerPixel(dark) = &calibration.dark else {
        bail!(
            "{} has no dark reference yet: put the lens cap on and run `parfocal calibrate dark` first",
            capture.to.out.display()
        );
    };

    let white = take(capture, &calibration)?.white(dark).map_err(|error| refused("white", &error))?;
    calibration.white = Reference::PerPixel(white);
    capture.to.save(calibration, &["white"])
}

fn refused(which: &str, error: &dyn std::fmt::Display) -> Failure {
    format!("this is not a {which} reference, and nothing was saved: {error}").into()
}

/// Averages frames of the camera, after the warm-up.
fn take(capture: &Capture, calibration: &Calibration) -> Result<Average, Failure> {
    calibration::check_scale(calibration)?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock);
    let optics = SimulatedLens::new(Arc::clone(&clock)).optics();
    let mut camera = camera::open(&capture.camera, CameraSettings { fps: capture.fps.into(), seed: 0, optics, clock })?;

    let mut average = Average::new(calibration.full_scale());

    for number in 0..WARM_UP + capture.frames {
        let frame = camera.next_frame(PATIENCE)?;
        match frame.image {
            FrameImage::Mosaic(mosaic) if number >= WARM_UP => average.add(&mosaic)?,
            FrameImage::Mosaic(_) => {}
            FrameImage::Rgb(_) => {
                bail!("the camera {} delivers colour pictures, which need no calibration", capture.camera);
            }
        }
    }

    Ok(average)
}

fn import(arguments: &Import) -> Result<(), Failure> {
    if arguments.from.is_none() && arguments.responses.is_none() && arguments.correction.is_none() {
        bail!("there is nothing to import: name a TOML file, --responses or --correction");
    }

    let mut calibration = calibration::begun(&arguments.to.out)?;
    let mut changed = Vec::new();

    if let Some(path) = &arguments.from {
        let before = calibration.clone();
        calibration = Calibration { version: before.version, ..calibration::read_into(calibration, path)? };
        let references = [("dark", calibration.dark != before.dark), ("white", calibration.white != before.white)];
        changed.extend(references.into_iter().filter(|(_, is_new)| *is_new).map(|(name, _)| name));
    }

    if let Some(path) = &arguments.responses {
        calibration.bands = bands(path, &arguments.range)?;
    }

    if let Some(path) = &arguments.correction {
        calibration.correction = tables::correction(path)?;
    }

    arguments.to.save(calibration, &changed)
}

/// The bands in the file `path`, the maker's own or a table.
fn bands(path: &Path, range: &WavelengthRange) -> Result<[Band; BANDS], Failure> {
    if !maker::is_makers(path) {
        return Ok(tables::bands(path, range)?);
    }

    let file = maker::read(path, range)?;
    if file.virtual_bands > 0 {
        let path = path.display();
        tell(format_args!("{path}: its spectral correction was not read; give yours by --correction"));
    }
    Ok(file.bands)
}

fn parse_range(text: &str) -> Result<WavelengthRange, String> {
    let numbers =
        text.split_once('-').and_then(|(from, to)| Some((from.parse::<f64>().ok()?, to.parse::<f64>().ok()?)));
    let range = numbers.filter(|(from, to)| 300.0 <= *from && from < to && *to <= 1100.0);
    range
        .map(|(from, to)| from..=to)
        .ok_or_else(|| "must be two wavelengths from 300 to 1100 nm, as 460-600".to_owned())
}

impl Destination {
    /// Saves `calibration` as the next version, dated today.
    fn save(&self, mut calibration: Calibration, changed: &[&str]) -> Result<(), Failure> {
        calibration.version = calibration::next_version(Path::new(&self.out), &calibration.version);
        calibration.date = Some(SystemClock.wall().strftime("%Y-%m-%d").to_string());

        if let Some(name) = &self.name {
            calibration.name.clone_from(name);
        }
        if self.unit.is_some() {
            calibration.unit.clone_from(&self.unit);
        }

        let path = calibration::save(Path::new(&self.out), &calibration, changed)?;
        print(&format!("{}\nsaved in {}\n", calibration.title(), path.display()))
    }
}

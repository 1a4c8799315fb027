//! `parfocal recording spectrum`: what each band shows at a place, as a table.

use std::path::PathBuf;

use crate::cli::output::{Failure, csv, print, save};
use parfocal_base::notices::tell;
use parfocal_devices::camera::calibration;
use parfocal_imaging::{Circle, Spectrum, SpectrumSum};
use parfocal_recording::Recording;
use parfocal_session::playback::PlaceSpectrum;

/// Arguments of `parfocal recording spectrum`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording.
    folder: PathBuf,
    /// The place, in samples of the mosaic from its left and upper edge.
    #[arg(long, value_name = "X,Y", value_parser = place, allow_hyphen_values = true)]
    at: (f64, f64),
    /// Take all cells whose middle is this near to the place, in samples. With 0, the cell there.
    #[arg(long, value_name = "SAMPLES", default_value_t = 0.0, allow_hyphen_values = true)]
    radius: f64,
    /// The frames, from 0: one, or the first and the last.
    #[arg(long, value_name = "N or A..B", value_parser = frames, default_value = "0")]
    frames: (usize, usize),
    /// Write the table there instead of printing it.
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

/// Prints or writes the table, the bands in order of wavelength.
///
/// # Errors
/// If the place or a frame is not in the recording, a frame is damaged, or the table cannot be written.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let recording = Recording::open(&arguments.folder)?;
    let calibration = calibration::of_recording(&recording)?;

    let (x, y) = arguments.at;
    let circle = Circle { x, y, radius: arguments.radius };
    let mut sum = SpectrumSum::new(&calibration, circle, recording.size()).map_err(|bad| bad.to_string())?;
    let (first, last) = arguments.frames;
    for frame in first..=last {
        sum.add(&recording.frame(frame)?);
    }
    let spectrum = sum.spectrum();

    let table = csv(PlaceSpectrum::new(&calibration, &spectrum).bands.into_iter().map(Ok))?;
    let Some(out) = &arguments.out else {
        print(&String::from_utf8_lossy(&table))?;
        tell(format_args!("{}", summary(&spectrum)));
        return Ok(());
    };
    save(out, &table)?;
    print(&format!("{}; the table is in {}\n", summary(&spectrum), out.display()))
}

fn summary(spectrum: &Spectrum) -> String {
    let of = |number: usize, what: &str| format!("{number} {what}{}", if number == 1 { "" } else { "s" });
    let taken = format!("{} in {}", of(spectrum.cells, "cell"), of(spectrum.frames, "frame"));
    let uncalibrated = match spectrum.reflectance {
        Some(_) => "",
        None => "; counts alone, since the sensor was recorded without a white reference",
    };
    let saturated = match spectrum.saturated {
        0 => String::new(),
        number => format!("; {} at full scale, so the true values are higher", of(number, "sample")),
    };
    format!("{taken}{uncalibrated}{saturated}")
}

fn place(text: &str) -> Result<(f64, f64), String> {
    let number = |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
    text.split_once(',')
        .and_then(|(x, y)| Some((number(x)?, number(y)?)))
        .ok_or_else(|| "must be two numbers, such as 1024,544".to_owned())
}

fn frames(text: &str) -> Result<(usize, usize), String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    match (first.trim().parse(), last.trim().parse()) {
        (Ok(first), Ok(last)) if first <= last => Ok((first, last)),
        _ => Err("must be a frame's number, or the first and the last, such as 0..49".to_owned()),
    }
}

//! `parfocal recording cube`: one frame as an ENVI file, a header beside its data.

use std::fmt::Write;
use std::path::PathBuf;

use crate::cli::output::{Failure, print, save};
use parfocal_devices::camera::calibration;
use parfocal_imaging::{CELL, Calibration, MosaicFrame};
use parfocal_recording::{Recording, by_wavelength};

/// Arguments of `parfocal recording cube`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the recording.
    folder: PathBuf,
    /// Number of the frame, from 0.
    #[arg(long, value_name = "N")]
    frame: usize,
    /// The header; the data goes beside it, with the ending `bil`.
    #[arg(long, value_name = "FILE.hdr", value_parser = header_path)]
    out: PathBuf,
}

/// Saves the cube: raw counts, the bands in order of wavelength.
///
/// # Errors
/// If the frame cannot be read, or the files cannot be written.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let recording = Recording::open(&arguments.folder)?;
    let calibration = calibration::of_recording(&recording)?;
    let mosaic = recording.frame(arguments.frame)?;

    let order = by_wavelength(&calibration);
    let data = arguments.out.with_extension("bil");
    save(&data, &line_by_line(&mosaic, &order))?;
    save(&arguments.out, header(arguments, &recording, &calibration, &order).as_bytes())?;

    print(&format!(
        "frame {}: {} bands of {}x{} in {} and {}\n",
        arguments.frame,
        order.len(),
        mosaic.band_width(),
        mosaic.band_height(),
        arguments.out.display(),
        data.display()
    ))
}

/// The samples as 16 bit, little-endian, band interleaved by line: for each row of cells all values of one band, then
/// all of the next.
fn line_by_line(mosaic: &MosaicFrame, order: &[usize]) -> Vec<u8> {
    let width = mosaic.width();
    let mut bytes = Vec::with_capacity(2 * mosaic.samples().len());

    for cells in mosaic.samples().chunks_exact(CELL * width) {
        for &band in order {
            let row = &cells[band / CELL * width..][..width];
            bytes.extend(row[band % CELL..].iter().step_by(CELL).flat_map(|sample| sample.to_le_bytes()));
        }
    }
    bytes
}

fn header(arguments: &Arguments, recording: &Recording, calibration: &Calibration, order: &[usize]) -> String {
    let (width, height) = recording.size();
    let list = |value: &dyn Fn(usize) -> f64| {
        let values: Vec<String> = order.iter().map(|&band| format!("{}", value(band))).collect();
        values.join(", ")
    };

    let row = recording.rows().get(arguments.frame);
    let number = row.map_or(0, |row| row.number);
    let made = &recording.header().started;

    let mut text = String::from("ENVI\n");
    let _ = writeln!(
        text,
        "description = {{frame {} of a parfocal recording of {made}; camera frame {number}; raw counts}}",
        arguments.frame
    );
    let _ = writeln!(text, "samples = {}\nlines = {}\nbands = {}", width / CELL, height / CELL, order.len());
    let _ = writeln!(text, "header offset = 0\nfile type = ENVI Standard\ndata type = 12\ninterleave = bil");
    let _ = writeln!(text, "byte order = 0\nwavelength units = Nanometers");
    let _ = writeln!(text, "wavelength = {{{}}}", list(&|band| calibration.bands[band].centre_nm));
    let _ = writeln!(text, "fwhm = {{{}}}", list(&|band| calibration.bands[band].fwhm_nm));
    let _ = writeln!(text, "data ignore value = {}", u16::MAX);
    text
}

fn header_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let named = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("hdr"));
    if named { Ok(path) } else { Err("must end in .hdr".to_owned()) }
}

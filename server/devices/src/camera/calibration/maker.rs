//! The sensor's own file, as IMEC writes it for each unit and XIMEA delivers it with the camera: XML.
//!
//! `filter_info/filter_zones` lists the bands in the order of the mosaic, each with its `peaks`: `wavelength_nm`,
//! `fwhm_nm` and `QE`.

use std::path::Path;

use roxmltree::{Document, Node};

use super::CalibrationFault;
use super::tables::{WavelengthRange, no_peak};
use parfocal_imaging::{BANDS, Band};

/// What the file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct MakersFile {
    /// The bands, by their highest peak within the sensor's range.
    pub bands: [Band; BANDS],
    /// Number of virtual bands of the file's spectral corrections. They are not read, because there may be several, and
    /// fewer than 16 bands.
    pub virtual_bands: usize,
}

/// Whether `path` names such a file.
pub fn is_makers(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("xml"))
}

/// Reads the file `path`. Only peaks within `range` count.
///
/// # Errors
/// If the file cannot be read, is not such a file or of another mosaic, or a band has no peak within `range`.
pub fn read(path: &Path, range: &WavelengthRange) -> Result<MakersFile, CalibrationFault> {
    let failed = |problem: &dyn std::fmt::Display| CalibrationFault(format!("{}: {problem}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| failed(&error))?;
    let document = Document::parse(text.trim_start_matches('\u{feff}')).map_err(|error| failed(&error))?;

    let zones = named(document.root(), "filter_zones").next();
    let zones = zones.ok_or_else(|| failed(&"it has no <filter_zones>, so it is not a sensor's calibration"))?;
    let found: Vec<Node> = named(zones, "band").filter(|band| named(*band, "peak").next().is_some()).collect();
    if found.len() != BANDS {
        return Err(failed(&format_args!("it has {} bands, but a mosaic of 4x4 has {BANDS}", found.len())));
    }

    let mut bands = Vec::with_capacity(BANDS);
    for (number, band) in found.into_iter().enumerate() {
        let peak = named(band, "peak").filter_map(peak).filter(|(band, _)| range.contains(&band.centre_nm));
        let highest = peak.max_by(|a, b| a.1.total_cmp(&b.1));
        bands.push(highest.ok_or_else(|| no_peak(path, number, range))?.0);
    }

    Ok(MakersFile {
        bands: bands.try_into().map_err(|_| failed(&"16 bands"))?,
        virtual_bands: named(document.root(), "virtual_band").count(),
    })
}

/// The elements called `name` within `node`.
fn named<'a, 'input: 'a>(node: Node<'a, 'input>, name: &'a str) -> impl Iterator<Item = Node<'a, 'input>> {
    node.descendants().filter(move |inner| inner.has_tag_name(name))
}

/// A peak as a band, and its quantum efficiency; none if it is not described by finite numbers.
fn peak(node: Node) -> Option<(Band, f64)> {
    let number = |name| {
        let text = named(node, name).next()?.text()?;
        text.trim().parse::<f64>().ok().filter(|value| value.is_finite())
    };
    let centre_nm = number("wavelength_nm")?;
    let fwhm_nm = number("fwhm_nm")?;
    Some((Band { centre_nm, fwhm_nm }, number("QE").unwrap_or(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of 16 bands at 465, 473, … nm, each with a side lobe at 430 nm that is higher.
    fn file(bands: usize) -> String {
        let peak = |nm: usize, efficiency: f64| {
            format!("<peak><wavelength_nm> {nm}.5</wavelength_nm><fwhm_nm>9.25</fwhm_nm><QE>{efficiency}</QE></peak>")
        };
        let band = |band: usize| {
            format!("<band><peaks>{}{}{}</peaks></band>", peak(430, 0.4), peak(465 + 8 * band, 0.2), peak(590, 0.1))
        };
        let bands: String = (0..bands).map(band).collect();
        format!(
            "\u{feff}<?xml version=\"1.0\"?><sensor_calibration><filter_info layout=\"MOSAIC\"><filter_zones>\
             <filter_zone><bands>{bands}</bands></filter_zone></filter_zones></filter_info><system_info>\
             <spectral_correction_info><virtual_bands><virtual_band><wavelength_nm>1</wavelength_nm></virtual_band>\
             </virtual_bands></spectral_correction_info></system_info></sensor_calibration>"
        )
    }

    fn read_text(text: &str, range: WavelengthRange) -> Result<MakersFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("unit.xml");
        std::fs::write(&path, text).unwrap();
        read(&path, &range).map_err(|error| error.to_string())
    }

    #[test]
    fn each_band_is_its_highest_peak_within_the_range() {
        let read = read_text(&file(16), 460.0..=600.0).unwrap();
        for (number, band) in (0_u32..).zip(read.bands) {
            assert_eq!(band, Band { centre_nm: 465.5 + 8.0 * f64::from(number), fwhm_nm: 9.25 });
        }
        assert_eq!(read.virtual_bands, 1);
    }

    #[test]
    fn another_mosaic_a_band_out_of_range_and_another_file_are_refused() {
        let refused = |text: &str, range| read_text(text, range).unwrap_err();
        assert!(refused(&file(25), 460.0..=600.0).contains("it has 25 bands, but a mosaic of 4x4 has 16"));
        let outside = refused(&file(16), 470.0..=585.0);
        assert!(outside.contains("unit.xml: band 0 has no peak between 470 and 585 nm"), "{outside}");
        assert!(refused("<a/>", 460.0..=600.0).contains("has no <filter_zones>"));
        assert!(refused("nm,1,2", 460.0..=600.0).contains("unit.xml: "));
    }
}

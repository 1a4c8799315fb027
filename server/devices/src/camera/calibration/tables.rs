//! A maker's tables of a sensor's unit, as CSV: the bands' responses and the spectral correction.

use std::ops::RangeInclusive;
use std::path::Path;

use super::CalibrationFault;
use parfocal_imaging::{BANDS, Band};

/// Wavelengths in nm between which a sensor's filters let light through. Beyond them a band's response has side lobes,
/// which the camera's own filter keeps away.
pub type WavelengthRange = RangeInclusive<f64>;

/// Reads the bands from the responses in `path`: a line per wavelength with nm and 16 responses; a heading may come
/// first. Centre and width are those of each response's highest peak within `range`, at half its height.
///
/// # Errors
/// If the table cannot be read, or a band has no peak within `range`.
pub fn bands(path: &Path, range: &WavelengthRange) -> Result<[Band; BANDS], CalibrationFault> {
    let rows = rows(path, BANDS + 1)?;
    let rising = rows.windows(2).all(|pair| pair[0][0] < pair[1][0]);
    if rows.len() < 3 || !rising {
        return Err(format!("{}: needs at least three wavelengths, in rising order", path.display()).into());
    }

    let mut bands = Vec::with_capacity(BANDS);
    for band in 1..=BANDS {
        let response: Vec<(f64, f64)> = rows.iter().map(|row| (row[0], row[band])).collect();
        let found = main_peak(&response, range);
        bands.push(found.ok_or_else(|| no_peak(path, band - 1, range))?);
    }

    bands.try_into().map_err(|_| CalibrationFault("16 bands".to_owned()))
}

/// The fault of a band, counted from 0, without a peak within `range`.
pub(super) fn no_peak(path: &Path, band: usize, range: &WavelengthRange) -> CalibrationFault {
    let (from, to) = (range.start(), range.end());
    CalibrationFault(format!(
        "{}: band {band} has no peak between {from} and {to} nm; give the sensor's own range, as --range {from}-{to}",
        path.display()
    ))
}

/// Reads the correction in `path`: 16 lines of 16 numbers.
///
/// # Errors
/// If the table cannot be read or has another shape.
pub fn correction(path: &Path) -> Result<[[f32; BANDS]; BANDS], CalibrationFault> {
    let rows = rows(path, BANDS)?;
    if rows.len() != BANDS {
        return Err(format!("{}: needs 16 lines of 16, but has {}", path.display(), rows.len()).into());
    }
    Ok(std::array::from_fn(|row| std::array::from_fn(|column| rows[row][column] as f32)))
}

/// Reads lines of `columns` finite numbers. A first line without any number is a heading.
fn rows(path: &Path, columns: usize) -> Result<Vec<Vec<f64>>, CalibrationFault> {
    let failed = |problem: &dyn std::fmt::Display| format!("{}: {problem}", path.display());
    let reader = csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_path(path);
    let mut rows = Vec::new();
    for (number, record) in (1..).zip(reader.map_err(|error| failed(&error))?.records()) {
        let record = record.map_err(|error| failed(&error))?;
        let values: Vec<Option<f64>> =
            record.iter().map(|text| text.parse().ok().filter(|value: &f64| value.is_finite())).collect();

        if number == 1 && values.iter().all(Option::is_none) {
            continue;
        }

        match values.into_iter().collect::<Option<Vec<f64>>>() {
            Some(row) if row.len() == columns => rows.push(row),
            _ => return Err(failed(&format_args!("line {number} must have {columns} numbers")).into()),
        }
    }
    Ok(rows)
}

/// The highest peak of a response within `range`: where it falls to half its height on either side, and the middle
/// between them. None if the response only falls or rises there, because then its peak is outside.
fn main_peak(response: &[(f64, f64)], range: &WavelengthRange) -> Option<Band> {
    let inside = response.iter().enumerate().filter(|(_, (nm, _))| range.contains(nm));
    let top = inside.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?.0;
    let half = response[top].1 / 2.0;
    let is_higher = |neighbour: Option<&(f64, f64)>| neighbour.is_some_and(|there| there.1 > response[top].1);
    let goes_on =
        is_higher(top.checked_sub(1).and_then(|before| response.get(before))) || is_higher(response.get(top + 1));
    if half <= 0.0 || goes_on {
        return None;
    }

    let crossing = |((inner, above), (outer, below)): ((f64, f64), (f64, f64))| {
        inner + (outer - inner) * (above - half) / (above - below)
    };
    let falls = |pair: &((f64, f64), (f64, f64))| pair.1.1 <= half;

    let left = (1..=top).rev().map(|at| (response[at], response[at - 1])).find(falls).map(crossing);
    let right = response[top..].windows(2).map(|pair| (pair[0], pair[1])).find(falls).map(crossing);
    // A peak cut off by the table's end goes as far as the table.
    let left = left.unwrap_or(response[0].0);
    let right = right.unwrap_or(response[response.len() - 1].0);

    Some(Band { centre_nm: f64::midpoint(left, right), fwhm_nm: right - left })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centre_and_width_are_those_at_half_height() {
        // A triangle of height 2 about 500 nm that reaches 0 at 480 and 520, and a lesser peak at 560.
        let height = |nm: f64| (2.0 - (nm - 500.0).abs() / 10.0).max(0.0) + (0.5 - (nm - 560.0).abs() / 20.0).max(0.0);
        let response: Vec<_> = (0..40).map(|step| 450.0 + 3.0 * f64::from(step)).map(|nm| (nm, height(nm))).collect();
        let band = main_peak(&response, &(400.0..=700.0)).unwrap();
        // The sampled top is 1.9 at 501, so half of it, 0.95, lies 10.5 nm from the middle.
        assert!((band.centre_nm - 500.0).abs() < 1e-9 && (band.fwhm_nm - 21.0).abs() < 1e-9, "{band:?}");
        assert_eq!(main_peak(&[(450.0, 0.0), (460.0, 0.0)], &(400.0..=700.0)), None);

        // Only the lesser peak is within the range, and then none is: the response just falls.
        let band = main_peak(&response, &(530.0..=600.0)).unwrap();
        assert!((band.centre_nm - 560.0).abs() < 0.5, "{band:?}");
        assert_eq!(main_peak(&response, &(505.0..=519.0)), None);
    }
}

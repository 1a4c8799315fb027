//! The arrays of a recording, as Zarr v3 describes them.

use serde_json::{Map, Value, json};
use zarrs::array::FillValue;
use zarrs::array::data_type::{float64, int64};

use super::codec::{Coder, frame_codecs, plain_codecs};
use super::columns::{COLUMN_CHUNK, COLUMNS};
use super::error::RecordingError;
use super::header::Header;
use super::shard::SHARD_FRAMES;
use parfocal_imaging::{BANDS, CELL, Calibration};

/// Name of the array of frames.
pub const MOSAIC: &str = "mosaic";
/// The file that describes an array or group.
pub const DESCRIPTION: &str = "zarr.json";

/// Names of the arrays that describe the bands: those of numbers, and those of places in a mosaic cell.
pub const BAND_NUMBERS: [&str; 5] = ["wavelength", "fwhm", "red", "green", "blue"];
pub const BAND_PLACES: [&str; 2] = ["cell_row", "cell_column"];

/// What an array's `zarr.json` says.
struct Array<'a> {
    shape: &'a [usize],
    chunk: &'a [usize],
    dimensions: &'a [&'a str],
    data_type: &'a str,
    codecs: Value,
    attributes: Value,
}

impl Array<'_> {
    fn description(&self) -> Value {
        let fill = if self.data_type == "float64" { json!("NaN") } else { json!(0) };
        json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": self.shape,
            "data_type": self.data_type,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": self.chunk}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": fill,
            "codecs": self.codecs,
            "attributes": self.attributes,
            "dimension_names": self.dimensions,
        })
    }
}

/// The descriptions of all arrays that grow, by name, when `frames` frames of `width` x `height` samples are stored.
pub fn growing(header: &Header, (width, height): (usize, usize), frames: usize) -> Map<String, Value> {
    let sharding = json!([{"name": "sharding_indexed", "configuration": {
        "chunk_shape": [1, height, width],
        "codecs": frame_codecs(),
        "index_codecs": plain_codecs(),
        "index_location": "end",
    }}]);
    let mosaic = Array {
        shape: &[frames, height, width],
        chunk: &[SHARD_FRAMES, height, width],
        dimensions: &["frame", "y", "x"],
        data_type: "uint16",
        codecs: sharding,
        attributes: json!({"long_name": "raw samples of the sensor", "units": "count"}),
    };

    let mut arrays = Map::from_iter([(MOSAIC.to_owned(), mosaic.description())]);
    for column in &COLUMNS {
        let array = Array {
            shape: &[frames],
            chunk: &[COLUMN_CHUNK],
            dimensions: &["frame"],
            data_type: column.field.data_type(),
            codecs: plain_codecs(),
            attributes: (column.attributes)(header),
        };
        arrays.insert(column.name.to_owned(), array.description());
    }
    arrays
}

/// An array of one value per band, in the order of wavelengths.
pub struct BandArray {
    /// Name of the array.
    pub name: &'static str,
    /// The array's `zarr.json`.
    pub description: Value,
    /// Its one file.
    pub stored: Vec<u8>,
}

/// The numbers of `calibration`'s bands (as in its mosaic cell), in the order of wavelengths.
pub fn by_wavelength(calibration: &Calibration) -> Vec<usize> {
    let mut order: Vec<usize> = (0..calibration.bands.len()).collect();
    order.sort_by(|&a, &b| calibration.bands[a].centre_nm.total_cmp(&calibration.bands[b].centre_nm));
    order
}

/// The arrays that describe the bands: wavelength, width, row and column in the cell, and weights in linear sRGB.
///
/// # Errors
/// If the codecs do not work.
pub fn band_arrays(calibration: &Calibration) -> Result<Vec<BandArray>, RecordingError> {
    let order = by_wavelength(calibration);
    let [red, green, blue] = calibration.linear_srgb();
    let weight = |colour: &str| {
        let name = format!("weight of the band's white-balanced samples in linear sRGB {colour}");
        json!({"long_name": name, "units": "1"})
    };

    let array = |name, data_type, stored, attributes| {
        let codecs = plain_codecs();
        let array =
            Array { shape: &[BANDS], chunk: &[BANDS], dimensions: &["wavelength"], data_type, codecs, attributes };
        BandArray { name, description: array.description(), stored }
    };
    // Wavelengths or widths in nm, or weights.
    let numbers = Coder::new(float64(), FillValue::from(f64::NAN), &[BANDS], plain_codecs())?;
    let numbers = |name, value: &dyn Fn(usize) -> f64, attributes| {
        let values: Vec<f64> = order.iter().map(|&band| value(band)).collect();
        Ok(array(name, "float64", numbers.encode(&values)?, attributes))
    };
    // Rows or columns in a mosaic cell, from 0.
    let places = Coder::new(int64(), FillValue::from(0_i64), &[BANDS], plain_codecs())?;
    let places = |name, value: &dyn Fn(usize) -> usize, attributes| {
        let values: Vec<i64> = order.iter().map(|&band| value(band) as i64).collect();
        Ok(array(name, "int64", places.encode(&values)?, attributes))
    };

    let wavelength = json!({"long_name": "centre wavelength of the band", "units": "nm"});
    let width = json!({"long_name": "full width at half maximum of the band", "units": "nm"});
    let row = json!({"long_name": "row of the band in each cell of 4 x 4 samples, from 0", "units": "1"});
    let column = json!({"long_name": "column of the band in each cell of 4 x 4 samples, from 0", "units": "1"});
    Ok(vec![
        numbers("wavelength", &|band| calibration.bands[band].centre_nm, wavelength)?,
        numbers("fwhm", &|band| calibration.bands[band].fwhm_nm, width)?,
        places("cell_row", &|band| band / CELL, row)?,
        places("cell_column", &|band| band % CELL, column)?,
        numbers("red", &|band| red[band].into(), weight("red"))?,
        numbers("green", &|band| green[band].into(), weight("green"))?,
        numbers("blue", &|band| blue[band].into(), weight("blue"))?,
    ])
}

/// The group's `zarr.json`. It also holds the descriptions of all arrays, so replacing this one file makes all of them
/// longer at once.
///
/// # Errors
/// If the header cannot be put into JSON, which would be an error of the program.
pub fn group(header: &Header, arrays: &Map<String, Value>) -> Result<Value, RecordingError> {
    let mut attributes = serde_json::to_value(header).map_err(RecordingError::codec)?;

    // Here xarray looks for the names of coordinates.
    let of_bands = ["fwhm", "cell_row", "cell_column", "red", "green", "blue"];
    let beside: Vec<_> = COLUMNS.iter().map(|column| column.name).chain(of_bands).collect();
    attributes["coordinates"] = beside.join(" ").into();

    Ok(json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": {"kind": "inline", "must_understand": false, "metadata": arrays},
    }))
}

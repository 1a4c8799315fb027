//! The arrays of a recording, as Zarr v3 describes them.

use serde_json::{Map, Value, json};

use super::codec::{frame_codecs, plain_codecs};
use super::error::RecordingError;
use super::header::Header;
use parfocal_imaging::{BANDS, CELL, Calibration};

/// Frames in a shard, which is one file: a second at 25 frames a second.
pub const SHARD_FRAMES: usize = 25;
/// Values in a file of a column: a multiple of [`SHARD_FRAMES`].
pub const COLUMN_CHUNK: usize = 160 * SHARD_FRAMES;
/// Name of the array of frames.
pub const MOSAIC: &str = "mosaic";
/// The file that describes an array or group.
pub const DESCRIPTION: &str = "zarr.json";

/// A value that is stored beside each frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    /// End of the exposure, nanoseconds since the recording's start.
    Time,
    /// The camera's number of the frame.
    Number,
    /// Length of the exposure, milliseconds.
    Exposure,
    /// Focal power asked of the lens after the frame.
    Asked,
    /// Focal power at the middle of the exposure.
    Measured,
    /// Focal power at which the patch would be sharpest.
    Optimal,
    /// Left column of the patch, in mosaic cells.
    PatchX,
    /// Top row of the patch, in mosaic cells.
    PatchY,
    /// How often the policy had forgotten what it saw.
    PatchJumps,
}

impl Column {
    /// All columns.
    pub const ALL: [Self; 9] = [
        Self::Time,
        Self::Number,
        Self::Exposure,
        Self::Asked,
        Self::Measured,
        Self::Optimal,
        Self::PatchX,
        Self::PatchY,
        Self::PatchJumps,
    ];

    /// The array's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Number => "frame_number",
            Self::Exposure => "exposure",
            Self::Asked => "focal_power_asked",
            Self::Measured => "focal_power_measured",
            Self::Optimal => "focal_power_optimal",
            Self::PatchX => "patch_x",
            Self::PatchY => "patch_y",
            Self::PatchJumps => "patch_jumps",
        }
    }

    const fn data_type(self) -> &'static str {
        match self {
            Self::Time => "int64",
            Self::Number | Self::PatchX | Self::PatchY | Self::PatchJumps => "uint64",
            Self::Exposure | Self::Asked | Self::Measured | Self::Optimal => "float64",
        }
    }

    fn attributes(self, header: &Header) -> Value {
        match self {
            Self::Time => json!({
                "long_name": "end of the exposure",
                "units": format!("nanoseconds since {}", header.started.strftime("%Y-%m-%dT%H:%M:%S.%f")),
                "calendar": "proleptic_gregorian",
            }),
            Self::Number => json!({"long_name": "the camera's number of the frame; a gap is a missing frame"}),
            Self::Exposure => json!({"long_name": "exposure time", "units": "ms"}),
            Self::Asked => json!({"long_name": "focal power asked of the lens after the frame", "units": "1"}),
            Self::Measured => {
                json!({"long_name": "focal power at the middle of the exposure; NaN while unknown", "units": "1"})
            }
            Self::Optimal => {
                json!({"long_name": "best focal power, where a simulation knows it; else NaN", "units": "1"})
            }
            Self::PatchX => json!({"long_name": "left column of the patch in mosaic cells", "units": "1"}),
            Self::PatchY => json!({"long_name": "top row of the patch in mosaic cells", "units": "1"}),
            Self::PatchJumps => json!({
                "long_name": "how often the patch had jumped or the focus had been let go; policies forget at a change",
            }),
        }
    }
}

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
    for column in Column::ALL {
        let array = Array {
            shape: &[frames],
            chunk: &[COLUMN_CHUNK],
            dimensions: &["frame"],
            data_type: column.data_type(),
            codecs: plain_codecs(),
            attributes: column.attributes(header),
        };
        arrays.insert(column.name().to_owned(), array.description());
    }
    arrays
}

/// An array of one value per band, in the order of wavelengths.
pub struct BandArray {
    /// Name of the array.
    pub name: &'static str,
    /// One value per band.
    pub values: BandValues,
    attributes: Value,
}

/// The values of a [`BandArray`], one per band.
pub enum BandValues {
    /// Wavelengths or widths in nm, or weights.
    Numbers(Vec<f64>),
    /// Rows or columns in a mosaic cell, from 0.
    Places(Vec<i64>),
}

impl BandArray {
    /// The array's `zarr.json`.
    pub fn description(&self) -> Value {
        let data_type = match self.values {
            BandValues::Numbers(_) => "float64",
            BandValues::Places(_) => "int64",
        };
        let array = Array {
            shape: &[BANDS],
            chunk: &[BANDS],
            dimensions: &["wavelength"],
            data_type,
            codecs: plain_codecs(),
            attributes: self.attributes.clone(),
        };
        array.description()
    }
}

/// The numbers of `calibration`'s bands (as in its mosaic cell), in the order of wavelengths.
#[must_use]
pub fn by_wavelength(calibration: &Calibration) -> Vec<usize> {
    let mut order: Vec<usize> = (0..calibration.bands.len()).collect();
    order.sort_by(|&a, &b| calibration.bands[a].centre_nm.total_cmp(&calibration.bands[b].centre_nm));
    order
}

/// The arrays that describe the bands: wavelength, width, row and column in the cell, and weights in linear sRGB.
pub fn band_arrays(calibration: &Calibration) -> Vec<BandArray> {
    let order = by_wavelength(calibration);
    let numbers = |value: &dyn Fn(usize) -> f64| BandValues::Numbers(order.iter().map(|&band| value(band)).collect());
    let places =
        |value: &dyn Fn(usize) -> usize| BandValues::Places(order.iter().map(|&band| value(band) as i64).collect());
    let array = |name, values, attributes| BandArray { name, values, attributes };

    let wavelength = json!({"long_name": "centre wavelength of the band", "units": "nm"});
    let width = json!({"long_name": "full width at half maximum of the band", "units": "nm"});
    let row = json!({"long_name": "row of the band in each cell of 4 x 4 samples, from 0", "units": "1"});
    let column = json!({"long_name": "column of the band in each cell of 4 x 4 samples, from 0", "units": "1"});

    let [red, green, blue] = calibration.linear_srgb();
    let weight = |colour: &str| json!({"long_name": format!("weight of the band's white-balanced samples in linear sRGB {colour}"), "units": "1"});

    vec![
        array("wavelength", numbers(&|band| calibration.bands[band].centre_nm), wavelength),
        array("fwhm", numbers(&|band| calibration.bands[band].fwhm_nm), width),
        array("cell_row", places(&|band| band / CELL), row),
        array("cell_column", places(&|band| band % CELL), column),
        array("red", numbers(&|band| red[band].into()), weight("red")),
        array("green", numbers(&|band| green[band].into()), weight("green")),
        array("blue", numbers(&|band| blue[band].into()), weight("blue")),
    ]
}

/// The group's `zarr.json`. It also holds the descriptions of all arrays, so replacing this one file makes all of them
/// longer at once.
///
/// # Errors
/// If the header cannot be put into JSON, which would be an error of the program.
pub fn group(header: &Header, arrays: &Map<String, Value>) -> Result<Value, RecordingError> {
    let mut attributes = serde_json::to_value(header).map_err(RecordingError::codec)?;

    // Here xarray looks for the names of coordinates.
    let beside =
        Column::ALL.map(Column::name).into_iter().chain(["fwhm", "cell_row", "cell_column", "red", "green", "blue"]);
    attributes["coordinates"] = beside.collect::<Vec<_>>().join(" ").into();

    Ok(json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attributes,
        "consolidated_metadata": {"kind": "inline", "must_understand": false, "metadata": arrays},
    }))
}

//! The sizes at which a mosaic is developed.

use serde::Serialize;

use super::frame::{CELL, MosaicFrame};

/// How large a picture is made from a mosaic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Size {
    /// One pixel per mosaic cell.
    #[default]
    Cell,
    /// Two by two pixels per mosaic cell.
    Half,
    /// One pixel per sample.
    Full,
}

impl Size {
    /// All sizes, smallest first.
    pub const ALL: [Self; 3] = [Self::Cell, Self::Half, Self::Full];

    /// Pixels along each side of a mosaic cell.
    pub const fn per_cell(self) -> usize {
        match self {
            Self::Cell => 1,
            Self::Half => 2,
            Self::Full => CELL,
        }
    }

    /// The name, as on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cell => "cell",
            Self::Half => "half",
            Self::Full => "full",
        }
    }

    /// The next smaller size; the smallest one stays.
    #[must_use]
    pub const fn smaller(self) -> Self {
        match self {
            Self::Cell | Self::Half => Self::Cell,
            Self::Full => Self::Half,
        }
    }

    /// The next larger size; the largest one stays.
    #[must_use]
    pub const fn larger(self) -> Self {
        match self {
            Self::Cell => Self::Half,
            Self::Half | Self::Full => Self::Full,
        }
    }

    /// Width and height of the picture of `mosaic`, in pixels.
    pub const fn of(self, mosaic: &MosaicFrame) -> (usize, usize) {
        (self.per_cell() * mosaic.band_width(), self.per_cell() * mosaic.band_height())
    }
}

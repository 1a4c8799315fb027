//! Imaging: from a sensor's mosaic to what people and policies see. No thread, clock, file or socket.

mod bad_reference;
mod calibration;
mod calibration_toml;
mod calibration_write;
mod colour;
pub mod content_area;
mod decode;
mod develop;
mod frame;
mod geometry;
mod jpeg;
mod luma;
mod reconstruct;
mod reduce;
mod references;
mod size;
mod view;
mod ycc;

pub use calibration::{BANDS, Band, Calibration, Reference};
pub use calibration_toml::CalibrationError;
pub use decode::{DecodeError, Picture, SENSOR_SIZE, decode, decode_any, decode_raw, is_mosaic};
pub use develop::{Developed, Developer};
pub use frame::{CELL, FrameError, GrayImage, MosaicFrame, RgbImage};
pub use geometry::{ContentArea, PATCH_SIDE, Patch, PatchArea, TooSmall};
pub use jpeg::{JpegEncoder, JpegError};
pub use luma::{rgb_patch, rgb_to_gray, rgb_view};
pub use reconstruct::Reconstructor;
pub use reduce::{fill_block_means, in_blocks, reduced};
pub use references::{Average, BadReference};
pub use size::Size;
pub use view::{Scale, Square, View, WIDER, block_means};
pub use ycc::YccImage;

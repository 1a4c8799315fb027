//! Imaging: from a sensor's mosaic to what people and policies see. No thread, clock, file or socket.

mod frame;
mod geometry;

pub use frame::{FrameError, GrayImage, MosaicFrame, RgbImage};
pub use geometry::{ContentArea, PATCH_SIDE, Patch, PatchArea};

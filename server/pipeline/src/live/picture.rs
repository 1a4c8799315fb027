//! A frame as it leaves the imaging thread: the picture, which anyone may see, separate from the data that only the
//! operator and the researcher may see.

use std::sync::Arc;

use bytes::Bytes;

use crate::control::Aim;
use parfocal_base::FocalPower;
use parfocal_base::clock::Moment;
use parfocal_base::step::Hold;
use parfocal_imaging::{ContentArea, PatchArea};

/// A picture and its data.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Number of the frame.
    pub number: u64,
    /// End of the exposure.
    pub exposed_at: Moment,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Pixels along each side of a mosaic cell; 1 for a colour picture, whose pixels count as cells.
    pub per_cell: usize,
    /// The colour picture as JPEG.
    pub jpeg: Bytes,
    /// Whether its colours are estimated from bands that hold no red.
    pub estimated: bool,
    /// The patch's place, in cells.
    pub patch: PatchArea,
    /// The content area in use at that time, in cells.
    pub content_area: Option<ContentArea>,
    /// Where people had chosen to look at that time.
    pub aim: Aim,
}

/// What the loop did with the frame. Never shown to surgeons.
#[derive(Debug, Clone, PartialEq)]
pub struct Insight {
    /// Focal power that the lens was asked for after this frame.
    pub asked: FocalPower,
    /// Focal power at which the frame was exposed; `None` if the lens does not know it.
    pub measured: Option<FocalPower>,
    /// The policy's focus metric.
    pub metric: Option<f64>,
    /// Why the lens was held, if it was.
    pub held: Option<Hold>,
    /// The policy's belief, if it has one.
    pub belief: Option<Arc<[f32]>>,
    /// Whether the lens stood where a session's policy had left it, so that nobody may see where.
    pub left_by_session: bool,
}

/// One frame, made once for all viewers.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedFrame {
    /// The part that anyone may see.
    pub picture: Picture,
    /// The part that only the operator and the researcher may see.
    pub insight: Insight,
}

//! Hyperspectral recordings: every frame's mosaic, lossless, with its time and focal power, as plain Zarr v3 in a
//! folder. `docs/recordings.md` describes the layout for others.

mod codec;
mod columns;
mod disk;
mod error;
mod header;
mod layout;
mod reading;
mod recorder;
mod session;
mod shard;
mod view;
mod view_reading;
mod writing;

pub use columns::{FrameRow, PatchRow};
pub use disk::{Room, room};
pub use error::RecordingError;
pub use header::{CALIBRATION, Ended, FORMAT, Header, VERSION};
pub use layout::by_wavelength;
pub use reading::Recording;
pub use recorder::{CapturedFrame, Intake, Recorder, RecordingProgress, compressed_size};
pub use session::{AnyRecording, FoundRecording, RecordingKind, belonging, of_session};
pub use shard::SHARD_FRAMES;
pub use view::{VIEW_FORMAT, VIEW_VERSION, ViewHeader, ViewWriter};
pub use view_reading::{ViewRecording, ViewRow};
pub use writing::Writer;

/// Folder of the server's recordings, in its data folder.
pub const FOLDER: &str = "recordings";

//! parfocal: keeps a handheld hyperspectral video exoscope in focus, shows the live view in a browser, and runs
//! blinded usability trials of its autofocus policies.
//!
//! Rooms, from the ground up; each uses only rooms listed before it (see ARCHITECTURE.md).

pub mod clock;
pub mod files;
pub mod ids;
pub mod imaging;
pub mod lens;
pub mod notices;
pub mod options;
pub mod priority;

pub mod autofocus;
pub mod camera;

pub mod control;
pub mod training;
pub mod trial;

pub mod bench;
pub mod store;

pub mod conductor;
pub mod live;

pub mod http;

pub mod cli;

//! parfocal: keeps a handheld hyperspectral video exoscope in focus, shows the live view in a browser, and runs
//! blinded usability trials of its autofocus policies.
//!
//! Rooms, roughly from the ground up. ARCHITECTURE.md says which room may use which.

pub mod clock;
pub mod files;
pub mod ids;
pub mod notices;
pub mod options;
pub mod plot;
pub mod priority;

pub mod imaging;
pub mod lens;
pub mod tls;

pub mod recording;
pub mod simulation;

pub mod accounts;
pub mod autofocus;
pub mod camera;

pub mod doctor;
pub mod scans;

pub mod control;
pub mod evaluation;
pub mod training;
pub mod trial;

pub mod lens_measurement;
pub mod live;
pub mod store;

pub mod analysis;
pub mod conductor;
pub mod health;
pub mod package;

pub mod playback;
pub mod recorder;
pub mod study_export;

pub mod http;

pub mod cli;

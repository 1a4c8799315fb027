//! The server over HTTP: who may do what, the contents of every response, and how the server starts and ends.

mod accounts;
pub mod analysis;
mod backup;
mod blinding;
mod checks;
mod crowd;
mod evidence;
mod failing_disk;
mod finality;
mod health;
pub mod live;
mod logs;
mod playback;
pub mod pointing;
mod privacy;
mod real_time;
mod recordings;
mod records;
mod restart;
mod roles;
mod seed;
mod service;
mod sizes;
mod stopping;
pub mod studies;
mod study_export;
mod voice;

//! A whole blinded trial in real browsers on the real server, as surgeon, operator and researcher do it; a check of all
//! data that reached the surgeon's browser; and a server that is killed again and again.

mod accessible;
mod aftermath;
mod analysis_page;
mod bad_day;
mod blinding;
mod by_hand;
#[cfg(feature = "aravis")]
mod camera_card;
mod checks_card;
mod course;
pub mod driver;
mod fits;
mod focus_sign;
mod full_disk;
mod instruments;
mod keyboard;
mod killed;
mod languages;
mod large_text;
mod lens_troubles;
mod link_over;
mod offline;
mod outbox;
mod people_page;
mod playback;
mod pointing;
mod pool;
mod proxy;
mod recording_card;
pub mod screenshots;
pub mod scripts;
mod spectra;
mod study_page;
mod tabs;
mod taps;
mod theatre;
mod trial;
mod view;
mod voice;
pub mod wait;
mod wire;
mod writing;

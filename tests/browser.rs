//! A whole blinded trial in real browsers on the real server, as surgeon, operator and researcher do it; what reached the
//! surgeon's browser; and a server killed again and again.

#[allow(dead_code, reason = "shared with other tests")]
#[path = "system/support/mod.rs"]
mod support;

#[path = "browser/aftermath.rs"]
mod aftermath;
#[path = "browser/blinding.rs"]
mod blinding;
#[path = "browser/by_hand.rs"]
mod by_hand;
#[cfg(feature = "aravis")]
#[path = "browser/camera_card.rs"]
mod camera_card;
#[path = "browser/course.rs"]
mod course;
#[path = "browser/full_disk.rs"]
mod full_disk;
#[path = "browser/killed.rs"]
mod killed;
#[path = "browser/lens_troubles.rs"]
mod lens_troubles;
#[path = "browser/outbox.rs"]
mod outbox;
#[path = "browser/proxy.rs"]
mod proxy;
#[path = "browser/screenshots.rs"]
mod screenshots;
#[path = "browser/tabs.rs"]
mod tabs;
#[path = "browser/theatre.rs"]
mod theatre;
#[path = "browser/trial.rs"]
mod trial;
#[path = "browser/wait.rs"]
mod wait;
#[path = "browser/webdriver.rs"]
mod webdriver;
#[path = "browser/wire.rs"]
mod wire;
#[path = "browser/writing.rs"]
mod writing;

use support::disk;
#[cfg(feature = "aravis")]
use support::fake_camera;

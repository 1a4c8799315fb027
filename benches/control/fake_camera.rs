//! Aravis's fake GigE Vision camera, a real peer on the loopback (Debian's package `aravis-tools`).

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::camera::gige::list;

const PROGRAM: &str = "arv-fake-gv-camera-0.8";

/// The fake camera's name in `gige:`.
pub const NAME: &str = "Aravis-Fake-BENCH";

/// A running fake camera; ended when dropped.
pub struct FakeCamera(Child);

impl FakeCamera {
    /// Starts it and waits until it answers. `None` if the program is not installed.
    pub fn start() -> Option<Self> {
        let mut command = Command::new(PROGRAM);
        command.args(["-i", "127.0.0.1", "-s", "BENCH"]).stdout(Stdio::null()).stderr(Stdio::null());
        let Ok(process) = command.spawn() else {
            println!("loop/gige  skipped: {PROGRAM} is not installed (Debian package aravis-tools)");
            return None;
        };

        let camera = Self(process);
        let begun = SystemClock.now();
        while !list().iter().any(|found| found.id == NAME) {
            assert!(SystemClock.now().since(begun) < Duration::from_secs(20), "the fake camera never answers");
        }
        Some(camera)
    }
}

impl Drop for FakeCamera {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

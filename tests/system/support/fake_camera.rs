//! Aravis's fake GigE Vision camera, a separate program on the loopback (Debian's package `aravis-tools`).

use std::fs::File;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_devices::camera::gige::list;

const PROGRAM: &str = "arv-fake-gv-camera-0.8";
/// Serial number; the camera answers to `Aravis-Fake-TEST`.
const SERIAL: &str = "TEST";

/// A fake camera. It uses the machine's only GigE Vision port, so other tests wait for their turn.
pub struct Fake {
    process: Child,
    options: Vec<String>,
    _turn: File,
}

impl Fake {
    /// Starts it; `None` if the program is not installed.
    pub fn start(options: &[&str]) -> Option<Self> {
        let Some(program) = Self::program() else {
            println!("skipped: {PROGRAM} is not installed (Debian package aravis-tools)");
            return None;
        };
        // The program's own file is locked: whoever runs tests on this machine, in whatever folder, finds the same one.
        let turn = File::open(program).unwrap();
        turn.lock().unwrap();

        let options: Vec<String> = options.iter().map(|&option| option.to_owned()).collect();
        let process = Self::spawn(&options).unwrap();
        let fake = Self { process, options, _turn: turn };
        Self::wait_until_it_answers();
        Some(fake)
    }

    fn program() -> Option<PathBuf> {
        let folders = std::env::var_os("PATH")?;
        std::env::split_paths(&folders).map(|folder| folder.join(PROGRAM)).find(|program| program.is_file())
    }

    fn spawn(options: &[String]) -> std::io::Result<Child> {
        let mut command = Command::new(PROGRAM);
        command.args(["-i", "127.0.0.1", "-s", SERIAL]).args(options).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn()
    }

    fn wait_until_it_answers() {
        let begun = SystemClock.now();
        while !list().iter().any(|found| found.id.ends_with(SERIAL)) {
            assert!(SystemClock.now().since(begun) < Duration::from_secs(20), "the fake camera never answers");
        }
    }

    /// Switches it off.
    pub fn kill(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }

    /// Switches it on again.
    pub fn restart(&mut self) {
        self.process = Self::spawn(&self.options).unwrap();
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

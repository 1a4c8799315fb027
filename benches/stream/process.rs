//! The server in its own process, and the resources that it uses.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use parfocal_base::clock::{Clock, Moment, SystemClock};
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

/// A running server.
pub struct Server {
    process: Child,
    started: Moment,
    /// Its address.
    pub address: SocketAddr,
    /// The operator's key.
    pub key: String,
    data: TempDir,
}

/// Processes that only keep a processor busy; ended when dropped.
pub struct Busy(Vec<Child>);

impl Busy {
    /// Starts this many processes.
    pub fn start(processes: usize) -> Self {
        let start = |_| Command::new("sh").args(["-c", "while :; do :; done"]).spawn().expect("a shell");
        Self((0..processes).map(start).collect())
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        for process in &mut self.0 {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// The command that starts the program. If root starts it and it is not `preferred`, it has no right to real-time
/// priority.
fn program(preferred: bool) -> Command {
    let program = env!("CARGO_BIN_EXE_parfocal");
    if preferred || !rustix::process::geteuid().is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.args(["--bounding-set=-sys_nice", program]);
    command
}

impl Server {
    /// Starts a server with `camera` at this many frames a second. It may have real-time priority if it is `preferred`.
    pub fn start(camera: &str, frames_a_second: u32, preferred: bool) -> Self {
        let data = tempfile::tempdir().expect("a folder");
        let started = SystemClock.now();
        let mut process = program(preferred)
            .args(["serve", "--bind", "127.0.0.1:0", "--seed", "1", "--camera", camera])
            .args(["--fps", &frames_a_second.to_string()])
            .arg("--data-dir")
            .arg(data.path())
            .env("RUST_LOG", "error")
            .stdout(Stdio::piped())
            .spawn()
            .expect("the server");
        let lines = BufReader::new(process.stdout.take().expect("its output")).lines();
        let mut lines = lines.map_while(Result::ok);
        let link = lines.find(|line| line.trim_start().starts_with("operator ")).expect("the operator's link");
        let (host, key) = link.split_once("/enter?key=").expect("a link");
        let port = host.rsplit(':').next().and_then(|port| port.parse().ok()).expect("a port");
        let key = key.trim().to_owned();
        Self { process, started, address: SocketAddr::from(([127, 0, 0, 1], port)), key, data }
    }

    /// Lets `policy` drive the lens.
    pub async fn put_in_charge(&self, policy: &str) {
        self.order("focus", &serde_json::json!({ "policy": policy })).await;
    }

    /// Starts or ends a recording of the mosaics.
    pub async fn record(&self, record: bool) {
        self.order("recording", &serde_json::json!({ "record": record })).await;
    }

    /// Posts `order` to the operator's `path`.
    pub async fn order(&self, path: &str, order: &serde_json::Value) {
        let client = reqwest::Client::builder().no_proxy().build().expect("a client");
        let request = client.post(format!("http://{}/api/operator/{path}", self.address));
        let answer = request.bearer_auth(&self.key).json(order).send().await;
        answer.and_then(reqwest::Response::error_for_status).expect("done");
    }

    /// Time from the start of the process to its first answer.
    pub async fn first_answer(&self) -> Duration {
        let client = reqwest::Client::builder().no_proxy().build().expect("a client");
        client.get(format!("http://{}/healthz", self.address)).send().await.expect("an answer");
        SystemClock.now().since(self.started)
    }

    /// Processor time and memory that it has used so far.
    pub fn usage(&self) -> Counted {
        Counted::of(self.process.id())
    }

    /// Ends it as a service manager would. Returns its data folder.
    pub fn end(&mut self) -> TempDir {
        kill_process(Pid::from_child(&self.process), Signal::TERM).expect("a signal");
        self.process.wait().expect("its end");
        std::mem::replace(&mut self.data, tempfile::tempdir().expect("a folder"))
    }
}

/// Processor time so far by kind of thread, in seconds, and memory.
pub struct Counted {
    control: f64,
    imaging: f64,
    serving: f64,
    resident_mb: u64,
}

/// Shares of a core, in percent, and memory.
pub struct Usage {
    /// The control loop.
    pub control: f64,
    /// The imaging threads: colour, JPEG, content area.
    pub imaging: f64,
    /// The threads that serve pages and streams.
    pub serving: f64,
    /// Resident memory, in MB.
    pub resident_mb: u64,
}

impl Counted {
    fn of(process: u32) -> Self {
        let mut counted = Self { control: 0.0, imaging: 0.0, serving: 0.0, resident_mb: resident_mb(process) };
        for task in fs::read_dir(format!("/proc/{process}/task")).expect("its threads").flatten() {
            let name = fs::read_to_string(task.path().join("comm")).unwrap_or_default();
            let kind = match name.trim() {
                "control" => &mut counted.control,
                name if name.starts_with("imaging") => &mut counted.imaging,
                name if name.starts_with("tokio") => &mut counted.serving,
                _ => continue,
            };
            // The first number is the nanoseconds on a processor.
            let text = fs::read_to_string(task.path().join("schedstat")).unwrap_or_default();
            *kind += text.split(' ').next().and_then(|time| time.parse::<f64>().ok()).unwrap_or_default() / 1e9;
        }
        counted
    }

    /// Usage since `before`, which was `time` ago.
    pub fn since(&self, before: &Self, time: Duration) -> Usage {
        let share = |now: f64, then: f64| (now - then) / time.as_secs_f64() * 100.0;
        Usage {
            control: share(self.control, before.control),
            imaging: share(self.imaging, before.imaging),
            serving: share(self.serving, before.serving),
            resident_mb: self.resident_mb,
        }
    }
}

fn resident_mb(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|kb| kb.parse::<u64>().ok()).unwrap_or_default() / 1024
}

/// A picture for the footage camera, whose window shows three quarters of it, 512 by 272. It has enough detail for a
/// JPEG of about 30 KB.
pub fn picture(folder: &TempDir) -> String {
    let width = 683;
    let height = 363;
    let picture = image::RgbImage::from_fn(width, height, |x, y| {
        let u = f64::from(x);
        let v = f64::from(y);
        let waves = (u / 3.1).sin() * (v / 2.7).cos() + ((u + v) / 9.0).sin() + ((u - 2.0 * v) / 23.0).cos();
        let shade = |offset: f64| (128.0 + 35.0 * (waves + (waves * 1.7 + offset).sin())) as u8;
        image::Rgb([shade(0.0), shade(1.0), shade(2.0)])
    });
    let path = folder.path().join("picture.png");
    picture.save(&path).expect("a picture");
    format!("footage:{}", path.display())
}

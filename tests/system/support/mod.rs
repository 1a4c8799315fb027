//! Starts the real server as its users do, with its own port and folder.

#[path = "../../trial/app.rs"]
mod app;
pub mod disk;
#[cfg(feature = "aravis")]
pub mod fake_camera;
#[path = "../../trial/fixture.rs"]
#[allow(dead_code, reason = "the trial's tests use more of it")]
mod fixture;
mod in_process;
mod requests;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_records::accounts::{Accounts, Cost, Passphrase};
use parfocal_trial::account::{AccountName, AccountRole};
use reqwest::{Client, RequestBuilder, redirect};
use tempfile::TempDir;
use tokio::runtime::Builder;

use self::in_process::{InProcess, on_a_thread};
pub use self::requests::database;
use crate::browser::screenshots::are_wanted as screenshots_are_wanted;

/// A running server; ends when dropped, if it is a process by a kill.
pub struct Server {
    runs: Runs,
    /// Address at which it is reached.
    pub address: SocketAddr,
    /// Everything that it printed until it was ready.
    pub said: String,
    keys: Vec<(String, String)>,
    /// Data folder.
    pub data: Arc<TempDir>,
    /// The camera with which it was started.
    pub camera: String,
}

/// How a server runs.
enum Runs {
    Process(Child),
    /// Within this program; it ends when dropped.
    Within(#[allow(dead_code, reason = "it is dropped")] Box<InProcess>),
}

impl Server {
    /// A server that only this machine can reach.
    pub fn start() -> Self {
        Self::with(&["--bind", "127.0.0.1:0"])
    }

    /// The same, with a camera whose pictures show something. See [`command`].
    pub fn seeing() -> Self {
        Self::with(&["--bind", "127.0.0.1:0", "--camera", BRAIN])
    }

    /// The same as [`Self::start`], encrypted with a certificate of its own local authority.
    pub fn encrypted() -> Self {
        Self::with(&["--bind", "127.0.0.1:0", "--tls"])
    }

    /// A server with these arguments and a new data folder.
    pub fn with(arguments: &[&str]) -> Self {
        Self::on(Arc::new(tempfile::tempdir().unwrap()), arguments)
    }

    /// A server within the test program that only this machine can reach, with a new data folder. It has the same pages
    /// and rules as the others and starts at once; no pictures come, and its clock stands still.
    pub fn within() -> Self {
        Self::within_by(None)
    }

    /// The same with the protocols in a folder.
    pub fn within_by(protocols: Option<&Path>) -> Self {
        Self::within_on(Arc::new(tempfile::tempdir().unwrap()), Ipv4Addr::LOCALHOST, protocols)
    }

    /// The same on a data folder, listening on `address`.
    pub fn within_on(data: Arc<TempDir>, address: Ipv4Addr, protocols: Option<&Path>) -> Self {
        let server = InProcess::start(data.path(), address.into(), protocols);
        let keys: toml::Table = std::fs::read_to_string(data.path().join("keys.toml")).unwrap().parse().unwrap();
        let key = |role: &str| (role.to_owned(), keys[role].as_str().expect("a key is text").to_owned());
        let keys = ["surgeon", "operator", "researcher"].map(key).to_vec();
        let address = SocketAddr::from(([127, 0, 0, 1], server.address.port()));
        Self {
            runs: Runs::Within(Box::new(server)),
            address,
            said: String::new(),
            keys,
            data,
            camera: "none".to_owned(),
        }
    }

    /// A server on a data folder that another server may have used before.
    pub fn on(data: Arc<TempDir>, arguments: &[&str]) -> Self {
        let command = command(data.path(), arguments);
        Self::run(data, command)
    }

    /// The server that `command` starts on `data`.
    pub fn run(data: Arc<TempDir>, mut command: Command) -> Self {
        let camera = command.get_args().skip_while(|argument| *argument != "--camera").nth(1).expect("a camera");
        let camera = camera.to_str().expect("a camera's name is text").to_owned();

        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let mut said = String::new();
        for line in &mut lines {
            let line = line.unwrap();
            said.push_str(&line);
            said.push('\n');
            if line.starts_with("Ctrl-C") {
                break;
            }
        }

        let keys: Vec<_> = said.lines().filter_map(link).collect();
        assert_eq!(keys.len(), 3, "the server did not start:\n{said}");
        let port = said.split("/enter").next().unwrap().rsplit(':').next().unwrap().parse().unwrap();
        Self {
            runs: Runs::Process(process),
            address: SocketAddr::from(([127, 0, 0, 1], port)),
            said,
            keys,
            data,
            camera,
        }
    }

    /// Key of `role`.
    pub fn key(&self, role: &str) -> &str {
        &self.keys.iter().find(|(name, _)| name == role).expect("a role").1
    }

    /// From now on requests of `role` use `key`: the token of a signed-in person, or the key of another link.
    pub fn use_key(&mut self, role: &str, key: &str) {
        let known = self.keys.iter_mut().find(|(name, _)| name == role).expect("a role");
        key.clone_into(&mut known.1);
    }

    /// Makes an account in the server's data folder while it runs, as `parfocal account add` does, but with a hash that
    /// costs little.
    pub fn add_account(&self, name: &str, role: &str, display: &str) {
        let added = async {
            let accounts = Accounts::open(self.data.path(), Arc::new(SystemClock), CHEAP).await.unwrap();
            let (name, role) = (AccountName::new(name).unwrap(), AccountRole::named(role).unwrap());
            accounts.add(name, display, role, Passphrase::new(PASSPHRASE).unwrap(), None).await.unwrap();
            accounts.close().await;
        };

        // A test's runtime, within which this is called, must not wait for it.
        on_a_thread(|| Builder::new_current_thread().enable_all().build().unwrap().block_on(added));
    }

    /// Signs in to account `name`. Returns the token.
    pub async fn sign_in(&self, name: &str) -> String {
        let body = serde_json::json!({"name": name, "passphrase": PASSPHRASE, "as_bearer": true});
        let response = client().post(self.url("/api/sign-in")).json(&body).send().await.unwrap();
        let signed_in: serde_json::Value = response.json().await.unwrap();
        signed_in["token"].as_str().unwrap_or_else(|| panic!("{signed_in}")).to_owned()
    }

    /// Full URL of `path`.
    pub fn url(&self, path: &str) -> String {
        let scheme = if self.said.contains("https://") { "https" } else { "http" };
        format!("{scheme}://{}{path}", self.address)
    }

    /// The link of `role`.
    pub fn link(&self, role: &str) -> String {
        self.url(&format!("/enter?key={}", self.key(role)))
    }

    /// A GET without any credential.
    pub fn get(&self, path: &str) -> RequestBuilder {
        client().get(self.url(path))
    }

    /// A GET with the key of `role`.
    pub fn get_as(&self, role: &str, path: &str) -> RequestBuilder {
        self.get(path).bearer_auth(self.key(role))
    }

    /// A POST with the key of `role`.
    pub fn post_as(&self, role: &str, path: &str) -> RequestBuilder {
        client().post(self.url(path)).bearer_auth(self.key(role))
    }

    /// Process of the server, for signals.
    pub fn pid(&self) -> rustix::process::Pid {
        rustix::process::Pid::from_child(self.process())
    }

    /// Process number of the server.
    pub fn id(&self) -> u32 {
        self.process().id()
    }

    /// Ends the server with `signal`, as Ctrl-C or a service manager would, and waits. Returns whether it succeeded.
    pub fn end(&mut self, signal: rustix::process::Signal) -> bool {
        rustix::process::kill_process(self.pid(), signal).unwrap();
        let Runs::Process(process) = &mut self.runs else { unreachable!("it has a process") };
        process.wait().unwrap().success()
    }

    fn process(&self) -> &Child {
        match &self.runs {
            Runs::Process(process) => process,
            Runs::Within(_) => panic!("a server within the test program has no process of its own"),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Runs::Process(process) = &mut self.runs {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// The phantom's brain under a camera in a hand: what a server shows unless it is told otherwise.
pub const BRAIN: &str = "phantom";

/// The phantom under the lens cap.
pub const DARK: &str = "phantom:dark";

/// `parfocal serve` with `arguments`. Tests that run at the same time share the machine, and drawing the brain takes a
/// core of it. So the camera is dark and slow, unless they say otherwise: a test that looks at a picture says so.
pub fn command(data: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.arg("serve").args(arguments).arg("--data-dir").arg(data).stdin(Stdio::null()).env("RUST_LOG", "warn");
    if !arguments.contains(&"--fps") {
        command.args(["--fps", "5"]);
    }
    if !arguments.contains(&"--camera") {
        // People look at the screenshots.
        command.args(["--camera", if screenshots_are_wanted() { BRAIN } else { DARK }]);
    }
    command
}

/// Runs `parfocal serve`, which must fail. Returns exit code and standard error.
pub fn refused(data: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    refusal(command(data, arguments))
}

/// Runs `command`, a server that must fail. Returns exit code and standard error.
pub fn refusal(mut command: Command) -> (Option<i32>, String) {
    let mut process = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let mut said = String::new();
    process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (process.wait().unwrap().code(), said)
}

/// Runs `parfocal` with `arguments` and `path`. Returns whether it succeeded, and its output.
pub fn parfocal(arguments: &[&str], path: &Path) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_parfocal")).args(arguments).arg(path).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(said).unwrap())
}

/// A cheap cost of passphrases' hashes, because most tests sign in to test something else. A hash says what it cost, so
/// the server spends no more when somebody signs in.
const CHEAP: Cost = Cost { memory_kib: 64, passes: 1 };

/// The passphrase of every account.
pub const PASSPHRASE: &str = "correct horse battery staple";

/// Runs `parfocal account` with `arguments` on `data`, with the passphrase on standard input. Returns whether it
/// succeeded, and its output.
pub fn account(data: &Path, arguments: &[&str]) -> (bool, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.arg("account").args(arguments).arg("--data-dir").arg(data);
    let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut process = piped.spawn().unwrap();
    // A command that needs no passphrase may have ended already.
    let _ = writeln!(process.stdin.take().unwrap(), "{PASSPHRASE}");
    let output = process.wait_with_output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(said).unwrap())
}

/// A client that follows no redirects and keeps no cookies.
pub fn client() -> Client {
    Client::builder().no_proxy().redirect(redirect::Policy::none()).build().unwrap()
}

fn link(line: &str) -> Option<(String, String)> {
    let (role, address) = line.trim().split_once("  ")?;
    Some((role.to_owned(), address.split_once("/enter?key=")?.1.to_owned()))
}

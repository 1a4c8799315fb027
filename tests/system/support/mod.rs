//! Starts the real server as its users do, with its own port and folder.

pub mod disk;
#[cfg(feature = "aravis")]
pub mod fake_camera;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use reqwest::{Client, RequestBuilder, redirect};
use tempfile::TempDir;

/// A running server; killed when dropped.
pub struct Server {
    process: Child,
    /// Address at which it is reached.
    pub address: SocketAddr,
    /// Everything that it printed until it was ready.
    pub said: String,
    keys: Vec<(String, String)>,
    /// Data folder.
    pub data: Arc<TempDir>,
}

impl Server {
    /// A server that only this machine can reach.
    pub fn start() -> Self {
        Self::with(&["--bind", "127.0.0.1:0"])
    }

    /// The same, encrypted with a certificate of its own local authority.
    pub fn encrypted() -> Self {
        Self::with(&["--bind", "127.0.0.1:0", "--tls"])
    }

    /// A server with these arguments and a new data folder.
    pub fn with(arguments: &[&str]) -> Self {
        Self::on(Arc::new(tempfile::tempdir().unwrap()), arguments)
    }

    /// A server on a data folder that another server may have used before.
    pub fn on(data: Arc<TempDir>, arguments: &[&str]) -> Self {
        let command = command(data.path(), arguments);
        Self::run(data, command)
    }

    /// The server that `command` starts on `data`.
    pub fn run(data: Arc<TempDir>, mut command: Command) -> Self {
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
        Self { process, address: SocketAddr::from(([127, 0, 0, 1], port)), said, keys, data }
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

    /// Makes an account in the server's data folder while it runs, as `parfocal account add` does.
    pub fn add_account(&self, name: &str, role: &str, display: &str) {
        let arguments = ["add", name, "--role", role, "--display", display];
        let (done, said) = account(self.data.path(), &arguments);
        assert!(done, "{said}");
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
        rustix::process::Pid::from_child(&self.process)
    }

    /// Process number of the server.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Ends the server with `signal`, as Ctrl-C or a service manager would, and waits. Returns whether it succeeded.
    pub fn end(&mut self, signal: rustix::process::Signal) -> bool {
        rustix::process::kill_process(self.pid(), signal).unwrap();
        self.process.wait().unwrap().success()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// `parfocal serve` with `arguments`. Unless they set it, the frame rate is lower than usual, because tests that run at
/// the same time share the machine, and the phantom takes a core of it.
pub fn command(data: &std::path::Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.arg("serve").args(arguments).arg("--data-dir").arg(data).stdin(Stdio::null()).env("RUST_LOG", "warn");
    if !arguments.contains(&"--fps") {
        command.args(["--fps", "5"]);
    }
    command
}

/// Runs `parfocal serve`, which must fail. Returns exit code and standard error.
pub fn refused(data: &std::path::Path, arguments: &[&str]) -> (Option<i32>, String) {
    refusal(command(data, arguments))
}

/// Runs `command`, a server that must fail. Returns exit code and standard error.
pub fn refusal(mut command: Command) -> (Option<i32>, String) {
    let mut process = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let mut said = String::new();
    process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (process.wait().unwrap().code(), said)
}

/// The passphrase of every account.
pub const PASSPHRASE: &str = "correct horse battery staple";

/// Runs `parfocal account` with `arguments` on `data`, with the passphrase on standard input. Returns whether it
/// succeeded, and its output.
pub fn account(data: &std::path::Path, arguments: &[&str]) -> (bool, String) {
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

//! Chromiums for all tests of this program. One chromedriver starts them. A test borrows a browser and gives it back,
//! and what the test left in it is removed before the next one gets it.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use fantoccini::error::CmdError;
use fantoccini::wd::{TimeoutConfiguration, WebDriverCompatibleCommand};
use fantoccini::{Client, ClientBuilder};
use hyper_util::client::legacy::connect::HttpConnector;
use reqwest::{Method, Url};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};
use tokio::task::JoinHandle;

const NEEDED: &str = "the browser tests need Chromium, its headless shell and its driver; \
                      on Debian: apt-get install chromium chromium-headless-shell chromium-driver";
/// Chromium without the interface around its pages. It starts in a third of the time, and takes a third less of a
/// processor. It has no permissions to ask for, no preferences and no lock on its profile.
const SHELL: &str = "chromium-headless-shell";
const ARGUMENTS: [&str; 8] = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1180,960",
];

/// Chromedriver's words before the port that it has chosen.
const STARTED: &str = "started successfully on port ";

/// A bash script that waits for the end of the test program, however it comes: then the script's input ends. It asks
/// chromedriver at port `$1` to end, with its browsers, and removes their profiles, the folder `$2`. Ended by a signal,
/// chromedriver would leave its browsers running.
const WATCH: &str = r#"
    read -r _
    exec 3<> "/dev/tcp/127.0.0.1/$1" &&
        printf 'POST /shutdown HTTP/1.1\r\nHost: 127.0.0.1:%s\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{}' "$1" >&3 &&
        cat <&3
    rm -rf "$2"
"#;

/// The only chromedriver.
static SERVICE: LazyLock<Service> = LazyLock::new(Service::start);

/// Browsers that no test uses, or that are about to be ready for the next test.
static IDLE: Mutex<Vec<JoinHandle<Option<Chromium>>>> = Mutex::new(Vec::new());

struct Service {
    port: u16,
    /// Talks to the browsers. The runtime of a test ends with the test.
    runtime: Runtime,
    /// Folder of all profiles.
    profiles: TempDir,
    /// Kept open, because a closed pipe would end chromedriver at its next output.
    _said: BufReader<ChildStdout>,
    /// Input of [`WATCH`].
    _watched: ChildStdin,
}

impl Service {
    fn start() -> Self {
        // It looks for a port that is free with IPv4, and ends if another program has that port with IPv6.
        let mut attempts = (0..5).filter_map(|_| start_chromedriver());
        let (port, said) = attempts.next().expect("chromedriver finds a port and says which");

        let profiles = tempfile::tempdir().unwrap();
        let mut watch = Command::new("bash");
        watch.args(["-c", WATCH, "watch", &port.to_string()]).arg(profiles.path());
        // Ctrl-C ends the test program, and not the script.
        watch.process_group(0).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        let watched = watch.spawn().unwrap().stdin.take().expect("piped above");

        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        Self { port, runtime, profiles, _said: said, _watched: watched }
    }
}

/// Starts chromedriver on a port of its choice. `None` if it ended at once.
fn start_chromedriver() -> Option<(u16, BufReader<ChildStdout>)> {
    let mut process = Command::new("chromedriver")
        .arg("--port=0")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap_or_else(|error| panic!("cannot start chromedriver ({error}): {NEEDED}"));

    let mut said = BufReader::new(process.stdout.take().expect("piped above"));
    let mut lines = said.by_ref().lines().map_while(Result::ok);
    let port = lines.find_map(|line| line.split_once(STARTED)?.1.trim_end_matches('.').parse().ok());
    let Some(port) = port else {
        let _ = process.wait();
        return None;
    };
    Some((port, said))
}

/// A running Chromium.
pub struct Chromium {
    /// Controls it.
    pub client: Client,
    /// Its profile, which stands for a tablet's disk; removed with the last browser that uses it.
    pub profile: Arc<TempDir>,
}

/// A browser without memory of anything: one that another test has used, or a new one.
pub async fn borrow() -> Chromium {
    loop {
        let idle = IDLE.lock().unwrap().pop();
        let Some(idle) = idle else { return start_shell().await };
        if let Ok(Some(chromium)) = idle.await {
            return chromium;
        }
    }
}

/// Takes back a browser that has visited `origins`.
pub fn give_back(chromium: Chromium, origins: BTreeSet<String>) {
    let cleaning = SERVICE.runtime.spawn(async move {
        match forget(&chromium.client, &origins).await {
            Ok(()) => Some(chromium),
            Err(error) => {
                eprintln!("a browser is ended, because it cannot be made like a new one: {error}");
                let _ = chromium.client.close().await;
                None
            }
        }
    });
    IDLE.lock().unwrap().push(cleaning);
}

/// Ends a browser.
pub fn end(chromium: Chromium) {
    SERVICE.runtime.spawn(async move {
        let Chromium { client, profile } = chromium;
        let _ = client.close().await;
        drop(profile);
    });
}

/// An empty profile.
pub fn profile() -> Arc<TempDir> {
    Arc::new(tempfile::tempdir_in(SERVICE.profiles.path()).unwrap())
}

/// Starts a whole browser with additional options on `profile`, with these preferences if it is new.
pub async fn start(profile: Arc<TempDir>, options: &[String], preferences: Value) -> Chromium {
    let mut arguments = arguments(&profile);
    arguments.push("--headless=new".to_owned());
    arguments.extend_from_slice(options);
    connect(profile, "chrome", json!({ "args": arguments, "prefs": preferences })).await
}

/// Starts a browser of those that tests share.
async fn start_shell() -> Chromium {
    // Chromedriver looks for whole browsers only.
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let shell = std::env::split_paths(&folders).map(|folder| folder.join(SHELL)).find(|file| file.exists());
    let shell = shell.unwrap_or_else(|| panic!("there is no {SHELL}: {NEEDED}"));

    let profile = profile();
    let options = json!({ "binary": shell, "args": arguments(&profile) });
    connect(profile, "chrome-headless-shell", options).await
}

fn arguments(profile: &TempDir) -> Vec<String> {
    let mut arguments = ARGUMENTS.map(str::to_owned).to_vec();
    arguments.push(format!("--user-data-dir={}", profile.path().display()));
    arguments
}

/// Starts the browser that chromedriver knows as `name`, on `profile`.
async fn connect(profile: Arc<TempDir>, name: &str, options: Value) -> Chromium {
    let wanted = json!({
        "browserName": name,
        "goog:chromeOptions": options,
        "goog:loggingPrefs": { "browser": "ALL" },
    });

    let Value::Object(wanted) = wanted else { unreachable!("an object") };
    let starting = SERVICE.runtime.spawn(async move {
        let mut builder = ClientBuilder::new(HttpConnector::new());
        builder.capabilities(wanted).connect(&format!("http://127.0.0.1:{}", SERVICE.port)).await
    });
    let started = starting.await.expect("it does not panic");
    let client = started.unwrap_or_else(|error| panic!("cannot start Chromium ({error}): {NEEDED}"));

    let timeouts = TimeoutConfiguration::new(Some(Duration::from_mins(1)), Some(Duration::from_mins(1)), None);
    client.update_timeouts(timeouts).await.unwrap();
    Chromium { client, profile }
}

/// Makes a browser forget what a test did in it.
async fn forget(client: &Client, origins: &BTreeSet<String>) -> Result<(), CmdError> {
    // What was emulated, injected or dispatched belongs to a tab and goes with it.
    let used = client.windows().await?;
    let fresh = client.new_window(true).await?.handle;
    for tab in used {
        client.switch_to_window(tab).await?;
        client.close_window().await?;
    }
    client.switch_to_window(fresh).await?;
    tools(client, "Page.bringToFront", json!({})).await?;
    client.release_actions().await?;

    // Cookies do not know ports. Everything else that a page keeps belongs to its origin.
    tools(client, "Network.clearBrowserCookies", json!({})).await?;
    tools(client, "Network.clearBrowserCache", json!({})).await?;
    for origin in origins {
        tools(client, "Storage.clearDataForOrigin", json!({ "origin": origin, "storageTypes": "all" })).await?;
    }
    tools(client, "Browser.resetPermissions", json!({})).await?;
    tools(client, "Browser.setDownloadBehavior", json!({ "behavior": "default" })).await?;
    log(client).await?;
    Ok(())
}

/// Executes a command of the developer tools on the current tab.
pub async fn tools(client: &Client, command: &str, parameters: Value) -> Result<Value, CmdError> {
    chrome(client, "goog/cdp/execute", json!({ "cmd": command, "params": parameters })).await
}

/// Takes what the pages' scripts wrote into the browser's log since the last call.
pub async fn log(client: &Client) -> Result<Value, CmdError> {
    chrome(client, "se/log", json!({ "type": "browser" })).await
}

async fn chrome(client: &Client, path: &'static str, body: Value) -> Result<Value, CmdError> {
    client.issue_cmd(ChromeCommand { path, body }).await
}

/// A command that only chromedriver has.
#[derive(Debug)]
struct ChromeCommand {
    path: &'static str,
    body: Value,
}

impl WebDriverCompatibleCommand for ChromeCommand {
    fn endpoint(&self, base: &Url, session: Option<&str>) -> Result<Url, <Url as std::str::FromStr>::Err> {
        base.join(&format!("session/{}/{}", session.unwrap_or_default(), self.path))
    }

    fn method_and_body(&self, _: &Url) -> (Method, Option<String>) {
        (Method::POST, Some(self.body.to_string()))
    }
}

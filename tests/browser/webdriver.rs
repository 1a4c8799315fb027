//! A browser to drive: headless Chromium through chromedriver, by the W3C `WebDriver` protocol (JSON over HTTP).

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use reqwest::{Client, Method};
use serde_json::{Value, json};

use crate::wait::until;

const ELEMENT: &str = "element-6066-11e4-a52e-4f735466cecf";
const NEEDED: &str =
    "the browser tests need Chromium and its driver; on Debian: apt-get install chromium chromium-driver";
const ARGUMENTS: [&str; 9] = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1180,960",
];

/// A running chromedriver; ends, with its browsers, when dropped.
pub struct Driver {
    process: Child,
    address: String,
    client: Client,
}

impl Driver {
    /// Starts chromedriver on a free port.
    pub async fn start() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let process = Command::new("chromedriver")
            .arg(format!("--port={port}"))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start chromedriver ({error}): {NEEDED}"));
        let driver = Self { process, address: format!("http://127.0.0.1:{port}"), client: crate::support::client() };
        until("chromedriver to be ready", || async { driver.send(Method::GET, "/status", None).await.is_ok() }).await;
        driver
    }

    /// A browser with a fresh profile.
    pub async fn browser(&self) -> Browser<'_> {
        let profile = tempfile::tempdir().unwrap();
        let mut arguments: Vec<_> = ARGUMENTS.iter().map(|argument| (*argument).to_owned()).collect();
        arguments.push(format!("--user-data-dir={}", profile.path().display()));
        let wanted = json!({ "capabilities": { "alwaysMatch": {
            "goog:chromeOptions": { "args": arguments },
            "goog:loggingPrefs": { "browser": "ALL" },
        } } });
        let session = self.send(Method::POST, "/session", Some(wanted)).await;
        let session = session.unwrap_or_else(|error| panic!("cannot start Chromium ({error}): {NEEDED}"));
        Browser { driver: self, session: session["sessionId"].as_str().unwrap().to_owned(), _profile: profile }
    }

    async fn send(&self, method: Method, path: &str, body: Option<Value>) -> Result<Value, String> {
        let request = self.client.request(method, format!("{}{path}", self.address)).timeout(Duration::from_mins(1));
        let request = match body {
            Some(body) => request.header("content-type", "application/json").body(body.to_string()),
            None => request,
        };
        let answer = request.send().await.map_err(|error| error.to_string())?;
        let (status, text) = (answer.status(), answer.text().await.map_err(|error| error.to_string())?);
        let value = serde_json::from_str::<Value>(&text).map_err(|error| error.to_string())?["value"].take();
        if status.is_success() { Ok(value) } else { Err(format!("{}: {}", value["error"], value["message"])) }
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // It ends its browsers when asked to; ended by a signal, it would leave them running.
        let host = self.address.trim_start_matches("http://");
        let asked = TcpStream::connect(host).and_then(|mut line| {
            line.set_read_timeout(Some(Duration::from_secs(10)))?;
            write!(
                line,
                "POST /shutdown HTTP/1.1\r\nHost: {host}\r\nContent-Length: 2\r\nConnection: close\r\n\r\n{{}}"
            )?;
            line.read_to_end(&mut Vec::new())
        });
        if asked.is_err() {
            let _ = self.process.kill();
        }
        let _ = self.process.wait();
    }
}

/// A browser with a profile of its own.
pub struct Browser<'a> {
    driver: &'a Driver,
    session: String,
    _profile: tempfile::TempDir,
}

impl Browser<'_> {
    async fn command(&self, method: Method, path: &str, body: Option<Value>) -> Result<Value, String> {
        self.driver.send(method, &format!("/session/{}{path}", self.session), body).await
    }

    async fn post(&self, path: &str, body: Value) -> Value {
        self.command(Method::POST, path, Some(body)).await.unwrap_or_else(|error| panic!("{path}: {error}"))
    }

    /// Opens `url`.
    pub async fn open(&self, url: &str) {
        self.post("/url", json!({ "url": url })).await;
    }

    /// Loads the page anew.
    pub async fn reload(&self) {
        self.post("/refresh", json!({})).await;
    }

    /// Runs `script`, the body of a function of `arguments`, and gives what it returns.
    pub async fn run(&self, script: &str, arguments: Value) -> Value {
        self.post("/execute/sync", json!({ "script": script, "args": arguments })).await
    }

    /// Text of the element that `css` selects, or empty where there is none or it is not shown.
    pub async fn text(&self, css: &str) -> String {
        let script =
            "const e = document.querySelector(arguments[0]); return e && e.checkVisibility() ? e.innerText : ''";
        self.run(script, json!([css])).await.as_str().unwrap_or_default().to_owned()
    }

    /// Waits until the element that `css` selects is shown and its text contains `text`.
    pub async fn sees(&self, css: &str, text: &str) {
        until(&format!("{css} to say '{text}'"), || async { self.text(css).await.contains(text) }).await;
    }

    /// Waits until nothing that `css` selects is shown.
    pub async fn sees_no(&self, css: &str) {
        let script = "return ![...document.querySelectorAll(arguments[0])].some((e) => e.checkVisibility())";
        until(&format!("{css} to be gone"), || async { self.run(script, json!([css])).await == true }).await;
    }

    /// Clicks, as a pointer does, on what `css` selects, once it can be clicked.
    pub async fn click(&self, css: &str) {
        until(&format!("{css} to be clickable"), || async { self.try_click(css).await }).await;
    }

    /// Clicks on what `css` selects; whether that was possible.
    pub async fn try_click(&self, css: &str) -> bool {
        let Some(element) = self.element(css).await else { return false };
        self.command(Method::POST, &format!("/element/{element}/click"), Some(json!({}))).await.is_ok()
    }

    /// Types `text` into what `css` selects, once it takes keys.
    pub async fn type_into(&self, css: &str, text: &str) {
        until(&format!("{css} to take keys"), || async {
            let Some(element) = self.element(css).await else { return false };
            let keys = Some(json!({ "text": text }));
            self.command(Method::POST, &format!("/element/{element}/value"), keys).await.is_ok()
        })
        .await;
    }

    /// Chooses the option `value` of the list that `css` selects.
    pub async fn select(&self, css: &str, value: &str) {
        let choose = "const list = document.querySelector(arguments[0]); list.value = arguments[1];
                      list.dispatchEvent(new Event('change')); return list.value";
        until(&format!("{css} to offer {value}"), || async { self.run(choose, json!([css, value])).await == value })
            .await;
    }

    async fn element(&self, css: &str) -> Option<String> {
        let found =
            self.command(Method::POST, "/element", Some(json!({ "using": "css selector", "value": css }))).await;
        Some(found.ok()?[ELEMENT].as_str()?.to_owned())
    }

    /// Opens a second tab on `url` and goes there; gives the handle of the first.
    pub async fn new_tab(&self, url: &str) -> Value {
        let first = self.command(Method::GET, "/window", None).await.unwrap();
        let tab = self.post("/window/new", json!({ "type": "tab" })).await;
        self.post("/window", json!({ "handle": tab["handle"] })).await;
        self.open(url).await;
        first
    }

    /// Goes to `tab`; gives the handle of the one left.
    pub async fn to_tab(&self, tab: &Value) -> Value {
        let left = self.command(Method::GET, "/window", None).await.unwrap();
        self.post("/window", json!({ "handle": tab })).await;
        left
    }

    /// Closes the tab and goes back to `tab`.
    pub async fn close_tab(&self, tab: &Value) {
        self.command(Method::DELETE, "/window", None).await.unwrap();
        self.post("/window", json!({ "handle": tab })).await;
    }

    /// A command of the developer tools.
    pub async fn tools(&self, command: &str, parameters: Value) -> Value {
        self.post("/goog/cdp/execute", json!({ "cmd": command, "params": parameters })).await
    }

    /// What the page's scripts complained of since the last call.
    pub async fn complaints(&self) -> Vec<String> {
        let log = self.post("/se/log", json!({ "type": "browser" })).await;
        let severe = log.as_array().into_iter().flatten().filter(|line| line["level"] == "SEVERE");
        severe.map(|line| line["message"].as_str().unwrap_or_default().to_owned()).collect()
    }
}

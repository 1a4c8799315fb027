//! The setup of a trial: the server, the surgeon's browser behind the recording proxy, and the operator's browser; and
//! their actions.

use std::path::Path;
use std::sync::Arc;

use rustix::process::Signal;
use tempfile::TempDir;

use super::driver::{Area, Browser, Driver};
use super::proxy::Proxy;
use super::screenshots;
use super::wait::until;
use crate::support::{BRAIN, DARK, Server};

/// A server with the surgeon's and operator's browsers.
pub struct Theatre {
    /// The server.
    pub server: Server,
    /// The proxy through which the surgeon's browser connects.
    pub proxy: Proxy,
    /// The surgeon's browser.
    pub surgeon: Browser,
    /// The operator's browser.
    pub operator: Browser,
}

/// A server with the simulated lens, the test's protocol, and a camera that sees nothing.
pub fn server() -> Server {
    start(Arc::new(tempfile::tempdir().unwrap()), "127.0.0.1:0", DARK)
}

/// The same with a camera that looks at the brain.
pub fn seeing_server() -> Server {
    start(Arc::new(tempfile::tempdir().unwrap()), "127.0.0.1:0", BRAIN)
}

/// A browser on the operator's page of `server`.
pub async fn operator(driver: &Driver, server: &Server) -> Browser {
    let browser = driver.browser().await;
    browser.open(&server.link("operator")).await;
    browser
}

fn start(data: Arc<TempDir>, address: &str, camera: &str) -> Server {
    let protocols = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/system/browser");
    // People look at the screenshots.
    let camera = if screenshots::are_wanted() { BRAIN } else { camera };
    Server::on(data, &["--bind", address, "--camera", camera, "--protocols", protocols.to_str().unwrap()])
}

/// Ends `server` as a power cut would.
pub fn kill(server: &mut Server) {
    assert!(!server.end(Signal::KILL));
}

/// Starts `server` again, on the same data and address.
pub fn start_again(server: &mut Server) {
    *server = start(Arc::clone(&server.data), &server.address.to_string(), &server.camera);
}

impl Browser {
    /// Waits for the panel over the picture whose heading contains `heading`, and until it takes taps.
    pub async fn sees_panel(&self, heading: &str) {
        self.sees("#panel h2", heading).await;
        self.may_tap("#panel h2").await;
    }

    /// Taps `css` in the panel over the picture, once the panel takes taps.
    pub async fn tap_in_panel(&self, css: &str) {
        self.may_tap(css).await;
        self.click(css).await;
    }

    /// Waits until the panel with `css` takes taps: right after it has appeared it takes none.
    async fn may_tap(&self, css: &str) {
        until("the panel to take taps", || async {
            self.count(css).await > 0 && self.count("#panel[data-fresh]").await == 0
        })
        .await;
    }
}

impl Browser {
    /// The operator presses "Prepare session", and waits until the session is there.
    pub async fn prepare_session(&self) {
        self.click("#new-session [type=submit]").await;
        self.sees("#phase", "Ready to start").await;
    }
}

impl Theatre {
    /// Starts a server and both browsers, which enter by their links. The camera sees nothing.
    pub async fn open(driver: &Driver) -> Self {
        Self::on(driver, Arc::new(tempfile::tempdir().unwrap())).await
    }

    /// The same with a camera that looks at the brain, for tests that look at its pictures.
    pub async fn seeing(driver: &Driver) -> Self {
        Self::before(driver, seeing_server(), &[]).await
    }

    /// The same on the data folder `data`.
    pub async fn on(driver: &Driver, data: Arc<TempDir>) -> Self {
        Self::heard(driver, data, &[]).await
    }

    /// The same, with `arguments` for the surgeon's browser, for example the sound in its microphone.
    pub async fn heard(driver: &Driver, data: Arc<TempDir>, arguments: &[String]) -> Self {
        Self::before(driver, start(data, "127.0.0.1:0", DARK), arguments).await
    }

    async fn before(driver: &Driver, server: Server, arguments: &[String]) -> Self {
        let proxy = Proxy::to(server.address).await;
        let (surgeon, operator) = tokio::join!(driver.browser_with(arguments), driver.browser());
        let surgeons = format!("http://{}/enter?key={}", proxy.address, server.key("surgeon"));
        let operators = server.link("operator");
        tokio::join!(surgeon.open(&surgeons), operator.open(&operators));
        Self { server, proxy, surgeon, operator }
    }

    /// The operator prepares and starts a session of a new participant `participant` by `protocol`.
    pub async fn begin(&self, participant: &str, protocol: &str) {
        self.prepare(participant, protocol).await;
        self.operator.click("#session-actions .primary").await;
    }

    /// The operator prepares a session of a new participant `participant` by `protocol`.
    pub async fn prepare(&self, participant: &str, protocol: &str) {
        let operator = &self.operator;
        operator.click("#add-participant").await;
        operator.type_into("#code", participant).await;
        operator.click("#participant-dialog [type=submit]").await;
        operator.sees_no("#participant-dialog").await;
        operator.select("#protocol", protocol).await;
        operator.prepare_session().await;
    }

    /// The operator enters `reason` in the dialog that asks for one, and confirms.
    pub async fn give_reason(&self, reason: &str) {
        self.operator.type_into("#reason", reason).await;
        self.operator.click("#reason-go").await;
    }

    /// The operator aborts the session, because of `reason`.
    pub async fn abort(&self, reason: &str) {
        self.operator.click_labelled("#session-actions", "Abort").await;
        self.give_reason(reason).await;
    }

    /// The operator writes, after a pause, why it was.
    pub async fn say_why_paused(&self, reason: &str) {
        self.operator.type_into("#pause-reason", reason).await;
        self.operator.click("#reason-wanted [type=submit]").await;
    }

    /// The surgeon taps the notice of setting `number` when it is shown, again and again until the page accepts the
    /// tap.
    pub async fn tap_notice(&self, number: usize) {
        self.surgeon.sees("#change-title", &format!("Setting {number} of ")).await;
        let title = self.surgeon.text("#change-title").await;
        until("the notice to take the tap", || async {
            self.surgeon.try_click("#change-tap").await;
            self.surgeon.text("#change-title").await != title
        })
        .await;

        self.surgeon.sees("#setting", &title).await;
        self.surgeon.sees("#remaining", "left").await;
    }

    /// The surgeon writes `text` at the end of the comment box.
    pub async fn write(&self, text: &str) {
        self.surgeon.click("#comment").await;
        self.surgeon.insert(text).await;
    }

    /// The surgeon writes a comment, presses Enter and sees it saved as the `total`th.
    pub async fn say(&self, text: &str, total: usize) {
        self.write(text).await;
        self.surgeon.type_into("#comment", "\u{e007}").await;
        self.sees_saved(total).await;
    }

    /// Waits until the surgeon sees `total` comments saved.
    pub async fn sees_saved(&self, total: usize) {
        let told = if total == 1 { "1 comment saved".to_owned() } else { format!("{total} comments saved") };
        self.surgeon.sees("#comment-state", &told).await;
    }

    /// Position and size of the live picture on the surgeon's page.
    pub async fn picture(&self) -> Area {
        self.surgeon.area("#view").await
    }

    /// The text in the comment box.
    pub async fn comment_box(&self) -> String {
        self.surgeon.property("#comment", "value").await.unwrap()
    }

    /// The surgeon finishes the setting by two taps. The second is repeated until the page accepts it.
    pub async fn finish(&self) {
        self.surgeon.click("#finish").await;
        until("the setting to be finished", || async {
            self.surgeon.try_click("#finish").await;
            self.surgeon.text("#finish").await.is_empty()
        })
        .await;
    }

    /// The surgeon finishes the setting, answers `point` to its question, and continues.
    pub async fn finish_setting(&self, point: u8) {
        self.finish().await;
        self.answer_questions(point).await;
    }

    /// The surgeon answers the questions after a setting and continues.
    pub async fn answer_questions(&self, point: u8) {
        self.surgeon.sees_panel("a few questions").await;
        self.choose("sharpness", point).await;
        self.surgeon.sees("[data-question=sharpness] > .state", "Saved").await;
        self.surgeon.tap_in_panel(".questions .done button").await;
        self.surgeon.sees_no("[data-question=sharpness]").await;
    }

    /// The surgeon selects point `point` of the scale called `name`, again and again until the page accepts the tap: it
    /// ignores taps right after the questions have appeared.
    pub async fn choose(&self, name: &str, point: u8) {
        let input = format!("input[name='{name}'][value='{point}']");
        self.surgeon.click(&input).await;
        until("the point to be chosen", || async {
            self.surgeon.is(&input, "checked").await || {
                self.surgeon.try_click(&input).await;
                false
            }
        })
        .await;
    }
}

//! A tablet without a network: out of Wi-Fi reach, while the server restarts, without storage. Comments and answers
//! given then are kept, and arrive once and with the time at which they were given. What the browser keeps reveals
//! nothing.

use serde_json::{Value, json};

use super::blinding;
use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::{Theatre, kill, start_again};
use super::wait::until;

/// All entries in this site's caches: path, headers, body in hexadecimal.
const CACHES: &str = "const all = [];
    for (const name of await caches.keys()) {
        const cache = await caches.open(name);
        for (const request of await cache.keys()) {
            const answer = await cache.match(request);
            const head = [...answer.headers].map((pair) => pair.join(': ')).join('\\n');
            const bytes = new Uint8Array(await answer.arrayBuffer());
            const body = Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
            all.push([new URL(request.url).pathname, head, body]);
        }
    }
    return all;";

/// The comments of the session, in the order in which the server has them.
const COMMENTS: &str = "SELECT COALESCE(text, kind) FROM comments ORDER BY number";

const LAST_VIEW: &str = "return localStorage.getItem('parfocal.last-view')";

impl Browser {
    /// Waits until the browser can open the surgeon's page by itself.
    pub async fn keeps_page(&self) {
        let kept = "return (async () => {
            const worker = await navigator.serviceWorker.getRegistration('/surgeon');
            return worker?.active?.state === 'activated' && (await caches.match('/surgeon')) !== undefined;
        })()";
        until("the browser to keep the page", || async { self.run(kept, &[]).await == true }).await;
    }

    /// All entries that the browser keeps to open the page without a network.
    async fn cached(&self) -> Vec<(String, String, Vec<u8>)> {
        let all = self.run(&format!("return (async () => {{ {CACHES} }})()"), &[]).await;
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let entries = all.as_array().unwrap().iter();
        entries.map(|entry| (text(&entry[0]), text(&entry[1]), hex::decode(text(&entry[2])).unwrap())).collect()
    }

    /// The last view of the session that this device keeps; null if it keeps none.
    async fn last_view(&self) -> Value {
        let kept = self.run(LAST_VIEW, &[]).await;
        kept.as_str().map_or(Value::Null, |kept| serde_json::from_str(kept).unwrap())
    }
}

impl Theatre {
    /// The surgeon writes a comment and presses Enter.
    async fn write_comment(&self, text: &str) {
        self.write(text).await;
        self.surgeon.type_into("#comment", "\u{e007}").await;
    }

    /// Waits until the tablet says that it holds `many` unsent items.
    async fn holds(&self, many: &str) {
        self.surgeon.sees("#comment-state", &format!("Saved here: {many}. Sent when the network is back.")).await;
    }

    /// Reloads the surgeon's page while no server answers; the page opens anyway.
    async fn reload_without_network(&self, setting: &str) {
        self.surgeon.reload().await;
        self.surgeon.sees("#setting", setting).await;
        self.surgeon.sees("#now", "No server since").await;
    }

    /// Time of each row of `sql`, minus its wait on the tablet, minus the tablet's own time, in milliseconds. The
    /// tablet's clock is the server's in these tests. Read from the database.
    async fn time_errors(&self, sql: &'static str) -> Vec<f64> {
        let pool = self.server.database().await;
        let errors = sqlx::query_scalar::<_, f64>(sql).fetch_all(&pool).await.unwrap();
        pool.close().await;
        errors
    }
}

/// Milliseconds between the server's time and the tablet's, for each comment.
const COMMENT_ERRORS: &str =
    "SELECT (julianday(wall) - 2440587.5) * 86400000.0 - waited_ms - client_millis FROM comments ORDER BY number";
/// The same for each answer.
const ANSWER_ERRORS: &str =
    "SELECT (julianday(wall) - 2440587.5) * 86400000.0 - waited_ms - client_millis FROM answers ORDER BY number";

/// Tolerance of the times. The comments and answers waited longer than this. Nobody knows how long the last attempt to
/// send took: on a busy machine, to a server that is just starting, some seconds.
const TOLERANCE_MS: f64 = 4000.0;

#[tokio::test(flavor = "multi_thread")]
async fn out_of_reach_in_a_setting_and_in_its_questions_nothing_is_lost_or_doubled() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-30", "short").await;
    theatre.tap_notice(1).await;
    theatre.say("In reach", 1).await;
    surgeon.keeps_page().await;

    theatre.proxy.go_dark();
    theatre.write_comment("Out of reach").await;
    surgeon.sees(".viewer-stale", "seconds old").await;
    surgeon.sees("#now", "No server since").await;
    surgeon.click("#mark").await;
    theatre.holds("2 comments").await;
    shoot(surgeon, "surgeon-30-out-of-reach").await;

    theatre.reload_without_network("Setting 1 of 6").await;
    theatre.holds("2 comments").await;
    surgeon.sees(".viewer-stale", "Waiting for the first picture").await;
    theatre.write_comment("Loaded again").await;
    theatre.holds("3 comments").await;
    shoot(surgeon, "surgeon-31-opened-without-network").await;

    theatre.proxy.come_back();
    theatre.sees_saved(4).await;
    surgeon.sees("#now", "Look around").await;
    theatre.keeps(COMMENTS, &["In reach", "Out of reach", "mark", "Loaded again"]).await;

    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    surgeon.keeps_page().await;
    theatre.proxy.go_dark();
    theatre.choose("sharpness", 3).await;
    theatre.choose("sharpness", 5).await;
    surgeon.type_into("[data-question=remarks] textarea", "Half a remark").await;
    surgeon.sees("#now", "No server since").await;

    theatre.reload_without_network("Setting 1 of 6").await;
    surgeon.sees("#panel h2", "Setting 1: a few questions").await;
    assert!(surgeon.is("input[name=sharpness][value='5']", "checked").await, "the answer given last is shown");
    assert_eq!(surgeon.value("[data-question=remarks] textarea").await, "Half a remark");
    surgeon.sees("[data-question=remarks] > .state", "Saved here").await;
    theatre.choose("sharpness", 6).await;
    surgeon.sees("[data-question=sharpness] > .state", "Saved here").await;
    shoot(surgeon, "surgeon-32-questions-without-network").await;

    theatre.proxy.come_back();
    surgeon.sees("[data-question=sharpness] > .state", "Saved").await;
    theatre.keeps("SELECT value FROM answers WHERE question = 'sharpness' ORDER BY number", &["3", "5", "6"]).await;
    surgeon.tap_in_panel(".questions .done button").await;
    theatre.tap_notice(2).await;
    theatre.keeps("SELECT value FROM answers WHERE question = 'remarks'", &["\"Half a remark\""]).await;
    assert_eq!(surgeon.kept_on_device().await, Vec::<String>::new());

    let comments = theatre.time_errors(COMMENT_ERRORS).await;
    let answers = theatre.time_errors(ANSWER_ERRORS).await;
    assert_eq!((comments.len(), answers.len()), (4, 4));
    let errors: Vec<_> = comments.into_iter().chain(answers).collect();
    assert!(errors.iter().all(|error| error.abs() < TOLERANCE_MS), "{errors:?}");
    blinding::check(&theatre.proxy.recorded());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_restart_of_the_server_and_a_reload_meanwhile_lose_nothing() {
    let driver = Driver::start();
    let mut theatre = Theatre::open(&driver).await;
    theatre.begin("S-31", "short").await;
    theatre.tap_notice(1).await;
    theatre.surgeon.keeps_page().await;
    theatre.write("Half").await;
    kill(&mut theatre.server);

    theatre.surgeon.sees("#now", "No server since").await;
    theatre.reload_without_network("Setting 1 of 6").await;
    until("the draft to be back", || async { theatre.comment_box().await == "Half" }).await;
    theatre.write_comment(" a comment").await;
    theatre.write_comment("Another").await;
    theatre.holds("2 comments").await;

    start_again(&mut theatre.server);
    theatre.sees_saved(2).await;
    theatre.keeps(COMMENTS, &["Half a comment", "Another"]).await;
    theatre.surgeon.sees("#now", "Press “Continue” when you are ready.").await;
    theatre.surgeon.tap_in_panel("#panel button").await;
    theatre.surgeon.sees("#now", "Look around").await;

    let errors = theatre.time_errors(COMMENT_ERRORS).await;
    assert!(errors.iter().all(|error| error.abs() < TOLERANCE_MS), "{errors:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_browser_keeps_tells_nothing_and_goes_with_the_session() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-32", "short").await;
    theatre.tap_notice(1).await;
    theatre.say("Uttered", 1).await;
    surgeon.keeps_page().await;

    let cached = surgeon.cached().await;
    let last = surgeon.last_view().await;
    let seen = blinding::check_kept(&cached, &last["view"]);
    assert!(seen.files.contains("surgeon/page.js") && seen.files.contains("shared/style.css"), "{:?}", seen.files);
    let pages: Vec<_> = cached.iter().map(|(path, ..)| path).filter(|path| !path.starts_with("/static/")).collect();
    assert_eq!(pages, ["/surgeon"], "no answer of the interface, and no other page");
    assert!(cached.iter().all(|(path, ..)| !path.contains("/operator/") && !path.contains("/researcher/")));

    // The policies for what the page may load and use are as strict without a network.
    let (_, head, _) = cached.iter().find(|(path, ..)| path == "/surgeon").unwrap();
    for strict in ["content-security-policy: default-src 'none'", "permissions-policy: camera=()"] {
        assert!(head.contains(strict), "{head}");
    }

    // Neither the page nor its files contain anything of a session.
    let session = last["view"]["session"].as_str().unwrap();
    for (path, head, body) in &cached {
        let text = format!("{head}{}", String::from_utf8_lossy(body));
        assert!(!text.contains(session) && !text.contains("S-32") && !text.contains("Uttered"), "{path}");
    }

    // The next surgeon's page contains nothing of this session.
    theatre.put_away().await;
    surgeon.sees("#panel", "No trial is under way").await;
    assert_eq!(surgeon.last_view().await, Value::Null);
    theatre.proxy.go_dark();
    surgeon.reload().await;
    surgeon.sees("#now", "The server cannot be reached. This page keeps trying.").await;
    assert_eq!(surgeon.text("#setting").await, "Live view");
    theatre.proxy.come_back();
    surgeon.sees("#panel", "No trial is under way").await;

    // A tablet that has lost its access does not open the kept page either.
    surgeon.tools("Network.clearBrowserCookies", json!({})).await;
    surgeon.reload().await;
    surgeon.sees("h1", "Not open to this browser").await;
    assert!(surgeon.cached().await.iter().all(|(path, ..)| path.starts_with("/static/")));

    // Operator and researcher have no service worker at all.
    let workers = "return (async () => (await navigator.serviceWorker.getRegistrations()).length)()";
    assert_eq!(theatre.operator.run(workers, &[]).await, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_device_that_keeps_nothing_says_so_before_the_trial_and_loses_nothing_while_the_page_is_open() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    surgeon.fill_storage().await;
    surgeon.reload().await;
    theatre.prepare("S-33", "short").await;
    surgeon.sees("#panel", "do not close or reload the page").await;
    shoot(surgeon, "surgeon-33-no-storage").await;

    theatre.operator.click("#session-actions .primary").await;
    theatre.tap_notice(1).await;
    theatre.proxy.go_dark();
    theatre.write_comment("Kept in the page").await;
    surgeon.sees("#comment-state", "Kept on this page only, so do not close it: 1 comment.").await;
    theatre.proxy.come_back();
    theatre.sees_saved(1).await;
    theatre.keeps(COMMENTS, &["Kept in the page"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_screen_is_kept_on_during_a_session_and_where_it_is_not_the_page_says_what_to_do() {
    // Counts the locks that the page holds, in place of the browser's own.
    const COUNT: &str = "window.locks = 0;
        navigator.wakeLock.request = async () => {
            window.locks += 1;
            const lock = new EventTarget();
            lock.release = async () => { window.locks -= 1; };
            return lock;
        };";
    const REFUSE: &str = "navigator.wakeLock.request = () => Promise.reject(new DOMException('', 'NotAllowedError'));";

    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    let held = async |count: usize| {
        until("the locks", || async { surgeon.run("return window.locks", &[]).await == count }).await;
    };
    surgeon.before_each_page(COUNT).await;
    surgeon.reload().await;
    surgeon.sees("#panel", "No trial is under way").await;
    held(0).await;
    theatre.begin("S-34", "short").await;
    held(1).await;
    theatre.tap_notice(1).await;
    theatre.put_away().await;
    held(0).await;

    surgeon.before_each_page(REFUSE).await;
    surgeon.reload().await;
    theatre.prepare("S-35", "short").await;
    surgeon.sees("#panel", "Set the tablet so that its screen stays on.").await;
    shoot(surgeon, "surgeon-34-screen-goes-dark").await;
}

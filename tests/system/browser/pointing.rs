//! Pointing at what is to be in focus, and holding it, on the real pages: by taps, mouse and keys, on two tablets.

use serde_json::{Value, json};

use super::accessible;
use super::driver::{Browser, Driver};
use super::screenshots::{resize, shoot};
use super::theatre::{Theatre, kill, operator, seeing_server, start_again};
use super::wait::until;
use crate::support::Server;

/// A tablet held upright and across.
const TABLET: [(u32, u32); 2] = [(820, 1180), (1180, 820)];

/// A place in the view, as fractions of its sides.
const PLACE: (f64, f64) = (0.6, 0.42);

/// Taps the view at `PLACE`, as a finger does.
async fn tap(browser: &Browser) {
    let view = browser.area("#view").await;
    browser.touch("touchStart", &[(view.left + PLACE.0 * view.width, view.top + PLACE.1 * view.height)]).await;
    browser.touch("touchEnd", &[]).await;
}

/// How many points of the overlay around `PLACE` have the colour of ring and corners.
async fn marked(browser: &Browser) -> u64 {
    let count = "const canvas = document.querySelector('.viewer-overlay');
        const [across, down] = arguments;
        const side = Math.round(canvas.width / 3);
        const x = Math.round(canvas.width * across - side / 2);
        const y = Math.round(canvas.height * down - side / 2);
        const { data } = canvas.getContext('2d').getImageData(x, y, side, side);
        let marked = 0;
        for (let at = 0; at < data.length; at += 4) {
            if (data[at] < 120 && data[at + 1] > 200 && data[at + 2] > 200 && data[at + 3] > 200) marked += 1;
        }
        return marked;";
    browser.run(count, &[json!(PLACE.0), json!(PLACE.1)]).await.as_u64().unwrap()
}

/// Waits for a live picture that takes taps: right after a tap on the notice it takes none.
async fn is_live(browser: &Browser) {
    until("a picture", || async {
        browser.is(".viewer-stale", "hidden").await && browser.count("#view[data-fresh]").await == 0
    })
    .await;
}

/// Whether anything is drawn over the picture.
const ANYTHING: &str = "const context = document.querySelector('.viewer-overlay').getContext('2d');
    return context.getImageData(0, 0, 2000, 2000).data.some((value) => value > 0);";

/// Waits until ring or corners stand at `PLACE`, or nothing does.
async fn shows(browser: &Browser, mark: bool) {
    until(if mark { "a mark" } else { "no mark" }, || async { (marked(browser).await > 0) == mark }).await;
}

/// Taps the surgeon's view until a ring stands there: on a busy machine the picture may be too old to be pointed at.
pub async fn point(browser: &Browser) {
    is_live(browser).await;
    tap(browser).await;
    until("a ring", || async {
        if marked(browser).await > 0 {
            return true;
        }
        let refused = browser.text("#trouble").await.contains("not live");
        if refused && browser.is(".viewer-stale", "hidden").await {
            tap(browser).await;
        }
        false
    })
    .await;
}

/// Taps *Centre*, again where the picture was too old, until `other` shows no mark any more.
async fn centre(browser: &Browser, other: &Browser) {
    is_live(browser).await;
    browser.click("#centre").await;
    until("no mark", || async {
        if browser.text("#trouble").await.contains("not live") {
            browser.click("#centre").await;
        }
        marked(other).await == 0
    })
    .await;
}

/// The kinds of the session's events about the focus, with the frames that were on screen.
async fn events(server: &Server) -> Vec<(String, Option<i64>)> {
    let pool = server.database().await;
    let sql =
        "SELECT kind, payload ->> 'frame' FROM events WHERE kind LIKE 'patch-%' OR kind LIKE 'focus-%' ORDER BY number";
    let events = sqlx::query_as(sql).fetch_all(&pool).await.unwrap();
    pool.close().await;
    events
}

async fn kinds(server: &Server) -> Vec<String> {
    events(server).await.into_iter().map(|(kind, _)| kind).collect()
}

async fn surgeon(driver: &Driver, server: &Server) -> Browser {
    let browser = driver.browser().await;
    browser.open(&server.link("surgeon")).await;
    is_live(&browser).await;
    browser
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tap_puts_the_focus_there_on_every_page_and_a_double_tap_still_zooms() {
    let driver = Driver::start();
    let server = seeing_server();
    let (one, other) = (surgeon(&driver, &server).await, surgeon(&driver, &server).await);
    assert_eq!(marked(&one).await, 0);

    // The ring stands within 300 ms of the tap, though the server is told later: measured in the page itself.
    let stands = "const canvas = document.querySelector('.viewer-overlay');
        window.ring = null;
        addEventListener('pointerup', () => {
            const began = performance.now();
            const look = () => {
                const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
                if (data.some((value) => value > 0)) window.ring = performance.now() - began;
                else requestAnimationFrame(look);
            };
            look();
        }, { once: true });";
    one.run(stands, &[]).await;
    point(&one).await;
    until("a ring", || async { one.run("return window.ring", &[]).await.is_number() }).await;
    let took = one.run("return window.ring", &[]).await.as_f64().unwrap();
    println!("the ring stood {took:.0} ms after the tap");

    shows(&one, true).await;
    shows(&other, true).await;
    for (width, height) in TABLET {
        resize(&one, width, height).await;
        accessible::check_reach(&one, &format!("a surgeon's page with Centre at {width}x{height}")).await;
    }
    shoot(&one, "pointing-1-no-session").await;
    centre(&one, &other).await;

    one.double_click("#view").await;
    one.sees(".viewer-unzoom", "2.5×").await;
    one.click(".viewer-unzoom").await;
    one.sees_no(".viewer-unzoom").await;
    assert_eq!(marked(&other).await, 0, "a double tap points nowhere");

    // With the mouse on the operator's page, and by keys alone.
    let operator = operator(&driver, &server).await;
    is_live(&operator).await;
    operator.click("#view").await;
    operator.focus("#view").await;
    until("the choice on the tablet", || async {
        operator.tools("Input.dispatchKeyEvent", key("keyDown", "ArrowRight", 8)).await;
        one.run(ANYTHING, &[]).await == json!(true)
    })
    .await;
    shoot(&operator, "pointing-2-operator").await;
    operator.focus("#view").await;
    // Each choice draws a ring, so the key is pressed again only where the picture was too old for it.
    operator.type_into("#view", "c").await;
    until("the centre again", || async {
        if operator.text("#pointing-trouble").await.contains("not live") {
            operator.type_into("#view", "c").await;
        }
        one.run(ANYTHING, &[]).await == json!(false)
    })
    .await;
}

/// A key event as Chromium's own protocol has it.
fn key(kind: &str, name: &str, modifiers: u32) -> Value {
    json!({ "type": kind, "key": name, "code": name, "modifiers": modifiers })
}

#[tokio::test(flavor = "multi_thread")]
async fn in_a_session_each_tap_and_each_hold_is_an_event_and_outlives_a_reload() {
    let driver = Driver::start();
    let mut theatre = Theatre::seeing(&driver).await;
    theatre.begin("P-01", "pointing").await;
    theatre.tap_notice(1).await;
    point(&theatre.surgeon).await;
    until("the event", || async { kinds(&theatre.server).await == ["patch-placed"] }).await;
    assert!(events(&theatre.server).await[0].1.is_some_and(|frame| frame > 0));
    for (width, height) in TABLET {
        resize(&theatre.surgeon, width, height).await;
        accessible::check_reach(&theatre.surgeon, &format!("pointing at {width}x{height}")).await;
    }
    shoot(&theatre.surgeon, "pointing-3-inspecting").await;

    theatre.surgeon.reload().await;
    is_live(&theatre.surgeon).await;
    shows(&theatre.surgeon, true).await;

    theatre.surgeon.click("#hold").await;
    theatre.surgeon.sees("#hold", "Focus held").await;
    theatre.operator.sees("#hold", "Focus held").await;
    theatre.operator.sees("#log", "Focus held").await;
    shoot(&theatre.surgeon, "pointing-4-held").await;
    shoot(&theatre.operator, "pointing-5-operator-held").await;
    theatre.operator.click("#hold").await;
    theatre.surgeon.sees("#hold", "Hold focus").await;

    // A pedal, while a comment is being written.
    theatre.surgeon.type_into("#comment", "half a sent").await;
    theatre.surgeon.tools("Input.dispatchKeyEvent", key("keyDown", "F24", 0)).await;
    theatre.surgeon.tools("Input.dispatchKeyEvent", key("keyUp", "F24", 0)).await;
    theatre.surgeon.sees("#hold", "Focus held").await;
    assert_eq!(theatre.surgeon.value("#comment").await, "half a sent");
    centre(&theatre.surgeon, &theatre.surgeon).await;
    let expected = ["patch-placed", "focus-held", "focus-released", "focus-held", "patch-centred"];
    until("all events", || async { kinds(&theatre.server).await == expected }).await;

    // Without a server a tap does nothing, now or later, and the page says why.
    kill(&mut theatre.server);
    until("an old picture", || async { !theatre.surgeon.is(".viewer-stale", "hidden").await }).await;
    tap(&theatre.surgeon).await;
    theatre.surgeon.sees("#trouble", "The picture is not live, so the focus was not moved.").await;
    start_again(&mut theatre.server);
    theatre.surgeon.sees("#panel", "Continue").await;
    assert_eq!(kinds(&theatre.server).await, expected);
    assert!(theatre.surgeon.is("#centre", "disabled").await, "one points only while a setting is inspected");

    // Nobody needs to read it any more once the setting has ended.
    theatre.operator.click_labelled("#session-actions", "Resume").await;
    theatre.operator.click_labelled("#session-actions", "End setting 1").await;
    theatre.operator.click("#reason-go").await;
    theatre.surgeon.sees("#change-title", "Setting 2 of ").await;
    assert_eq!(theatre.surgeon.text("#trouble").await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_papers_trial_has_neither_button_and_a_tap_changes_nothing() {
    let driver = Driver::start();
    let theatre = Theatre::seeing(&driver).await;
    theatre.begin("P-02", "short").await;
    theatre.tap_notice(1).await;
    is_live(&theatre.surgeon).await;
    tap(&theatre.surgeon).await;
    theatre.surgeon.sees_no("#centre").await;
    theatre.surgeon.sees_no("#hold").await;
    theatre.finish_setting(1).await;
    assert_eq!(marked(&theatre.surgeon).await, 0);
    assert_eq!(kinds(&theatre.server).await, [""; 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn with_text_of_twice_the_size_the_buttons_stay_in_reach() {
    let driver = Driver::start();
    let mut theatre = Theatre::open(&driver).await;
    let link = theatre.server.link("surgeon");
    theatre.surgeon = driver.browser_with_large_text().await;
    theatre.surgeon.open(&link).await;
    theatre.begin("P-03", "pointing").await;
    theatre.tap_notice(1).await;
    is_live(&theatre.surgeon).await;
    for (width, height) in TABLET {
        resize(&theatre.surgeon, width, height).await;
        accessible::check_reach(&theatre.surgeon, &format!("pointing with large text at {width}x{height}")).await;
    }
    shoot(&theatre.surgeon, "pointing-6-large-text").await;
}

//! The page changes while a surgeon is writing: nothing of the text is lost, and no key does something else.

use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use serde_json::json;

use super::driver::{Browser, Driver};
use super::theatre::Theatre;
use super::wait::until;

const REMARKS: &str = "[data-question=remarks] textarea";

impl Theatre {
    /// The operator ends the session and removes it from the screens.
    pub async fn put_away(&self) {
        self.operator.click_labelled("#session-actions", "Abort").await;
        self.give_reason("Enough").await;
        self.operator.sees("#phase", "Aborted").await;
        self.operator.click("#session-actions .primary").await;
        self.operator.sees("#new-session", "Participant").await;
    }

    /// Answers the questions after a setting on another device.
    async fn answer_elsewhere(&self, driver: &Driver) {
        let other = driver.browser().await;
        other.open(&self.server.link("surgeon")).await;
        other.tap_in_panel("input[name=sharpness][value='3']").await;
        other.sees("[data-question=sharpness] > .state", "Saved").await;
        other.tap_in_panel(".questions .done button").await;
    }

    /// Waits until the result of `sql` in the database is `expected`.
    pub async fn keeps(&self, sql: &'static str, expected: &[&str]) {
        let pool = self.server.database().await;
        until(&format!("{sql} to give {expected:?}"), || async {
            sqlx::query_scalar::<_, String>(sql).fetch_all(&pool).await.unwrap() == expected
        })
        .await;
        pool.close().await;
    }
}

/// Presses a key as a keyboard does; `text` is what it writes, if anything.
async fn press(page: &Browser, key: &str, text: &str, repeat: bool) {
    let code = if key == "Enter" { 13 } else { 0 };
    let down =
        json!({ "type": "keyDown", "key": key, "text": text, "autoRepeat": repeat, "windowsVirtualKeyCode": code });
    page.tools("Input.dispatchKeyEvent", down).await;
    if !repeat {
        page.tools("Input.dispatchKeyEvent", json!({ "type": "keyUp", "key": key, "windowsVirtualKeyCode": code }))
            .await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_left_half_written_is_sent_when_its_question_is_gone() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-07", "short").await;
    theatre.tap_notice(1).await;
    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    // Written and left at once, before the page has sent it.
    surgeon.write_and_leave(REMARKS, "Half an answer").await;
    theatre.put_away().await;
    surgeon.open(&format!("http://{}/surgeon", theatre.proxy.address)).await;
    theatre.keeps("SELECT value FROM answers", &["\"Half an answer\""]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tablet_that_stores_nothing_loses_nothing_that_is_written() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    surgeon.fill_storage().await;
    surgeon.reload().await;
    theatre.begin("S-08", "short").await;
    theatre.tap_notice(1).await;
    theatre.finish().await;
    surgeon.type_into(REMARKS, "Good at rest").await;
    theatre.answer_questions(4).await;
    theatre.keeps("SELECT value FROM answers WHERE question = 'remarks'", &["\"Good at rest\""]).await;
    theatre.tap_notice(2).await;
    theatre.write("Half a comment").await;
    theatre.put_away().await;
    theatre.keeps("SELECT text FROM comments", &["Half a comment"]).await;
    assert_eq!(theatre.comment_box().await, "");
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_of_a_comment_do_not_accept_the_notice_nor_does_a_held_key_finish() {
    const TEXT: &str = "before we begin the light is dim and the view is wet";
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-09", "short").await;
    theatre.tap_notice(1).await;
    theatre.finish().await;
    surgeon.click("#comment").await;
    let (first, rest) = TEXT.split_at(TEXT.len() / 2);
    for letter in first.chars() {
        press(surgeon, &letter.to_string(), &letter.to_string(), false).await;
    }
    // This brings the notice of the next setting.
    theatre.answer_elsewhere(&driver).await;
    surgeon.sees("#change-title", "Setting 2 of ").await;
    for letter in rest.chars() {
        press(surgeon, &letter.to_string(), &letter.to_string(), false).await;
    }
    assert_eq!(theatre.comment_box().await, TEXT);
    surgeon.sees("#change-title", "Setting 2 of ").await;
    theatre.tap_notice(2).await;

    surgeon.focus("#finish").await;
    press(surgeon, "Enter", "\r", false).await;
    surgeon.sees("#finish", "Tap again to finish").await;
    let since = SystemClock.now();
    while SystemClock.now().since(since) < Duration::from_secs(1) {
        press(surgeon, "Enter", "\r", true).await;
    }
    assert!(surgeon.text("#finish").await.contains("Tap again"), "a key held down is one press");
    press(surgeon, "Enter", "\r", false).await;
    surgeon.sees_panel("a few questions").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_box_takes_nothing_before_the_page_knows_what_it_would_be_about() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    // A network that swallows everything, from the page's first moment.
    surgeon.silence().await;
    surgeon.reload().await;
    assert!(surgeon.is("#comment", "disabled").await, "what is typed there could not be kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_comment_left_behind_leaves_the_next_participant_a_box_as_ever() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    theatre.begin("S-10", "short").await;
    theatre.tap_notice(1).await;
    theatre.write(&"so much to say of this ".repeat(6)).await;
    theatre.put_away().await;
    theatre.begin("S-11", "short").await;
    theatre.tap_notice(1).await;
    assert_eq!(theatre.comment_box().await, "");
    assert_eq!(theatre.surgeon.property("#comment", "className").await.as_deref(), Some(""));
    assert_eq!(theatre.surgeon.style("#quick", "visibility").await, "visible");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_comment_that_comes_back_refused_is_still_about_its_setting() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-12", "short").await;
    theatre.tap_notice(1).await;
    // The comment is longer than the server accepts, and its refusal is on the way until the next setting has begun.
    surgeon.hold("/comments").await;
    surgeon.paste("#comment", &"long ".repeat(4000)).await;
    surgeon.click("#send").await;
    theatre.finish().await;
    theatre.answer_elsewhere(&driver).await;
    theatre.tap_notice(2).await;
    surgeon.release().await;
    surgeon.sees("#comment-trouble", "is back in the box").await;
    surgeon.sees("#about", "This comment is about setting 1.").await;
    surgeon.paste("#comment", "short").await;
    surgeon.click("#send").await;
    let sql = "SELECT text || ' ' || setting FROM comments JOIN segments USING (segment)";
    theatre.keeps(sql, &["short 1"]).await;
}

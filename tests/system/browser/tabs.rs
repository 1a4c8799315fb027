//! Two tabs and two tablets of one surgeon: a draft belongs to one of them, and the latest of two answers counts.

use super::driver::{Browser, Driver};
use super::theatre::Theatre;

const COMMENTS: &str = "SELECT text FROM comments ORDER BY number";

/// The selected point of the scale called `name`, if any.
async fn chosen(page: &Browser, name: &str) -> Option<String> {
    page.property(&format!("input[name={name}]:checked"), "value").await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_draft_belongs_to_one_tab_and_a_second_one_offers_it() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    let page = format!("http://{}/surgeon", theatre.proxy.address);
    theatre.begin("S-13", "short").await;
    theatre.tap_notice(1).await;
    theatre.write("Half a thought").await;

    let first = surgeon.new_tab(&page).await;
    surgeon.sees("#elsewhere", "Continue “Half a thought”").await;
    super::screenshots::shoot(surgeon, "surgeon-17-begun-elsewhere").await;
    assert_eq!(theatre.comment_box().await, "", "what is written in one tab is not in the other");
    surgeon.click("#elsewhere").await;
    assert_eq!(theatre.comment_box().await, "Half a thought");
    let second = surgeon.to_tab(&first).await;
    surgeon.sees("#elsewhere", "Continue").await;
    assert_eq!(theatre.comment_box().await, "", "it has gone over");
    surgeon.to_tab(&second).await;
    theatre.say(", whole", 1).await;
    surgeon.sees_no("#elsewhere").await;
    theatre.keeps(COMMENTS, &["Half a thought, whole"]).await;

    // A comment is left half-written in a tab while another is open. When the session ends, it is sent once.
    theatre.write("Left in a tab").await;
    surgeon.to_tab(&first).await;
    surgeon.sees("#elsewhere", "Continue “Left in a tab”").await;
    theatre.put_away().await;
    surgeon.sees("#panel", "No trial is under way").await;
    surgeon.to_tab(&second).await;
    surgeon.sees("#panel", "No trial is under way").await;
    super::wait::until("both tabs to have sent all", || async { surgeon.kept_on_device().await.is_empty() }).await;
    theatre.keeps(COMMENTS, &["Half a thought, whole", "Left in a tab"]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_a_tablet_held_does_not_replace_a_newer_one_of_another() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    let other = driver.browser().await;
    other.open(&theatre.server.link("surgeon")).await;
    theatre.begin("S-14", "short").await;
    theatre.tap_notice(1).await;
    theatre.finish().await;

    surgeon.sees_panel("a few questions").await;
    surgeon.cut("/answers").await;
    theatre.choose("sharpness", 3).await;
    surgeon.sees("[data-question=sharpness] > .state", "Saved here").await;
    other.tap_in_panel("input[name=sharpness][value='5']").await;
    other.sees("[data-question=sharpness] > .state", "Saved").await;

    surgeon.release().await;
    surgeon.sees("[data-question=sharpness] > .state", "Saved").await;
    theatre.keeps("SELECT value FROM answers ORDER BY number", &["5", "3"]).await;
    super::wait::until("the first tablet to show what counts", || async {
        chosen(surgeon, "sharpness").await.as_deref() == Some("5")
    })
    .await;
    assert_eq!(chosen(&other, "sharpness").await.as_deref(), Some("5"));

    // Both report that they hold nothing after the session, and the researcher sees that they disagreed.
    theatre.operator.click_labelled("#session-actions", "Abort").await;
    theatre.give_reason("Enough").await;
    theatre.operator.sees("#phase", "Aborted").await;
    let empty = "SELECT CAST(count(*) AS TEXT) FROM surgeon_devices AS d, events AS e WHERE d.holding = 0
        AND e.kind = 'aborted' AND d.monotonic_ns > e.monotonic_ns";
    theatre.keeps(empty, &["2"]).await;
    let page = &theatre.operator;
    page.open(&theatre.server.link("researcher")).await;
    page.click("td a.button").await;
    page.sees("#aside-list", "3 (another device gave a different answer later; 5 counts)").await;
    page.sees("table.answers", "5").await;
    super::screenshots::shoot(page, "researcher-6-answers-apart").await;
    assert_eq!(page.count(".timeline .aside").await, 1);
}

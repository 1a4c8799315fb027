//! Text at 200 %: on the pages of surgeon and operator nothing is cut off, overlaps or is out of reach, with the tablet
//! held upright or across.

use super::accessible;
use super::driver::{Browser, Driver};
use super::screenshots::{resize, shoot};
use super::theatre::Theatre;

/// A tablet held upright and across.
const TABLET: [(u32, u32); 2] = [(820, 1180), (1180, 820)];

/// Checks the state `name` of a page in both positions of the tablet.
pub(super) async fn look(browser: &Browser, name: &str) {
    for (width, height) in TABLET {
        resize(browser, width, height).await;
        accessible::check_reach(browser, &format!("{name} at {width}x{height}")).await;
    }
    shoot(browser, name).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn text_of_twice_the_size_leaves_every_page_usable() {
    let driver = Driver::start();
    let mut theatre = Theatre::open(&driver).await;
    theatre.surgeon = driver.browser_with_large_text().await;
    theatre.surgeon.open(&theatre.server.link("surgeon")).await;
    theatre.operator = driver.browser_with_large_text().await;
    theatre.operator.open(&theatre.server.link("operator")).await;
    let surgeon = &theatre.surgeon;
    assert_eq!(surgeon.style("html", "font-size").await, "32px");

    surgeon.sees("#panel", "No trial is under way").await;
    look(surgeon, "large-text-surgeon-1-no-session").await;
    look(&theatre.operator, "large-text-operator-1-no-session").await;

    theatre.begin("S-40", "short").await;
    surgeon.sees("#change-title", "Setting 1 of 6").await;
    look(surgeon, "large-text-surgeon-2-notice").await;
    theatre.tap_notice(1).await;
    theatre.say("Large enough to be read at a metre", 1).await;
    look(surgeon, "large-text-surgeon-3-inspecting").await;
    surgeon.click("#overlays summary").await;
    look(surgeon, "large-text-surgeon-4-overlays").await;
    surgeon.click("#overlays summary").await;
    theatre.operator.sees("#phase", "inspecting").await;
    look(&theatre.operator, "large-text-operator-2-inspecting").await;

    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    look(surgeon, "large-text-surgeon-5-questions").await;
    theatre.answer_questions(4).await;
}

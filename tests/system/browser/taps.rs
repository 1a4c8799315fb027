//! How often the surgeon touches the tablet in the paper's trial: each touch is time in which nobody looks at the tissue.

use super::driver::{Browser, Driver};
use super::theatre::Theatre;
use super::wait::until;

/// Counts the touches on a page from now on.
const COUNT: &str =
    "window.touches = 0; addEventListener('pointerdown', () => { window.touches += 1; }, { capture: true });";

/// What the paper's protocol asks after each setting: a tap each on a scale of seven points.
const SCALES: [&str; 3] = ["sharpness", "steadiness", "surgery"];

/// A tap on each notice, a long touch on *Done with this setting*, three answers, *Continue*; at the end the ten items
/// of the questionnaire, and *Continue*. The ranking is left out, since its taps depend on the order.
const TOUCHES: u64 = 6 * (1 + 1 + 3 + 1) + 10 + 1;

#[tokio::test(flavor = "multi_thread")]
async fn the_papers_trial_takes_no_more_touches_than_it_asks_for() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-01", "paper").await;
    surgeon.sees("#change-title", "Setting 1 of 6").await;
    surgeon.run(COUNT, &[]).await;

    let mut too_soon = 0;
    for setting in 1..=6 {
        too_soon += tap_notice(&theatre, setting).await - 1;
        hold(surgeon, "#finish").await;
        for scale in SCALES {
            surgeon.sees_panel(&format!("Setting {setting}: a few questions")).await;
            tap_point(surgeon, scale, 5).await;
            surgeon.sees(&format!("[data-question={scale}] > .state"), "Saved").await;
        }
        surgeon.tap_in_panel(".questions .done button").await;
    }

    surgeon.sees_panel("Final questions").await;
    surgeon.show("[data-question=preference] .confirm").await;
    surgeon.tap_in_panel("[data-question=preference] .confirm").await;
    surgeon.sees("[data-question=preference] > .state", "Saved").await;
    let ranking = 1;

    for item in 0..10 {
        tap_point(surgeon, &format!("usability-{item}"), 3).await;
    }
    surgeon.sees("[data-question=usability] > .state", "Saved").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#panel h2", "Thank you").await;

    let touches = surgeon.run("return window.touches;", &[]).await.as_u64().unwrap();
    assert_eq!(touches - ranking - too_soon, TOUCHES);
}

/// Taps the notice until it takes the tap, and returns how often that was: right after it has appeared it takes none.
async fn tap_notice(theatre: &Theatre, setting: usize) -> u64 {
    let surgeon = &theatre.surgeon;
    let title = format!("Setting {setting} of 6");
    surgeon.sees("#change-title", &title).await;
    let before = surgeon.run("return window.touches;", &[]).await.as_u64().unwrap();
    until("the notice to take the tap", || async {
        surgeon.try_click("#change-tap").await;
        surgeon.text("#change-title").await != title
    })
    .await;
    surgeon.sees("#setting", &title).await;
    surgeon.run("return window.touches;", &[]).await.as_u64().unwrap() - before
}

/// Selects point `point` of the scale called `name` by one tap.
async fn tap_point(surgeon: &Browser, name: &str, point: u8) {
    let input = format!("input[name='{name}'][value='{point}']");
    surgeon.show(&input).await;
    surgeon.click(&input).await;
    until("the point to be chosen", || async { surgeon.is(&input, "checked").await }).await;
}

/// Holds a finger on `css` until that is gone. To let go any sooner would not do.
async fn hold(surgeon: &Browser, css: &str) {
    surgeon.sees(css, "").await;
    let area = surgeon.area(css).await;
    let finger = (area.left + area.width / 2.0, area.top + area.height / 2.0);
    surgeon.touch("touchStart", &[finger]).await;
    surgeon.sees_no(css).await;
    surgeon.touch("touchEnd", &[]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_touch_that_slides_off_finishes_nothing() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-02", "paper").await;
    theatre.tap_notice(1).await;

    let area = surgeon.area("#finish").await;
    let button = (area.left + area.width / 2.0, area.top + area.height / 2.0);
    surgeon.touch("touchStart", &[button]).await;
    until("the button to fill", || async { surgeon.count("#finish.held").await == 1 }).await;
    let picture = theatre.picture().await;
    surgeon.touch("touchMove", &[(area.left, picture.top + 40.0)]).await;
    until("the button to be let go", || async { surgeon.count("#finish.held").await == 0 }).await;
    surgeon.touch("touchEnd", &[]).await;

    // A short tap afterwards is the first of two, so nothing was finished and nothing is half done.
    surgeon.sees("#finish", "Done with this setting").await;
    surgeon.click("#finish").await;
    surgeon.sees("#finish", "Tap again to finish").await;
    surgeon.sees("#setting", "Setting 1 of 6").await;
}

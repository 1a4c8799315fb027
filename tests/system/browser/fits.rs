//! What is needed most has room: the box to write in, the slider in a pause, and the researcher's pages on a
//! telephone.

use super::driver::{Browser, Driver};
use super::instruments::prepare;
use super::screenshots::resize;
use super::theatre::Theatre;

#[tokio::test(flavor = "multi_thread")]
async fn the_box_is_wide_enough_to_write_in_and_a_pause_brings_the_slider_under_the_picture() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let Theatre { surgeon, operator, server, .. } = &theatre;
    resize(surgeon, 1180, 820).await;
    resize(operator, 1366, 900).await;
    prepare(&theatre).await;
    theatre.tap_notice(1).await;
    theatre.write("The vessel is sharp").await;
    surgeon.click("#send").await;
    surgeon.sees("#undo", "Undo").await;
    assert_eq!(surgeon.count("#quick button").await, 0, "without quick comments, one row would hold everything");
    let written = surgeon.area("#comment").await;
    assert!(written.width >= 280.0, "{written:?}");

    surgeon.click("#pause").await;
    operator.sees("#focus-now", "Move the slider to focus by hand.").await;
    let (slider, picture) = (operator.area("#focal-power").await, operator.area("#view").await);
    assert!(slider.top >= picture.bottom() && slider.bottom() <= 900.0, "{slider:?} under {picture:?}");

    // A reason may be one long word.
    let reason = "Lampenwechsel".repeat(8);
    theatre.say_why_paused(&reason).await;
    operator.sees("#log", &reason).await;

    operator.open(&server.link("researcher")).await;
    resize(operator, 390, 844).await;
    operator.sees("tbody", "S-31").await;
    fits_across(operator).await;

    operator.click("td a.button").await;
    operator.sees(".events", &reason).await;
    fits_across(operator).await;
    resize(operator, 768, 1024).await;
    fits_across(operator).await;
}

/// Nothing lies beyond the page's right edge.
async fn fits_across(page: &Browser) {
    let measure = "const { scrollWidth, clientWidth } = document.documentElement; return scrollWidth - clientWidth";
    let beyond = page.run(measure, &[]).await;
    assert_eq!(beyond, 0, "the page scrolls sideways");
}

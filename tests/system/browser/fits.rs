//! What is needed most has room: the box to write in, the slider in a pause, and a list of sessions on a telephone.

use super::driver::Driver;
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

    operator.open(&server.link("researcher")).await;
    resize(operator, 390, 844).await;
    operator.sees("tbody", "S-31").await;
    let beyond = operator.run("return document.documentElement.scrollWidth - innerWidth", &[]).await;
    assert_eq!(beyond, 0, "the page scrolls sideways");
}

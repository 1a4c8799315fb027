//! The operator changes a real camera's settings by typing and tapping; the page refuses wrong values and shows the
//! effect.

use serde_json::Value;

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::operator;
use super::wait::until;
use crate::support::Server;
use crate::support::fake_camera::Fake;

const DELETE: &str = "\u{e017}";

/// The keys, in `WebDriver`'s code, that select everything in a field, type `text` and press Enter.
fn keys(text: &str) -> String {
    format!("\u{e009}a\u{e000}{text}\u{e007}")
}

/// The camera's value of a setting.
async fn value(server: &Server, setting: &str) -> f64 {
    let offer: Value = server.get_as("operator", "/api/operator/camera").send().await.unwrap().json().await.unwrap();
    let settings = offer["settings"].as_array().unwrap();
    settings.iter().find(|one| one["setting"] == setting).unwrap()["value"].as_f64().unwrap()
}

async fn becomes(server: &Server, setting: &str, expected: f64) {
    until(&format!("{setting} to become {expected}"), || async {
        (value(server, setting).await - expected).abs() < 0.5 + expected / 1000.0
    })
    .await;
}

/// The text in the field of a setting.
async fn field(operator: &Browser, setting: &str) -> String {
    operator.property(&format!("#camera-{setting}"), "value").await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_sets_exposure_gain_and_frame_rate() {
    let Some(_fake) = Fake::start(&[]) else { return };
    let camera = "gige:Aravis-Fake-TEST?format=Mono8&width=512&height=512&exposure=10000";
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10", "--camera", camera]);
    let driver = Driver::start();
    let operator = operator(&driver, &server).await;
    operator.sees("#camera-settings", "Exposure, ms").await;
    operator.sees("#camera-settings", "Gain").await;
    operator.sees("#camera-settings", "Frame rate, fps").await;
    assert_eq!(field(&operator, "exposure").await, "10");
    until("a picture", || async { operator.brightness().await > 20.0 }).await;

    // The fake camera's ramp gets darker with a shorter exposure: at 1 ms it is black.
    operator.type_into("#camera-exposure", &keys("1")).await;
    becomes(&server, "exposure", 1000.0).await;
    until("a dark picture", || async { operator.brightness().await < 10.0 }).await;
    operator.click("#camera-settings [aria-label='More exposure']").await;
    becomes(&server, "exposure", 1260.0).await; // a third of a stop: the cube root of 2
    operator.type_into("#camera-exposure", &keys("8")).await;
    until("a bright picture", || async { operator.brightness().await > 20.0 }).await;

    operator.type_into("#camera-frame-rate", &keys("20")).await;
    becomes(&server, "frame-rate", 20.0).await;
    operator.click("#camera-settings [aria-label='Less frame rate']").await;
    operator.click("#camera-settings [aria-label='Less frame rate']").await;
    becomes(&server, "frame-rate", 18.0).await;
    operator.click("#camera-settings [aria-label='More gain']").await;
    becomes(&server, "gain", 1.0).await;

    refused(&operator, &server).await;
    assert_eq!(operator.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
}

/// The camera refuses a value. The page names the bounds in the displayed unit, and shows the old value again.
async fn refused(operator: &Browser, server: &Server) {
    operator.type_into("#camera-exposure", &keys("99999999")).await;
    operator.sees("#camera-trouble", "Exposure must be from ").await;
    operator.sees("#camera-trouble", " ms.").await;
    until("the old value", || async { field(operator, "exposure").await == "8" }).await;
    shoot(operator, "operator-8-camera").await;
    operator.type_into("#camera-gain", &keys(DELETE)).await;
    operator.sees("#camera-trouble", "Gain must be a number").await;
    until("the old value", || async { field(operator, "gain").await == "1" }).await;
    assert!((value(server, "exposure").await - 8000.0).abs() < 1.0);
    operator.type_into("#camera-exposure", &keys("5")).await;
    operator.sees_no("#camera-trouble:not(:empty)").await;
    becomes(server, "exposure", 5000.0).await;
}

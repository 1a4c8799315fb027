//! Spectra of the live picture: for the operator alone, outside sessions alone, and the same numbers as a recording's.

use std::collections::BTreeMap;
use std::process::Command;
use std::sync::Arc;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_recording::Recording;
use reqwest::StatusCode;
use serde_json::{Value, json};

use super::recordings::{abort, begin, order, post, recordings, start, until};
use crate::support::Server;

const PATH: &str = "/api/operator/spectra";

/// Two circles within the phantom's picture.
fn places() -> Value {
    json!({"places": [{"x": 1000.5, "y": 500, "radius": 40}, {"x": 1100, "y": 620.2}]})
}

/// The bands that `parfocal recording spectrum` prints for a place of frame `frame`.
fn printed(recording: &Recording, frame: usize, place: &Value) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    let at = format!("{},{}", place["x"], place["y"]);
    let radius = place["radius"].as_f64().unwrap_or(0.0).to_string();
    command.args(["recording", "spectrum", "--at", &at, "--radius", &radius, "--frames", &frame.to_string()]);
    let table = command.arg(recording.folder()).output().unwrap().stdout;
    let rows = csv::Reader::from_reader(table.as_slice()).into_deserialize::<BTreeMap<String, Option<f64>>>();
    json!(rows.map(Result::unwrap).collect::<Vec<_>>())
}

#[tokio::test]
async fn the_live_spectrum_is_that_of_the_same_frame_in_a_recording() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    order(&server, true).await;
    until(&server, |status| status["frames"].as_u64() >= Some(2)).await;
    let began = SystemClock.now();
    let (status, found) = post(&server, PATH, places()).await;
    println!("two spectra of the next of 10 frames a second came after {:?}", SystemClock.now().since(began));
    assert_eq!(status, StatusCode::OK, "{found}");
    let so_far = until(&server, |_| true).await["frames"].as_u64().unwrap();
    let running = until(&server, |status| status["frames"].as_u64() >= Some(so_far + 3)).await;
    order(&server, false).await;

    let recording = Recording::open(&recordings(&server).join(running["folder"].as_str().unwrap())).unwrap();
    let frame = recording.rows().iter().position(|row| row.number == found["frame"].as_u64().unwrap()).unwrap();
    for (place, spectrum) in places()["places"].as_array().unwrap().iter().zip(found["spectra"].as_array().unwrap()) {
        assert_eq!(spectrum["bands"], printed(&recording, frame, place), "{place}");
        assert_eq!(spectrum["bands"].as_array().unwrap().len(), 16);
    }
    assert_eq!(found["spectra"][1]["cells"], 1);
}

#[tokio::test]
async fn only_the_operator_gets_live_spectra_and_never_while_a_session_is_on_the_screens() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    for role in ["surgeon", "researcher"] {
        let status = server.post_as(role, PATH).json(&places()).send().await.unwrap().status();
        assert_eq!(status, StatusCode::FORBIDDEN, "{role}");
    }

    let (status, said) = post(&server, PATH, places()).await;
    assert_eq!(status, StatusCode::OK, "{said}");
    let session = begin(&server, "places").await;
    assert_refused(&server).await;
    abort(&server, &session).await;
    assert_refused(&server).await;
    let (status, _) = post(&server, "/api/operator/dismissals", json!({ "session": session })).await;
    assert_eq!(status, StatusCode::OK);
    assert_eq!(post(&server, PATH, places()).await.0, StatusCode::OK);
}

async fn assert_refused(server: &Server) {
    let (status, said) = post(server, PATH, places()).await;
    assert_eq!(status, StatusCode::CONFLICT);
    let said = said.as_object().unwrap();
    assert_eq!(said["error"], "a session is under way; spectra of the live picture are shown again once it is closed");
    assert_eq!(said.len(), 1, "{said:?}");
}

#[tokio::test]
async fn places_that_cannot_be_measured_are_refused_in_words() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let six = vec![json!({"x": 9, "y": 9}); 6];
    for (places, words) in [
        (json!([{"x": 2048, "y": 0}]), "the place 2048,0 is outside the picture of 2048x1088 samples"),
        (json!([{"x": 9, "y": 9, "radius": -1}]), "a radius must be 0 or more samples, not -1"),
        (
            json!([{"x": 9, "y": 9, "radius": 257}]),
            "A radius must be 256 samples or less on the live picture, not 257.",
        ),
        (json!(six), "Ask for 1 to 5 places at once, not 6."),
        (json!([]), "Ask for 1 to 5 places at once, not 0."),
    ] {
        let (status, said) = post(&server, PATH, json!({ "places": places })).await;
        assert_eq!((status, &said["error"]), (StatusCode::UNPROCESSABLE_ENTITY, &words.into()));
    }
}

#[tokio::test]
async fn colour_pictures_have_no_spectra() {
    let folder = tempfile::tempdir().unwrap();
    let still = folder.path().join("still.png");
    image::GrayImage::from_pixel(640, 480, image::Luma([90])).save(&still).unwrap();
    let camera = format!("footage:{}", still.display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10", "--camera", &camera]);
    let (status, said) = post(&server, PATH, json!({"places": [{"x": 9, "y": 9}]})).await;
    assert_eq!(status, StatusCode::CONFLICT);
    assert_eq!(said["error"], "The camera delivers colour pictures, which have no spectra.");
}

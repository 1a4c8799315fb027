//! Answers become final: tested with plain requests to the real server, as the pages send them.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::support::Server;

const TABLET: &str = "00000000-0000-4000-8000-00000000000a";

#[tokio::test]
async fn unblinding_asks_first_and_nothing_that_comes_after_it_counts() {
    let server = Server::start();
    let session = server.prepare("S-01", "practice").await;
    let view = server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
    let segment = &view["segment"];
    for action in ["acknowledge", "finish-segment"] {
        server.post("/api/surgeon/actions", json!({"session": session, "action": action, "segment": segment})).await;
    }
    let answer = |number: u32, value: u8| {
        json!({
            "key": format!("00000000-0000-4000-8000-{number:012}"), "session": session, "segment": segment,
            "question": "sharpness", "value": value,
            "device": TABLET, "sequence": number, "waited_millis": 0, "waited_by": "page-clock",
        })
    };

    server.post("/api/surgeon/answers", answer(1, 6)).await;
    server.post("/api/operator/actions", json!({"session": session, "action": "abort", "reason": "over"})).await;
    // The tablet still held this answer, so it counts.
    server.post("/api/surgeon/answers", answer(2, 5)).await;

    let path = format!("/api/researcher/sessions/{session}");
    let unblind = format!("{path}/unblind");
    let unasked = json!({"reason": "analysis"});
    let (status, said) = server.ask("researcher", Method::POST, &unblind, &unasked).await;
    assert!(status == StatusCode::CONFLICT && said.contains("counts until"), "{status} {said}");
    server.post("/api/surgeon/holding", json!({"session": session, "device": TABLET, "holding": 0})).await;
    let (status, _) = server.ask("researcher", Method::POST, &unblind, &unasked).await;
    assert_eq!(status, StatusCode::CONFLICT, "another tablet may hold something still");
    let known = json!({"reason": "analysis", "despite_outstanding": true});
    server.post(&unblind, known).await;

    // It is stored and acknowledged, but nothing counts any more.
    server.post("/api/surgeon/answers", answer(3, 1)).await;
    let detail = server.read(&path).await;
    assert_eq!(detail["answers"][0]["value"], 5, "{detail}");
    let timeline = server.read(&format!("{path}/timeline")).await;
    let aside = &timeline["set_aside"];
    assert_eq!((&aside[0]["value"], &aside[0]["late"], &aside[1]), (&json!(1), &json!(true), &Value::Null));
}

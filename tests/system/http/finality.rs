//! Answers become final: tested with plain requests to the real server, as the pages send them.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::support::{Server, client};

const TABLET: &str = "00000000-0000-4000-8000-00000000000a";

async fn ask(server: &Server, role: &str, method: Method, path: &str, body: &Value) -> (StatusCode, Value) {
    let path = format!("/api/{role}/{path}");
    let request = client().request(method, server.url(&path)).bearer_auth(server.key(role)).json(body);
    let response = request.send().await.unwrap();
    let status = response.status();
    let text = response.text().await.unwrap();
    (status, serde_json::from_str(&text).unwrap_or(Value::Null))
}

async fn post(server: &Server, role: &str, path: &str, body: &Value) -> Value {
    let (status, said) = ask(server, role, Method::POST, path, body).await;
    assert!(status.is_success(), "{path} {body}: {status} {said}");
    said
}

#[tokio::test]
async fn unblinding_asks_first_and_nothing_that_comes_after_it_counts() {
    let server = Server::start();
    post(&server, "operator", "participants", &json!({"code": "S-01"})).await;
    let made = post(&server, "operator", "sessions", &json!({"participant": "S-01", "protocol": "practice"})).await;
    let session = &made["session"];
    let view = post(&server, "operator", "actions", &json!({"session": session, "action": "start"})).await;
    let segment = &view["segment"];
    for action in ["acknowledge", "finish-segment"] {
        post(&server, "surgeon", "actions", &json!({"session": session, "action": action, "segment": segment})).await;
    }
    let answer = |number: u32, value: u8| {
        json!({
            "key": format!("00000000-0000-4000-8000-{number:012}"), "session": session, "segment": segment,
            "question": "sharpness", "value": value,
            "device": TABLET, "sequence": number, "waited_millis": 0, "waited_by": "page-clock",
        })
    };

    post(&server, "surgeon", "answers", &answer(1, 6)).await;
    post(&server, "operator", "actions", &json!({"session": session, "action": "abort", "reason": "over"})).await;
    // The tablet still held this answer, so it counts.
    post(&server, "surgeon", "answers", &answer(2, 5)).await;

    let unblind = format!("sessions/{}/unblind", session.as_str().unwrap());
    let unasked = json!({"reason": "analysis"});
    let (status, said) = ask(&server, "researcher", Method::POST, &unblind, &unasked).await;
    let said = said["error"].as_str().unwrap_or_default().to_owned();
    assert!(status == StatusCode::CONFLICT && said.contains("counts until"), "{status} {said}");
    post(&server, "surgeon", "holding", &json!({"session": session, "device": TABLET, "holding": 0})).await;
    let (status, _) = ask(&server, "researcher", Method::POST, &unblind, &unasked).await;
    assert_eq!(status, StatusCode::CONFLICT, "another tablet may hold something still");
    let known = json!({"reason": "analysis", "despite_outstanding": true});
    post(&server, "researcher", &unblind, &known).await;

    // It is stored and acknowledged, but nothing counts any more.
    post(&server, "surgeon", "answers", &answer(3, 1)).await;
    let session = format!("sessions/{}", session.as_str().unwrap());
    let (_, detail) = ask(&server, "researcher", Method::GET, &session, &Value::Null).await;
    assert_eq!(detail["answers"][0]["value"], 5, "{detail}");
    let (_, timeline) = ask(&server, "researcher", Method::GET, &format!("{session}/timeline"), &Value::Null).await;
    let aside = &timeline["set_aside"];
    assert_eq!((&aside[0]["value"], &aside[0]["late"], &aside[1]), (&json!(1), &json!(true), &Value::Null));
}

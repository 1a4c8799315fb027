//! Corrections, consents, withdrawals and erasures over HTTP: who may make them, and what is refused with which
//! message.

use reqwest::Method;
use serde_json::{Value, json};

use crate::support::Server;

/// Posts `body` as `role`. Returns the status, and the error message if it is refused.
async fn post(server: &Server, role: &str, path: &str, body: &Value) -> (u16, String) {
    let (status, text) = server.ask(role, Method::POST, path, body).await;
    let said = serde_json::from_str::<Value>(&text).unwrap_or_default();
    (status.as_u16(), said["error"].as_str().unwrap_or_default().to_owned())
}

/// Text of the session's second comment.
const OTHER: &str = "the edge of the liver is sharp";

/// A session that was aborted after two comments. Returns its id and the first comment's key.
async fn a_session(server: &Server) -> (String, &'static str) {
    const KEY: &str = "00000000-0000-4000-8000-000000000001";
    let session = server.prepare("S-05", "practice").await;
    let comment = json!({"key": KEY, "session": session, "kind": "text", "text": "Mustermann"});
    server.post("/api/surgeon/comments", comment).await;
    let other =
        json!({"key": "00000000-0000-4000-8000-000000000002", "session": session, "kind": "text", "text": OTHER});
    server.post("/api/surgeon/comments", other).await;
    let abort = json!({"session": session, "action": "abort", "reason": "enough"});
    server.post("/api/operator/actions", abort).await;
    (session, KEY)
}

#[tokio::test]
async fn records_are_put_right_by_the_researcher_alone() {
    let server = Server::within();
    let (session, comment) = a_session(&server).await;
    let base = format!("/api/researcher/sessions/{session}");
    let note = json!({"field": "note", "record": comment, "old": "", "new": "of the monitor", "reason": "for clarity"});
    let erase = json!({"subject": "comment", "record": comment, "reason": "names a patient"});
    let withdraw = json!({"reason": "wants no part in it"});
    let deeds = [("corrections", &note), ("erasures", &erase), ("withdraw", &withdraw)];
    for (path, body) in deeds {
        for role in ["surgeon", "operator"] {
            let (status, said) = post(&server, role, &format!("{base}/{path}"), body).await;
            assert_eq!(status, 403, "{role} {path}: {said}");
        }
        let mut no_reason = body.clone();
        no_reason["reason"] = json!(" ");
        let (status, said) = post(&server, "researcher", &format!("{base}/{path}"), &no_reason).await;
        assert!(status == 422 && said.contains("reason"), "{path}: {status} {said}");
    }

    for (path, body) in deeds {
        let (status, said) = post(&server, "researcher", &format!("{base}/{path}"), body).await;
        assert_eq!((status, said.as_str()), (204, ""), "{path}");
    }
    let (status, said) = post(&server, "researcher", &format!("{base}/corrections"), &note).await;
    assert!(status == 409 && said.contains("the participant withdrew"), "{said}");

    let export = server.get_as("researcher", &format!("{base}/export.zip")).send().await.unwrap();
    assert_eq!(export.status(), 409);
    assert!(export.text().await.unwrap().contains("was withdrawn by the researcher"));
    let page = server.get_as("researcher", &format!("/researcher/sessions/{session}")).send().await.unwrap();
    let page = page.text().await.unwrap();
    assert!(page.contains("no longer shown, analysed or exported") && !page.contains("Mustermann"), "{page}");
    assert!(
        page.contains("by the researcher: wants no part in it") && page.contains("Session aborted: enough"),
        "{page}"
    );
    for rest in ["", "/course", "/timeline"] {
        let said = server.get_as("researcher", &format!("{base}{rest}")).send().await.unwrap();
        assert_eq!(said.status(), if rest.is_empty() { 200 } else { 409 });
        assert!(!said.text().await.unwrap().contains(OTHER), "{rest}");
    }

    // Only the researcher can erase all its words at once.
    let all = format!("{base}/erasures/all");
    let reason = json!({"reason": "the participant asks for it"});
    assert_eq!(post(&server, "operator", &all, &reason).await.0, 403);
    assert_eq!(post(&server, "researcher", &all, &json!({"reason": " "})).await.0, 422);
    assert_eq!(post(&server, "researcher", &all, &reason).await.0, 204);
    let (status, said) = post(&server, "researcher", &all, &reason).await;
    assert!(status == 409 && said.contains("no words of this session are left"), "{said}");
    let database = std::fs::read(server.data.path().join("parfocal.db")).unwrap();
    assert!(!database.windows(OTHER.len()).any(|window| window == OTHER.as_bytes()));
}

#[tokio::test]
async fn an_erased_reason_of_a_pause_is_not_asked_for_again() {
    let server = Server::within();
    let session = server.prepare("S-05", "practice").await;
    let act = async |body: Value| server.post("/api/operator/actions", body).await;
    act(json!({"session": session, "action": "start"})).await;
    act(json!({"session": session, "action": "pause", "reason": "Mustermann bleeds"})).await;
    act(json!({"session": session, "action": "abort", "reason": "enough"})).await;

    let base = format!("/api/researcher/sessions/{session}");
    let log = server.read(&base).await["log"].as_array().unwrap().clone();
    let pause = log.iter().find(|line| line["text"] == "Paused: Mustermann bleeds").unwrap();
    let erase = json!({
        "subject": "event", "record": pause["erasable_event"].to_string(), "reason": "names a patient",
    });
    assert_eq!(post(&server, "researcher", &format!("{base}/erasures"), &erase).await.0, 204);

    // A further event of the session, for which its state is made from all events again.
    let view = act(json!({"session": session, "action": "withdraw", "reason": "wants no part in it"})).await;
    assert_eq!(view["reason_wanted"], Value::Null);
    let again = json!({
        "session": session, "action": "give-reason", "event": pause["erasable_event"], "reason": "bleeding",
    });
    assert_eq!(post(&server, "operator", "/api/operator/actions", &again).await.0, 409);
}

#[tokio::test]
async fn a_consent_that_makes_no_sense_is_refused_with_words() {
    let server = Server::within();
    let (session, _) = a_session(&server).await;
    let good = json!({
        "session": session, "text_version": "2.1", "given_on": "2026-03-01", "obtained_by": "KM", "medium": "paper",
    });
    let consents = "/api/operator/consents";
    for (field, wrong) in [
        ("text_version", json!("")),
        ("obtained_by", json!("x".repeat(81))),
        ("given_on", json!("9000-01-01")),
        ("given_on", json!("yesterday")),
        ("medium", json!("telephone")),
    ] {
        let mut body = good.clone();
        body[field] = wrong;
        let (status, said) = post(&server, "operator", consents, &body).await;
        assert!(status == 422 && !said.is_empty(), "{field}: {status} {said}");
    }
    assert_eq!(post(&server, "surgeon", consents, &good).await.0, 403);
    let mut elsewhere = good.clone();
    elsewhere["session"] = json!("00000000-0000-4000-8000-000000000000");
    assert_eq!(post(&server, "operator", consents, &elsewhere).await.0, 404);
    assert_eq!(post(&server, "operator", consents, &good).await.0, 200);
}

//! The server's log never contains what was said, who said it, or how they got in.

use std::fs::File;
use std::sync::Arc;

use reqwest::{Method, StatusCode};
use rustix::process::Signal;
use serde_json::json;

use super::live::Page;
use crate::support::{PASSPHRASE, Server, client, command};

#[tokio::test]
async fn nothing_personal_and_no_key_stands_in_the_log() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let mut serve = command(data.path(), &["--bind", "127.0.0.1:0", "--fps", "10"]);
    // The most detailed level for our own lines, and every request.
    serve.env("RUST_LOG", "info,parfocal=debug,tower_http=debug").stderr(File::create(&log).unwrap());
    let mut server = Server::run(data, serve);

    server.add_account("ottoline", "lead", "Dr Ottoline Quill");
    let token = server.sign_in("ottoline").await;
    let wrong = json!({"name": "ottoline", "passphrase": "wrong battery wrong staple"});
    let refused = client().post(server.url("/api/sign-in")).json(&wrong).send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::FORBIDDEN);
    for key in [server.key("surgeon"), "misspelled-key"] {
        server.get(&format!("/enter?key={key}")).send().await.unwrap();
    }

    let session = server.prepare("QX-93", "practice").await;
    server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
    let mut page = Page::open(&server, "surgeon").await;
    page.watch(2).await;

    let key = "00000000-0000-4000-8000-000000000001";
    let text = "the zebrafish swims sideways";
    let comment = json!({"key": key, "session": session, "kind": "text", "text": text});
    server.post("/api/surgeon/comments", comment).await;
    let reason = "the patient Zacharias coughed";
    server.post("/api/operator/actions", json!({"session": session, "action": "abort", "reason": reason})).await;
    // A refused request with the words in its body.
    let unknown = json!({"session": key, "action": "abort", "reason": reason});
    let (status, _) = server.ask("operator", Method::POST, "/api/operator/actions", &unknown).await;
    assert_eq!(status, StatusCode::NOT_FOUND);
    assert!(server.end(Signal::TERM));

    let written = std::fs::read_to_string(&log).unwrap();
    assert!(written.contains("ending") && written.contains("/api/surgeon/comments"), "it logs: {written}");
    let keys = ["surgeon", "operator", "researcher"].map(|role| server.key(role).to_owned());
    let secrets =
        keys.iter().map(String::as_str).chain([token.as_str(), PASSPHRASE, "misspelled-key", "wrong battery"]);
    for personal in secrets.chain(["QX-93", "ottoline", "Ottoline", "Quill", "zebrafish", "Zacharias"]) {
        assert!(!written.contains(personal), "'{personal}' is in the log:\n{written}");
    }
}

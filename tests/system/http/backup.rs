//! The backup that a lead gets from the page: who may have it, and that it is a whole database.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::support::{PASSPHRASE, Server, client, parfocal};

const API: &str = "/api/researcher/backup";
const FILE: &str = "/api/researcher/backup.db";

async fn ask(server: &Server, token: &str, method: Method, path: &str, body: &Value) -> (StatusCode, Vec<u8>) {
    let request = client().request(method, server.url(path)).bearer_auth(token).json(body);
    let response = request.send().await.unwrap();
    (response.status(), response.bytes().await.unwrap().to_vec())
}

async fn state(server: &Server, token: &str) -> Value {
    let (status, said) = ask(server, token, Method::GET, API, &Value::Null).await;
    assert_eq!(status, StatusCode::OK);
    serde_json::from_slice(&said).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lead_who_confirms_gets_a_backup_and_nobody_else_does() {
    let server = Server::start();
    for (name, role, display) in [
        ("lead", "lead", "Dr Lead"),
        ("second", "lead", "Dr Second"),
        ("nurse", "operator", "Nurse Op"),
        ("reader", "researcher", "Dr Reader"),
    ] {
        server.add_account(name, role, display);
    }
    let lead = server.sign_in("lead").await;
    let second = server.sign_in("second").await;
    let wish = json!({"passphrase": PASSPHRASE});

    let mut others = Vec::new();
    for name in ["nurse", "reader"] {
        others.push(server.sign_in(name).await);
    }
    others.extend(["surgeon", "operator", "researcher"].map(|role| server.key(role).to_owned()));
    for token in &others {
        for (method, path) in [(Method::POST, API), (Method::GET, API), (Method::GET, FILE)] {
            let (status, _) = ask(&server, token, method.clone(), path, &wish).await;
            assert_eq!(status, StatusCode::FORBIDDEN, "{method} {path}");
        }
    }
    let (status, _) = ask(&server, &lead, Method::POST, API, &json!({"passphrase": "not the passphrase"})).await;
    assert_eq!(status, StatusCode::FORBIDDEN);
    assert_eq!(state(&server, &lead).await, json!({"state": "none"}));
    assert_eq!(ask(&server, &lead, Method::GET, FILE, &Value::Null).await.0, StatusCode::NOT_FOUND);

    let (status, said) = ask(&server, &lead, Method::POST, API, &wish).await;
    assert_eq!(status, StatusCode::OK, "{}", String::from_utf8_lossy(&said));
    let ready = loop {
        let now = state(&server, &lead).await;
        if now["state"] != "running" {
            break now;
        }
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    };
    assert_eq!(ready["state"], "ready", "{ready}");

    // Another lead did not ask for it, and so does not get it.
    assert_eq!(state(&server, &second).await, json!({"state": "none"}));
    assert_eq!(ask(&server, &second, Method::GET, FILE, &Value::Null).await.0, StatusCode::NOT_FOUND);

    let (status, content) = ask(&server, &lead, Method::GET, FILE, &Value::Null).await;
    assert_eq!(status, StatusCode::OK);
    assert_eq!(ready["bytes"], content.len());
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("backup.db");
    std::fs::write(&file, content).unwrap();
    let (verified, said) = parfocal(&["verify", "--head", ready["head"].as_str().unwrap()], &file);
    assert!(verified, "{said}");
    let restore = ["restore", file.to_str().unwrap(), "--data-dir"];
    let (restored, said) = parfocal(&restore, &folder.path().join("restored"));
    assert!(restored, "{said}");

    // It is recorded under the lead's account.
    let pool = server.database().await;
    let by: Vec<String> = sqlx::query_scalar(
        "SELECT account FROM actors JOIN accesses ON record = CAST(accesses.number AS TEXT) AND actors.kind = 'access'
         WHERE accesses.kind = 'backed-up'",
    )
    .fetch_all(&pool)
    .await
    .unwrap();
    pool.close().await;
    assert_eq!(by, ["lead"]);
}

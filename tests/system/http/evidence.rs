//! The chain of records of a real server: complete after the server is killed while it writes, shown on the pages, and
//! extended by everyone who looks.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use rustix::process::Signal;
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use crate::support::{Server, client, parfocal};

async fn head(server: &Server) -> Value {
    server.get_as("operator", "/api/chain/head").send().await.unwrap().json().await.unwrap()
}

#[tokio::test]
async fn after_a_kill_in_mid_writing_the_chain_is_whole_and_each_acknowledged_comment_is_there_once() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let mut server = Server::on(Arc::clone(&data), &["--bind", "127.0.0.1:0"]);
    let session = server.prepare("S-05", "paper").await;
    let mut kept: Vec<String> = Vec::new();
    let keys = Arc::new(AtomicUsize::new(1));

    for _ in 0..3 {
        let acknowledged = Arc::new(AtomicUsize::new(0));
        let talkers: Vec<_> = (0..4)
            .map(|_| {
                let url = server.url("/api/surgeon/comments");
                let key = server.key("surgeon").to_owned();
                let session = session.clone();
                let acknowledged = Arc::clone(&acknowledged);
                let keys = Arc::clone(&keys);
                tokio::spawn(async move {
                    let client = client();
                    let mut kept = Vec::new();
                    loop {
                        let id = uuid::Uuid::from_u128(keys.fetch_add(1, Ordering::Relaxed) as u128).to_string();
                        let body = json!({"key": id, "session": session, "kind": "text", "text": "sharp 🔬"});
                        match client.post(&url).bearer_auth(&key).json(&body).send().await {
                            Ok(answer) if answer.status().is_success() => kept.push(id),
                            Ok(answer) => panic!("{}", answer.status()),
                            Err(_) => return kept,
                        }
                        acknowledged.fetch_add(1, Ordering::Relaxed);
                    }
                })
            })
            .collect();

        while acknowledged.load(Ordering::Relaxed) < 20 {
            assert!(!talkers.iter().any(JoinHandle::is_finished), "a comment was refused while the server ran");
            tokio::task::yield_now().await;
        }
        assert!(!server.end(Signal::KILL));
        for talker in talkers {
            kept.extend(talker.await.unwrap());
        }

        let (verified, said) = parfocal(&["verify"], data.path());
        assert!(verified, "{said}");
        server = Server::on(Arc::clone(&data), &["--bind", "127.0.0.1:0"]);
        let (verified, said) = parfocal(&["verify"], data.path());
        assert!(verified, "while the server runs: {said}");
    }

    let pool = server.database().await;
    let found: Vec<String> = sqlx::query_scalar("SELECT key FROM comments").fetch_all(&pool).await.unwrap();
    pool.close().await;
    for key in &kept {
        assert_eq!(found.iter().filter(|found| *found == key).count(), 1, "{key}");
    }
}

#[tokio::test]
async fn the_head_stands_on_the_pages_and_grows_with_everyone_who_looks() {
    let mut server = Server::start();
    let session = server.prepare("S-05", "paper").await;
    let first = head(&server).await;
    let shown = first["head"].as_str().unwrap();
    assert!(first["hash"].as_str().unwrap().len() == 64 && shown.split(':').nth(1).unwrap().len() == 32, "{first}");
    for (role, path) in [("operator", "/operator"), ("researcher", "/researcher")] {
        let page = server.get_as(role, path).send().await.unwrap().text().await.unwrap();
        assert!(page.contains(shown), "{path}");
    }
    assert_eq!(server.get_as("surgeon", "/api/chain/head").send().await.unwrap().status(), 403);

    let number = async || head(&server).await["number"].as_i64().unwrap();
    let before = number().await;
    let sessions = "/api/researcher/sessions";
    let get = async |path: &str| {
        let answer = server.get_as("researcher", &format!("{sessions}/{session}{path}")).send().await.unwrap();
        assert!(answer.status().is_success(), "{path}");
        answer.bytes().await.unwrap()
    };
    get("/course").await;
    assert_eq!(number().await, before, "without the focal path");
    get("/timeline").await;
    assert_eq!(number().await, before + 1);
    get("/export.zip").await;
    assert!(number().await >= before + 2);
    let entered = number().await;
    assert_eq!(server.get(&format!("/enter?key={}", server.key("operator"))).send().await.unwrap().status(), 303);
    assert_eq!(number().await, entered + 1);
    assert_eq!(server.get("/enter?key=wrong").send().await.unwrap().status(), 403);
    assert_eq!(number().await, entered + 1);

    // A backup made beside the running server proves the head that the page showed.
    let folder = tempfile::tempdir().unwrap();
    let backup = folder.path().join("backup.db");
    let out = backup.to_str().unwrap();
    let (made, said) = parfocal(&["backup", "--out", out, "--data-dir"], server.data.path());
    assert!(made && said.contains("verified"), "{said}");
    let (verified, said) = parfocal(&["verify", "--head", shown], &backup);
    assert!(verified, "{said}");
    let (restored, said) = parfocal(&["restore", out, "--data-dir"], server.data.path());
    assert!(!restored && said.contains("in use by another parfocal server"), "{said}");

    assert!(server.end(Signal::TERM));
    let (restored, said) = parfocal(&["restore", out, "--data-dir"], server.data.path());
    assert!(restored && said.contains("kept as"), "{said}");
    let (verified, said) = parfocal(&["verify", "--head", shown], server.data.path());
    assert!(verified, "{said}");
}

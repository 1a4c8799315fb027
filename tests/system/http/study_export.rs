//! The server exports a whole study: start, progress, download, verification; and what files remain.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use reqwest::StatusCode;
use rustix::process::Signal;
use serde_json::{Value, json};

use super::studies::{act, new_session, on, open, protocols, refused, server, sign_in_as_lead};
use crate::support::disk::SmallDisk;
use crate::support::{Server, database, parfocal};

const EXPORT: &str = "/api/researcher/studies/scope-2026/export";
const ZIP: &str = "/api/researcher/studies/scope-2026/export.zip";

async fn state(server: &Server) -> Value {
    server.read(EXPORT).await
}

/// Waits until the export is no longer being made. Returns its state.
async fn ended(server: &Server) -> Value {
    loop {
        let state = state(server).await;
        if state["state"] != "running" {
            return state;
        }
        assert_eq!(state["unblinded"], false);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

/// Makes, aborts and closes a session of `participant` in the study.
async fn a_session(server: &Server, participant: &str) {
    server.post("/api/operator/participants", json!({"code": participant})).await;
    let made = server.post("/api/operator/sessions", new_session(participant)).await;
    let session = made["session"].clone();
    act(server, "operator", json!({"session": session, "action": "abort", "reason": "the light failed"})).await;
    server.post("/api/operator/dismissals", json!({"session": session})).await;
}

/// The session exports in the chain, each with the account that requested it.
async fn recorded(data: &Path) -> Vec<(String, String)> {
    let pool = database(data).await;
    let sql = "SELECT detail, account FROM accesses JOIN actors ON actors.record = accesses.number
               WHERE accesses.kind = 'exported' AND actors.kind = 'access' ORDER BY accesses.number";
    let found = sqlx::query_as(sql).fetch_all(&pool).await.unwrap();
    pool.close().await;
    found
}

fn in_folder(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, Iterator::count)
}

#[tokio::test]
async fn a_study_is_exported_in_the_background_downloaded_and_verifies() {
    let (_protocols, mut server) = server();
    let data = Arc::clone(&server.data);
    let exports = data.path().join("study-exports");

    // A role's link is not enough.
    assert_eq!(refused(&server, "researcher", EXPORT, json!({})).await.0, 403);
    assert_eq!(server.look("researcher", EXPORT).await.0, StatusCode::FORBIDDEN);

    sign_in_as_lead(&mut server).await;
    assert_eq!(refused(&server, "researcher", EXPORT, json!({})).await.0, 404);
    open(&server).await;
    let (status, said) = refused(&server, "researcher", EXPORT, json!({})).await;
    assert!(status == 409 && said.contains("has no session to export"), "{said}");
    a_session(&server, "S-01").await;
    a_session(&server, "S-02").await;
    let (status, said) = refused(&server, "researcher", EXPORT, json!({"unblinded": true})).await;
    assert!(status == 409 && said.contains("is not unblinded"), "{said}");
    let (status, said) = server.look("researcher", ZIP).await;
    assert!(status == StatusCode::NOT_FOUND && said.contains("Start one on the study's page"), "{said}");
    assert_eq!(state(&server).await, json!({"state": "none"}));

    // If it cannot be written, it fails with a reason, is not recorded, and can be tried again.
    std::fs::write(&exports, "").unwrap();
    server.post(EXPORT, json!({})).await;
    let failed = ended(&server).await;
    assert!(failed["state"] == "failed" && failed["reason"].as_str().unwrap().contains("study-exports"), "{failed}");
    std::fs::remove_file(&exports).unwrap();

    // A monitor may read everything, including exports.
    server.add_account("monitor", "monitor", "Ms Monitor");
    let token = server.sign_in("monitor").await;
    server.use_key("researcher", &token);
    let started = server.post(EXPORT, json!({"unblinded": false})).await;
    assert_eq!(started["state"], "running");
    assert_eq!(ended(&server).await, json!({"state": "ready", "unblinded": false, "sessions": 2}));
    let asked = ("blinded".to_owned(), "monitor".to_owned());
    assert_eq!(recorded(data.path()).await, [asked.clone(), asked]);

    let zip = server.get_as("researcher", ZIP).send().await.unwrap();
    assert_eq!(zip.headers()["content-disposition"], "attachment; filename=\"parfocal-scope-2026.zip\"");
    let zip = zip.bytes().await.unwrap();
    let unpacked = tempfile::tempdir().unwrap();
    zip::ZipArchive::new(Cursor::new(zip)).unwrap().extract(unpacked.path()).unwrap();
    let package = unpacked.path().join("parfocal-scope-2026");
    assert_eq!(in_folder(&package.join("sessions")), 2);
    let (verified, said) = parfocal(&["verify"], &package);
    assert!(verified, "{said}");

    // Only the finished package is kept, and only as long as the server runs.
    assert_eq!(in_folder(&exports), 1);
    let room = std::fs::read_dir(&exports).unwrap().next().unwrap().unwrap().path();
    assert_eq!(in_folder(&room), 1);
    assert!(server.end(Signal::TERM));
    let server = Server::on(Arc::clone(&data), &["--bind", "127.0.0.1:0"]);
    assert!(!exports.exists() && server.said.contains("127.0.0.1"));
}

#[tokio::test]
async fn an_export_leaves_room_for_the_trial() {
    let Some(disk) = SmallDisk::of_megabytes(40) else { return };
    let protocols = protocols();
    let mut server = on(Arc::clone(&disk.folder), protocols.path());
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    a_session(&server, "S-01").await;

    // A twentieth of a small disk stays free, which is 2 MB here.
    disk.fill_but(1_500_000);
    server.post(EXPORT, json!({})).await;
    let failed = ended(&server).await;
    assert!(failed["reason"].as_str().unwrap().contains("has no room for the export"), "{failed}");
    assert_eq!(in_folder(&disk.folder.path().join("study-exports")), 0, "nothing is left of it");

    disk.empty();
    server.post(EXPORT, json!({})).await;
    assert_eq!(ended(&server).await["state"], "ready");
}

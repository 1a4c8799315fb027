//! Disks that really fail: full or read-only, at the start or during a session. Nothing is acknowledged that is not
//! stored.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::Arc;

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use crate::support::disk::{SmallDisk, as_nobody};
use crate::support::{Server, command, refusal, refused};

const LISTEN: [&str; 2] = ["--bind", "127.0.0.1:0"];

/// The surgeon sends a comment.
async fn send(server: &Server, comment: Value) -> (StatusCode, String) {
    server.ask("surgeon", Method::POST, "/api/surgeon/comments", &comment).await
}

fn comment(session: &str, number: u32, text: &str) -> Value {
    json!({"key": format!("00000000-0000-4000-8000-{number:012}"), "session": session, "kind": "text", "text": text})
}

async fn comments(server: &Server) -> Value {
    server.read("/api/surgeon/session").await["comments"].clone()
}

#[tokio::test]
async fn a_disk_that_fills_up_refuses_and_takes_again_when_there_is_room() {
    let Some(disk) = SmallDisk::mount() else { return };
    let server = Server::on(Arc::clone(&disk.folder), &LISTEN);
    let session = server.prepare("S-05", "practice").await;
    let (status, _) = send(&server, comment(&session, 1, "there is room")).await;
    assert_eq!(status, StatusCode::NO_CONTENT);
    disk.fill();
    // There may be space left within the files: send comments until it is used up.
    let mut number = 1;
    let told = loop {
        number += 1;
        let long = "no room ".repeat(1500);
        let (status, told) = send(&server, comment(&session, number, &long)).await;
        if status != StatusCode::NO_CONTENT {
            assert_eq!(status, StatusCode::INSUFFICIENT_STORAGE, "{told}");
            break told;
        }

        assert!(number < 1000, "the disk never fills");
    };

    assert!(told.contains("the disk is full; make room"), "{told}");
    assert_eq!(comments(&server).await, number - 1, "what was refused does not count");
    disk.empty();
    let (status, _) = send(&server, comment(&session, number, "again")).await;
    assert_eq!(status, StatusCode::NO_CONTENT);
    assert_eq!(comments(&server).await, number);
}

#[tokio::test]
async fn nothing_is_acknowledged_while_the_database_is_not_in_its_folder() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let server = Server::on(Arc::clone(&data), &LISTEN);
    let session = server.prepare("S-05", "practice").await;
    let elsewhere = tempfile::tempdir().unwrap();
    let away = elsewhere.path().join("data");

    std::fs::rename(data.path(), &away).unwrap();
    let (status, told) = send(&server, comment(&session, 1, "kept by the tablet")).await;
    assert_eq!(status, StatusCode::INSUFFICIENT_STORAGE, "{told}");
    assert!(told.contains("deleted or moved away") && told.contains("put it back there"), "{told}");

    std::fs::rename(&away, data.path()).unwrap();
    let (status, told) = send(&server, comment(&session, 1, "kept by the tablet")).await;
    assert_eq!(status, StatusCode::NO_CONTENT, "{told}");

    // The server could still write to the deleted file, and all of it would be gone at its end.
    std::fs::remove_file(data.path().join("parfocal.db")).unwrap();
    let (status, told) = send(&server, comment(&session, 2, "lost otherwise")).await;
    assert_eq!(status, StatusCode::INSUFFICIENT_STORAGE, "{told}");
    assert_eq!(comments(&server).await, 1);
}

#[test]
fn a_disk_without_room_is_named_at_the_start() {
    let Some(disk) = SmallDisk::mount() else { return };
    disk.fill();
    let (code, said) = refused(&disk.folder.path().join("data"), &LISTEN);
    assert_eq!(code, Some(1));
    assert!(said.contains("disk is full; make room") && said.lines().count() == 1, "{said}");
    // Space for the folder and its lock, and hardly more.
    disk.empty();
    let room = std::fs::File::create(disk.folder.path().join("room")).unwrap();
    rustix::fs::fallocate(&room, rustix::fs::FallocateFlags::empty(), 0, 48 * 1024).unwrap();
    disk.fill();
    drop(room);
    std::fs::remove_file(disk.folder.path().join("room")).unwrap();
    let (code, said) = refused(&disk.folder.path().join("data"), &LISTEN);
    assert_eq!(code, Some(1));
    assert!(said.contains("disk is full; make room") && said.lines().count() == 1, "{said}");
}

#[test]
fn a_read_only_disk_is_named_at_the_start() {
    let Some(disk) = SmallDisk::mount() else { return };
    disk.make_read_only();
    let (code, said) = refused(disk.folder.path(), &LISTEN);
    assert_eq!(code, Some(1));
    assert!(said.contains("its disk is read-only") && said.contains("--data-dir"), "{said}");
}

fn allow(path: &Path, mode: u32) {
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
}

#[tokio::test]
async fn a_user_without_write_permission_learns_it_at_the_start_and_loses_nothing_in_mid_session() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let Some(start) = as_nobody(&command(data.path(), &LISTEN)) else { return };
    allow(data.path(), 0o755);
    let (code, said) = refusal(start);
    assert_eq!(code, Some(1));
    assert!(said.contains("you may not write there; change its permissions"), "{said}");

    allow(data.path(), 0o777);
    let server = Server::run(Arc::clone(&data), as_nobody(&command(data.path(), &LISTEN)).unwrap());
    let session = server.prepare("S-05", "practice").await;
    for file in ["parfocal.db", "parfocal.db-wal", "parfocal.db-shm"] {
        allow(&data.path().join(file), 0o444);
    }
    allow(data.path(), 0o555);
    // The files are already open, so what the server acknowledges from here on is in them.
    let (status, _) = send(&server, comment(&session, 1, "still kept")).await;
    assert_eq!(status, StatusCode::NO_CONTENT);
    drop(server);
    let (code, said) = refusal(as_nobody(&command(data.path(), &LISTEN)).unwrap());
    assert_eq!(code, Some(1));
    assert!(said.contains("read-only; make it writable"), "{said}");
    allow(data.path(), 0o777);
    for file in ["parfocal.db", "parfocal.db-wal", "parfocal.db-shm"] {
        allow(&data.path().join(file), 0o666);
    }
    let server = Server::run(Arc::clone(&data), as_nobody(&command(data.path(), &LISTEN)).unwrap());
    assert_eq!(comments(&server).await, 1);
}

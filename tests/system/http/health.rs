//! How the server reports its health: that it is well, or what is wrong, in words for people and codes for programs.

use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Emulator, Model};
use reqwest::StatusCode;
use serde_json::{Value, json};
use sqlx::Connection;

use crate::browser::wait::until;
use crate::support::Server;
use crate::support::disk::SmallDisk;

/// Status code, `status`, and the codes of the problems.
async fn health(server: &Server) -> (StatusCode, Value, Vec<String>) {
    let response = server.get("/healthz").send().await.unwrap();
    let code = response.status();
    let told: Value = response.json().await.unwrap();
    let problems = told["problems"].as_array().unwrap();
    let codes = problems.iter().map(|problem| problem["code"].as_str().unwrap().to_owned()).collect();
    (code, told["status"].clone(), codes)
}

async fn becomes(server: &Server, code: StatusCode, status: &str, problems: &[&str]) {
    until(&format!("{status} with {problems:?}"), || async {
        health(server).await == (code, json!(status), problems.iter().map(|&one| one.to_owned()).collect())
    })
    .await;
}

#[tokio::test]
async fn a_lens_that_is_unplugged_degrades_the_server_and_costs_no_restart() {
    let mut lens = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
    let spec = format!("optotune:{}", lens.path().display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10", "--lens", &spec]);
    becomes(&server, StatusCode::OK, "ok", &[]).await;

    lens.unplug();
    becomes(&server, StatusCode::OK, "degraded", &["lens-gone"]).await;
    let told: Value = server.get("/healthz").send().await.unwrap().json().await.unwrap();
    assert_eq!((&told["lens"], &told["camera"]), (&json!(false), &json!(true)));
    assert_eq!(told["problems"][0]["condition"], "degraded");
    assert!(told["problems"][0]["message"].as_str().unwrap().contains("Check its cable"), "{told}");
    assert!(!told.to_string().contains(&*lens.path().display().to_string()), "no device is named: {told}");

    lens.plug_in().unwrap();
    becomes(&server, StatusCode::OK, "ok", &[]).await;
}

#[tokio::test]
async fn a_locked_database_is_reported_while_it_is_locked() {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10"]);
    let other_program = server.lock_database().await;

    // SQLite gives up after 5 seconds. Until then the state is unknown, and the server answers anyway.
    assert_eq!(health(&server).await.0, StatusCode::OK);
    becomes(&server, StatusCode::OK, "degraded", &["database-troubled"]).await;
    other_program.close().await.unwrap();
    becomes(&server, StatusCode::OK, "ok", &[]).await;
}

#[tokio::test]
#[ignore = "takes more than a minute"]
async fn a_database_that_takes_nothing_for_a_minute_is_a_failure() {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10"]);
    let other_program = server.lock_database().await;
    let failing = async {
        while health(&server).await.0 == StatusCode::OK {
            tokio::time::sleep(std::time::Duration::from_secs(1)).await;
        }
    };
    tokio::time::timeout(std::time::Duration::from_secs(100), failing).await.expect("it fails in the end");
    assert_eq!(
        health(&server).await,
        (StatusCode::SERVICE_UNAVAILABLE, json!("failing"), vec!["database-unwritable".to_owned()])
    );

    other_program.close().await.unwrap();
    becomes(&server, StatusCode::OK, "ok", &[]).await;
}

#[tokio::test]
async fn a_small_or_full_disk_is_reported() {
    let Some(disk) = SmallDisk::mount() else { return };
    let server = Server::on(Arc::clone(&disk.folder), &["--bind", "127.0.0.1:0", "--fps", "10"]);
    becomes(&server, StatusCode::OK, "degraded", &["disk-nearly-full"]).await;
    disk.fill();
    becomes(&server, StatusCode::OK, "degraded", &["database-troubled", "disk-nearly-full"]).await;
    disk.empty();
    becomes(&server, StatusCode::OK, "degraded", &["disk-nearly-full"]).await;
}

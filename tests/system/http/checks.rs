//! The operator's report on whether everything is ready for a trial.

use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Emulator, Model};
use serde_json::{Value, json};

use super::live::Page;
use crate::browser::wait::until;
use crate::support::Server;

async fn findings(server: &Server) -> Vec<Value> {
    let answer: Value = server.get_as("operator", "/api/operator/checks").send().await.unwrap().json().await.unwrap();
    answer["findings"].as_array().unwrap().clone()
}

fn about<'a>(findings: &'a [Value], subject: &str) -> &'a Value {
    findings
        .iter()
        .find(|finding| finding["subject"] == subject)
        .unwrap_or_else(|| panic!("no {subject}: {findings:?}"))
}

#[tokio::test]
async fn the_operator_sees_the_checks_of_machine_devices_and_tablet() {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10"]);
    let found = findings(&server).await;
    for subject in ["disk", "data folder", "database", "clock", "network", "camera", "lens", "calibration", "tablet"] {
        let finding = about(&found, subject);
        assert_eq!(finding["advice"].is_null(), finding["verdict"] == "well", "what is not well has advice: {finding}");
    }
    assert_eq!(about(&found, "data folder")["verdict"], "well");
    assert_eq!(about(&found, "database")["verdict"], "well");
    assert_eq!(about(&found, "network")["found"], "Only this machine can connect to the server.");
    assert_eq!(about(&found, "tablet")["found"], "No surgeon's page is open.");
    assert!(about(&found, "lens")["found"].as_str().unwrap().contains("simulated lens"), "{found:?}");

    // A page that tries a tablet opens the connection, too, but says nothing on it.
    let mut trial = Page::open(&server, "surgeon").await;
    trial.message().await;
    assert_eq!(about(&findings(&server).await, "tablet")["found"], "No surgeon's page is open.");
    drop(trial);

    let mut page = Page::open(&server, "surgeon").await;
    page.say(json!({"type": "screen", "width": 1180})).await;
    page.watch(1).await;
    until("the tablet is seen", || async {
        about(&findings(&server).await, "tablet")["found"].as_str().unwrap().contains("1180 pixels wide")
    })
    .await;

    page.say(json!({"type": "visible", "visible": false})).await;
    until("the tablet sleeps", || async { about(&findings(&server).await, "tablet")["verdict"] == "advice" }).await;
    drop(page);
    until("the tablet has left", || async {
        about(&findings(&server).await, "tablet")["found"] == "No surgeon's page is open."
    })
    .await;
}

#[tokio::test]
async fn a_lens_that_was_cold_at_the_start_is_well_once_it_is_warm() {
    let emulator = Emulator::start(Model { serial: *b"AREA0042", ..Model::default() }, Arc::new(SystemClock)).unwrap();
    emulator.set_temperature(12.0);
    let lens = format!("optotune:{}", emulator.path().display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "10", "--lens", &lens]);
    assert_eq!(about(&findings(&server).await, "lens")["verdict"], "advice");

    emulator.set_temperature(25.0);
    until("the lens is well", || async { about(&findings(&server).await, "lens")["verdict"] == "well" }).await;
    let found = findings(&server).await;
    assert!(about(&found, "lens")["found"].as_str().unwrap().contains("serial number AREA0042: 5.0 to 10.0 dpt"));
}

/// The dynamics may be those of a lens that is switched on only after the server.
#[tokio::test]
async fn the_server_waits_for_the_lens_that_was_measured_and_warns_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let dynamics = folder.path().join("dynamics.toml");
    let measured = "driver = \"Optotune Lens Driver 4\"\nserial = \"AREA0042\"\ndate = \"2026-03-01T10:00:00Z\"\n\
                    delay_ms = 3.0\nsettling_ms = 20.0\nhysteresis = 0.01\n";
    std::fs::write(&dynamics, measured).unwrap();

    let model = Model { serial: *b"AREA0043", ..Model::default() };
    let mut emulator = Emulator::start(model, Arc::new(SystemClock)).unwrap();
    emulator.unplug();
    let lens = format!("optotune:{}", emulator.path().display());
    let dynamics = dynamics.to_str().unwrap();
    let options = ["--bind", "127.0.0.1:0", "--fps", "10", "--lens", &lens, "--lens-dynamics", dynamics];
    let server = Server::with(&options);
    assert_eq!(about(&findings(&server).await, "lens")["verdict"], "wrong", "it is not there");

    emulator.plug_in().unwrap();
    until("the other lens is told", || async {
        let found = findings(&server).await;
        let lens = about(&found, "lens");
        lens["verdict"] == "advice" && lens["found"].as_str().unwrap().contains("was measured on lens AREA0042")
    })
    .await;
}

#[tokio::test]
async fn only_the_operator_sees_the_checks() {
    let server = Server::within();
    for role in ["surgeon", "researcher"] {
        let answer = server.get_as(role, "/api/operator/checks").send().await.unwrap();
        assert_eq!(answer.status().as_u16(), 403, "{role}");
    }
}

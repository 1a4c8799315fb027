//! The operator's report on whether everything is ready for a trial.

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
async fn only_the_operator_sees_the_checks() {
    let server = Server::within();
    for role in ["surgeon", "researcher"] {
        let answer = server.get_as(role, "/api/operator/checks").send().await.unwrap();
        assert_eq!(answer.status().as_u16(), 403, "{role}");
    }
}

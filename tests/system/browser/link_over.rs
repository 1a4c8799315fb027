//! The page of a tablet whose link has ended with its session: what was half written is sent from there, and the server
//! is told that nothing is left.

use serde_json::json;

use super::driver::Driver;
use super::wait::until;
use crate::http::studies::{act, new_session, open, server_within, sign_in_as_lead, take_session_link};

#[tokio::test(flavor = "multi_thread")]
async fn what_was_half_written_when_the_link_ended_is_sent_and_nothing_stays_outstanding() {
    let (_protocols, mut server) = server_within();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-01")).await;
    let session = &made["session"];
    take_session_link(&mut server).await;

    let tablet = Driver::start().browser().await;
    tablet.open(&server.link("surgeon")).await;
    act(&server, "operator", json!({"session": session, "action": "start"})).await;
    tablet.sees("#change-title", "Setting 1 of 2").await;
    until("the notice to take the tap", || async {
        tablet.try_click("#change-tap").await;
        !tablet.text("#change-title").await.contains("Setting 1")
    })
    .await;
    tablet.click("#comment").await;
    tablet.insert("Half a thought").await;

    // The tablet is away while the session is aborted and closed.
    tablet.open("about:blank").await;
    act(&server, "operator", json!({"session": session, "action": "abort", "reason": "the light failed"})).await;
    server.post("/api/operator/dismissals", json!({"session": session})).await;
    tablet.open(&server.url("/surgeon")).await;
    tablet.sees("main", "which has ended").await;
    tablet.sees("#held", "Everything on this tablet has been saved.").await;
    super::screenshots::shoot(&tablet, "surgeon-link-over").await;

    let pool = server.database().await;
    let texts: Vec<String> = sqlx::query_scalar("SELECT text FROM comments").fetch_all(&pool).await.unwrap();
    assert_eq!(texts, ["Half a thought"]);
    until("the server to know that nothing is left", || async {
        let sql = "SELECT holding FROM surgeon_devices";
        let holding: Option<i64> = sqlx::query_scalar(sql).fetch_optional(&pool).await.unwrap();
        holding == Some(0)
    })
    .await;
    pool.close().await;
}

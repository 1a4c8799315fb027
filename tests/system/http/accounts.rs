//! People on a real server: signing in and out, what a study asks of whom, and the surgeon's link to one session.

use std::process::Command;

use reqwest::header::{COOKIE, SET_COOKIE};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::{connect_async, tungstenite};
use uuid::Uuid;

use super::live::{Page, upgrade};
use super::studies::{act, ask, new_session, open, post, refused, server, sign_in_as_lead, take_session_link};
use crate::support::{PASSPHRASE, Server, account, client};

async fn sign_in(server: &Server, name: &str, passphrase: &str) -> Response {
    let body = json!({"name": name, "passphrase": passphrase});
    client().post(server.url("/api/sign-in")).json(&body).send().await.unwrap()
}

async fn status(server: &Server, path: &str, cookie: &str) -> u16 {
    server.get(path).header(COOKIE, cookie).send().await.unwrap().status().as_u16()
}

#[tokio::test]
async fn whoever_signs_in_has_the_pages_of_the_role_until_it_is_ended() {
    let server = Server::start();
    server.add_account("lead", "lead", "Dr Lead");
    server.add_account("operator", "operator", "Nurse Op");

    let wrong = sign_in(&server, "operator", "something else").await;
    assert_eq!(wrong.status(), StatusCode::FORBIDDEN);
    assert!(wrong.headers().get(SET_COOKIE).is_none());
    let said: Value = wrong.json().await.unwrap();
    assert!(said["error"].as_str().unwrap().contains("do not belong together"), "{said}");

    let response = sign_in(&server, "operator", PASSPHRASE).await;
    let header = response.headers()[SET_COOKIE].to_str().unwrap().to_owned();
    assert!(header.contains("HttpOnly") && header.contains("SameSite=Strict") && header.contains("Max-Age=43200"));
    let cookie = header.split(';').next().unwrap().to_owned();
    let said: Value = response.json().await.unwrap();
    assert_eq!(
        said,
        json!({"account": "operator", "display": "Nurse Op", "role": "operator", "disabled": false,
               "home": "/operator", "token": null})
    );

    // No link is needed, and no other role comes with it.
    assert_eq!(status(&server, "/operator", &cookie).await, 200);
    assert_eq!(status(&server, "/researcher", &cookie).await, 403);
    assert_eq!(status(&server, "/surgeon", &cookie).await, 403);
    let page = server.get("/operator").header(COOKIE, &cookie).send().await.unwrap().text().await.unwrap();
    assert!(page.contains("Nurse Op"), "the page says who is signed in");

    let out = client().post(server.url("/api/sign-out")).header(COOKIE, &cookie).send().await.unwrap();
    assert_eq!(out.status(), StatusCode::NO_CONTENT);
    assert_eq!(status(&server, "/operator", &cookie).await, 403);

    // A command ends what a browser is doing, at once.
    let token = server.sign_in("operator").await;
    let bearer = async || server.get("/operator").bearer_auth(&token).send().await.unwrap().status().as_u16();
    assert_eq!(bearer().await, 200);
    let (done, said) = account(server.data.path(), &["disable", "operator"]);
    assert!(done && said.contains("all its sign-ins have ended"), "{said}");
    assert_eq!(bearer().await, 403);
    assert_eq!(sign_in(&server, "operator", PASSPHRASE).await.status(), StatusCode::FORBIDDEN);
}

#[tokio::test]
async fn the_command_line_keeps_accounts_and_refuses_what_does_not_fit() {
    let nothing = tempfile::tempdir().unwrap();
    let (done, said) = account(nothing.path(), &["add", "lead", "--role", "lead"]);
    assert!(!done && said.contains("start `parfocal serve` once"), "{said}");

    let server = Server::start();
    let on = |arguments: &[&str]| account(server.data.path(), arguments);
    assert_eq!(on(&["list"]), (true, "no accounts yet\n".to_owned()));
    server.add_account("lead", "lead", "Dr Lead");
    for (arguments, expected) in [
        (&["add", "lead", "--role", "lead"][..], "there is an account 'lead' already"),
        (&["add", "A b", "--role", "lead"], "lower-case letters"),
        (&["add", "b", "--role", "boss"], "there are: lead, operator, researcher, monitor"),
        (&["disable", "lead"], "the last account that leads"),
        (&["role", "lead", "monitor"], "the last account that leads"),
        (&["passphrase", "nobody"], "there is no account 'nobody'; there are: lead"),
    ] {
        let (done, said) = on(arguments);
        assert!(!done && said.contains(expected), "{arguments:?}: {said}");
    }

    server.add_account("m", "monitor", "Monitor of the sponsor");
    let (done, said) = on(&["role", "m", "researcher"]);
    assert!(done && said.contains("account m has the role researcher now\nchain "), "{said}");
    let (_, said) = on(&["list"]);
    assert_eq!(said, "lead (Dr Lead): lead\nm (Monitor of the sponsor): researcher\n");
    let (_, said) = on(&["list", "--json"]);
    assert!(!said.contains("hash") && !said.contains("salt"), "{said}");
}

/// What touches a session of a study: path and body, if it changes something.
fn doors(session: &str) -> Vec<(&'static str, String, Option<Value>)> {
    let of = |rest: &str| format!("/api/researcher/sessions/{session}{rest}");
    let reason = json!({"reason": "because"});
    let consent = json!({"session": session, "text_version": "1", "given_on": "2026-01-02", "obtained_by": "Dr A",
                         "medium": "paper"});
    let note = json!({"field": "participant", "old": "S-01", "new": "S-02", "reason": "a slip"});
    vec![
        ("operator", "/api/operator/sessions".to_owned(), Some(new_session("S-01"))),
        ("operator", "/api/operator/actions".to_owned(), Some(json!({"session": session, "action": "start"}))),
        ("operator", "/api/operator/consents".to_owned(), Some(consent)),
        ("operator", "/api/operator/dismissals".to_owned(), Some(json!({"session": session}))),
        ("operator", "/api/operator/surgeon-link".to_owned(), None),
        ("researcher", format!("/researcher/sessions/{session}"), None),
        ("researcher", of(""), None),
        ("researcher", of("/course"), None),
        ("researcher", of("/timeline"), None),
        ("researcher", of("/recordings"), None),
        ("researcher", of("/export.zip"), None),
        ("researcher", of("/corrections"), Some(note)),
        ("researcher", of("/erasures"), Some(json!({"subject": "comment", "record": "x", "reason": "because"}))),
        ("researcher", of("/withdraw"), Some(reason.clone())),
        ("researcher", of("/unblind"), Some(reason)),
        ("researcher", "/researcher/studies/scope-2026".to_owned(), None),
        ("researcher", "/api/researcher/studies/scope-2026".to_owned(), None),
        ("researcher", "/researcher/studies/scope-2026/analysis".to_owned(), None),
        ("researcher", "/api/researcher/studies/scope-2026/analysis".to_owned(), None),
        ("researcher", "/api/researcher/studies/scope-2026/analysis.zip".to_owned(), None),
        (
            "researcher",
            "/api/researcher/studies/scope-2026/changes".to_owned(),
            Some(json!({"change": "close", "reason": "because"})),
        ),
    ]
}

#[tokio::test]
async fn a_study_opens_only_to_people_and_to_each_what_the_role_may() {
    let (_protocols, mut server) = server();
    let links = ["operator", "researcher"].map(|role| (role, server.key(role).to_owned()));
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    post(&server, "operator", "/api/operator/participants", json!({"code": "S-01"})).await;
    let made = post(&server, "operator", "/api/operator/sessions", new_session("S-01")).await;
    let session = made["session"].as_str().unwrap().to_owned();

    let through = async |server: &Server, role: &str| {
        let mut refusals = Vec::new();
        for (of, path, body) in doors(&session) {
            let method = if body.is_some() { Method::POST } else { Method::GET };
            let changes = body.is_some();
            let (status, said) = ask(server, of, method, &path, &body.unwrap_or_default()).await;
            let said: Value = serde_json::from_str(&said).unwrap_or_default();
            let asks = said["sign_in"] == json!(true);
            assert!(!asks || status == StatusCode::FORBIDDEN, "{role}: {path}");
            refusals.push((path, changes, status == StatusCode::FORBIDDEN, asks));
        }
        refusals
    };

    // The links alone: nothing, and each refusal says where to sign in.
    for (role, key) in &links {
        server.use_key(role, key);
    }
    for (path, _, refused, asks) in through(&server, "the links").await {
        assert!(refused && asks, "{path}");
    }
    let page = server.get_as("researcher", "/researcher/studies/scope-2026").header("accept", "text/html");
    let page = page.send().await.unwrap().text().await.unwrap();
    assert!(page.contains("href=\"/sign-in?next=/researcher/studies/scope-2026\""), "{page}");

    // A monitor reads what a researcher reads, and changes nothing.
    server.add_account("monitor", "monitor", "Monitor");
    let token = server.sign_in("monitor").await;
    for role in ["operator", "researcher"] {
        server.use_key(role, &token);
    }
    for (path, changes, refused, _) in through(&server, "monitor").await {
        let reads = !changes && !path.contains("operator");
        assert_eq!(refused, !reads, "{path}");
    }

    // A researcher does not operate, and neither locks nor unblinds.
    server.add_account("researcher", "researcher", "Dr Search");
    let token = server.sign_in("researcher").await;
    server.use_key("researcher", &token);
    let unblind = json!({"reason": "bleeding", "passphrase": PASSPHRASE});
    let (code, said) =
        self::refused(&server, "researcher", &format!("/api/researcher/sessions/{session}/unblind"), unblind).await;
    assert!(
        code == 403 && said.contains("Only a lead locks and unblinds; you are signed in as Dr Search, researcher"),
        "{said}"
    );

    // An operator acts, and is named.
    server.add_account("operator", "operator", "Nurse Op");
    let token = server.sign_in("operator").await;
    server.use_key("operator", &token);
    post(&server, "operator", "/api/operator/actions", json!({"session": session, "action": "start"})).await;
    let view = ask(&server, "operator", Method::GET, "/api/operator/session", &Value::Null).await.1;
    let view: Value = serde_json::from_str(&view).unwrap();
    let started = view["log"].as_array().unwrap().iter().find(|line| line["text"] == "Session started").unwrap();
    assert_eq!((started["account"].as_str(), view["study"].as_str()), (Some("operator"), Some("scope-2026")));
}

#[tokio::test]
async fn locking_and_unblinding_ask_for_the_passphrase_once_more() {
    let (_protocols, mut server) = server();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    let changes = "/api/researcher/studies/scope-2026/changes";
    post(&server, "researcher", changes, json!({"change": "close", "reason": "over"})).await;

    let (code, said) = refused(&server, "researcher", changes, json!({"change": "lock", "reason": "over"})).await;
    assert!(code == 422 && said.contains("passphrase"), "{said}");
    let wrong = json!({"change": "lock", "reason": "over", "passphrase": "not this one"});
    let (code, said) = refused(&server, "researcher", changes, wrong).await;
    assert!(code == 403 && said.contains("This is not your passphrase. Nothing was changed"), "{said}");
    let study =
        post(&server, "researcher", changes, json!({"change": "lock", "reason": "over", "passphrase": PASSPHRASE}))
            .await;
    assert_eq!(study["stage"], "locked");
    let last = study["log"].as_array().unwrap().last().unwrap().clone();
    assert_eq!((last["person"].as_str(), last["by"].as_str()), (Some("Dr Lead"), Some("researcher")));

    let verified = Command::new(env!("CARGO_BIN_EXE_parfocal")).arg("verify").arg(server.data.path()).output().unwrap();
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
}

#[tokio::test]
async fn a_surgeons_link_is_for_one_session_and_ends_with_it() {
    let (_protocols, mut server) = server();
    let shared = server.key("surgeon").to_owned();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    let mut shared_page = Page::open(&server, "surgeon").await;
    post(&server, "operator", "/api/operator/participants", json!({"code": "S-01"})).await;
    let made = post(&server, "operator", "/api/operator/sessions", new_session("S-01")).await;
    let session = made["session"].clone();

    // The shared link opens nothing of a study, and a page that was open is closed.
    assert_eq!(closed(&mut shared_page).await, CloseCode::from(4403));
    let (status, said) = ask(&server, "surgeon", Method::GET, "/api/surgeon/session", &Value::Null).await;
    assert!(status == 403 && said.contains("has a link of its own"), "{said}");

    take_session_link(&mut server).await;
    let link = server.key("surgeon").to_owned();
    assert_ne!(link, shared);
    let entered = server.get(&format!("/enter?key={link}")).send().await.unwrap();
    let cookie = entered.headers()[SET_COOKIE].to_str().unwrap().split(';').next().unwrap().to_owned();
    assert!(!cookie.contains(&link), "the cookie gives no link away");
    assert_eq!(self::status(&server, "/api/surgeon/session", &cookie).await, 200);
    let mut page = Page::open(&server, "surgeon").await;
    let (_, said) = ask(&server, "surgeon", Method::GET, "/api/surgeon/session", &Value::Null).await;
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap()["session"], session);

    // The session ends: the link lets nobody in any more. The tablet may still say that it has ended.
    act(&server, "operator", json!({"session": session, "action": "abort", "reason": "the light failed"})).await;
    let stolen = server.get(&format!("/enter?key={link}")).send().await.unwrap();
    assert_eq!(stolen.status(), StatusCode::FORBIDDEN);
    assert!(stolen.headers().get(SET_COOKIE).is_none());
    let said: Value = stolen.json().await.unwrap();
    assert!(said["error"].as_str().unwrap().contains("for one session, which has ended"), "{said}");
    assert_eq!(self::status(&server, "/api/surgeon/session", &cookie).await, 200);

    // The operator closes it: nothing is open to the tablet any more, but what it still holds is taken.
    post(&server, "operator", "/api/operator/dismissals", json!({"session": session})).await;
    assert_eq!(closed(&mut page).await, CloseCode::from(4403));
    for path in ["/api/surgeon/session", "/stream.mjpeg", "/api/openapi.json"] {
        assert_eq!(self::status(&server, path, &cookie).await, 403, "{path}");
    }
    let refused = connect_async(upgrade(&server, "/live?role=surgeon", "surgeon")).await.unwrap_err();
    assert!(matches!(refused, tungstenite::Error::Http(answer) if answer.status() == 403));
    let over = server.get("/surgeon").header(COOKIE, &cookie).send().await.unwrap().text().await.unwrap();
    assert!(over.contains("which has ended") && over.contains("surgeon/over.js"), "{over}");

    let comment = json!({"key": Uuid::from_u128(5), "session": session, "kind": "text", "text": "said before the end"});
    post(&server, "surgeon", "/api/surgeon/comments", comment).await;
    let detail = format!("/api/researcher/sessions/{}/course", session.as_str().unwrap());
    let (_, said) = ask(&server, "researcher", Method::GET, &detail, &Value::Null).await;
    assert!(said.contains("said before the end"), "{said}");
}

/// The code with which the server closes `page`.
async fn closed(page: &mut Page) -> CloseCode {
    loop {
        if let Message::Close(Some(frame)) = page.message().await {
            return frame.code;
        }
    }
}

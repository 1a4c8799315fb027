//! Accounts on a real server: signing in and out, what a study requires of each role, and the surgeon's link to one
//! session.

use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use reqwest::header::{COOKIE, SET_COOKIE};
use reqwest::{Method, Response, StatusCode};
use rustix::process::Signal;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::{connect_async, tungstenite};
use uuid::Uuid;

use super::live::{Page, upgrade};
use super::studies::{act, new_session, open, refused, server, server_within, sign_in_as_lead, take_session_link};
use crate::support::{PASSPHRASE, Server, account, client, parfocal};

async fn sign_in(server: &Server, name: &str, passphrase: &str) -> Response {
    let body = json!({"name": name, "passphrase": passphrase});
    client().post(server.url("/api/sign-in")).json(&body).send().await.unwrap()
}

async fn status(server: &Server, path: &str, cookie: &str) -> u16 {
    server.get(path).header(COOKIE, cookie).send().await.unwrap().status().as_u16()
}

#[tokio::test]
async fn a_person_who_signs_in_has_the_pages_of_the_role_until_the_sign_in_ends() {
    let server = Server::within();
    server.add_account("lead", "lead", "Dr Lead");
    server.add_account("operator", "operator", "Nurse Op");

    let wrong = sign_in(&server, "operator", "something else").await;
    assert_eq!(wrong.status(), StatusCode::FORBIDDEN);
    assert!(wrong.headers().get(SET_COOKIE).is_none());
    let said: Value = wrong.json().await.unwrap();
    assert!(said["error"].as_str().unwrap().contains("do not match"), "{said}");

    let response = sign_in(&server, "operator", PASSPHRASE).await;
    let header = response.headers()[SET_COOKIE].to_str().unwrap().to_owned();
    // The cookie outlives the sign-in, which ends after twelve hours.
    assert!(header.contains("HttpOnly") && header.contains("SameSite=Strict") && header.contains("Max-Age=2592000"));
    let cookie = header.split(';').next().unwrap().to_owned();
    let said: Value = response.json().await.unwrap();
    assert_eq!(
        said,
        json!({"account": "operator", "display": "Nurse Op", "role": "operator", "disabled": false,
               "home": "/operator", "token": null})
    );

    // No link is needed, and the sign-in gives access to no other role.
    assert_eq!(status(&server, "/operator", &cookie).await, 200);
    assert_eq!(status(&server, "/researcher", &cookie).await, 403);
    assert_eq!(status(&server, "/surgeon", &cookie).await, 403);
    let page = server.get("/operator").header(COOKIE, &cookie).send().await.unwrap().text().await.unwrap();
    assert!(page.contains("Nurse Op"), "the page says who is signed in");

    let out = client().post(server.url("/api/sign-out")).header(COOKIE, &cookie).send().await.unwrap();
    assert_eq!(out.status(), StatusCode::NO_CONTENT);
    assert_eq!(status(&server, "/operator", &cookie).await, 403);

    // The browser's other pages are asked to sign in again. They hold the cookie that the sign-out has left.
    let left = out.headers()[SET_COOKIE].to_str().unwrap().split(';').next().unwrap();
    assert_eq!(left, "parfocal-account=");
    let refused = server.get("/api/operator/session").header(COOKIE, left).send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::FORBIDDEN);
    assert_eq!(refused.json::<Value>().await.unwrap()["sign_in"], true);

    // A command ends a browser's sign-in at once.
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

    let server = Server::within();
    let on = |arguments: &[&str]| account(server.data.path(), arguments);
    assert_eq!(on(&["list"]), (true, "no accounts yet\n".to_owned()));
    server.add_account("lead", "lead", "Dr Lead");
    for (arguments, expected) in [
        (&["add", "lead", "--role", "lead"][..], "there is an account 'lead' already"),
        (&["add", "A b", "--role", "lead"], "lower-case letters"),
        (&["add", "b", "--role", "boss"], "there are: lead, operator, researcher, monitor"),
        (&["disable", "lead"], "the last lead who can sign in"),
        (&["role", "lead", "monitor"], "the last lead who can sign in"),
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

/// All requests that concern a session of a study: role, path, and a body if it changes something.
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
        ("researcher", of("/erasures/all"), Some(reason.clone())),
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
    let (_protocols, mut server) = server_within();
    let links = ["operator", "researcher"].map(|role| (role, server.key(role).to_owned()));
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-01")).await;
    let session = made["session"].as_str().unwrap().to_owned();

    let through = async |server: &Server, role: &str| {
        let mut refusals = Vec::new();
        for (of, path, body) in doors(&session) {
            let method = if body.is_some() { Method::POST } else { Method::GET };
            let changes = body.is_some();
            let (status, said) = server.ask(of, method, &path, &body.unwrap_or_default()).await;
            let said: Value = serde_json::from_str(&said).unwrap_or_default();
            let asks = said["sign_in"] == json!(true);
            assert!(!asks || status == StatusCode::FORBIDDEN, "{role}: {path}");
            refusals.push((path, changes, status == StatusCode::FORBIDDEN, asks));
        }
        refusals
    };

    // The links alone give access to nothing, and each refusal says where to sign in.
    for (role, key) in &links {
        server.use_key(role, key);
    }
    for (path, _, refused, asks) in through(&server, "the links").await {
        assert!(refused && asks, "{path}");
    }
    let page = server.get_as("researcher", "/researcher/studies/scope-2026").header("accept", "text/html");
    let page = page.send().await.unwrap().text().await.unwrap();
    assert!(page.contains("href=\"/sign-in?next=/researcher/studies/scope-2026\""), "{page}");

    // A monitor may read what a researcher may read, and change nothing.
    server.add_account("monitor", "monitor", "Monitor");
    let token = server.sign_in("monitor").await;
    for role in ["operator", "researcher"] {
        server.use_key(role, &token);
    }
    for (path, changes, refused, _) in through(&server, "monitor").await {
        let reads = !changes && !path.contains("operator");
        assert_eq!(refused, !reads, "{path}");
    }

    // A researcher may not operate, lock or unblind.
    server.add_account("researcher", "researcher", "Dr Search");
    let token = server.sign_in("researcher").await;
    server.use_key("researcher", &token);
    let unblind = json!({"reason": "bleeding", "passphrase": PASSPHRASE});
    let (code, said) =
        self::refused(&server, "researcher", &format!("/api/researcher/sessions/{session}/unblind"), unblind).await;
    assert!(
        code == 403 && said.contains("Only a lead may do this; you are signed in as Dr Search, researcher"),
        "{said}"
    );

    // An operator may act, and the log names their account.
    server.add_account("operator", "operator", "Nurse Op");
    let token = server.sign_in("operator").await;
    server.use_key("operator", &token);
    server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
    let view = server.read("/api/operator/session").await;
    let started = view["log"].as_array().unwrap().iter().find(|line| line["text"] == "Session started").unwrap();
    assert_eq!((started["account"].as_str(), view["study"].as_str()), (Some("operator"), Some("scope-2026")));
}

#[tokio::test]
async fn locking_and_unblinding_ask_for_the_passphrase_once_more() {
    let (_protocols, mut server) = server_within();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    let changes = "/api/researcher/studies/scope-2026/changes";
    server.post(changes, json!({"change": "close", "reason": "over"})).await;

    let (code, said) = refused(&server, "researcher", changes, json!({"change": "lock", "reason": "over"})).await;
    assert!(code == 422 && said.contains("passphrase"), "{said}");
    let wrong = json!({"change": "lock", "reason": "over", "passphrase": "not this one"});
    let (code, said) = refused(&server, "researcher", changes, wrong).await;
    assert!(code == 403 && said.contains("This is not your passphrase. Nothing was changed"), "{said}");
    let study = server.post(changes, json!({"change": "lock", "reason": "over", "passphrase": PASSPHRASE})).await;
    assert_eq!(study["stage"], "locked");
    let last = study["log"].as_array().unwrap().last().unwrap().clone();
    assert_eq!((last["person"].as_str(), last["by"].as_str()), (Some("Dr Lead"), Some("researcher")));

    let (verified, said) = parfocal(&["verify"], server.data.path());
    assert!(verified, "{said}");
}

#[tokio::test]
async fn a_surgeons_link_is_for_one_session_and_ends_with_it() {
    let (_protocols, mut server) = server_within();
    let shared = server.key("surgeon").to_owned();
    let operators_link = server.key("operator").to_owned();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    let mut shared_page = Page::open(&server, "surgeon").await;
    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-01")).await;
    let session = made["session"].clone();

    // The shared link gives no access to a study, and a page that was open is closed.
    assert_eq!(closed(&mut shared_page).await, CloseCode::from(4403));
    let (status, said) = server.look("surgeon", "/api/surgeon/session").await;
    assert!(status == 403 && said.contains("has its own link"), "{said}");

    take_session_link(&mut server).await;
    let link = server.key("surgeon").to_owned();
    assert_ne!(link, shared);
    let entered = server.get(&format!("/enter?key={link}")).send().await.unwrap();
    let cookie = entered.headers()[SET_COOKIE].to_str().unwrap().split(';').next().unwrap().to_owned();
    assert!(!cookie.contains(&link), "the cookie gives no link away");
    assert_eq!(self::status(&server, "/api/surgeon/session", &cookie).await, 200);
    let mut page = Page::open(&server, "surgeon").await;
    assert_eq!(server.read("/api/surgeon/session").await["session"], session);

    // After the session the link gives no access any more. The tablet may still learn that the session has ended.
    act(&server, "operator", json!({"session": session, "action": "abort", "reason": "the light failed"})).await;
    let stolen = server.get(&format!("/enter?key={link}")).send().await.unwrap();
    assert_eq!(stolen.status(), StatusCode::FORBIDDEN);
    assert!(stolen.headers().get(SET_COOKIE).is_none());
    let said: Value = stolen.json().await.unwrap();
    assert!(said["error"].as_str().unwrap().contains("for one session, which has ended"), "{said}");
    assert_eq!(self::status(&server, "/api/surgeon/session", &cookie).await, 200);

    // Whoever moves the lens of a study's session by hand is known.
    let by_hand = json!({"focal_power": 0.3});
    let focus = client().post(server.url("/api/operator/focus")).bearer_auth(operators_link).json(&by_hand);
    assert_eq!(focus.send().await.unwrap().status(), StatusCode::FORBIDDEN);
    let (status, said) = server.ask("operator", Method::POST, "/api/operator/focus", &by_hand).await;
    assert!(status.is_success(), "{said}");

    // After the operator has closed the session, the tablet has no access, but the server accepts what it still holds.
    server.post("/api/operator/dismissals", json!({"session": session})).await;
    assert_eq!(closed(&mut page).await, CloseCode::from(4403));
    for path in ["/api/surgeon/session", "/tablet", "/stream.mjpeg", "/api/openapi.json"] {
        assert_eq!(self::status(&server, path, &cookie).await, 403, "{path}");
    }
    let refused = connect_async(upgrade(&server, "/live?role=surgeon", "surgeon")).await.unwrap_err();
    assert!(matches!(refused, tungstenite::Error::Http(answer) if answer.status() == 403));
    let over = server.get("/surgeon").header(COOKIE, &cookie).send().await.unwrap().text().await.unwrap();
    assert!(over.contains("which has ended") && over.contains("surgeon/over.js"), "{over}");

    let comment = json!({"key": Uuid::from_u128(5), "session": session, "kind": "text", "text": "said before the end"});
    server.post("/api/surgeon/comments", comment).await;
    let detail = format!("/api/researcher/sessions/{}/course", session.as_str().unwrap());
    let (_, said) = server.look("researcher", &detail).await;
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

/// The lead changes account `name`, with the passphrase `passphrase`.
async fn change(server: &Server, name: &str, mut change: Value, passphrase: &str) -> (u16, Value) {
    change["passphrase"] = json!(passphrase);
    let path = format!("/api/researcher/accounts/{name}/changes");
    let (status, said) = server.ask("researcher", Method::POST, &path, &change).await;
    (status.as_u16(), serde_json::from_str(&said).unwrap())
}

#[tokio::test]
async fn a_lead_makes_accounts_whose_people_choose_their_own_passphrases() {
    let mut server = Server::within();
    sign_in_as_lead(&mut server).await;
    let accounts = "/api/researcher/accounts";
    let new = json!({"account": "n.op", "display": "Nurse Op", "role": "operator",
                     "first_passphrase": "given by the lead", "passphrase": PASSPHRASE});

    // Each field is wrong in turn: the answer is a sentence, and no account is made.
    for (field, wrong, code, expected) in [
        ("account", "Nurse Op", 422, "lower-case letters"),
        ("account", "lead", 409, "there is an account 'lead' already"),
        ("display", " ", 422, "give the person's name"),
        ("display", "Dr Lead", 409, "has the display name 'Dr Lead' already"),
        ("role", "boss", 422, "boss"),
        ("first_passphrase", "short", 422, "10 to 256 characters"),
        ("passphrase", "not my passphrase", 403, "This is not your passphrase"),
        ("passphrase", "", 422, "Give your own passphrase once more"),
    ] {
        let mut bad = new.clone();
        bad[field] = json!(wrong);
        let (status, said) = refused(&server, "researcher", accounts, bad).await;
        assert_eq!(status, code, "{field}: {said}");
        assert!(said.contains(expected), "{field}: {said}");
    }
    server.post(accounts, new).await;

    // The passphrase that the lead set gives no access until the person has chosen another.
    let given = json!({"name": "n.op", "passphrase": "given by the lead", "as_bearer": true});
    let sign_in_with = async |chosen: Value| {
        let mut body = given.clone();
        body["new_passphrase"] = chosen;
        let response = client().post(server.url("/api/sign-in")).json(&body).send().await.unwrap();
        (response.status().as_u16(), response.json::<Value>().await.unwrap())
    };
    let (status, said) = sign_in_with(Value::Null).await;
    assert!(status == 409 && said["error"].as_str().unwrap().contains("Choose one that only you know"), "{said}");
    let (status, said) = sign_in_with(json!("given by the lead")).await;
    assert!(status == 422 && said["error"].as_str().unwrap().contains("same as the old one"), "{said}");
    let (status, said) = sign_in_with(json!("only I know this")).await;
    assert!(status == 200 && said["token"].is_string(), "{said}");
    assert_eq!(sign_in(&server, "n.op", "given by the lead").await.status(), StatusCode::FORBIDDEN);
    assert_eq!(sign_in(&server, "n.op", "only I know this").await.status(), StatusCode::OK);

    let (_, said) = server.look("researcher", accounts).await;
    let lines: Value = serde_json::from_str(&said).unwrap();
    assert!(!said.contains("hash") && !said.contains("salt"), "{said}");
    assert_eq!((lines[1]["account"].as_str(), lines[1]["set_by_another"].as_bool()), (Some("n.op"), Some(false)));
    assert!(lines[1]["last_signed_in"].is_string(), "{said}");

    // The chain records who made the account, and who chose the passphrase.
    let pool = server.database().await;
    let sql = "SELECT kind, done_by FROM account_events WHERE account = 'n.op' ORDER BY number LIMIT 2";
    let events: Vec<(String, String)> = sqlx::query_as(sql).fetch_all(&pool).await.unwrap();
    pool.close().await;
    assert_eq!(
        events,
        [("added".to_owned(), "lead".to_owned()), ("passphrase-replaced".to_owned(), "n.op".to_owned())]
    );
}

#[tokio::test]
async fn a_lead_changes_accounts_and_nobody_else_does() {
    let mut server = Server::within();
    let link = server.key("researcher").to_owned();
    sign_in_as_lead(&mut server).await;
    server.add_account("m", "monitor", "Monitor");
    let token = server.sign_in("m").await;
    let as_monitor = async |path: &str| server.get(path).bearer_auth(&token).send().await.unwrap().status().as_u16();
    assert_eq!(as_monitor("/researcher").await, 200);

    let (status, lines) = change(&server, "m", json!({"change": "role", "role": "operator"}), PASSPHRASE).await;
    assert_eq!((status, lines[1]["role"].as_str()), (200, Some("operator")));
    assert_eq!((as_monitor("/researcher").await, as_monitor("/operator").await), (403, 200), "at once");
    assert_eq!(change(&server, "m", json!({"change": "sign-out"}), PASSPHRASE).await.0, 200);
    assert_eq!(as_monitor("/operator").await, 403);

    let reset = json!({"change": "passphrase", "first_passphrase": "for one sign-in"});
    let (status, lines) = change(&server, "m", reset, PASSPHRASE).await;
    assert_eq!((status, lines[1]["set_by_another"].as_bool()), (200, Some(true)));
    assert_eq!(sign_in(&server, "m", "for one sign-in").await.status(), StatusCode::CONFLICT);
    assert_eq!(change(&server, "m", json!({"change": "disable"}), PASSPHRASE).await.1[1]["disabled"], true);
    assert_eq!(sign_in(&server, "m", "for one sign-in").await.status(), StatusCode::FORBIDDEN);
    assert_eq!(change(&server, "m", json!({"change": "enable"}), PASSPHRASE).await.1[1]["disabled"], false);

    for (name, wanted, passphrase, code, expected) in [
        ("lead", json!({"change": "disable"}), PASSPHRASE, 409, "the last lead who can sign in"),
        ("nobody", json!({"change": "disable"}), PASSPHRASE, 404, "there is no account 'nobody'"),
        ("No Body", json!({"change": "disable"}), PASSPHRASE, 404, "there is no account 'No Body'"),
        ("m", json!({"change": "remove"}), PASSPHRASE, 422, "remove"),
        ("m", json!({"change": "disable"}), "not my passphrase", 403, "This is not your passphrase"),
    ] {
        let (status, said) = change(&server, name, wanted, passphrase).await;
        assert!(status == code && said["error"].as_str().unwrap().contains(expected), "{name}: {status} {said}");
    }

    // Neither the link nor a researcher's account may open the page or change anything.
    server.add_account("researcher", "researcher", "Dr Search");
    let researcher = server.sign_in("researcher").await;
    for (key, expected) in [(link, "acts under a personal account"), (researcher, "Only a lead may do this")] {
        server.use_key("researcher", &key);
        for path in ["/researcher/accounts", "/api/researcher/accounts"] {
            let (status, said) = server.look("researcher", path).await;
            assert!(status == StatusCode::FORBIDDEN && said.contains(expected), "{path}: {said}");
        }
        let (status, said) = change(&server, "m", json!({"change": "disable"}), PASSPHRASE).await;
        assert!(status == 403 && said["error"].as_str().unwrap().contains(expected), "{said}");
    }
}

#[tokio::test]
async fn a_live_view_ends_when_its_account_is_disabled() {
    let (_protocols, mut server) = server();
    sign_in_as_lead(&mut server).await;
    server.add_account("operator", "operator", "Nurse Op");
    let token = server.sign_in("operator").await;
    server.use_key("operator", &token);
    let mut page = Page::open(&server, "operator").await;
    page.watch(2).await;
    let stream = client().get(server.url("/stream.mjpeg")).bearer_auth(&token).send().await.unwrap();
    assert_eq!(stream.status(), StatusCode::OK);

    assert_eq!(change(&server, "operator", json!({"change": "disable"}), PASSPHRASE).await.0, 200);
    assert_eq!(closed(&mut page).await, CloseCode::Policy);
    let pictures = tokio::time::timeout(Duration::from_secs(20), stream.bytes()).await;
    assert!(pictures.expect("the stream of pictures ends, too").unwrap().len() > 100);
}

#[tokio::test]
async fn a_live_view_ends_when_its_account_no_longer_has_the_role() {
    let (_protocols, mut server) = server();
    sign_in_as_lead(&mut server).await;
    server.add_account("operator", "operator", "Nurse Op");
    let token = server.sign_in("operator").await;
    // The browser has also opened a surgeon's link, which goes on.
    let entered = server.get(&format!("/enter?key={}", server.key("surgeon"))).send().await.unwrap();
    let surgeons = entered.headers()[SET_COOKIE].to_str().unwrap().split(';').next().unwrap();
    let cookies = format!("parfocal-account={token}; {surgeons}");
    let stream = client().get(server.url("/stream.mjpeg")).header(COOKIE, cookies).send().await.unwrap();
    assert_eq!(stream.status(), StatusCode::OK);
    server.use_key("operator", &token);
    let mut page = Page::open(&server, "operator").await;
    page.watch(2).await;

    let change = change(&server, "operator", json!({"change": "role", "role": "monitor"}), PASSPHRASE).await;
    assert_eq!(change.0, 200);
    assert_eq!(closed(&mut page).await, CloseCode::Policy);
    let pictures = tokio::time::timeout(Duration::from_secs(20), stream.bytes()).await;
    assert!(pictures.expect("the stream of pictures ends, too").unwrap().len() > 100);
}

/// Runs `parfocal account` with these arguments in a terminal of its own. Types each of `lines` after its prompt, and
/// returns what the terminal showed.
fn at_a_terminal(server: &Server, arguments: &str, lines: &[(&str, &str)]) -> String {
    let program = env!("CARGO_BIN_EXE_parfocal");
    let command = format!("'{program}' account {arguments} --data-dir '{}'", server.data.path().display());
    let mut terminal = Command::new("script")
        .args(["--quiet", "--return", "--flush", "--command", &command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut typed = terminal.stdin.take().unwrap();
    let mut screen = terminal.stdout.take().unwrap();
    let mut shown = String::new();
    let mut bytes = [0; 256];

    for (asked, line) in lines {
        while !shown.contains(asked) {
            let length = screen.read(&mut bytes).unwrap();
            assert!(length > 0, "the command ended without asking for '{asked}': {shown}");
            shown.push_str(&String::from_utf8_lossy(&bytes[..length]));
        }
        writeln!(typed, "{line}").unwrap();
    }

    screen.read_to_string(&mut shown).unwrap();
    assert!(terminal.wait().unwrap().success(), "{shown}");
    shown
}

#[test]
fn a_terminal_shows_nothing_of_a_passphrase() {
    let server = Server::within();
    let typed = [("passphrase (10", "battery staple"), ("repeat the passphrase", "battery staple")];
    let shown = at_a_terminal(&server, "add lead --role lead", &typed);
    assert!(shown.contains("account lead (lead): lead"), "{shown}");
    assert!(!shown.contains("battery") && !shown.contains("staple"), "{shown}");
}

#[tokio::test]
async fn a_restored_database_signs_nobody_in() {
    let mut server = Server::start();
    sign_in_as_lead(&mut server).await;
    let token = server.key("researcher").to_owned();
    let elsewhere = tempfile::tempdir().unwrap();
    let backup = elsewhere.path().join("backup.db");
    let backup = backup.to_str().unwrap();
    let (made, said) = parfocal(&["backup", "--out", backup, "--data-dir"], server.data.path());
    assert!(made, "{said}");
    assert!(server.end(Signal::TERM));
    let (restored, said) = parfocal(&["restore", backup, "--data-dir"], server.data.path());
    assert!(restored, "{said}");

    let server = Server::on(Arc::clone(&server.data), &["--bind", "127.0.0.1:0"]);
    let status = server.get("/researcher").bearer_auth(&token).send().await.unwrap().status();
    assert_eq!(status, StatusCode::FORBIDDEN, "a stolen backup's sign-ins open nothing");
    assert_eq!(sign_in(&server, "lead", PASSPHRASE).await.status(), StatusCode::OK);
}

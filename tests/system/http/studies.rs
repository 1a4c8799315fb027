//! Studies on a real server: over HTTP, by the command line, and what operator and surgeon receive during a session.

use std::path::Path;
use std::sync::Arc;

use reqwest::{Method, StatusCode};
use rustix::process::Signal;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::live::{Heard, Page};
use crate::support::{PASSPHRASE, Server, parfocal};

const PROTOCOL: &str = include_str!("pair.toml");

/// A definition of a study with that protocol at one site, for two surgeons.
pub fn definition() -> String {
    let sha256 = hex::encode(Sha256::digest(PROTOCOL));
    format!(
        "name = \"scope-2026\"\ntitle = \"Two settings in the eyes of two surgeons\"\norder = \"balanced\"\n\
         aborted = \"same-place\"\nwithdrawn = \"next-spare\"\nrepeated = \"refuse\"\n\
         when_used_up = \"Call the trial office.\"\nmay_unblind = [\"Trial statistician\"]\n\
         analysis = \"Wilcoxon signed-rank test on sharpness\"\n\
         [[protocols]]\nname = \"pair\"\nsha256 = \"{sha256}\"\n\
         [[sites]]\nname = \"leeds\"\ntitle = \"Leeds General Infirmary\"\nsurgeons = 2\nspares = 1\n"
    )
}

/// A folder that contains the protocol.
pub fn protocols() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("pair.toml"), PROTOCOL).unwrap();
    folder
}

/// That folder, and a server that reads it and has a data folder of its own.
pub fn server() -> (TempDir, Server) {
    let protocols = protocols();
    let server = on(Arc::new(tempfile::tempdir().unwrap()), protocols.path());
    (protocols, server)
}

/// The same within the test program.
pub fn server_within() -> (TempDir, Server) {
    let protocols = protocols();
    let server = Server::within_by(Some(protocols.path()));
    (protocols, server)
}

/// A server on a data folder that another server may have used before.
pub fn on(data: Arc<TempDir>, protocols: &Path) -> Server {
    Server::on(data, &["--bind", "127.0.0.1:0", "--protocols", protocols.to_str().unwrap()])
}

pub async fn refused(server: &Server, role: &str, path: &str, body: Value) -> (u16, String) {
    let (status, said) = server.ask(role, Method::POST, path, &body).await;
    assert!(!status.is_success(), "{path} {body}: {said}");
    (status.as_u16(), said)
}

/// Makes a lead's account; requests as operator and researcher use its token from then on.
pub async fn sign_in_as_lead(server: &mut Server) {
    server.add_account("lead", "lead", "Dr Lead");
    let token = server.sign_in("lead").await;
    server.use_key("operator", &token);
    server.use_key("researcher", &token);
}

/// The tablet opens the link to the session under way, which belongs to a study.
pub async fn take_session_link(server: &mut Server) {
    let link = server.read("/api/operator/surgeon-link").await;
    let (_, key) = link["link"].as_str().unwrap().split_once("key=").unwrap();
    server.use_key("surgeon", key);
}

/// Plans and opens the study.
pub async fn open(server: &Server) -> Value {
    let plan = json!({"definition": definition(), "reason": "ethics approved it"});
    server.post("/api/researcher/studies", plan).await;
    let opening = json!({"change": "open", "despite_concerns": true, "reason": "the first surgeon comes"});
    server.post("/api/researcher/studies/scope-2026/changes", opening).await
}

pub fn new_session(participant: &str) -> Value {
    let study = json!({"study": "scope-2026", "site": "leeds"});
    json!({"participant": participant, "protocol": "pair", "study": study})
}

pub async fn act(server: &Server, role: &str, action: Value) {
    server.post(&format!("/api/{role}/actions"), action).await;
}

/// The session under way as the surgeon sees it; also adds the answer to `heard`.
async fn view(server: &Server, heard: &mut Vec<String>) -> Value {
    let (_, said) = server.look("surgeon", "/api/surgeon/session").await;
    let view = serde_json::from_str(&said).unwrap();
    heard.push(said);
    view
}

/// The secrets of the orders in the database: seeds, and policies in the order in which they run.
async fn secrets(server: &Server) -> Vec<String> {
    let pool = server.database().await;
    let sql = "SELECT seed FROM study_seeds UNION SELECT seed FROM sessions
               UNION SELECT group_concat(policy, ',') FROM segments GROUP BY session";
    let found: Vec<String> = sqlx::query_scalar(sql).fetch_all(&pool).await.unwrap();
    pool.close().await;
    found
}

#[tokio::test]
async fn during_a_studys_session_nobody_is_sent_anything_of_an_order() {
    let (_protocols, mut server) = server();
    sign_in_as_lead(&mut server).await;
    open(&server).await;
    let mut operator_page = Page::open(&server, "operator").await;
    let mut surgeon = Vec::new();
    let mut others = Vec::new();

    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let (status, made) = server.ask("operator", Method::POST, "/api/operator/sessions", &new_session("S-01")).await;
    assert_eq!(status, StatusCode::OK, "{made}");
    others.push(made);
    take_session_link(&mut server).await;
    let mut surgeon_page = Page::open(&server, "surgeon").await;
    let session = view(&server, &mut surgeon).await["session"].clone();
    act(&server, "operator", json!({"session": session, "action": "start"})).await;

    for _ in 0..2 {
        let segment = view(&server, &mut surgeon).await["segment"].clone();
        let tap = |action: &str| json!({"session": session, "action": action, "segment": segment});
        act(&server, "surgeon", tap("acknowledge")).await;
        surgeon_page.watch(3).await;
        operator_page.watch(3).await;
        act(&server, "surgeon", tap("finish-segment")).await;

        for (role, path) in [
            ("surgeon", "/surgeon"),
            ("operator", "/operator"),
            ("operator", "/api/operator/choices"),
            ("operator", "/api/operator/session"),
            ("operator", "/metrics"),
            ("researcher", "/researcher"),
            ("researcher", "/researcher/studies"),
            ("researcher", "/researcher/studies/scope-2026"),
            ("researcher", "/api/researcher/studies"),
            ("researcher", "/api/researcher/studies/scope-2026"),
            ("researcher", "/api/researcher/sessions"),
        ] {
            let (status, said) = server.look(role, path).await;
            assert_eq!(status, StatusCode::OK, "{path}");
            if role == "surgeon" { surgeon.push(said) } else { others.push(said) }
        }
    }
    assert_eq!(view(&server, &mut surgeon).await["phase"], "completed");

    let texts = |page: Page| {
        page.heard.into_iter().map(|heard| match heard {
            Heard::Text(text) => text,
            Heard::Frame(header) => header.to_string(),
        })
    };
    surgeon.extend(texts(surgeon_page));
    others.extend(texts(operator_page));

    for heard in &surgeon {
        for telling in ["climber", "mgm", "mlr", "scope-2026", "leeds"] {
            let heard = heard.to_lowercase();
            assert!(!heard.contains(telling), "'{telling}' in {heard}");
        }
    }

    let secrets = secrets(&server).await;
    assert_eq!(secrets.len(), 3, "the study's seed, the set's, one order");
    for secret in &secrets {
        assert!(secret.len() > 30, "{secret}");
        for heard in surgeon.iter().chain(&others) {
            assert!(!heard.contains(secret.as_str()), "'{secret}' in {heard}");
        }
    }
}

#[tokio::test]
async fn a_study_is_planned_opened_and_locked_over_http_and_refuses_what_does_not_fit() {
    let (_protocols, mut server) = server_within();
    sign_in_as_lead(&mut server).await;
    let studies = "/api/researcher/studies";
    let changes = "/api/researcher/studies/scope-2026/changes";
    let signed = |change: &str| json!({"change": change, "reason": "as planned", "passphrase": PASSPHRASE});

    let malformed = definition().replace("surgeons = 2", "surgeons = 0");
    let plan = json!({"definition": malformed, "reason": "x"});
    let (status, said) = refused(&server, "researcher", studies, plan).await;
    assert!(status == 422 && said.contains("key 'surgeons': must be from 1 to 500"), "{said}");
    let unsigned = json!({"definition": definition(), "reason": " "});
    assert_eq!(refused(&server, "researcher", studies, unsigned).await.0, 422);
    assert_eq!(refused(&server, "researcher", changes, signed("open")).await.0, 404);
    let plan = json!({"definition": definition(), "reason": "x"});
    assert_eq!(refused(&server, "surgeon", studies, plan).await.0, 403);

    let study = open(&server).await;
    let line = study["commitment_line"].as_str().unwrap().to_owned();
    let hash = hex::encode(Sha256::digest(definition()));
    assert!(line.starts_with(&format!("parfocal study scope-2026 definition {hash} orders ")), "{line}");
    assert_eq!(refused(&server, "researcher", changes, signed("open")).await.0, 409);
    let (_, page) = server.look("researcher", "/researcher/studies/scope-2026").await;
    assert!(page.contains(&line), "the line stands on the page");

    // The operator can choose the study while it is open.
    let choices = async || server.read("/api/operator/choices").await["studies"].clone();
    assert_eq!(choices().await[0]["sites"], json!(["leeds"]));
    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-01")).await;
    let session = made["session"].clone();
    server.post(changes, signed("close")).await;
    assert_eq!(choices().await, json!([]));
    assert_eq!(refused(&server, "researcher", changes, signed("lock")).await.0, 409);

    act(&server, "operator", json!({"session": session, "action": "abort", "reason": "a trial run"})).await;
    server.post("/api/operator/dismissals", json!({"session": session})).await;
    let (status, said) = refused(&server, "researcher", changes, signed("lock")).await;
    assert!(status == 409 && said.contains("despite_outstanding"), "{said}");
    let mut lock = signed("lock");
    lock["despite_outstanding"] = true.into();
    let page =
        async || server.look("researcher", &format!("/researcher/sessions/{}", session.as_str().unwrap())).await.1;
    // No other code is known, and nothing was answered.
    let unlocked = page().await;
    let offered = unlocked.contains("correct-participant") || unlocked.contains("correct-answer");
    assert!(unlocked.contains("their code is added on the operator’s page first") && !offered, "{unlocked}");
    server.post("/api/operator/participants", json!({"code": "S-09"})).await;
    assert!(page().await.contains("correct-participant"));
    server.post(changes, lock).await;
    let locked = page().await;
    assert!(locked.contains("The study is locked") && !locked.contains("correct-participant"), "{locked}");
    assert_eq!(refused(&server, "researcher", changes, signed("unblind")).await.0, 403);

    // The definition names who may unblind.
    server.add_account("statistician", "lead", "Trial statistician");
    let token = server.sign_in("statistician").await;
    server.use_key("researcher", &token);
    let unblind = json!({"change": "unblind", "passphrase": PASSPHRASE, "reason": "the data are locked"});
    let study = server.post(changes, unblind).await;
    assert_eq!(study["stage"], "unblinded");
    let path = format!("/api/researcher/sessions/{}", session.as_str().unwrap());
    let detail = server.read(&path).await;
    assert_eq!((detail["study"].as_str(), detail["emergency"].as_bool()), (Some("scope-2026"), Some(false)));
    assert_eq!(detail["unblinding"]["policies"].as_array().unwrap().len(), 2);
}

/// Runs `parfocal study` with `arguments` on `data`. Returns whether it succeeded, and its output.
fn study(arguments: &[&str], data: &Path) -> (bool, String) {
    parfocal(&[&["study"], arguments, &["--data-dir"]].concat(), data)
}

#[tokio::test]
async fn the_command_line_plans_opens_closes_locks_and_shows_studies() {
    let (protocols, mut server) = server();
    let data = Arc::clone(&server.data);
    let folder = protocols.path().to_str().unwrap().to_owned();
    let file = protocols.path().join("study.definition");
    std::fs::write(&file, definition()).unwrap();
    let file = file.to_str().unwrap();
    let signature = ["--by", "Dr Lead", "--reason", "as planned"];
    let new = [&["new", file, "--protocols", &folder][..], &signature].concat();

    let (done, said) = study(&new, data.path());
    assert!(!done && said.contains("a server runs on") && said.contains("/researcher/studies"), "{said}");
    assert_eq!(study(&["show"], data.path()), (true, "no studies yet\n".to_owned()));
    assert!(server.end(Signal::TERM));

    let (done, said) = study(&new, data.path());
    assert!(
        done && said.starts_with("scope-2026: planned; sessions: 0; surgeons planned here: 2; Two settings"),
        "{said}"
    );
    let (done, said) = study(&new, data.path());
    assert!(!done && said.contains("there is already a study 'scope-2026'"), "{said}");

    let (done, said) = study(&[&["open", "scope-2026"][..], &signature].concat(), data.path());
    assert!(!done && said.contains("make accounts first, with `parfocal account add NAME --role lead`"), "{said}");
    server.add_account("lead", "lead", "Dr Lead");
    let (done, said) = study(&[&["open", "scope-2026"][..], &signature].concat(), data.path());
    assert!(!done && said.contains("Nobody here could unblind the study"), "{said}");
    let confirmed = ["open", "scope-2026", "--despite-concerns"];
    let (done, said) = study(&[&confirmed[..], &signature].concat(), data.path());
    assert!(done && said.contains("parfocal study scope-2026 definition") && said.contains("chain "), "{said}");
    let line = said.lines().nth(1).unwrap().to_owned();
    let (done, said) = study(&[&["open", "scope-2026"][..], &signature].concat(), data.path());
    assert!(!done && said == "parfocal: the study is open already\n", "{said}");
    let (done, said) = study(&[&["lock", "scope-2026"][..], &signature].concat(), data.path());
    assert!(!done && said.contains("close it first"), "{said}");
    let (done, said) = study(&["open", "another", "--by", "x", "--reason", "y"], data.path());
    assert!(!done && said.contains("there is no study 'another'; there are: scope-2026"), "{said}");

    // A session of the study on a server that no longer has the protocol: the study kept its own copy.
    let none = tempfile::tempdir().unwrap();
    let mut server = on(Arc::clone(&data), none.path());
    let token = server.sign_in("lead").await;
    server.use_key("operator", &token);
    server.post("/api/operator/participants", json!({"code": "S-01"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-01")).await;
    assert_eq!(made["title"], "Comparison of two focus settings");
    let session = made["session"].clone();
    act(&server, "operator", json!({"session": session, "action": "abort", "reason": "over"})).await;
    let (done, said) = study(&["show", "scope-2026"], data.path());
    assert!(done && said.contains(&line) && said.contains("S-01 leeds pair place 1"), "{said}");
    let (_, said) = study(&["show", "scope-2026", "--json"], data.path());
    let shown: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((shown["stage"].as_str(), shown["commitment_line"].as_str()), (Some("open"), Some(line.as_str())));
    drop(server);

    let (done, said) = study(&[&["close", "scope-2026"][..], &signature].concat(), data.path());
    assert!(done, "{said}");
    let (done, said) = study(&[&["lock", "scope-2026"][..], &signature].concat(), data.path());
    assert!(!done && said.contains("despite_outstanding"), "{said}");
    let (done, said) = study(&[&["lock", "scope-2026", "--despite-outstanding"][..], &signature].concat(), data.path());
    assert!(done && said.starts_with("scope-2026: locked"), "{said}");

    let (verified, said) = parfocal(&["verify"], data.path());
    assert!(
        verified && said.contains("studies as planned: 1; sessions with the next place and its order: 1"),
        "{said}"
    );
}

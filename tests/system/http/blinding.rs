//! Blinding: reads every byte that the surgeon's browser gets in a whole session.

use std::collections::{BTreeSet, HashSet};
use std::sync::Arc;

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};

use super::live::{Heard, Page};
use super::recordings::{abort, begin, post, start};
use crate::support::{Server, client};

/// Words that would reveal a policy, or how one works.
pub const TELLING: [&str; 10] =
    ["polic", "fixed", "climber", "learned", "mgm", "mlr", "cnn", "metric", "asked", "measured"];

/// A session, driven by its operator and its surgeon.
pub struct Session<'a> {
    server: &'a Server,
    /// Everything that was sent to the surgeon's browser, except pictures.
    pub heard: Vec<String>,
    segments: Vec<String>,
    keys: u32,
}

impl<'a> Session<'a> {
    pub const fn of(server: &'a Server) -> Self {
        Self { server, heard: Vec::new(), segments: Vec::new(), keys: 0 }
    }

    pub async fn ask(&self, role: &str, method: Method, path: &str, body: &Value) -> (StatusCode, String) {
        let request = client().request(method, self.server.url(path)).bearer_auth(self.server.key(role)).json(body);
        let response = request.send().await.unwrap();
        (response.status(), format!("{:?} ", response.headers()) + &response.text().await.unwrap())
    }

    pub async fn operator(&self, path: &str, body: Value) {
        let (status, said) = self.ask("operator", Method::POST, path, &body).await;
        assert!(status.is_success(), "{path}: {status} {said}");
    }

    pub async fn surgeon(&mut self, path: &str, body: Value) {
        let (status, said) = self.ask("surgeon", Method::POST, path, &body).await;
        assert!(status.is_success(), "{path} {body}: {status} {said}");
        self.heard.push(said);
    }

    pub async fn view(&mut self) -> Value {
        let (_, said) = self.ask("surgeon", Method::GET, "/api/surgeon/session", &Value::Null).await;
        let view = serde_json::from_str(said.split_once("} ").unwrap().1).unwrap();
        self.heard.push(said);
        view
    }

    /// A key that no other request has.
    fn key(&mut self) -> String {
        self.keys += 1;
        format!("00000000-0000-4000-8000-{:012}", self.keys)
    }

    async fn inspect(&mut self, page: &mut Page) {
        let view = self.view().await;
        let segment = view["segment"].as_str().expect("a segment").to_owned();
        let act = |action: &str| json!({"session": view["session"], "action": action, "segment": segment});
        self.surgeon("/api/surgeon/actions", act("acknowledge")).await;
        page.watch(5).await;
        let comment = json!({"key": self.key(), "session": view["session"], "segment": segment, "frame": 1,
            "client_millis": 0, "kind": "text", "text": "as sharp as before"});
        self.surgeon("/api/surgeon/comments", comment).await;
        self.surgeon("/api/surgeon/actions", act("finish-segment")).await;
        self.segments.push(segment);
    }

    /// Answers the present questions, if any.
    async fn answer(&mut self) {
        let view = self.view().await;
        let segment = if view["phase"] == "questions" { view["segment"].clone() } else { Value::Null };
        for question in view["questions"].as_array().unwrap() {
            let value = match question["kind"].as_str().unwrap() {
                "likert" => json!(3),
                "ranking" => json!((1..=view["settings"].as_u64().unwrap()).collect::<Vec<_>>()),
                "sus" => json!(vec![3; 10]),
                _ => json!("nothing to add"),
            };

            let answer = json!({"key": self.key(), "session": view["session"], "segment": segment,
                "question": question["id"], "value": value});
            self.surgeon("/api/surgeon/answers", answer).await;
        }

        let done = json!({"session": view["session"], "action": "finish-questions", "segment": segment});
        self.surgeon("/api/surgeon/actions", done).await;
    }
}

#[tokio::test]
async fn a_whole_session_tells_the_surgeons_browser_nothing_of_the_policies() {
    let server = Server::seeing();
    let mut session = Session::of(&server);
    let mut page = Page::open(&server, "surgeon").await;

    session.operator("/api/operator/participants", json!({"code": "S01"})).await;
    session.operator("/api/operator/sessions", json!({"participant": "S01", "protocol": "paper"})).await;
    let id = session.view().await["session"].clone();
    session.operator("/api/operator/actions", json!({"session": id, "action": "start"})).await;

    let settings = session.view().await["settings"].as_u64().unwrap();
    for _ in 0..settings {
        session.inspect(&mut page).await;
        session.answer().await;
    }

    assert_eq!(session.view().await["phase"], "closing");
    session.answer().await;
    assert_eq!(session.view().await["phase"], "completed");
    page.sent_so_far().await;

    let distinct: HashSet<_> = session.segments.iter().collect();
    assert_eq!(distinct.len(), 6, "no two segments share an id");

    let (_, html) = session.ask("surgeon", Method::GET, "/surgeon", &Value::Null).await;
    session.heard.push(html);

    let mut forms = BTreeSet::new();
    for message in page.heard {
        match message {
            Heard::Text(text) => session.heard.push(text),
            Heard::Frame(header) => {
                forms.insert(form(&header));
                session.heard.push(header.to_string());
            }
        }
    }

    // With and without a content area; nothing else may vary.
    assert!(forms.len() <= 2, "{forms:?}");
    assert!(session.heard.len() > 60);

    for heard in &session.heard {
        let heard = without_header_names(heard);
        for telling in TELLING {
            assert!(!heard.contains(telling), "'{telling}' in {heard}");
        }
    }
}

#[tokio::test]
async fn during_a_session_the_operator_sees_nothing_that_distinguishes_policies() {
    let server = Server::seeing();
    let mut session = Session::of(&server);
    let mut page = Page::open(&server, "operator").await;

    // Before a session the operator sees everything.
    session.operator("/api/operator/focus", json!({"policy": "parfocal"})).await;
    page.until_belief().await;
    session.operator("/api/operator/focus", json!({"policy": "mgm-hill-climber"})).await;
    page.until(|told| told["policy"] == "mgm-hill-climber" && told["latency_p50_micros"].is_number()).await;
    assert!(metrics(&session).await.contains("latency"));

    // From here on, nothing.
    session.operator("/api/operator/participants", json!({"code": "S01"})).await;
    session.operator("/api/operator/sessions", json!({"participant": "S01", "protocol": "paper"})).await;
    page.until(|told| told["type"] == "session" && !told["view"].is_null()).await;
    page.until(|told| told["type"] == "status" && told["policy"].is_null()).await;

    page.heard.clear();
    page.watch(5).await;

    let id = session.view().await["session"].clone();
    let act = |action: &str| json!({"session": id, "action": action, "reason": "a question"});
    session.operator("/api/operator/actions", act("start")).await;

    for _ in 0..2 {
        let view = session.view().await;
        let tap = |action: &str| json!({"session": id, "action": action, "segment": view["segment"]});
        session.surgeon("/api/surgeon/actions", tap("acknowledge")).await;
        page.watch(10).await;
        session.operator("/api/operator/actions", act("pause")).await;
        page.watch(5).await;
        session.operator("/api/operator/actions", act("resume")).await;
        page.watch(10).await;
        session.surgeon("/api/surgeon/actions", tap("finish-segment")).await;
        session.answer().await;
    }

    page.until(|told| told["type"] == "status").await;
    let counted = metrics(&session).await;
    for time in ["latency", "step_seconds", "picture_seconds", "database_write_seconds"] {
        assert!(!counted.contains(time), "how long things take tells a network from a hill-climber: {time}");
    }

    for path in ["/healthz", "/api/operator/checks"] {
        let (status, said) = session.ask("operator", Method::GET, path, &Value::Null).await;
        let said = said.split_once("} ").unwrap().1.to_lowercase();
        assert!(status.is_success() && TELLING.iter().all(|telling| !said.contains(telling)), "{path}: {said}");
    }

    let told: Vec<_> = page.heard.iter().map(|message| format!("{message:?}")).collect();
    assert!(told.iter().all(|told| !told.contains("climber")), "{told:?}");

    let frames = page.heard.iter().filter_map(|heard| match heard {
        Heard::Frame(header) => Some(header),
        Heard::Text(_) => None,
    });

    for header in frames {
        for telling in ["asked", "measured", "metric", "belief"] {
            assert!(header[telling].is_null(), "{telling} in {header}");
        }
        assert!(header["age"].as_f64().unwrap() % 100.0 == 0.0, "{header}");
    }

    let states = page.heard.iter().filter_map(|heard| match heard {
        Heard::Text(text) => Some(serde_json::from_str::<Value>(text).unwrap()).filter(|told| told["type"] == "status"),
        Heard::Frame(_) => None,
    });

    for state in states {
        for telling in ["policy", "focal_power", "latency_p50_micros", "latency_p99_micros"] {
            assert!(state[telling].is_null(), "{telling} in {state}");
        }
        assert_eq!(state["lens"]["working"], true, "that the lens works is the operator's business");
    }
}

#[tokio::test]
async fn where_a_session_has_left_the_lens_is_hidden_until_something_else_has_moved_it() {
    let server = start(Arc::new(tempfile::tempdir().unwrap()));
    let mut page = Page::open(&server, "operator").await;
    page.until(|told| told["type"] == "session").await;
    page.watch_until(|header| header["measured"].is_number()).await;

    let session = begin(&server, "moving").await;
    let view = server.read("/api/surgeon/session").await;
    let tap = json!({"session": session, "action": "acknowledge", "segment": view["segment"]});
    server.post("/api/surgeon/actions", tap).await;
    page.until(|told| told["view"]["phase"] == "inspecting").await;
    page.watch(10).await;
    abort(&server, &session).await;
    server.post("/api/operator/dismissals", json!({ "session": session })).await;
    page.until(|told| told["type"] == "session" && told["view"].is_null()).await;

    page.heard.clear();
    page.watch(5).await;
    page.until(|told| told["type"] == "status").await;
    for heard in &page.heard {
        let told = match heard {
            Heard::Frame(header) => header.clone(),
            Heard::Text(text) => serde_json::from_str(text).unwrap(),
        };
        for telling in ["asked", "measured", "metric", "focal_power", "latency_p50_micros", "lock"] {
            assert!(told[telling].is_null(), "{telling} in {told}");
        }
    }

    let (status, said) = post(&server, "/api/operator/focus", json!({"policy": "fixed"})).await;
    assert_eq!(status, StatusCode::NO_CONTENT, "{said}");
    let first = page.watch_until(|header| header["measured"].is_number()).await;
    assert_eq!(first.header["measured"], 0.5, "a policy begins in the middle, not at the place that is hidden");
    page.until(|told| told["policy"] == "fixed" && told["focal_power"] == 0.5).await;
}

/// `heard` in small letters, without the names of headers that every response has.
pub fn without_header_names(heard: &str) -> String {
    let heard = heard.to_lowercase();
    let heard = heard.replace("content-security-policy", "").replace("referrer-policy", "");
    heard.replace("cross-origin-resource-policy", "").replace("permissions-policy", "")
}

async fn metrics(session: &Session<'_>) -> String {
    session.ask("operator", Method::GET, "/metrics", &Value::Null).await.1
}

/// The names of all fields, and whether there is a content area.
pub fn form(header: &Value) -> String {
    match header {
        Value::Object(fields) => {
            let fields: Vec<_> = fields.iter().map(|(name, value)| format!("{name}:{}", form(value))).collect();
            fields.join(";")
        }
        Value::Null => "none".into(),
        _ => String::new(),
    }
}

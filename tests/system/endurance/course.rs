//! Conducts sessions over HTTP as operator and surgeon.

use std::time::Duration;

use serde_json::{Value, json};

use crate::support::Server;

/// Conducts sessions on a server, one after another.
pub struct Conductor<'a> {
    server: &'a Server,
    /// Number of sessions conducted so far.
    pub sessions: usize,
    /// Number of comments that the server acknowledged.
    pub comments: usize,
    keys: u32,
}

/// How long the surgeon looks at a setting, and how often they comment on it.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// Time in each setting.
    pub setting: Duration,
    /// Number of comments in each setting, evenly spread.
    pub comments: u32,
}

impl<'a> Conductor<'a> {
    /// Prepares to conduct sessions on `server`; adds their participant.
    pub async fn new(server: &'a Server) -> Self {
        let conductor = Self { server, sessions: 0, comments: 0, keys: 0 };
        conductor.server.post("/api/operator/participants", json!({"code": "S-07"})).await;
        conductor
    }

    /// Conducts one session from preparing to closing it. Every fourth is aborted in its first setting.
    pub async fn conduct(&mut self, pace: Pace) {
        let made = json!({"participant": "S-07", "protocol": "long-day"});
        let view = self.server.post("/api/operator/sessions", made).await;
        let session = view["session"].clone();
        self.server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;

        let aborted = self.sessions % 4 == 3;
        let settings = if aborted { 1 } else { view["settings"].as_u64().unwrap() };
        for _ in 0..settings {
            self.inspect(&session, pace).await;
        }

        if aborted {
            let abort = json!({"session": session, "action": "abort", "reason": "every fourth session is"});
            self.server.post("/api/operator/actions", abort).await;
        } else {
            self.answer(&session).await;
            assert_eq!(self.view().await["phase"], "completed");
        }
        self.server.post("/api/operator/dismissals", json!({"session": session})).await;
        self.sessions += 1;
    }

    /// One setting: accept the notice, comment, pause for a moment, and answer the questions.
    async fn inspect(&mut self, session: &Value, pace: Pace) {
        let segment = self.view().await["segment"].clone();
        let act = |action: &str| json!({"session": session, "action": action, "segment": segment});
        self.server.post("/api/surgeon/actions", act("acknowledge")).await;

        for _ in 0..pace.comments {
            tokio::time::sleep(pace.setting / pace.comments).await;
            let comment = json!({"key": self.key(), "session": session, "segment": segment, "frame": 1,
                "client_millis": 0, "kind": "text", "text": "as sharp as before, at the edge of the picture too"});
            self.server.post("/api/surgeon/comments", comment).await;
            self.comments += 1;
        }

        let pause = json!({"session": session, "action": "pause", "reason": "a question"});
        self.server.post("/api/operator/actions", pause).await;
        self.server.post("/api/operator/actions", json!({"session": session, "action": "resume"})).await;
        self.server.post("/api/surgeon/actions", act("finish-segment")).await;
        if self.view().await["phase"] == "questions" {
            self.answer(session).await;
        }
    }

    /// Answers the present questions.
    async fn answer(&mut self, session: &Value) {
        let view = self.view().await;
        let segment = if view["phase"] == "questions" { view["segment"].clone() } else { Value::Null };
        for question in view["questions"].as_array().unwrap() {
            let value = if question["kind"] == "sus" { json!(vec![3; 10]) } else { json!(4) };
            let answer = json!({"key": self.key(), "session": session, "segment": segment,
                "question": question["id"], "value": value});
            self.server.post("/api/surgeon/answers", answer).await;
        }

        let done = json!({"session": session, "action": "finish-questions", "segment": segment});
        self.server.post("/api/surgeon/actions", done).await;
    }

    /// A key that no other record has.
    fn key(&mut self) -> String {
        self.keys += 1;
        format!("00000000-0000-4000-8000-{:012}", self.keys)
    }

    /// The session as the surgeon sees it.
    async fn view(&self) -> Value {
        self.server.read("/api/surgeon/session").await
    }
}

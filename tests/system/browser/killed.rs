//! A server that is killed, as by a power cut, right after it acknowledged a comment, at every point of a session. It
//! continues at the same place, and loses nothing that it acknowledged.

use serde_json::{Value, json};
use uuid::Uuid;

use super::theatre;
use crate::support::Server;

/// A session driven by plain requests as surgeon and operator.
struct Trial {
    server: Server,
    session: String,
    acknowledged: Vec<String>,
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_server_loses_nothing_that_it_acknowledged() {
    let mut trial = Trial::begin().await;
    for number in 1..=2 {
        trial.say_and_kill("notice", number).await;
        trial.act(json!({ "action": "acknowledge" })).await;
        trial.say_and_kill("inspecting", number).await;
        trial.act(json!({ "action": "finish-segment" })).await;
        trial.answer("sharpness", json!(4)).await;
        trial.say_and_kill("questions", number).await;
        let view = trial.view().await;
        assert_eq!(view["answers"]["sharpness"], 4, "the answer is still there");
        trial.act(json!({ "action": "finish-questions" })).await;
    }

    for number in 3..=6 {
        assert_eq!(trial.view().await["setting"], number);
        trial.act(json!({ "action": "acknowledge" })).await;
        trial.act(json!({ "action": "finish-segment" })).await;
        trial.answer("sharpness", json!(4)).await;
        trial.act(json!({ "action": "finish-questions" })).await;
    }

    trial.say_and_kill("closing", 6).await;
    assert_eq!(trial.kept().await, trial.acknowledged);
}

impl Trial {
    async fn begin() -> Self {
        let server = theatre::server();
        let session = server.prepare("S-02", "short").await;
        server.post("/api/operator/actions", json!({ "session": session, "action": "start" })).await;
        Self { server, session, acknowledged: Vec::new() }
    }

    /// Sends a comment, waits for the acknowledgement, and cuts the power. Then checks that the session is where it
    /// was.
    async fn say_and_kill(&mut self, phase: &str, setting: u64) {
        let before = self.view().await;
        assert_eq!((before["phase"].as_str(), before["setting"].as_u64()), (Some(phase), Some(setting)));
        let text = format!("{phase} {setting}");
        let comment = json!({
            "key": Uuid::from_u128(0x4000_8000 << 64 | self.acknowledged.len() as u128),
            "session": self.session, "segment": before["segment"], "kind": "text", "text": text,
        });

        self.server.post("/api/surgeon/comments", comment.clone()).await;
        self.acknowledged.push(text);
        theatre::kill(&mut self.server);
        theatre::start_again(&mut self.server);
        // A tablet that never got the answer sends the comment again.
        self.server.post("/api/surgeon/comments", comment).await;
        let after = self.view().await;
        assert_eq!((&after["phase"], &after["segment"]), (&before["phase"], &before["segment"]));
        assert_eq!((&after["paused"], &after["may_resume"]), (&json!(true), &json!(true)));
        self.act(json!({ "action": "resume" })).await;
    }

    async fn view(&self) -> Value {
        self.server.read("/api/surgeon/session").await
    }

    /// The surgeon acts on the session under way.
    async fn act(&self, mut action: Value) {
        action["session"] = json!(self.session);
        action["segment"] = self.view().await["segment"].clone();
        self.server.post("/api/surgeon/actions", action).await;
    }

    async fn answer(&self, question: &str, value: Value) {
        let segment = self.view().await["segment"].clone();
        let key = Uuid::parse_str(segment.as_str().unwrap()).unwrap();
        let answer =
            json!({ "key": key, "session": self.session, "segment": segment, "question": question, "value": value });
        self.server.post("/api/surgeon/answers", answer).await;
    }

    /// The comments in the database.
    async fn kept(&self) -> Vec<String> {
        let pool = self.server.database().await;
        let comments = sqlx::query_scalar("SELECT text FROM comments ORDER BY number").fetch_all(&pool).await.unwrap();
        pool.close().await;
        comments
    }
}

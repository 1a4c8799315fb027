//! Stopping waits for no disk: even with a full disk, or while another program holds the database's lock, stopping the
//! session stops the lens. The events are recorded, in order, when the disk accepts them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Emulator, Model};
use reqwest::{Method, StatusCode};
use rustix::process::Signal;
use serde_json::{Value, json};
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use super::live::Page;
use crate::support::Server;
use crate::support::disk::SmallDisk;

/// Something that keeps the server from writing.
enum Trouble {
    /// Another program holds the database's lock.
    Lock(SqliteConnection),
    /// The disk is full.
    Full(SmallDisk),
}

impl Trouble {
    async fn lock(server: &Server) -> Self {
        let options = SqliteConnectOptions::new().filename(server.data.path().join("parfocal.db"));
        Self::Lock(options.connect().await.unwrap())
    }

    async fn begin(&mut self, stage: &Stage) {
        match self {
            Self::Lock(connection) => {
                sqlx::query("BEGIN IMMEDIATE").execute(connection).await.unwrap();
            }
            Self::Full(disk) => {
                disk.fill();
                // There may be space left within the files: send comments until it is used up.
                while stage.comment(&"no room ".repeat(1000)).await != StatusCode::INSUFFICIENT_STORAGE {}
            }
        }
    }

    async fn end(&mut self) {
        match self {
            Self::Lock(connection) => {
                sqlx::query("ROLLBACK").execute(connection).await.unwrap();
            }
            Self::Full(disk) => disk.empty(),
        }
    }

    /// The operator's message about it.
    const fn words(&self) -> &'static str {
        match self {
            Self::Lock(_) => "another program has locked the database",
            Self::Full(_) => "the disk is full",
        }
    }
}

/// A session under way on a server whose lens is observed.
struct Stage {
    server: Server,
    emulator: Emulator,
    page: Page,
    session: String,
    comments: AtomicU32,
}

impl Stage {
    async fn on(data: Arc<tempfile::TempDir>) -> Self {
        let emulator = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
        let server = start(data, &emulator);
        let page = Page::open(&server, "operator").await;
        let session = server.prepare("S-05", "moving").await;
        let stage = Self { server, emulator, page, session, comments: AtomicU32::new(1) };
        stage.act("operator", json!({"action": "start"})).await;
        stage
    }

    async fn act(&self, role: &str, mut action: Value) -> Value {
        action["session"] = self.session.clone().into();
        if action["segment"].is_null() {
            action["segment"] = self.view().await["segment"].clone();
        }
        self.server.post(&format!("/api/{role}/actions"), action).await
    }

    async fn view(&self) -> Value {
        self.server.read("/api/operator/session").await
    }

    async fn comment(&self, text: &str) -> StatusCode {
        let key = uuid::Uuid::from_u128(self.comments.fetch_add(1, Ordering::Relaxed).into());
        let comment = json!({"key": key, "session": self.session, "kind": "text", "text": text});
        self.server.ask("surgeon", Method::POST, "/api/surgeon/comments", &comment).await.0
    }

    /// The surgeon taps the notice; waits until the policy drives the lens.
    async fn inspect(&mut self) {
        self.act("surgeon", json!({"action": "acknowledge"})).await;
        let before = self.commanded().len();
        while self.commanded().len() < before + 3 {
            self.page.watch(1).await;
        }
    }

    /// The positions commanded so far, without repetitions.
    fn commanded(&self) -> Vec<i16> {
        let mut commanded: Vec<i16> = self.emulator.commands().into_iter().map(|(_, command)| command).collect();
        commanded.dedup();
        commanded
    }

    /// Checks that the policy, which never stands still, no longer drives the lens.
    async fn rests(&mut self) {
        self.page.until(|told| told["type"] == "status" && told["held"] == "paused").await;
        self.page.watch(3).await;
        let before = self.commanded();
        self.page.watch(10).await;
        assert_eq!(self.commanded(), before, "the lens is driven on");
    }

    /// Waits until the operator sees why it is not recorded; then ends the trouble and waits until it is recorded.
    async fn recorded_after(&mut self, trouble: &mut Trouble) {
        let words = trouble.words();
        let told = |view: &Value| view["unrecorded_because"].as_str().is_some_and(|why| why.contains(words));
        while !told(&self.view().await) {
            self.page.watch(1).await;
        }
        self.recorded_at_last(trouble).await;
    }

    async fn recorded_at_last(&mut self, trouble: &mut Trouble) {
        trouble.end().await;
        while self.view().await["unrecorded"] == true {
            self.page.watch(1).await;
        }
    }

    async fn events(&self) -> Vec<(i64, String, String, Value)> {
        let pool = self.server.database().await;
        let sql = "SELECT number, kind, role, payload FROM events ORDER BY number";
        let events: Vec<(i64, String, String, String)> = sqlx::query_as(sql).fetch_all(&pool).await.unwrap();
        pool.close().await;
        let whole = |(number, kind, role, payload): (_, _, _, String)| {
            (number, kind, role, serde_json::from_str(&payload).unwrap())
        };
        events.into_iter().map(whole).collect()
    }
}

fn start(data: Arc<tempfile::TempDir>, emulator: &Emulator) -> Server {
    let lens = format!("optotune:{}", emulator.path().display());
    let protocols = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/system/http");
    Server::on(data, &["--bind", "127.0.0.1:0", "--fps", "20", "--lens", &lens, "--protocols", protocols])
}

/// Stops in every possible way, each while nothing can be written.
async fn every_way_to_stop(mut stage: Stage, mut trouble: Trouble) {
    let stopped = |view: &Value| assert_eq!(view["unrecorded"], true, "{view}");

    stage.inspect().await;
    trouble.begin(&stage).await;
    let view = stage.act("operator", json!({"action": "pause", "reason": "The phone"})).await;
    stopped(&view);
    assert_eq!((&view["phase"], &view["paused"]), (&json!("inspecting"), &json!(true)));
    assert!(view["log"][0]["text"].as_str().unwrap().contains("The phone (not recorded yet)"), "{view}");
    stage.rests().await;
    stage.recorded_after(&mut trouble).await;
    stage.act("operator", json!({"action": "resume"})).await;

    trouble.begin(&stage).await;
    let view = stage.act("operator", json!({"action": "finish-segment"})).await;
    stopped(&view);
    assert_eq!(view["phase"], "questions");
    stage.rests().await;
    stage.recorded_at_last(&mut trouble).await;
    stage.act("surgeon", json!({"action": "finish-questions"})).await;

    stage.inspect().await;
    trouble.begin(&stage).await;
    while stage.view().await["phase"] == "inspecting" {
        stage.page.watch(1).await;
    }
    stopped(&stage.view().await);
    stage.rests().await;
    stage.recorded_at_last(&mut trouble).await;
    stage.act("surgeon", json!({"action": "finish-questions"})).await;

    stage.inspect().await;
    trouble.begin(&stage).await;
    let view = stage.act("operator", json!({"action": "abort", "reason": "The lamp failed"})).await;
    stopped(&view);
    assert_eq!(view["phase"], "aborted");
    stage.rests().await;
    // The operator closes the session and moves the lens by hand.
    stage.server.post("/api/operator/dismissals", json!({"session": stage.session})).await;
    let before = stage.commanded();
    stage.server.post("/api/operator/focus", json!({"focal_power": 0.9})).await;
    while stage.commanded() == before {
        stage.page.watch(1).await;
    }
    trouble.end().await;
    while stage.events().await.last().unwrap().1 != "aborted" {
        stage.page.watch(1).await;
    }

    let events = stage.events().await;
    let kinds: Vec<&str> = events.iter().map(|(_, kind, ..)| kind.as_str()).collect();
    let setting = ["segment-started", "segment-finished", "questions-finished"];
    let first =
        ["created", "started", "segment-started", "paused", "resumed", "segment-finished", "questions-finished"];
    assert_eq!(kinds, [&first[..], &setting, &["segment-started", "aborted"]].concat(), "each once, in order");
    assert!(events.iter().zip(1..).all(|((number, ..), expected)| *number == expected), "{events:?}");
    assert_eq!(events[3].3["reason"], "The phone");
    assert_eq!((events[5].2.as_str(), events[8].2.as_str()), ("operator", "system"));
    assert_eq!(events[8].3["inspected_ms"], 5000);
    assert_eq!(events[11].3["reason"], "The lamp failed");
}

#[tokio::test]
async fn while_another_program_has_locked_the_database_every_way_to_stop_stops_the_lens() {
    let stage = Stage::on(Arc::new(tempfile::tempdir().unwrap())).await;
    let trouble = Trouble::lock(&stage.server).await;
    every_way_to_stop(stage, trouble).await;
}

#[tokio::test]
async fn on_a_full_disk_every_way_to_stop_stops_the_lens() {
    let Some(disk) = SmallDisk::mount() else { return };
    let stage = Stage::on(Arc::clone(&disk.folder)).await;
    every_way_to_stop(stage, Trouble::Full(disk)).await;
}

#[tokio::test]
async fn a_server_killed_before_a_pause_is_recorded_comes_back_paused() {
    let mut stage = Stage::on(Arc::new(tempfile::tempdir().unwrap())).await;
    let mut trouble = Trouble::lock(&stage.server).await;
    stage.inspect().await;
    trouble.begin(&stage).await;
    let view = stage.act("operator", json!({"action": "pause", "reason": "The phone"})).await;
    assert_eq!(view["unrecorded"], true);

    stage.server.end(Signal::KILL);
    trouble.end().await;
    stage.server = start(Arc::clone(&stage.server.data), &stage.emulator);
    stage.page = Page::open(&stage.server, "operator").await;
    let view = stage.view().await;
    assert_eq!((&view["phase"], &view["paused"]), (&json!("inspecting"), &json!(true)), "{view}");
    stage.rests().await;
    let kinds: Vec<String> = stage.events().await.into_iter().map(|(_, kind, ..)| kind).collect();
    assert_eq!(kinds.last().unwrap(), "server-restarted", "nobody said that it was paused, and so it is not on record");
}

#[tokio::test]
async fn a_server_that_ends_in_order_records_a_pause_first() {
    let mut stage = Stage::on(Arc::new(tempfile::tempdir().unwrap())).await;
    let mut trouble = Trouble::lock(&stage.server).await;
    stage.inspect().await;
    trouble.begin(&stage).await;
    stage.act("operator", json!({"action": "pause", "reason": "The phone"})).await;
    trouble.end().await;
    assert!(stage.server.end(Signal::TERM));
    let events = stage.events().await;
    assert_eq!(events.last().unwrap().3["reason"], "The phone");
}

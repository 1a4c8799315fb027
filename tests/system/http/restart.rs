//! What a server resumes after it was killed during a setting.

use std::sync::Arc;

use rustix::process::Signal;
use serde_json::{Value, json};

use super::live::Page;
use crate::support::Server;

/// A step of the loop in the telemetry: run, policy, requested focal power.
type Step = (i64, Option<String>, f64);

struct Stage {
    server: Server,
    session: String,
}

impl Stage {
    fn start(data: Arc<tempfile::TempDir>) -> Server {
        let protocols = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/system/http");
        Server::on(data, &["--bind", "127.0.0.1:0", "--fps", "20", "--protocols", protocols])
    }

    async fn act(&self, role: &str, action: &str) -> Value {
        let segment = self.server.read("/api/surgeon/session").await["segment"].clone();
        let action = json!({"session": self.session, "action": action, "segment": segment});
        self.server.post(&format!("/api/{role}/actions"), action).await
    }

    /// The steps in setting `setting` so far, oldest first.
    async fn steps(&self, setting: i64) -> Vec<Step> {
        let pool = self.server.database().await;
        let sql = "SELECT run, name, asked FROM telemetry JOIN segments ON segments.number = telemetry.segment
                   LEFT JOIN policies ON policies.number = telemetry.policy
                   WHERE setting = ? ORDER BY telemetry.number";
        let steps = sqlx::query_as(sql).bind(setting).fetch_all(&pool).await.unwrap();
        pool.close().await;
        steps
    }

    /// Waits until `count` steps of run `run` in `setting` that are `wanted` are on disk.
    async fn until(&self, setting: i64, run: i64, count: usize, wanted: impl Fn(&Step) -> bool) -> Vec<Step> {
        let mut page = Page::open(&self.server, "surgeon").await;
        loop {
            let steps = self.steps(setting).await;
            if steps.iter().filter(|step| step.0 == run && wanted(step)).count() >= count {
                return steps;
            }
            page.watch(1).await;
        }
    }
}

#[tokio::test]
async fn a_setting_continues_at_the_focal_power_last_commanded_in_it() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let server = Stage::start(data);
    let session = server.prepare("S-05", "places").await;
    let mut stage = Stage { server, session };
    stage.act("operator", "start").await;

    let mut run = 1;
    for setting in 1..=2 {
        stage.act("surgeon", "acknowledge").await;
        stage.until(setting, run, 10, |(_, policy, _)| policy.is_some()).await;
        stage.server.end(Signal::KILL);
        // Kill it again before anyone resumes: the lens's position at restart must not count as commanded.
        for _ in 0..2 {
            run += 1;
            stage.server = Stage::start(Arc::clone(&stage.server.data));
            stage.until(setting, run, 5, |(_, policy, _)| policy.is_none()).await;
            if run % 2 == 0 {
                stage.server.end(Signal::KILL);
            }
        }

        stage.act("surgeon", "resume").await;
        let steps = stage.until(setting, run, 10, |(_, policy, _)| policy.is_some()).await;

        let asked = |steps: Vec<&Step>| steps.into_iter().map(|step| step.2).collect::<Vec<f64>>();
        let driven: Vec<&Step> = steps.iter().filter(|step| step.1.is_some()).collect();
        let before = asked(driven.iter().copied().filter(|step| step.0 <= run - 2).collect());
        let held = asked(steps.iter().filter(|step| step.0 > run - 2 && step.1.is_none()).collect());
        let after = asked(driven.iter().copied().filter(|step| step.0 == run).collect());
        let last = *before.last().unwrap();
        assert!(held.iter().all(|asked| (asked - last).abs() < 1e-9), "{held:?} after {last}");
        if driven[0].1.as_deref() == Some("fixed") {
            assert!(before.iter().chain(&after).all(|asked| (asked - 0.3).abs() < 1e-9), "{before:?} {after:?}");
        } else {
            assert!((after[0] - last).abs() < 0.051, "one step of the climber from {last}, not {}", after[0]);
        }

        stage.act("surgeon", "finish-segment").await;
        stage.act("surgeon", "finish-questions").await;
    }
}

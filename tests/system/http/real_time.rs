//! Real-time priority: used if the system allows it, never beyond its limits; otherwise the page says how to allow it.

use std::fs;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use rustix::process::Signal;
use serde_json::json;

use super::live::Page;
use crate::support::{Server, command};

const OTHER: u32 = 0;
const FIFO: u32 = 1;

/// Whether this user may use real-time priority here, according to `chrt`.
fn allowed() -> bool {
    Command::new("chrt").args(["--fifo", "30", "true"]).stderr(Stdio::null()).status().unwrap().success()
}

/// A server with a policy that drives an emulated lens. With `refused`, the system gives it no rights.
async fn server(refused: bool) -> Server {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let usual = command(data.path(), &["--bind", "127.0.0.1:0", "--lens", "emulated"]);
    let command = if refused { without_rights(&usual) } else { usual };
    let server = Server::run(data, command);
    server.post("/api/operator/focus", json!({ "policy": "mgm-hill-climber" })).await;
    server
}

/// The command `usual` without the rights that real-time priority needs, also if root runs the test.
fn without_rights(usual: &Command) -> Command {
    let mut command = Command::new("prlimit");
    command.args(["--rtprio=0:0", "--memlock=65536:65536"]);
    if rustix::process::geteuid().is_root() {
        command.args(["setpriv", "--bounding-set=-sys_nice,-ipc_lock"]);
    }
    command.arg(usual.get_program()).args(usual.get_args()).stdin(Stdio::null()).env("RUST_LOG", "off");
    command
}

/// Scheduling policy and real-time priority of each thread called `name`.
fn threads(server: &Server, name: &str) -> Vec<(u32, u32)> {
    let tasks = fs::read_dir(format!("/proc/{}/task", server.id())).unwrap().flatten();
    tasks
        .filter_map(|task| {
            let stat = fs::read_to_string(task.path().join("stat")).ok()?;
            let (before, after) = stat.rsplit_once(')')?;
            // Fields 40 and 41 of proc(5); the name is the second.
            let fields: Vec<u32> = after.split(' ').skip(38).map_while(|field| field.trim().parse().ok()).collect();
            let &[priority, policy, ..] = fields.as_slice() else { return None };
            before.ends_with(&format!("({name}")).then_some((policy, priority))
        })
        .collect()
}

/// Checks repeatedly until `condition` holds. Fails after ten seconds.
async fn until(what: &str, condition: impl Fn() -> bool) {
    let waited = tokio::time::timeout(Duration::from_secs(10), async {
        while !condition() {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    });
    waited.await.unwrap_or_else(|_| panic!("never: {what}"));
}

async fn metric(server: &Server, name: &str) -> f64 {
    let request = server.get("/metrics").bearer_auth(server.key("operator"));
    let text = request.send().await.unwrap().text().await.unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name)).expect("the metric");
    line.trim().parse().unwrap()
}

/// Waits until the operator's page gets a message with these `words` about the loop's priority.
async fn page_tells(server: &Server, words: &str) {
    let mut page = Page::open(server, "operator").await;
    let told = page.until(|told| told["priority"]["message"].as_str().is_some_and(|message| message.contains(words)));
    tokio::time::timeout(Duration::from_secs(10), told).await.expect("the words");
}

/// The line that starts with `line`, of a file in the server's folder of `/proc`.
fn told(server: &Server, file: &str, line: &str) -> String {
    let text = fs::read_to_string(format!("/proc/{}/{file}", server.id())).unwrap();
    text.lines().find(|told| told.starts_with(line)).unwrap().to_owned()
}

#[tokio::test]
async fn where_it_is_allowed_the_way_from_camera_to_lens_is_at_real_time_priority_and_bounded() {
    if !allowed() {
        return println!("skipped: real-time priority is not allowed here");
    }
    let server = server(false).await;
    // A thread that has just started has the name of the thread that started it.
    until("the loop has its priority", || threads(&server, "control") == [(FIFO, 20)]).await;
    until("the lens has its priority", || threads(&server, "lens") == [(FIFO, 30)]).await;
    until("the loop waits for the policy first of all", || threads(&server, "policy") == [(FIFO, 10)]).await;
    assert_eq!(threads(&server, "camera"), [(OTHER, 0)], "a simulation's work is no part of the way");
    assert_eq!(threads(&server, "imaging"), [(OTHER, 0)]);

    let bound = told(&server, "limits", "Max realtime timeout");
    assert!(bound.contains(" 2000000 "), "{bound}");
    assert!((metric(&server, "parfocal_real_time").await - 1.0).abs() < 0.5);
    page_tells(&server, "real-time priority").await;
}

#[tokio::test]
async fn a_thread_that_keeps_a_processor_costs_the_priority_and_not_the_machine() {
    if !allowed() {
        return println!("skipped: real-time priority is not allowed here");
    }
    let server = server(false).await;
    // The kernel sends this signal in that case.
    rustix::process::kill_process(server.pid(), Signal::XCPU).unwrap();
    let ordinary =
        || ["control", "lens", "policy"].iter().all(|name| threads(&server, name).iter().all(|t| t.0 == OTHER));
    until("every thread is ordinary", ordinary).await;
    assert!(server.get("/healthz").send().await.unwrap().status().is_success());
    page_tells(&server, "kept a processor").await;
    assert!(metric(&server, "parfocal_real_time").await < 0.5);
}

#[tokio::test]
async fn where_it_is_not_allowed_the_server_works_and_says_how_to_allow_it() {
    let server = server(true).await;
    until("the loop runs", || threads(&server, "control") == [(OTHER, 0)]).await;
    assert!(metric(&server, "parfocal_real_time").await < 0.5);
    page_tells(&server, "`parfocal serve --help`").await;
    let locked = told(&server, "status", "VmLck");
    assert!(locked.contains(" 0 kB"), "beyond its limit memory would be refused: {locked}");

    let help = Command::new(env!("CARGO_BIN_EXE_parfocal")).args(["serve", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    assert!(help.contains("rtprio") && help.contains("LimitRTPRIO") && help.contains("SYS_NICE"), "{help}");
}

#[tokio::test]
async fn memory_stays_in_place_where_that_is_allowed() {
    if !rustix::process::geteuid().is_root() {
        return println!("skipped: only root may for certain");
    }
    let server = server(false).await;
    let locked = told(&server, "status", "VmLck");
    assert!(!locked.contains(" 0 kB"), "{locked}");
}

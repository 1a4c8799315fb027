//! Viewers that come and go, of five kinds.

use std::time::Duration;

use serde_json::json;
use tokio::net::TcpStream;
use tokio::sync::watch;
use tokio::time::{sleep, timeout};

use crate::http::live::Page;
use crate::support::Server;

/// Longest wait for a picture; none comes while the camera is unplugged.
const PATIENCE: Duration = Duration::from_secs(2);

/// Runs one viewer after another, of alternating kinds, until `end` turns true. `kind` is where the alternation starts.
/// Returns how many came.
pub async fn come_and_go(server: &Server, kind: usize, end: watch::Receiver<bool>) -> usize {
    let mut viewers = 0;
    while !*end.borrow() {
        match (viewers + kind) % 5 {
            0 => look(server, "surgeon", 1180, 150).await,
            1 => look(server, "operator", 2048, 100).await,
            2 => look(server, "researcher", 512, 50).await,
            3 => watch_motion_jpeg(server).await,
            _ => knock_and_leave(server).await,
        }
        viewers += 1;
    }
    viewers
}

/// A page that watches `frames` pictures on a screen of this width, hides for a moment, watches again and closes.
async fn look(server: &Server, role: &str, width: u32, frames: usize) {
    let mut page = Page::open(server, role).await;
    page.say(json!({"type": "screen", "width": width})).await;
    watch_some(&mut page, frames).await;

    page.say(json!({"type": "visible", "visible": false})).await;
    sleep(Duration::from_millis(300)).await;
    page.say(json!({"type": "visible", "visible": true})).await;
    watch_some(&mut page, frames).await;
}

async fn watch_some(page: &mut Page, frames: usize) {
    for _ in 0..frames {
        if timeout(PATIENCE, page.watch(1)).await.is_err() {
            return;
        }
    }
}

/// A program that reads Motion JPEG for a while and breaks the connection.
async fn watch_motion_jpeg(server: &Server) {
    let mut stream = server.get_as("surgeon", "/stream.mjpeg").send().await.unwrap();
    for _ in 0..100 {
        if !matches!(timeout(PATIENCE, stream.chunk()).await, Ok(Ok(Some(_)))) {
            return;
        }
    }
}

/// A connection that stays silent, and requests without a valid key.
async fn knock_and_leave(server: &Server) {
    let silent = TcpStream::connect(server.address).await.unwrap();
    for path in ["/healthz", "/operator", "/static/none", "/enter?key=wrong"] {
        server.get(path).send().await.unwrap();
    }
    sleep(Duration::from_millis(500)).await;
    drop(silent);
}

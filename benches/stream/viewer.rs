//! A viewer that draws at once: acknowledges each frame as soon as it arrives.

use std::net::SocketAddr;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use parfocal_base::clock::{Clock, SystemClock};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

/// A frame that arrived.
pub struct Seen {
    /// Number of the frame.
    pub frame: u64,
    /// When its message arrived whole, in monotonic nanoseconds.
    pub at: u64,
    /// Size of its message, in bytes.
    pub bytes: usize,
}

/// Watches for `time` as the operator, whose key is `key`, on a screen on which the picture is `screen` pixels wide.
pub async fn watch(address: SocketAddr, key: String, screen: u32, time: Duration) -> Vec<Seen> {
    let mut request = format!("ws://{address}/live?role=operator").into_client_request().expect("an address");
    request.headers_mut().insert("authorization", format!("Bearer {key}").parse().expect("a key"));
    let (mut socket, _) = connect_async(request).await.expect("the stream");
    socket.send(Message::text(format!("{{\"type\":\"screen\",\"width\":{screen}}}"))).await.expect("the stream");
    let mut seen = Vec::new();
    let end = tokio::time::Instant::now() + time;
    while let Ok(Some(Ok(message))) = tokio::time::timeout_at(end, socket.next()).await {
        let Message::Binary(message) = message else { continue };
        let at = SystemClock.now().as_nanos();
        let frame = number(&message);
        seen.push(Seen { frame, at, bytes: message.len() });
        let drawn = format!("{{\"type\":\"drawn\",\"frame\":{frame}}}");
        socket.send(Message::text(drawn)).await.expect("the stream");
    }
    seen
}

fn number(message: &[u8]) -> u64 {
    let length = usize::from(u16::from_le_bytes([message[0], message[1]]));
    let header: serde_json::Value = serde_json::from_slice(&message[2..2 + length]).expect("a header");
    header["frame"].as_u64().expect("a number")
}

//! One client: it gets the latest frame whenever it has taken the one before. What it sends is only looked at for its
//! version and for requests.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytes::Bytes;
use socket2::SockRef;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::sync::{Notify, watch};
use tokio::time::timeout;

use super::disconnections::Disconnections;
use super::frame_messages::{self, FrameMessages};
use super::message::{HEADER_BYTES, Header, Version};
use super::{LinkSource, condition};

/// A client that takes nothing for so long is disconnected.
const STUCK: Duration = Duration::from_secs(10);

/// Bytes that the system may hold of what a client has not taken yet; Linux doubles them, up to its own limit. By
/// itself it would take megabytes. Over a slow link those are pictures of half a minute ago, and it accepts no more
/// until a third of them is gone, for which [`STUCK`] is too short.
const SEND_BUFFER: usize = 256 << 10;

/// What the two halves of a connection share.
#[derive(Default)]
struct Shared {
    /// Whether the client has spoken version 3. Until then it gets version 2, which all understand.
    three: AtomicBool,
    /// It asked for the status.
    asked: Notify,
}

impl Shared {
    fn version(&self) -> Version {
        if self.three.load(Ordering::Relaxed) { Version::Three } else { Version::Two }
    }
}

/// Why a connection ended.
enum End {
    /// It was closed.
    Closed,
    /// It sent something that is not a message.
    Stranger(&'static str),
    /// It did not take what it was sent.
    Stuck,
}

/// Serves `stream` until the client leaves.
pub async fn serve(
    stream: TcpStream,
    peer: SocketAddr,
    messages: watch::Receiver<Option<Arc<FrameMessages>>>,
    source: &LinkSource,
    disconnections: &Disconnections,
) {
    // A picture must not wait for the acknowledgement of the one before.
    let _ = stream.set_nodelay(true);
    let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
    let (from, to) = stream.into_split();
    let shared = Shared::default();

    let end = tokio::select! {
        end = listen(from, &shared) => end,
        end = tell(to, messages, source, &shared) => end,
    };
    match end {
        End::Closed => tracing::debug!(%peer, "an OpenIGTLink client left"),
        End::Stranger(why) => disconnections.log(source.clock.now(), peer, why),
        End::Stuck => disconnections.log(source.clock.now(), peer, "it took nothing for 10 s"),
    }
}

async fn listen(mut from: OwnedReadHalf, shared: &Shared) -> End {
    loop {
        let mut header = [0; HEADER_BYTES];
        match from.read(&mut header[..1]).await {
            Ok(1) => {}
            // Closed between two messages.
            _ => return End::Closed,
        }
        if from.read_exact(&mut header[1..]).await.is_err() {
            return End::Stranger("it left in the middle of a header");
        }
        let header = match Header::parse(&header) {
            Ok(header) => header,
            Err(why) => return End::Stranger(why),
        };

        let mut body = vec![0; header.body];
        if from.read_exact(&mut body).await.is_err() {
            return End::Stranger("it left in the middle of a message");
        }
        if !header.fits(&body) {
            return End::Stranger("a message's checksum is wrong");
        }

        shared.three.fetch_or(header.version == Version::Three, Ordering::Relaxed);
        if header.kind == "GET_STATUS" {
            shared.asked.notify_one();
        }
    }
}

async fn tell(
    mut to: OwnedWriteHalf,
    mut messages: watch::Receiver<Option<Arc<FrameMessages>>>,
    source: &LinkSource,
    shared: &Shared,
) -> End {
    let mut states = source.status.clone();
    let mut last_sent = None;
    loop {
        let condition = condition(&states.borrow_and_update());
        if last_sent != Some(condition) {
            last_sent = Some(condition);
            let message = frame_messages::status(shared.version(), source.clock.wall(), condition);
            if let Err(end) = send(&mut to, message).await {
                return end;
            }
        }

        tokio::select! {
            changed = messages.changed() => {
                if changed.is_err() {
                    return End::Closed;
                }
                let latest = messages.borrow_and_update().clone();
                if let Some(of_frame) = latest && let Err(end) = show(&mut to, &of_frame, source, shared).await {
                    return end;
                }
            }
            changed = states.changed() => {
                if changed.is_err() {
                    return End::Closed;
                }
            }
            () = shared.asked.notified() => last_sent = None,
        }
    }
}

/// Sends a frame.
async fn show(
    to: &mut OwnedWriteHalf,
    messages: &FrameMessages,
    source: &LinkSource,
    shared: &Shared,
) -> Result<(), End> {
    // A session may have begun since it was made.
    if messages.tells_focal_power() && (source.blinded)() {
        return Ok(());
    }

    let version = shared.version();
    send(to, messages.picture(version)).await?;
    match messages.focal_power(version) {
        Some(message) => send(to, message).await,
        None => Ok(()),
    }
}

/// Sends a message piece by piece: over a slow link a large picture takes longer than [`STUCK`], and the client takes
/// it all the same.
async fn send(to: &mut OwnedWriteHalf, mut message: Bytes) -> Result<(), End> {
    while !message.is_empty() {
        match timeout(STUCK, to.write_buf(&mut message)).await {
            Ok(Ok(1..)) => {}
            Ok(_) => return Err(End::Closed),
            Err(_) => return Err(End::Stuck),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use tokio::net::TcpListener;

    use super::super::message::Envelope;
    use super::*;

    #[tokio::test]
    async fn who_has_spoken_version_three_gets_it_from_then_on() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        let (stream, _) = listener.accept().await.unwrap();
        let (from, _to) = stream.into_split();

        let message = Envelope { kind: "STRING", device: "Tablet", stamp: 0, id: 0 };
        for version in [Version::Three, Version::Two] {
            client.write_all(&message.seal(version, b"hello", &[])).await.unwrap();
        }
        drop(client);

        let shared = Shared::default();
        assert_eq!(shared.version(), Version::Two);
        assert!(matches!(listen(from, &shared).await, End::Closed));
        assert_eq!(shared.version(), Version::Three);
    }
}

//! Connections: accepts them, as many as there are places, and sees to it that no queue forms behind a slow one.

use std::io;
use std::net::SocketAddr;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use hyper::body::Incoming;
use hyper::server::conn::http1::Builder;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tower::ServiceExt;

use super::places::{Place, Places};
use super::shutdown::ended;

/// What one connection may hold back in this process: about half a frame, so that a stream gets a new frame only when
/// the last has gone to the kernel. Also the limit of a request's headers.
const BUFFER: usize = 16 * 1024;

/// What the kernel may hold unsent before it takes no more; it would take megabytes, which is seconds of pictures.
const UNSENT: u32 = 16 * 1024;

/// A browser that has not said what it wants by then never will.
const HEADERS_WITHIN: Duration = Duration::from_secs(30);

/// Wait after a failed accept: the system is out of something, and will be at once again.
const BREATHER: Duration = Duration::from_millis(50);

/// Serves `router` on `listener` until `shutdown` turns true. Connections then end when what is under way is answered;
/// each holds `shutdown` until it has.
pub(super) async fn serve(listener: TcpListener, router: Router, mut shutdown: watch::Receiver<bool>) {
    let places = Places::default();
    loop {
        let accepted = tokio::select! {
            () = ended(&mut shutdown) => return,
            accepted = listener.accept() => accepted,
        };

        match accepted {
            Ok((stream, peer)) => {
                tokio::spawn(serve_one(stream, peer, places.clone(), router.clone(), shutdown.clone()));
            }
            Err(error) if is_the_peers_fault(&error) => {}
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(BREATHER).await;
            }
        }
    }
}

async fn serve_one(
    stream: TcpStream,
    peer: SocketAddr,
    places: Places,
    router: Router,
    mut shutdown: watch::Receiver<bool>,
) {
    // Where a socket cannot be tuned it still works.
    let _ = stream.set_nodelay(true);
    let _ = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);

    let (place, give_way) = places.take(peer.ip());
    let place = Arc::new(place);
    let socket = Placed { stream, _place: Arc::clone(&place) };

    let service = router.map_request(move |mut request: axum::http::Request<Incoming>| {
        request.extensions_mut().insert(Arc::clone(&place));
        request.map(Body::new)
    });

    let mut builder = Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(BUFFER);
    let connection = builder.serve_connection(TokioIo::new(socket), TowerToHyperService::new(service)).with_upgrades();
    let mut connection = pin!(connection);

    let outcome = tokio::select! {
        outcome = connection.as_mut() => outcome,
        _ = give_way => {
            tracing::debug!(%peer, "a connection gave way to newer ones");
            return;
        }
        () = ended(&mut shutdown) => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };

    if let Err(error) = outcome {
        tracing::debug!(%error, "a connection broke");
    }
}

/// A connection with its place, which it keeps also as a WebSocket.
struct Placed {
    stream: TcpStream,
    _place: Arc<Place>,
}

impl Placed {
    fn stream(self: Pin<&mut Self>) -> Pin<&mut TcpStream> {
        Pin::new(&mut self.get_mut().stream)
    }
}

impl AsyncRead for Placed {
    fn poll_read(self: Pin<&mut Self>, cx: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        self.stream().poll_read(cx, buffer)
    }
}

impl AsyncWrite for Placed {
    fn poll_write(self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.stream().poll_write(cx, bytes)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.stream().poll_write_vectored(cx, parts)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream().poll_flush(cx)
    }

    fn poll_shutdown(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.stream().poll_shutdown(cx)
    }
}

fn is_the_peers_fault(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

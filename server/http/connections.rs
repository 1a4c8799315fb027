//! Connections: accepts them, as many as there are places, and sees to it that no queue forms behind a slow one.

use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::http::header::{HOST, HeaderValue};
use axum::http::{Request, Version};
use hyper::body::Incoming;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::time::timeout;
use tower::ServiceExt;

use super::door::Door;
use super::places::Places;
use super::shutdown::ended;

/// What one connection may hold back in this process: about half a frame, so that a stream gets a new frame only when
/// the last has gone to the kernel.
const BUFFER: usize = 16 * 1024;

/// The limit of a request's headers over HTTP/2; over HTTP/1 the buffer is.
const HEADERS: u32 = 16 * 1024;

/// What the kernel may hold unsent before it takes no more; it would take megabytes, which is seconds of pictures.
const UNSENT: u32 = 16 * 1024;

/// A browser that has not said what it wants by then never will.
const HEADERS_WITHIN: Duration = Duration::from_secs(30);

/// Wait after a failed accept: the system is out of something, and will be at once again.
const BREATHER: Duration = Duration::from_millis(50);

/// A browser shakes hands within two round trips, once it has been asked whether it trusts the certificate.
const HANDSHAKE_WITHIN: Duration = Duration::from_secs(10);

/// Over HTTP/2 a browser is asked so often whether it is still there, and given so long to answer.
const STILL_THERE: Duration = Duration::from_secs(20);

/// Lets connections on `listener` in through `door` until `shutdown` turns true. They then end when what is under way is
/// answered; each holds `shutdown` until it has.
pub(super) async fn serve(listener: TcpListener, door: Door, mut shutdown: watch::Receiver<bool>) {
    let places = Places::default();
    loop {
        let accepted = tokio::select! {
            () = ended(&mut shutdown) => return,
            accepted = listener.accept() => accepted,
        };

        match accepted {
            Ok((stream, peer)) => {
                tokio::spawn(serve_one(stream, peer, places.clone(), door.clone(), shutdown.clone()));
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
    door: Door,
    mut shutdown: watch::Receiver<bool>,
) {
    // Where a socket cannot be tuned it still works.
    let _ = stream.set_nodelay(true);
    let _ = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);

    let (place, mut give_way) = places.take(peer.ip());
    let place = Arc::new(place);

    let opened = tokio::select! {
        opened = timeout(HANDSHAKE_WITHIN, door.open(stream, Arc::clone(&place), BUFFER)) => opened,
        _ = &mut give_way => return,
        () = ended(&mut shutdown) => return,
    };

    let opened = match opened {
        Ok(Ok(opened)) => opened,
        // Most often a device that does not trust the certificate.
        Ok(Err(error)) => {
            tracing::debug!(%peer, %error, "a handshake failed");
            return;
        }
        Err(_) => {
            tracing::debug!(%peer, "a connection did not shake hands in time");
            return;
        }
    };

    let service = opened.pages.map_request(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(Arc::clone(&place));
        name_host(&mut request);
        request.map(Body::new)
    });

    let builder = builder(opened.http2);
    let line = TokioIo::new(opened.line);
    let connection = builder.serve_connection_with_upgrades(line, TowerToHyperService::new(service));
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

/// How requests are read and answered. A WebSocket comes over HTTP/1 also from a browser that uses HTTP/2 for pages: a
/// connection of their own, in which no page's bytes stand before a picture.
fn builder(http2: bool) -> Builder<TokioExecutor> {
    let builder = Builder::new(TokioExecutor::new());
    let mut builder = if http2 { builder.http2_only() } else { builder.http1_only() };

    builder.http1().timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(BUFFER);

    let mut http2 = builder.http2();
    http2.timer(TokioTimer::new()).keep_alive_interval(STILL_THERE).keep_alive_timeout(STILL_THERE);
    http2.max_send_buf_size(BUFFER).max_header_list_size(HEADERS);

    builder
}

/// HTTP/2 names the host in the request's address (RFC 9113, 8.3.1). Everything after this looks for it in the header.
fn name_host(request: &mut Request<Incoming>) {
    if request.version() != Version::HTTP_2 {
        return;
    }
    let authority = request.uri().authority().and_then(|authority| HeaderValue::from_str(authority.as_str()).ok());
    if let Some(authority) = authority {
        request.headers_mut().insert(HOST, authority);
    }
}

fn is_the_peers_fault(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionRefused, ConnectionReset};
    matches!(error.kind(), ConnectionAborted | ConnectionRefused | ConnectionReset)
}

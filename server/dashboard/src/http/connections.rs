//! Accepts connections, as many as there are permits, and prevents queues behind slow ones.

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

use super::permits::Permits;
use super::transport::Transport;

/// Bytes that one connection may buffer in this process: about half a frame, so that a stream gets a new frame only
/// when the last one has gone to the kernel.
const BUFFER: usize = 16 * 1024;

/// Largest headers of a request over HTTP/2, bytes. Over HTTP/1 [`BUFFER`] is the limit.
const HEADERS: u32 = 16 * 1024;

/// Unsent bytes at which the kernel takes no more. By default it would take megabytes, which is seconds of pictures.
const UNSENT: u32 = 16 * 1024;

/// Time limit for a request's headers over HTTP/1.
const HEADERS_WITHIN: Duration = Duration::from_secs(30);

/// Wait after a failed accept: the system has run out of some resource, and an immediate retry would fail too.
const BREATHER: Duration = Duration::from_millis(50);

/// Time limit for the TLS handshake. It takes a browser two round trips, once it trusts the certificate.
const HANDSHAKE_WITHIN: Duration = Duration::from_secs(10);

/// Over HTTP/2, a browser is asked at this interval whether it is still there, and has as long to answer.
const STILL_THERE: Duration = Duration::from_secs(20);

/// Accepts connections on `listener` and opens them with `door` until `shutdown` turns true. Each connection then ends
/// once its requests under way are answered, and holds a clone of `shutdown` until then.
pub(super) async fn serve(listener: TcpListener, transport: Transport, mut shutdown: watch::Receiver<bool>) {
    let permits = Permits::default();
    loop {
        let accepted = tokio::select! {
            () = ended(&mut shutdown) => return,
            accepted = listener.accept() => accepted,
        };

        match accepted {
            Ok((stream, peer)) => {
                tokio::spawn(serve_one(stream, peer, permits.clone(), transport.clone(), shutdown.clone()));
            }
            Err(error) if is_the_peers_fault(&error) => {}
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(BREATHER).await;
            }
        }
    }
}

/// Waits until the server is asked to shut down.
pub(super) async fn ended(shutdown: &mut watch::Receiver<bool>) {
    let _ = shutdown.wait_for(|end| *end).await;
}

async fn serve_one(
    stream: TcpStream,
    peer: SocketAddr,
    permits: Permits,
    transport: Transport,
    mut shutdown: watch::Receiver<bool>,
) {
    // A socket that cannot be tuned still works.
    let _ = stream.set_nodelay(true);
    let _ = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);

    let (permit, mut give_way) = permits.take(peer.ip());
    let permit = Arc::new(permit);

    let opened = tokio::select! {
        opened = timeout(HANDSHAKE_WITHIN, transport.open(stream, BUFFER)) => opened,
        _ = &mut give_way => return,
        () = ended(&mut shutdown) => return,
    };

    let opened = match opened {
        Ok(Ok(opened)) => opened,
        // Most often this is a device that does not trust the certificate.
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
        request.extensions_mut().insert(Arc::clone(&permit));
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

/// How requests are read and answered. A WebSocket always comes over HTTP/1, even from a browser that uses HTTP/2 for
/// pages. So it has its own connection, in which no page's bytes are queued before a picture.
fn builder(http2: bool) -> Builder<TokioExecutor> {
    let builder = Builder::new(TokioExecutor::new());
    let mut builder = if http2 { builder.http2_only() } else { builder.http1_only() };

    builder.http1().timer(TokioTimer::new()).header_read_timeout(HEADERS_WITHIN).max_buf_size(BUFFER);

    let mut http2 = builder.http2();
    http2.timer(TokioTimer::new()).keep_alive_interval(STILL_THERE).keep_alive_timeout(STILL_THERE);
    http2.max_send_buf_size(BUFFER).max_header_list_size(HEADERS);

    builder
}

/// Copies the host into the header, where all later code looks for it: HTTP/2 names it in the request's address
/// (RFC 9113, 8.3.1).
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

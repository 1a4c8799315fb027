//! The door: what a new connection speaks, and which pages it gets.
//!
//! An encrypted server tells by a connection's first byte whether it begins a TLS handshake. Any other is a browser that
//! does not encrypt: it is led to the encrypted page, on the same port.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use axum::Router;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;

use super::places::Place;

/// The first byte of a TLS handshake (RFC 8446, 5.1); no method of HTTP begins with it.
const HANDSHAKE: u8 = 22;

/// How HTTP/2 is called when client and server choose (RFC 9113, 3.1).
const HTTP2: &[u8] = b"h2";

/// What connections get.
#[derive(Clone)]
pub(super) enum Door {
    /// Every page, to everyone in the clear.
    Plain { pages: Router },
    /// Every page encrypted; in the clear, only what leads there.
    Encrypted { tls: TlsAcceptor, pages: Router, plain: Router },
}

/// A connection that is ready for requests.
pub(super) struct Opened {
    pub(super) line: Box<dyn Line>,
    /// Whether both ends have agreed on HTTP/2; it is HTTP/1 otherwise.
    pub(super) http2: bool,
    /// What it gets.
    pub(super) pages: Router,
}

impl Door {
    /// Finds out what `stream` speaks, and shakes hands. Takes as long as the other end likes. Encryption holds back at
    /// most `buffer` bytes.
    pub(super) async fn open(self, stream: TcpStream, place: Arc<Place>, buffer: usize) -> io::Result<Opened> {
        let (tls, pages, plain) = match self {
            Self::Plain { pages } => {
                return Ok(Opened { line: Box::new(Placed { stream, _place: place }), http2: false, pages });
            }
            Self::Encrypted { tls, pages, plain } => (tls, pages, plain),
        };

        let mut first = [0];
        let is_handshake = stream.peek(&mut first).await? == 1 && first[0] == HANDSHAKE;
        let placed = Placed { stream, _place: place };
        if !is_handshake {
            return Ok(Opened { line: Box::new(placed), http2: false, pages: plain });
        }

        // A picture that waits here would be seen late.
        let stream = tls.accept_with(placed, |connection| connection.set_buffer_limit(Some(buffer))).await?;
        let http2 = stream.get_ref().1.alpn_protocol() == Some(HTTP2);
        Ok(Opened { line: Box::new(stream), http2, pages })
    }
}

/// A connection's bytes, encrypted or not.
pub(super) trait Line: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Line for T {}

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

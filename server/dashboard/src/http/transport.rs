//! The door: finds out which protocol a new connection speaks, and which pages it gets.
//!
//! An encrypted server sees from a connection's first byte whether it begins a TLS handshake. Otherwise it is from a
//! browser that does not encrypt, which is redirected to the encrypted page on the same port.

use std::io;

use axum::Router;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;

/// The first byte of a TLS handshake (RFC 8446, 5.1); no method of HTTP begins with it.
const HANDSHAKE: u8 = 22;

/// Name of HTTP/2 in the negotiation between client and server (RFC 9113, 3.1).
const HTTP2: &[u8] = b"h2";

/// The pages that connections get.
#[derive(Clone)]
pub(super) enum Transport {
    /// Every page, unencrypted.
    Plain { pages: Router },
    /// Encrypted, every page; unencrypted, only the pages that lead to the encrypted ones (`plain`).
    Encrypted { tls: TlsAcceptor, pages: Router, plain: Router },
}

/// A connection that is ready for requests.
pub(super) struct ReadyConnection {
    pub(super) line: Box<dyn Line>,
    /// Whether both ends have agreed on HTTP/2; otherwise it is HTTP/1.
    pub(super) http2: bool,
    /// The pages that this connection gets.
    pub(super) pages: Router,
}

impl Transport {
    /// Finds out which protocol `stream` speaks, and does the handshake. There is no time limit here. Encryption
    /// buffers at most `buffer` bytes.
    pub(super) async fn open(self, stream: TcpStream, buffer: usize) -> io::Result<ReadyConnection> {
        let (tls, pages, plain) = match self {
            Self::Plain { pages } => return Ok(ReadyConnection { line: Box::new(stream), http2: false, pages }),
            Self::Encrypted { tls, pages, plain } => (tls, pages, plain),
        };

        let mut first = [0];
        let is_handshake = stream.peek(&mut first).await? == 1 && first[0] == HANDSHAKE;
        if !is_handshake {
            return Ok(ReadyConnection { line: Box::new(stream), http2: false, pages: plain });
        }

        // A picture that waits in this buffer would be seen late.
        let stream = tls.accept_with(stream, |connection| connection.set_buffer_limit(Some(buffer))).await?;
        let http2 = stream.get_ref().1.alpn_protocol() == Some(HTTP2);
        Ok(ReadyConnection { line: Box::new(stream), http2, pages })
    }
}

/// A connection's bytes, encrypted or not.
pub(super) trait Line: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Line for T {}

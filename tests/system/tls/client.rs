//! A client that inspects TLS: the certificate it was shown, and the HTTP version agreed on.

use bytes::Bytes;
use http_body_util::{BodyExt, Full};
use hyper::body::Incoming;
use hyper::client::conn::{http1, http2};
use hyper::{Request, Response};
use hyper_util::rt::{TokioExecutor, TokioIo};
use tokio::net::TcpStream;
use tokio_rustls::client::TlsStream;

use super::trust::Trust;
use crate::support::Server;

impl Trust {
    /// Trusts the local authority of `server`.
    pub fn of(server: &Server, protocols: &[&str]) -> Self {
        Self::in_authority(&server.data.path().join("tls/authority.crt"), protocols)
    }
}

/// The certificate that the server showed on `stream`.
pub fn certificate(stream: &TlsStream<TcpStream>) -> Vec<u8> {
    stream.get_ref().1.peer_certificates().unwrap()[0].to_vec()
}

/// The application protocol that both ends of `stream` agreed on.
pub fn protocol(stream: &TlsStream<TcpStream>) -> String {
    String::from_utf8(stream.get_ref().1.alpn_protocol().unwrap_or_default().to_vec()).unwrap()
}

/// A GET of `path` with the key of `role`.
pub fn get_as(server: &Server, role: &str, path: &str) -> Request<Full<Bytes>> {
    request(server, role, "GET", path, Bytes::new())
}

/// A request with the key of `role`, and `body` as JSON unless it is empty.
pub fn request(server: &Server, role: &str, method: &str, path: &str, body: Bytes) -> Request<Full<Bytes>> {
    let mut request = Request::builder()
        .method(method)
        .uri(format!("https://{}{path}", server.address))
        .header("authorization", format!("Bearer {}", server.key(role)));
    if !body.is_empty() {
        request = request.header("content-type", "application/json");
    }
    request.body(Full::new(body)).unwrap()
}

/// A connection that speaks HTTP/2.
pub async fn http2(server: &Server) -> http2::SendRequest<Full<Bytes>> {
    http2_trusting(&Trust::of(server, &["h2", "http/1.1"]), server).await
}

/// The same, with a client that trusts `trust` instead of the server's own authority.
pub async fn http2_trusting(trust: &Trust, server: &Server) -> http2::SendRequest<Full<Bytes>> {
    let stream = trust.connect(server.address, "127.0.0.1").await.unwrap();
    assert_eq!(protocol(&stream), "h2");
    let (sender, connection) = http2::handshake(TokioExecutor::new(), TokioIo::new(stream)).await.unwrap();
    tokio::spawn(connection);
    sender
}

/// Requests `path` without encryption, as a browser does for `http://`.
pub async fn plain(server: &Server, method: &str, path: &str) -> Response<Incoming> {
    let stream = TcpStream::connect(server.address).await.unwrap();
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await.unwrap();
    tokio::spawn(connection);
    let request = Request::builder().method(method).uri(path).header("host", server.address.to_string());
    sender.send_request(request.body(Full::<Bytes>::default()).unwrap()).await.unwrap()
}

/// The whole body of `response`, as text.
pub async fn text(response: Response<Incoming>) -> String {
    String::from_utf8(response.into_body().collect().await.unwrap().to_bytes().to_vec()).unwrap()
}

//! A refusal needs no more than a request's head. The connection stays usable, also when the body comes after the head.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::support::Server;

/// Reads `connection` until what was read contains `end`, or until the server closes it. Returns what was read.
async fn read_until(connection: &mut TcpStream, end: &str) -> String {
    let mut read = Vec::new();
    while !String::from_utf8_lossy(&read).contains(end) {
        match connection.read_buf(&mut read).await {
            Ok(0) | Err(_) => break,
            Ok(_) => {}
        }
    }
    String::from_utf8(read).unwrap()
}

#[tokio::test]
async fn after_a_refusal_the_next_request_on_the_connection_is_answered() {
    let server = Server::within();
    let host = server.address;
    let body = r#"{"code": "S-01"}"#;
    let mut connection = TcpStream::connect(host).await.unwrap();
    let head = format!(
        "POST /api/operator/participants HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n\
         Content-Length: {}\r\n\r\n",
        body.len()
    );
    connection.write_all(head.as_bytes()).await.unwrap();

    // As Python's clients send it. While the body is on its way, the server has time to refuse.
    for _ in 0..3 {
        assert_eq!(server.look("researcher", "/api/chain/head").await.0, 200);
    }
    connection.write_all(body.as_bytes()).await.unwrap();

    let refused = read_until(&mut connection, "}").await;
    assert!(refused.starts_with("HTTP/1.1 403") && !refused.contains("connection: close"), "{refused}");
    let key = server.key("researcher");
    let request = format!("GET /api/chain/head HTTP/1.1\r\nHost: {host}\r\nAuthorization: Bearer {key}\r\n\r\n");
    connection.write_all(request.as_bytes()).await.unwrap();
    let next = read_until(&mut connection, "}").await;
    assert!(next.starts_with("HTTP/1.1 200"), "{next}");
}

#[tokio::test]
async fn a_refusal_does_not_wait_long_for_a_body_and_says_that_it_closes_the_connection() {
    let server = Server::within();
    let mut connection = TcpStream::connect(server.address).await.unwrap();
    let head =
        format!("POST /api/operator/participants HTTP/1.1\r\nHost: {}\r\nContent-Length: 20\r\n\r\n{{", server.address);
    connection.write_all(head.as_bytes()).await.unwrap();

    let refused = read_until(&mut connection, "}").await;
    assert!(refused.starts_with("HTTP/1.1 403") && refused.contains("connection: close"), "{refused}");
}

//! Pages, streams and comments over TLS, and clients with slow handshakes.

use std::time::Duration;

use bytes::Bytes;
use futures_util::StreamExt;
use http_body_util::BodyExt;
use jiff::Timestamp;
use parfocal_base::clock::{Clock, SystemClock};
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_tungstenite::client_async;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use super::client::{get_as, http2, plain, protocol, request, text};
use super::trust::Trust;
use crate::support::Server;

#[tokio::test]
async fn http2_is_agreed_on_and_http1_is_spoken_with_who_knows_nothing_else() {
    let server = Server::encrypted();
    for (offered, agreed) in [(vec!["h2", "http/1.1"], "h2"), (vec!["http/1.1"], "http/1.1"), (vec![], "")] {
        let stream = Trust::of(&server, &offered).connect(server.address, "localhost").await.unwrap();
        assert_eq!(protocol(&stream), agreed);
    }
}

#[tokio::test]
async fn a_page_comes_over_http2_and_its_cookie_never_goes_in_the_clear() {
    let server = Server::encrypted();
    let mut http2 = http2(&server).await;
    let page = http2.send_request(get_as(&server, "operator", "/operator")).await.unwrap();
    assert_eq!(page.status(), 200);
    let page = text(page).await;
    let link = format!("https://{}/enter?key={}", server.address, server.key("surgeon"));
    assert!(page.contains(&link), "the surgeon's link");

    let enter = format!("/enter?key={}", server.key("operator"));
    let entered = http2.send_request(get_as(&server, "operator", &enter)).await.unwrap();
    let cookie = entered.headers()["set-cookie"].to_str().unwrap().to_owned();
    assert!(cookie.contains("; HttpOnly; SameSite=Strict; Secure; "), "{cookie}");
    // Signing out also sets the account's cookie.
    let out = request(&server, "operator", "POST", "/api/sign-out", Bytes::new());
    let out = http2.send_request(out).await.unwrap();
    assert!(out.headers()["set-cookie"].to_str().unwrap().contains("; Secure; "), "{out:?}");
}

#[tokio::test]
async fn another_site_changes_nothing_over_http2_and_neither_does_a_page_that_came_in_the_clear() {
    let server = Server::encrypted();
    let mut http2 = http2(&server).await;
    let mut post = async |origin: String| {
        let mut post = request(&server, "operator", "POST", "/api/sign-out", Bytes::new());
        post.headers_mut().insert("origin", origin.parse().unwrap());
        http2.send_request(post).await.unwrap().status().as_u16()
    };

    assert_eq!(post(format!("https://{}", server.address)).await, 204);
    assert_eq!(post(format!("http://{}", server.address)).await, 403);
    assert_eq!(post("https://evil.example".to_owned()).await, 403);
}

#[tokio::test]
async fn pictures_and_state_come_over_tls() {
    let server = Server::encrypted();

    // Motion JPEG together with a page, on one HTTP/2 connection.
    let mut http2 = http2(&server).await;
    let mut stream = http2.send_request(get_as(&server, "surgeon", "/stream.mjpeg")).await.unwrap().into_body();
    let mut received = Vec::new();
    while !contains(&received, b"\xff\xd8\xff") {
        received.extend_from_slice(stream.frame().await.unwrap().unwrap().data_ref().unwrap());
    }
    assert_eq!(http2.send_request(get_as(&server, "surgeon", "/surgeon")).await.unwrap().status(), 200);

    // The page's own stream, a WebSocket.
    let line = Trust::of(&server, &["http/1.1"]).connect(server.address, "127.0.0.1").await.unwrap();
    let mut upgrade = format!("wss://{}/live?role=surgeon", server.address).into_client_request().unwrap();
    let key = format!("Bearer {}", server.key("surgeon"));
    upgrade.headers_mut().insert("authorization", key.parse().unwrap());
    let (mut socket, _) = client_async(upgrade, line).await.unwrap();
    let (mut status, mut pictures) = (None, 0);
    while status.is_none() || pictures == 0 {
        match socket.next().await.unwrap().unwrap() {
            Message::Text(text) => {
                let told: Value = serde_json::from_str(&text).unwrap();
                status = status.or_else(|| (told["type"] == "status").then_some(told));
            }
            Message::Binary(_) => pictures += 1,
            _ => {}
        }
    }

    // A page that is still open when the certificate ends says so itself, because the server cannot reach it then.
    let until: Timestamp = status.unwrap()["certificate_until"].as_str().unwrap().parse().unwrap();
    let days = until.duration_since(SystemClock.wall()).as_hours() / 24;
    assert!((88..=90).contains(&days), "the authority's certificates live 90 days; this one has {days} left");
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

#[tokio::test]
async fn a_comment_is_saved_over_http2() {
    let server = Server::encrypted();
    let mut http2 = http2(&server).await;
    let mut post = async |role: &str, path: &str, body: Value| {
        let post = request(&server, role, "POST", path, body.to_string().into());
        let answer = http2.send_request(post).await.unwrap();
        assert!(answer.status().is_success(), "{path}: {}", text(answer).await);
        text(answer).await
    };

    post("operator", "/api/operator/participants", json!({"code": "S-01"})).await;
    let new = json!({"participant": "S-01", "protocol": "practice"});
    let session: Value = serde_json::from_str(&post("operator", "/api/operator/sessions", new).await).unwrap();
    let session = session["session"].as_str().unwrap();
    let key = "00000000-0000-4000-8000-000000000001";
    let comment = json!({"key": key, "session": session, "kind": "text", "text": "sharp at last"});
    post("surgeon", "/api/surgeon/comments", comment).await;

    let session = http2.send_request(get_as(&server, "operator", "/api/operator/session")).await.unwrap();
    let session: Value = serde_json::from_str(&text(session).await).unwrap();
    assert!(session["latest_comments"][0].to_string().contains("sharp at last"), "{session}");
}

#[tokio::test]
async fn who_says_nothing_holds_up_nobody_and_is_let_go() {
    let server = Server::encrypted();
    let mut silent = Vec::new();
    for begin in [&b""[..], &[22], &[22, 3, 1, 2, 0, 1]] {
        let mut line = TcpStream::connect(server.address).await.unwrap();
        line.write_all(begin).await.unwrap();
        silent.push(line);
    }

    let mut http2 = http2(&server).await;
    assert_eq!(http2.send_request(get_as(&server, "surgeon", "/surgeon")).await.unwrap().status(), 200);

    // The server closes each of them by itself.
    for mut line in silent {
        let mut rest = Vec::new();
        let closed = tokio::time::timeout(Duration::from_mins(1), line.read_to_end(&mut rest)).await;
        assert!(closed.is_ok(), "still open");
    }
}

#[tokio::test]
async fn a_broken_handshake_leaves_the_server_as_it_was() {
    let server = Server::encrypted();
    let mut line = TcpStream::connect(server.address).await.unwrap();
    line.write_all(&[22; 512]).await.unwrap();
    let mut answer = Vec::new();
    line.read_to_end(&mut answer).await.unwrap();
    // A TLS alert (21), and the end of the connection.
    assert_eq!(answer.first(), Some(&21), "{answer:?}");
    assert_eq!(plain(&server, "GET", "/trust").await.status(), 200);
}

//! The live stream: paced by its viewers, silent for hidden pages, and without a trace of the policy for surgeons.

use std::net::SocketAddr;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use reqwest::Method;
use reqwest::header::AUTHORIZATION;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async, tungstenite};
use tungstenite::Message;

use super::recordings::begin;
use crate::support::{BRAIN, Server};

/// What does not come in this time never comes.
const PATIENCE: Duration = Duration::from_mins(2);

/// The client end of a page's stream.
pub struct Page {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
    /// Everything received so far, without the pictures themselves.
    pub heard: Vec<Heard>,
}

/// Something that a page received.
#[derive(Debug)]
pub enum Heard {
    /// A state message, as it was sent.
    Text(String),
    /// The header of a picture.
    Frame(Value),
}

/// A frame as a page receives it.
pub struct Frame {
    /// The header of the picture.
    pub header: Value,
    /// The picture as JPEG.
    pub jpeg: Vec<u8>,
}

impl Frame {
    /// Number of the frame.
    pub fn number(&self) -> u64 {
        self.header["frame"].as_u64().unwrap()
    }

    fn fields(&self) -> Vec<&str> {
        let mut fields: Vec<_> = self.header.as_object().unwrap().keys().map(String::as_str).collect();
        fields.sort_unstable();
        fields
    }
}

impl Page {
    pub async fn open(server: &Server, role: &str) -> Self {
        Self::through(server.address, server, role).await
    }

    /// The same, through the program that listens on `address`.
    pub async fn through(address: SocketAddr, server: &Server, role: &str) -> Self {
        let mut request = upgrade(server, &format!("/live?role={role}"), role);
        *request.uri_mut() = format!("ws://{address}/live?role={role}").parse().unwrap();
        Self { socket: connect_async(request).await.unwrap().0, heard: Vec::new() }
    }

    /// Sends a message.
    pub async fn say(&mut self, message: Value) {
        self.socket.send(Message::text(message.to_string())).await.unwrap();
    }

    /// Waits for the next message other than a ping.
    pub async fn message(&mut self) -> Message {
        let message = self.socket.next().await.unwrap().unwrap();
        match &message {
            Message::Text(text) => self.heard.push(Heard::Text(text.to_string())),
            Message::Binary(frame) => self.heard.push(Heard::Frame(unpack(frame).header)),
            _ => {}
        }
        message
    }

    /// Waits for the next frame.
    pub async fn frame(&mut self) -> Frame {
        loop {
            if let Message::Binary(frame) = self.message().await {
                return unpack(&frame);
            }
        }
    }

    /// The state messages so far.
    fn told(&self) -> Vec<Value> {
        let texts = self.heard.iter().filter_map(|heard| match heard {
            Heard::Text(text) => Some(serde_json::from_str(text).unwrap()),
            Heard::Frame(_) => None,
        });
        texts.collect()
    }

    /// Waits for a state message that is `wanted`, acknowledging the frames that come in between.
    pub async fn until(&mut self, wanted: impl Fn(&Value) -> bool) {
        let told = async {
            loop {
                match self.message().await {
                    Message::Text(text) if wanted(&serde_json::from_str(&text).unwrap()) => return,
                    Message::Binary(frame) => self.drawn(&unpack(&frame)).await,
                    _ => {}
                }
            }
        };
        let in_time = tokio::time::timeout(PATIENCE, told).await.is_ok();
        assert!(in_time, "waited {PATIENCE:?} for a message; the last one: {:?}", self.told().last());
    }

    /// Waits until the server closes the connection, and returns its code.
    async fn refused(&mut self) -> CloseCode {
        loop {
            match self.message().await {
                Message::Close(Some(frame)) => return frame.code,
                Message::Close(None) => panic!("no reason"),
                _ => {}
            }
        }
    }

    /// Waits for a frame with a belief, and returns the belief.
    pub async fn until_belief(&mut self) -> Vec<Value> {
        self.watch_until(|header| header["belief"].is_array()).await.header["belief"].as_array().unwrap().clone()
    }

    /// Acknowledges that `frame` is drawn.
    pub async fn drawn(&mut self, frame: &Frame) {
        self.say(json!({"type": "drawn", "frame": frame.number()})).await;
    }

    /// Number of frames that the server sends before it answers this ping.
    pub async fn sent_so_far(&mut self) -> usize {
        self.socket.send(Message::Ping("so far".into())).await.unwrap();
        let mut frames = 0;
        loop {
            match self.message().await {
                Message::Binary(_) => frames += 1,
                Message::Pong(payload) if payload == "so far" => return frames,
                _ => {}
            }
        }
    }

    /// Acknowledges frames until one fits, and returns that one.
    pub async fn watch_until(&mut self, fits: impl Fn(&Value) -> bool) -> Frame {
        let watched = async {
            loop {
                let frame = self.frame().await;
                self.drawn(&frame).await;
                if fits(&frame.header) {
                    return frame;
                }
            }
        };
        let Ok(frame) = tokio::time::timeout(PATIENCE, watched).await else {
            panic!("waited {PATIENCE:?} for a picture that fits; the last message: {:?}", self.heard.last());
        };
        frame
    }

    /// Waits for and acknowledges `count` frames.
    pub async fn watch(&mut self, count: usize) {
        for _ in 0..count {
            let frame = self.frame().await;
            self.drawn(&frame).await;
        }
    }
}

/// A request for a WebSocket at `path`, with the key of `role`.
pub fn upgrade(server: &Server, path: &str, role: &str) -> Request {
    let mut request = format!("ws://{}{path}", server.address).into_client_request().unwrap();
    let bearer = format!("Bearer {}", server.key(role)).parse().unwrap();
    request.headers_mut().insert(AUTHORIZATION, bearer);
    request
}

/// Parses a frame message: header length (u16, little-endian), header, JPEG.
fn unpack(message: &[u8]) -> Frame {
    let length = usize::from(u16::from_le_bytes([message[0], message[1]]));
    let header = serde_json::from_slice(&message[2..2 + length]).unwrap();
    Frame { header, jpeg: message[2 + length..].to_vec() }
}

#[tokio::test]
async fn frames_are_whole_pictures_with_their_metadata() {
    let server = Server::seeing();
    let mut page = Page::open(&server, "surgeon").await;
    let frame = page.frame().await;
    let picture = image::load_from_memory_with_format(&frame.jpeg, image::ImageFormat::Jpeg).unwrap();
    assert_eq!(json!(picture.width()), frame.header["width"]);
    assert_eq!(json!(picture.height()), frame.header["height"]);
    assert_eq!(frame.header["patch"]["width"], 32);
    assert!(frame.header["age"].as_f64().unwrap() >= 0.0);
}

#[tokio::test]
async fn who_does_not_answer_gets_no_second_frame_and_then_the_latest() {
    let server = Server::seeing();
    let mut slow = Page::open(&server, "operator").await;
    let mut quick = Page::open(&server, "operator").await;
    let first = slow.frame().await;
    quick.watch(8).await;
    assert_eq!(slow.sent_so_far().await, 0);
    slow.say(json!({"type": "drawn", "frame": first.number() + 1})).await;
    quick.watch(2).await;
    assert_eq!(slow.sent_so_far().await, 0, "another frame's number is no answer");
    slow.drawn(&first).await;
    let second = slow.frame().await;
    assert!(second.number() >= first.number() + 8, "the latest, not the next");
    quick.watch(4).await;
    assert_eq!(slow.sent_so_far().await, 0);
}

#[tokio::test]
async fn a_hidden_page_gets_nothing_until_it_is_seen_again() {
    let server = Server::seeing();
    let mut hidden = Page::open(&server, "surgeon").await;
    let mut other = Page::open(&server, "surgeon").await;
    let frame = hidden.frame().await;
    hidden.say(json!({"type": "visible", "visible": false})).await;
    hidden.drawn(&frame).await;
    assert_eq!(hidden.sent_so_far().await, 0);
    other.watch(5).await;
    assert_eq!(hidden.sent_so_far().await, 0);
    hidden.say(json!({"type": "visible", "visible": true})).await;
    assert!(hidden.frame().await.number() > frame.number());
}

#[tokio::test]
async fn surgeons_get_no_field_that_could_tell_a_policy() {
    let server = Server::seeing();
    let mut surgeon = Page::open(&server, "surgeon").await;
    let frame = surgeon.frame().await;
    assert_eq!(
        frame.fields(),
        [
            "age",
            "area",
            "choices",
            "estimated",
            "frame",
            "height",
            "patch",
            "per_cell",
            "pointed",
            "reduced",
            "run",
            "travel",
            "width"
        ]
    );
    assert!(frame.header["age"].as_f64().unwrap() % 100.0 == 0.0, "finer, it would hold the policy's own time");
    surgeon.sent_so_far().await;
    let told = surgeon.told();
    let status = told.iter().find(|told| told["type"] == "status").expect("a status");
    let mut fields: Vec<_> = status.as_object().unwrap().keys().collect();
    fields.sort_unstable();
    assert_eq!(fields, ["camera_simulated", "certificate_until", "lens_simulated", "notice", "type"]);
    assert!(told.contains(&json!({"type": "session", "view": null})));

    let mut operator = Page::open(&server, "operator").await;
    let frame = operator.frame().await;
    for field in ["asked", "measured", "metric", "held", "belief"] {
        assert!(frame.fields().contains(&field), "{field}");
    }
}

#[tokio::test]
async fn a_belief_goes_to_the_operator_and_never_to_a_surgeon() {
    let server = Server::seeing();
    server.post("/api/operator/focus", json!({"policy": "parfocal"})).await;
    let mut surgeon = Page::open(&server, "surgeon").await;
    let mut operator = Page::open(&server, "operator").await;
    let belief = operator.until_belief().await;
    // The belief tracker's probability of each slice of focal power.
    assert_eq!(belief.len(), 41);
    assert!((belief.iter().map(|slice| slice.as_f64().unwrap()).sum::<f64>() - 1.0).abs() < 1e-3, "{belief:?}");
    surgeon.watch(5).await;
    for heard in &surgeon.heard {
        assert!(!format!("{heard:?}").contains("belief"), "{heard:?}");
    }
}

#[tokio::test]
async fn depth_maps_go_to_an_operator_who_asks_outside_sessions_and_never_to_a_surgeon() {
    let server = Server::seeing();
    let mut operator = Page::open(&server, "operator").await;
    operator.watch_until(|header| header["depths"].is_null()).await;
    operator.say(json!({"type": "depths", "wanted": true})).await;
    // It learns while the lens moves.
    server.post("/api/operator/focus", json!({"policy": "mgm-hill-climber"})).await;
    let is_sure = |header: &Value| {
        let places = header["depths"]["places"].as_array();
        places.is_some_and(|places| places.iter().filter(|place| place["side"] == "in-focus").count() >= 3)
    };
    let frame = operator.watch_until(is_sure).await;
    let area = &frame.header["area"];
    let middle = |key: &str| area[key].as_f64().unwrap();
    for place in frame.header["depths"]["places"].as_array().unwrap() {
        let at = |key: &str| place[key].as_f64().unwrap() - middle(key);
        assert!(at("x").hypot(at("y")) < middle("radius"), "{place} in {area}");
    }

    operator.say(json!({"type": "depths", "wanted": false})).await;
    operator.watch_until(|header| header["depths"].is_null()).await;

    let mut surgeon = Page::open(&server, "surgeon").await;
    surgeon.say(json!({"type": "depths", "wanted": true})).await;
    assert_eq!(surgeon.refused().await, CloseCode::Policy);
    assert!(!format!("{:?}", surgeon.heard).contains("depths"));

    operator.say(json!({"type": "depths", "wanted": true})).await;
    operator.watch_until(is_sure).await;
    let session = begin(&server, "practice").await;
    operator.until(|told| told["view"]["session"] == session).await;
    // The next frames were made after the session had begun, and so are all others.
    for _ in 0..5 {
        let frame = operator.frame().await;
        assert_eq!(frame.header["depths"], Value::Null);
        operator.drawn(&frame).await;
    }
}

#[tokio::test]
async fn a_role_that_is_not_held_is_not_served() {
    let server = Server::with(&["--bind", "0.0.0.0:0", "--insecure", "--camera", BRAIN]);
    let error =
        connect_async(upgrade(&server, "/live?role=operator", "surgeon")).await.expect_err("a surgeon is no operator");
    assert!(matches!(error, tungstenite::Error::Http(response) if response.status() == 403));
}

#[tokio::test]
async fn nonsense_closes_the_connection_with_a_reason() {
    let server = Server::seeing();
    let mut page = Page::open(&server, "operator").await;
    page.say(json!({"type": "drawn"})).await;
    assert_eq!(page.refused().await, CloseCode::Policy);
}

#[tokio::test]
async fn pages_learn_when_the_server_ends() {
    let mut server = Server::seeing();
    let mut page = Page::open(&server, "surgeon").await;
    page.frame().await;
    assert!(server.end(rustix::process::Signal::TERM));
    let code = loop {
        match page.socket.next().await.unwrap() {
            Ok(Message::Close(Some(frame))) => break frame.code,
            Ok(_) => {}
            Err(error) => panic!("cut off: {error}"),
        }
    };

    assert_eq!(code, CloseCode::Away);
}

#[tokio::test]
async fn motion_jpeg_sends_the_next_parts_headers_at_once() {
    const PART: &[u8] = b"--parfocal-frame\r\nContent-Type: image/jpeg\r\n\r\n";
    let server = Server::seeing();
    let mut response = server.get_as("surgeon", "/stream.mjpeg").send().await.unwrap();
    assert_eq!(response.headers()["content-type"], "multipart/x-mixed-replace; boundary=parfocal-frame");
    let mut stream = Vec::new();
    let mut complete = 0;
    while complete < 3 {
        stream.extend_from_slice(&response.chunk().await.unwrap().expect("no end"));
        // The headers of the next part are here, so the previous part is complete without a byte of the next picture.
        complete += usize::from(stream.ends_with(PART) && stream.len() > PART.len());
    }

    assert!(stream.starts_with(PART));
    let end = stream.windows(PART.len()).skip(1).position(|window| window == PART).unwrap() + 1;
    let first = &stream[PART.len()..end - 2];
    assert_eq!(&stream[end - 2..end], b"\r\n");
    image::load_from_memory_with_format(first, image::ImageFormat::Jpeg).unwrap();
}

#[tokio::test]
async fn a_tablet_that_goes_silent_is_told_to_the_operator_and_pauses_the_papers_setting() {
    let server = Server::seeing();
    let mut operator = Page::open(&server, "operator").await;
    operator.until(|told| told["tablet"]["presence"] == "never-seen").await;
    let mut surgeon = Page::open(&server, "surgeon").await;
    surgeon.say(json!({"type": "visible", "visible": true})).await;
    operator.until(|told| told["tablet"]["presence"] == "present").await;

    let session = server.prepare("S-01", "paper").await;
    server.post("/api/operator/actions", json!({"session": session, "action": "start"})).await;
    let started = server.read("/api/surgeon/session").await;
    let tap = json!({"session": session, "action": "acknowledge", "segment": started["segment"]});
    server.post("/api/surgeon/actions", tap).await;
    surgeon.watch(20).await;

    // The page from before has not been read meanwhile. After ten seconds, which 20 frames take on a busy machine, the
    // server lets such a page go.
    let mut operator = Page::open(&server, "operator").await;
    drop(surgeon);
    operator.until(|told| told["tablet"]["presence"] == "silent" && told["tablet"]["away_seconds"].is_u64()).await;
    // The session may have followed before the sign was sent, so the server is asked, at each status.
    let view = async || server.read("/api/operator/session").await;
    while view().await["paused_by"] != "tablet-away" {
        operator.until(|told| told["type"] == "status").await;
    }

    let mut back = Page::open(&server, "surgeon").await;
    back.watch(5).await;
    let is_back = |view: &Value| {
        view["log"].as_array().unwrap().iter().any(|line| line["text"] == "The surgeon’s tablet is back")
    };
    while !is_back(&view().await) {
        operator.until(|told| told["type"] == "status").await;
    }

    // The size of the picture belongs to the record. For the operator it would push out what people did.
    let texts = |of: &Value| {
        let lines = of["log"].as_array().unwrap().iter();
        lines.map(|line| line["text"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let seen = |texts: &[String]| texts.iter().any(|text| text.starts_with("Setting 1 seen at 512x272"));
    let shown = texts(&view().await);
    assert!(!seen(&shown) && shown.contains(&"Paused: the surgeon’s tablet is away".to_owned()), "{shown:?}");

    let recorded = texts(&server.read(&format!("/api/researcher/sessions/{session}")).await);
    assert!(seen(&recorded), "{recorded:?}");
}

/// The emergency: pause, then the lens by hand. Neither asks for anything.
#[tokio::test]
async fn two_requests_lead_from_a_running_setting_to_focus_by_hand() {
    let server = Server::seeing();
    let session = server.prepare("S-01", "practice").await;
    let act = async |body: Value| server.post("/api/operator/actions", body).await;
    act(json!({"session": session, "action": "start"})).await;
    let focus = async || {
        let by_hand = json!({"focal_power": 0.8});
        server.ask("operator", Method::POST, "/api/operator/focus", &by_hand).await.0.as_u16()
    };
    assert_eq!(focus().await, 409);

    act(json!({"session": session, "action": "pause"})).await;
    assert_eq!(focus().await, 204);
    let view = server.read("/api/operator/session").await;
    assert_eq!((&view["by_hand"], &view["may_focus_by_hand"]), (&json!(0.8), &json!(true)));
    let event = &view["reason_wanted"]["event"];
    let view = act(json!({"session": session, "action": "give-reason", "event": event, "reason": "bleeding"})).await;
    assert_eq!(view["reason_wanted"], Value::Null);
    assert!(view["log"][0]["text"].as_str().unwrap().contains("bleeding"));
}

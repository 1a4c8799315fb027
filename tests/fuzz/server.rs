//! A whole server, as bytes from the network reach it: requests, messages of the live view, pieces of voice, and what
//! comes to the port of an encrypted server, before TLS and inside it. Each thread has its own server with its own
//! folder, in a session that asks for voice. The server is replaced from time to time, so that changes by earlier
//! inputs do not add up.

use std::cell::{Cell, RefCell};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Once};
use std::time::Duration;

use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_dashboard::http::{self, ServerAddress};
use parfocal_dashboard::tls::Certificates;
use parfocal_trial::account::AccountRole;
use parfocal_trial::action::Action;
use parfocal_trial::remark::CommentContent;
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;
use tokio::time::timeout;
use tokio_rustls::client::TlsStream;

use super::app;
use super::fixture::Trial;
use super::http2;
use super::trust::Trust;

/// Inputs that one server takes.
const LIFE: u32 = 2000;

/// If an answer has not ended by then, the server waits for more of the request. The request is then ended.
const PATIENCE: Duration = Duration::from_millis(5);

/// Longest that a connection may last after the client has said that nothing more comes.
const LONGEST: Duration = Duration::from_secs(20);

/// The roles' keys. They are the same in every server, so that the requests in the seeds are let in.
const KEYS: &str = include_str!("../../fuzz/corpus/keys/seed.toml");
const SURGEON: &str = "0123456789abcdef0123456789abcdef";
const OPERATOR: &str = "123456789abcdef0123456789abcdef0";
const RESEARCHER: &str = "23456789abcdef0123456789abcdef01";

const PROTOCOL: &str = include_str!("../system/browser/spoken.toml");

thread_local! {
    static SERVER: RefCell<Option<Server>> = const { RefCell::new(None) };
    /// Number of panics on this thread, including those that the server catches.
    static PANICS: Cell<u64> = const { Cell::new(0) };
}

/// A server and its addresses.
struct Server {
    runtime: Runtime,
    /// Address at which every page is served without encryption.
    open: SocketAddr,
    /// Address of the encrypted pages. Without encryption, it leads to them.
    encrypted: SocketAddr,
    /// What a client of the encrypted pages trusts. The client speaks HTTP/2.
    trust: Trust,
    /// Inputs that it has taken.
    taken: u32,
    trial: Trial,
    /// Ends the server when dropped.
    _end: watch::Sender<bool>,
    _folder: TempDir,
}

impl Drop for Server {
    fn drop(&mut self) {
        // Ends the threads that wait for pictures.
        self.trial.control.frames.close();
    }
}

/// Identifiers in the seeds. They are the same in every server.
#[derive(Clone, Copy)]
struct Names {
    session: SessionId,
    segment: SegmentId,
    comment: IdempotencyKey,
}

/// Bytes to the port of an encrypted server: a handshake, or a request without encryption.
pub fn door(bytes: &[u8]) {
    ask(at_the_door, bytes);
}

/// Requests that are redirected to the encrypted pages or refused. The folder of seeds holds a TLS handshake.
pub fn knocks() -> Vec<Vec<u8>> {
    let requests = [
        "GET / HTTP/1.1\r\nHost: 10.0.0.5:8080\r\n\r\n",
        "GET /surgeon?a=%20b HTTP/1.1\r\nHost: exoscope.local\r\nAccept: text/html\r\n\r\n",
        "GET /trust HTTP/1.1\r\nHost: [fd00::7]:8080\r\nAccept: text/html\r\n\r\n",
        "GET /trust/authority.mobileconfig HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET http://elsewhere.example/trust/check HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "POST /api/sign-in HTTP/1.1\r\nHost: localhost\r\nContent-Length: 2\r\n\r\n{}",
        "HEAD /static/0/shared/api.js HTTP/1.0\r\n\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ];
    requests.map(|request| request.as_bytes().to_vec()).to_vec()
}

/// Bytes of a client in HTTP/2, inside TLS.
pub fn in_http2(bytes: &[u8]) {
    let statuses = http2::statuses(&ask(inside_tls, bytes));
    assert!(!statuses.contains(&Some(http2::STATUS_500)), "the server failed");
}

/// Requests in HTTP/2, with a body and without, and a client's other frames.
pub fn http2_requests() -> Vec<Vec<u8>> {
    let page = http2::request(1, "GET", "/surgeon", SURGEON, b"");
    let focus = http2::request(3, "POST", "/api/operator/focus", OPERATOR, br#"{"focal_power":0.5}"#);
    [page, focus, http2::asides()].map(|frames| [http2::opening(), frames].concat()).to_vec()
}

/// Bytes to a server's port without encryption: requests to every page, by every role.
pub fn request(bytes: &[u8]) {
    ask(in_the_clear, bytes);
}

/// Requests as pages and programs make them.
pub fn requests() -> Vec<Vec<u8>> {
    let Names { session, segment, comment } = names();
    let (session, segment, comment) = (session.to_string(), segment.to_string(), comment.0.to_string());

    let reads = [
        (SURGEON, "/surgeon".to_owned()),
        (SURGEON, "/api/surgeon/session".to_owned()),
        (SURGEON, format!("/enter?key={SURGEON}")),
        (OPERATOR, "/operator".to_owned()),
        (OPERATOR, "/api/operator/surgeon-link".to_owned()),
        (OPERATOR, "/api/operator/choices".to_owned()),
        (RESEARCHER, "/researcher".to_owned()),
        (RESEARCHER, format!("/researcher/sessions/{session}")),
        (RESEARCHER, format!("/api/researcher/sessions/{session}/timeline")),
        (RESEARCHER, format!("/api/researcher/sessions/{session}/voice/{comment}")),
        (RESEARCHER, format!("/api/researcher/sessions/{session}/recordings/view/frames/3?fine=true")),
        (RESEARCHER, "/sign-in?next=/researcher/studies".to_owned()),
        (RESEARCHER, "/metrics".to_owned()),
    ];
    let reads = reads.into_iter().map(|(key, path)| {
        let more = "Accept: text/html\r\nRange: bytes=1-3\r\nCookie: parfocal-surgeon=a; parfocal-account=b\r\n";
        format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\n{more}\r\n").into_bytes()
    });

    let said = |kind: &str, text: &str| {
        format!(
            r#"{{"key":"{}","session":"{session}","segment":"{segment}","frame":7,"run":1,"device":"{comment}",
            "sequence":1,"client_millis":1772355600000,"waited_millis":12,"kind":"{kind}"{text}}}"#,
            uuid::Uuid::from_u128(7)
        )
    };
    let writes = [
        (SURGEON, "surgeon/comments", said("text", r#","text":"sharp""#)),
        (SURGEON, "surgeon/comments", said("voice", "")),
        (SURGEON, "surgeon/holding", format!(r#"{{"session":"{session}","device":"{comment}","holding":2}}"#)),
        (SURGEON, "surgeon/actions", act(&session, &format!(r#""finish-segment","segment":"{segment}""#))),
        (OPERATOR, "operator/actions", act(&session, r#""pause","reason":"the patient""#)),
        (OPERATOR, "operator/actions", act(&session, r#""resume""#)),
        (OPERATOR, "operator/focus", r#"{"focal_power":0.5}"#.to_owned()),
        (OPERATOR, "operator/participants", r#"{"code":"S-77"}"#.to_owned()),
        (OPERATOR, "operator/sessions", r#"{"participant":"S-01","protocol":"practice"}"#.to_owned()),
        (OPERATOR, "operator/camera", r#"{"setting":"gain","value":2.0}"#.to_owned()),
        (OPERATOR, "sign-in", r#"{"name":"lead","passphrase":"four words and a number 7"}"#.to_owned()),
        (
            OPERATOR,
            "operator/consents",
            format!(
                r#"{{"session":"{session}","text_version":"3","given_on":"2026-03-01",
                "obtained_by":"AB","medium":"paper"}}"#
            ),
        ),
        (RESEARCHER, "researcher/studies", r#"{"definition":"name = \"a\"","reason":"planned"}"#.to_owned()),
    ];
    let mut writes: Vec<_> = writes.iter().map(|(key, path, body)| post(key, path, "application/json", body)).collect();
    let correction = r#"{"field":"participant","old":"S-01","new":"S-02","reason":"a misspelled code"}"#;
    let corrections = format!("researcher/sessions/{session}/corrections");
    writes.push(post(RESEARCHER, &corrections, "application/json", correction));

    reads.chain(writes).chain(voices().iter().map(|voice| piece(voice))).collect()
}

/// A piece of a recording: the end of its address, its type, and then the sound, on a line each.
pub fn voice(bytes: &[u8]) {
    ask(in_the_clear, &piece(bytes));
}

/// Pieces of a recording, first and last.
pub fn voices() -> Vec<Vec<u8>> {
    let Names { session, comment, .. } = names();
    let address = format!("{}/1?session={session}&through_ms=1000", comment.0);
    let last = format!("{}/2?session={session}&through_ms=1200&ended=released", comment.0);
    vec![
        [format!("{address}\naudio/webm;codecs=opus\n").as_bytes(), b"\x1a\x45\xdf\xa3 sound"].concat(),
        format!("{address}\naudio/mp4; codecs=\"mp4a.40.2\"\nsound").into_bytes(),
        format!("{last}\naudio/webm;codecs=opus\n").into_bytes(),
    ]
}

/// Messages of a page to the live view, one a line. The line's first byte says which kind.
pub fn live(bytes: &[u8]) {
    let mut sent = upgrade();
    for line in bytes.split(|byte| *byte == b'\n') {
        let Some((kind, message)) = line.split_first() else { continue };
        // Text, binary, ping or pong. Any other byte is the opcode itself.
        let opcode = match kind {
            b't' => 0x81,
            b'b' => 0x82,
            b'?' => 0x89,
            b'!' => 0x8A,
            other => *other,
        };
        sent.extend(frame(opcode, message));
    }
    sent.extend(frame(0x88, &1000_u16.to_be_bytes()));
    ask(in_the_clear, &sent);
}

/// Messages that pages send to the live view.
pub fn messages() -> Vec<Vec<u8>> {
    let all = [
        r#"t{"type":"drawn","frame":1}"#,
        r#"t{"type":"screen","width":2048}"#,
        r#"t{"type":"visible","visible":false}"#,
        r#"t{"type":"visible","visible":true}"#,
        "?are you there",
        "bbytes",
    ];
    let apart = all.iter().map(|message| message.as_bytes().to_vec());
    apart.chain([all[..4].join("\n").into_bytes()]).collect()
}

/// The request that makes a connection a WebSocket.
fn upgrade() -> Vec<u8> {
    let key = format!("Authorization: Bearer {SURGEON}\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
    let what = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n";
    format!("GET /live?role=surgeon HTTP/1.1\r\nHost: localhost\r\n{key}{what}\r\n").into_bytes()
}

/// A frame of a WebSocket (RFC 6455, 5.2) from a client. Its mask changes nothing.
fn frame(opcode: u8, message: &[u8]) -> Vec<u8> {
    let mut frame = vec![opcode];
    match u16::try_from(message.len()) {
        Ok(length @ 0..126) => frame.push(0x80 | length as u8),
        Ok(length) => {
            frame.push(0xFE);
            frame.extend(length.to_be_bytes());
        }
        Err(_) => {
            frame.push(0xFF);
            frame.extend((message.len() as u64).to_be_bytes());
        }
    }
    frame.extend([0; 4]);
    frame.extend(message);
    frame
}

fn act(session: &str, action: &str) -> String {
    format!(r#"{{"session":"{session}","action":{action}}}"#)
}

fn post(key: &str, path: &str, media_type: &str, body: impl AsRef<[u8]>) -> Vec<u8> {
    let body = body.as_ref();
    let head = format!(
        "POST /api/{path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\nContent-Type: {media_type}\r\n\
         Content-Length: {}\r\n\r\n",
        body.len()
    );
    [head.as_bytes(), body].concat()
}

/// The request that sends a piece of a recording, made from its three lines.
fn piece(bytes: &[u8]) -> Vec<u8> {
    let mut lines = bytes.splitn(3, |byte| *byte == b'\n');
    let [address, media_type, sound] = [(); 3].map(|()| lines.next().unwrap_or_default());
    let [address, media_type] = [address, media_type].map(String::from_utf8_lossy);
    post(SURGEON, &format!("surgeon/voice/{address}"), &media_type, sound)
}

/// The identifiers in the seeds, as every server has them.
fn names() -> Names {
    let folder = tempfile::tempdir().unwrap();
    runtime().block_on(async { begin(&folder).await.1 })
}

/// Connects to the server of this thread with `connect`, sends `bytes` and returns the answer. Panics if anything in
/// the server panicked, or if the server answers that it failed.
fn ask<S>(connect: impl AsyncFnOnce(&Server) -> S, bytes: &[u8]) -> Vec<u8>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let mut kept = SERVER.take().filter(|server| server.taken < LIFE).unwrap_or_else(start);
    kept.taken += 1;
    let before = PANICS.get();
    let answer = kept.runtime.block_on(async { exchange(connect(&kept).await, bytes).await });

    let panics = PANICS.get() - before;
    // If this fails, the server is dropped, and the next input gets a new one.
    assert!(panics == 0, "the server panicked");
    let failed = b"HTTP/1.1 500";
    assert!(!answer.windows(failed.len()).any(|part| part == failed), "{}", String::from_utf8_lossy(&answer));
    SERVER.set(Some(kept));
    answer
}

/// Connects to what `server` serves unencrypted.
async fn in_the_clear(server: &Server) -> TcpStream {
    connection(server.open).await
}

/// Connects to the port of encrypted pages, and leaves the handshake to the input.
async fn at_the_door(server: &Server) -> TcpStream {
    connection(server.encrypted).await
}

/// Makes the TLS handshake, as a client that will speak HTTP/2.
async fn inside_tls(server: &Server) -> TlsStream<TcpStream> {
    let stream = server.trust.connect(server.encrypted, "127.0.0.1").await.unwrap();
    free_port_at_once(stream.get_ref().0);
    assert_eq!(stream.get_ref().1.alpn_protocol(), Some(&b"h2"[..]));
    stream
}

async fn connection(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).await.unwrap();
    free_port_at_once(&stream);
    stream
}

/// Frees the connection's port at once. Ports otherwise stay taken for a while, and a million connections would use up
/// those of this machine.
fn free_port_at_once(stream: &TcpStream) {
    stream.set_zero_linger().unwrap();
}

/// Sends `bytes` on `stream`, and reads the answer until its end.
async fn exchange(mut stream: impl AsyncRead + AsyncWrite + Unpin, bytes: &[u8]) -> Vec<u8> {
    // A server may end the connection before it has read everything.
    let _ = stream.write_all(bytes).await;
    // TLS may hold back the last bytes until then.
    let _ = stream.flush().await;
    let mut answer = Vec::new();
    if timeout(PATIENCE, stream.read_to_end(&mut answer)).await.is_err() {
        let _ = stream.shutdown().await;
        let ended = timeout(LONGEST, stream.read_to_end(&mut answer)).await;
        assert!(ended.is_ok(), "the connection never ended");
    }
    answer
}

fn runtime() -> Runtime {
    Builder::new_current_thread().enable_all().build().unwrap()
}

/// A trial in `folder`, in its first setting, about which the surgeon has begun to speak.
async fn begin(folder: &TempDir) -> (Trial, Names) {
    let protocols = folder.path().join("protocols");
    std::fs::create_dir(&protocols).unwrap();
    std::fs::write(protocols.join("spoken.toml"), PROTOCOL).unwrap();
    std::fs::write(folder.path().join("keys.toml"), KEYS).unwrap();

    let mut trial = Trial::start_with(folder.path(), Some(&protocols), 7).await;
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;
    let session = trial.begin("spoken").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    let mut comment = trial.comment("");
    comment.said = CommentContent::Voice;
    trial.conductor.comment(comment.clone()).await.unwrap();
    (trial, Names { session, segment, comment: comment.key })
}

fn start() -> Server {
    count_panics();
    let folder = tempfile::tempdir().unwrap();
    let runtime = runtime();
    let (end, shutdown) = watch::channel(false);
    let (trial, [open, encrypted]) = runtime.block_on(async {
        let (trial, _) = begin(&folder).await;
        let addresses = serve(&trial, &folder, &shutdown).await;
        (trial, addresses)
    });
    let trust = Trust::in_authority(&folder.path().join("tls/authority.crt"), &["h2"]);
    Server { runtime, open, encrypted, trust, taken: 0, trial, _end: end, _folder: folder }
}

/// Serves `trial` without encryption and with it. Returns the two addresses.
async fn serve(trial: &Trial, folder: &TempDir, shutdown: &watch::Receiver<bool>) -> [SocketAddr; 2] {
    // Clients check certificates against the real time.
    let now = SystemClock.wall();
    let local = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let certificates = Arc::new(Certificates::local(folder.path(), local, now).unwrap());
    let settings = certificates.settings().unwrap();

    let open = TcpListener::bind((local, 0)).await.unwrap();
    let encrypted = TcpListener::bind((local, 0)).await.unwrap();
    let addresses = [&open, &encrypted].map(|listener| listener.local_addr().unwrap());

    let [in_the_clear, with_tls] =
        [(addresses[0], None), (addresses[1], Some(certificates))].map(|(address, certificates)| {
            app::app(trial, folder.path(), ServerAddress::new(address, certificates), shutdown.clone())
        });
    tokio::spawn(http::run(open, in_the_clear, None));
    tokio::spawn(http::run(encrypted, with_tls, Some(settings)));
    addresses
}

/// Counts panics from now on, because the server catches those of its handlers.
fn count_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            PANICS.set(PANICS.get() + 1);
            before(panic);
        }));
    });
}

#[test]
fn a_panic_that_the_server_survives_is_seen() {
    let server = SERVER.take().unwrap_or_else(start);
    server.runtime.spawn(async { panic!("in a task of the server") });
    SERVER.set(Some(server));
    let asked = std::panic::catch_unwind(|| request(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"));
    assert!(asked.is_err());
}

#[test]
fn seeds_are_let_in_and_understood() {
    let refused = ["400", "401", "403", "413", "415", "422", "500"];
    for seed in requests() {
        let answer = ask(in_the_clear, &seed);
        // A page that takes long has no status yet.
        let status = answer.get(9..12).map(String::from_utf8_lossy).unwrap_or_default();
        // Only a person who is signed in may plan a study.
        let is_plan = seed.starts_with(b"POST /api/researcher/studies");
        assert!(is_plan || !refused.contains(&&*status), "{status} to {}", String::from_utf8_lossy(&seed));
    }
}

#[test]
fn requests_in_http2_are_let_in_and_understood() {
    let once = |seed: &Vec<u8>| http2::statuses(&ask(inside_tls, seed)).first().copied().flatten();
    // While other tests run, an answer may take longer than fuzzing waits for one.
    let answered = |seed: &Vec<u8>| (0..100).find_map(|_| once(seed));
    // A page, a request that is not allowed during a session, and frames that are not a request.
    let requests = http2_requests();
    assert_eq!(answered(&requests[0]), Some(http2::STATUS_200));
    assert!(answered(&requests[1]).is_some());
    assert_eq!(once(&requests[2]), None);
}

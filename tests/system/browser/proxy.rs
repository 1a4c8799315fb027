//! A TCP proxy that records every byte in both directions between the browser and the server.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// One connection's bytes.
#[derive(Debug, Clone, Default)]
pub struct Connection {
    /// Bytes from the browser.
    pub asked: Vec<u8>,
    /// Bytes from the server.
    pub answered: Vec<u8>,
}

type Recording = Arc<Mutex<Connection>>;

/// A proxy to one server.
pub struct Proxy {
    /// Address for the browser.
    pub address: SocketAddr,
    recordings: Arc<Mutex<Vec<Recording>>>,
    /// Number of silent breaks. Connections older than the last one pass nothing on.
    broken: watch::Sender<u64>,
    /// Whether the network swallows everything.
    dark: watch::Sender<bool>,
}

impl Proxy {
    /// A proxy to `server`, which need not run all the time.
    pub async fn to(server: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let recordings = Arc::<Mutex<Vec<Recording>>>::default();
        let all = Arc::clone(&recordings);
        let (broken, breaks) = watch::channel(0);
        let (dark, darkness) = watch::channel(false);
        tokio::spawn(async move {
            while let Ok((browser, _)) = listener.accept().await {
                let recording = Recording::default();
                all.lock().unwrap().push(Arc::clone(&recording));
                let mut breaks = breaks.clone();
                breaks.mark_unchanged();
                let mut darkness = darkness.clone();
                tokio::spawn(async move {
                    if *darkness.borrow() {
                        until_dark_is(false, &mut darkness).await;
                        return;
                    }

                    let mut link = std::pin::pin!(pass(browser, server, recording));
                    tokio::select! {
                        () = &mut link => return,
                        // Neither end is notified, and neither receives anything more.
                        _ = breaks.changed() => std::future::pending().await,
                        () = until_dark_is(true, &mut darkness) => {}
                    }
                    // Here too neither end receives anything until the network is back. Then the connection is lost.
                    until_dark_is(false, &mut darkness).await;
                });
            }
        });

        Self { address, recordings, broken, dark }
    }

    /// Breaks all existing connections silently, as when the tablet leaves the network's range.
    pub fn break_silently(&self) {
        self.broken.send_modify(|count| *count += 1);
    }

    /// From now on swallows everything, on existing and new connections: the tablet is out of reach.
    pub fn go_dark(&self) {
        self.dark.send_replace(true);
    }

    /// The tablet is in reach again. Connections from before are lost.
    pub fn come_back(&self) {
        self.dark.send_replace(false);
    }

    /// All connections so far.
    pub fn recorded(&self) -> Vec<Connection> {
        self.recordings.lock().unwrap().iter().map(|recording| recording.lock().unwrap().clone()).collect()
    }
}

async fn until_dark_is(dark: bool, darkness: &mut watch::Receiver<bool>) {
    if darkness.wait_for(|is_dark| *is_dark == dark).await.is_err() {
        std::future::pending::<()>().await;
    }
}

async fn pass(browser: TcpStream, server: SocketAddr, recording: Recording) {
    // While the server is down its port refuses, and the browser's connection just closes.
    let Ok(server) = TcpStream::connect(server).await else { return };
    let (from_browser, to_browser) = browser.into_split();
    let (from_server, to_server) = server.into_split();
    tokio::join!(
        copy(from_browser, to_server, |bytes| recording.lock().unwrap().asked.extend_from_slice(bytes)),
        copy(from_server, to_browser, |bytes| recording.lock().unwrap().answered.extend_from_slice(bytes)),
    );
}

async fn copy(mut from: impl AsyncRead + Unpin, mut to: impl AsyncWrite + Unpin, keep: impl Fn(&[u8])) {
    let mut buffer = vec![0; 64 * 1024];
    while let Ok(length @ 1..) = from.read(&mut buffer).await {
        keep(&buffer[..length]);
        if to.write_all(&buffer[..length]).await.is_err() {
            break;
        }
    }
    let _ = to.shutdown().await;
}

//! Connections that somebody opens and leaves idle: anyone with a key still gets in, and stays in.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use reqwest::{Client, StatusCode};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::io::AsyncReadExt;
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinSet;

use super::live::Page;
use crate::browser::wait::until;
use crate::support::{Server, command};

/// More connections than the server may have open files.
const FLOOD: usize = 600;

/// A server whose limit on open files is below the number of connections in the flood.
fn server() -> Server {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let serve = command(data.path(), &["--bind", "0.0.0.0:0", "--insecure", "--fps", "5"]);
    let mut limited = std::process::Command::new("sh");
    limited.args(["-c", "ulimit -n 500; exec \"$0\" \"$@\""]).arg(serve.get_program()).args(serve.get_args());
    limited.env("RUST_LOG", "error");
    Server::run(data, limited)
}

/// Raises this process's limit on open files, because it holds the other end of each connection.
fn allow_as_many_files_as_possible() {
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, maximum: limit.maximum }).unwrap();
}

/// A connection from `host`, one of this machine's many loopback addresses.
async fn connect(server: SocketAddr, host: IpAddr) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind(SocketAddr::new(host, 0)).unwrap();
    socket.connect(server).await.unwrap()
}

/// A client at `host` that opens a connection for each request.
fn client_at(host: IpAddr) -> Client {
    let client = Client::builder().no_proxy().local_address(host).pool_max_idle_per_host(0);
    client.timeout(Duration::from_secs(20)).build().unwrap()
}

/// Whether the server has closed `connection`. It sends nothing to a silent client.
async fn is_closed(connection: &mut TcpStream) -> bool {
    tokio::time::timeout(Duration::from_millis(1), connection.read(&mut [0])).await.is_ok()
}

#[tokio::test]
async fn an_idle_flood_from_one_host_shuts_nobody_with_a_key_out() {
    allow_as_many_files_as_possible();
    let server = server();
    let mut page = Page::open(&server, "surgeon").await;
    page.watch(1).await;

    let flooder: IpAddr = "127.0.0.1".parse().unwrap();
    let mut flood = Vec::new();
    for _ in 0..FLOOD {
        flood.push(connect(server.address, flooder).await);
    }
    // From another host, and from the host of the flood.
    for host in ["127.0.0.2", "127.0.0.1"] {
        let tablet = client_at(host.parse().unwrap());
        let request = tablet.get(server.url("/surgeon")).bearer_auth(server.key("surgeon"));
        assert_eq!(request.send().await.unwrap().status(), StatusCode::OK, "from {host}");
    }

    page.watch(3).await;

    let mut open = 0;
    for connection in &mut flood {
        open += usize::from(!is_closed(connection).await);
    }
    assert!((1..=32).contains(&open), "{open} of the flood's connections are open");
}

#[tokio::test]
async fn an_idle_flood_from_many_hosts_shuts_nobody_with_a_key_out() {
    allow_as_many_files_as_possible();
    let server = server();
    let mut page = Page::open(&server, "surgeon").await;
    let mut flood = Vec::new();
    for number in 0..FLOOD {
        let host = IpAddr::from([127, 0, 1, u8::try_from(number / 20).unwrap()]);
        flood.push(connect(server.address, host).await);
    }

    let tablet = client_at("127.0.0.2".parse().unwrap());
    let request = tablet.get(server.url("/surgeon")).bearer_auth(server.key("surgeon"));
    assert_eq!(request.send().await.unwrap().status(), StatusCode::OK);
    page.watch(3).await;
    let mut open = 0;
    for connection in &mut flood {
        open += usize::from(!is_closed(connection).await);
    }
    assert!((1..=128).contains(&open), "{open} of the flood's connections are open");
}

#[tokio::test]
async fn each_open_page_takes_one_of_its_hosts_places_until_it_leaves() {
    let server = server();
    let mut pages = JoinSet::new();
    for _ in 0..128 {
        let mut page = Page::open(&server, "surgeon").await;
        // A page that answers no ping would be taken for gone.
        pages.spawn(async move {
            loop {
                page.message().await;
            }
        });
    }

    let another = client_at("127.0.0.1".parse().unwrap());
    let status = async || {
        let request = another.get(server.url("/surgeon")).bearer_auth(server.key("surgeon"));
        request.send().await.unwrap().status()
    };
    assert_eq!(status().await, StatusCode::SERVICE_UNAVAILABLE);

    pages.shutdown().await;
    until("another page to be let in", || async { status().await == StatusCode::OK }).await;
}

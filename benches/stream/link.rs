//! A slow link: forwards what the server sends at a given number of bits a second, and holds no more than a packet
//! itself, but for those that are on their way to a distant place.

use std::net::SocketAddr;
use std::time::Duration;

use socket2::SockRef;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

/// Bytes forwarded at a time, about a packet.
const PACKET: usize = 1460;

/// Address of a link to `server` that carries `bits` a second downwards.
pub async fn slow(server: SocketAddr, bits: u64) -> SocketAddr {
    distant(server, bits, Duration::ZERO).await
}

/// The same, where everything takes `way` from one end to the other, in each direction.
pub async fn distant(server: SocketAddr, bits: u64, way: Duration) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("an address");
    tokio::spawn(async move {
        while let Ok((client, _)) = listener.accept().await {
            tokio::spawn(carry(client, server, bits, way));
        }
    });
    address
}

async fn carry(client: TcpStream, server: SocketAddr, bits: u64, way: Duration) {
    let socket = TcpSocket::new_v4().expect("a socket");
    // Set before connecting, because both are agreed on then. Segments must be as small as on a network: those of
    // loopback, of 64 KB, never fit the small buffer and would leave only when a timer ran out. So the queue stands
    // where it would on a slow network: in the server's kernel.
    SockRef::from(&socket).set_tcp_mss(PACKET as u32).expect("small segments");
    SockRef::from(&socket).set_recv_buffer_size(PACKET * 8).expect("a small buffer");
    let upstream = socket.connect(server).await.expect("the server");
    client.set_nodelay(true).expect("no delay");
    upstream.set_nodelay(true).expect("no delay");
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = upstream.into_split();
    tokio::spawn(forward(from_client, to_server, None, way));
    forward(from_server, to_client, Some(bits), way).await;
}

/// Forwards from one end to the other, as fast as `bits` a second allow, each packet after `way`.
async fn forward(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, bits: Option<u64>, way: Duration) {
    let (sent, mut arriving) = mpsc::unbounded_channel::<(Instant, Vec<u8>)>();
    tokio::spawn(async move {
        while let Some((at, packet)) = arriving.recv().await {
            sleep_until(at).await;
            if to.write_all(&packet).await.is_err() {
                return;
            }
        }
    });

    let mut packet = [0; PACKET];
    let mut free_at = Instant::now();
    while let Ok(length @ 1..) = from.read(&mut packet).await {
        if let Some(bits) = bits {
            free_at = free_at.max(Instant::now()) + Duration::from_nanos(length as u64 * 8 * 1_000_000_000 / bits);
            sleep_until(free_at).await;
        }
        if sent.send((Instant::now() + way, packet[..length].to_vec())).is_err() {
            return;
        }
    }
}

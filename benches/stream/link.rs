//! A slow link: forwards what the server sends at a given number of bits a second, and holds no more than a packet
//! itself.

use std::net::SocketAddr;
use std::time::Duration;

use socket2::SockRef;
use tokio::io::{AsyncReadExt, AsyncWriteExt, copy};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::time::{Instant, sleep_until};

/// Bytes forwarded at a time, about a packet.
const PACKET: usize = 1460;

/// Address of a link to `server` that carries `bits` a second downwards.
pub async fn slow(server: SocketAddr, bits: u64) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("an address");
    tokio::spawn(async move {
        while let Ok((client, _)) = listener.accept().await {
            tokio::spawn(carry(client, server, bits));
        }
    });
    address
}

async fn carry(client: TcpStream, server: SocketAddr, bits: u64) {
    let socket = TcpSocket::new_v4().expect("a socket");
    // Set before connecting, because both are agreed on then. Segments must be as small as on a network: those of
    // loopback, of 64 KB, never fit the small buffer and would leave only when a timer ran out. So the queue stands
    // where it would on a slow network: in the server's kernel.
    SockRef::from(&socket).set_tcp_mss(PACKET as u32).expect("small segments");
    SockRef::from(&socket).set_recv_buffer_size(PACKET * 8).expect("a small buffer");
    let upstream = socket.connect(server).await.expect("the server");
    client.set_nodelay(true).expect("no delay");
    upstream.set_nodelay(true).expect("no delay");
    let (mut from_client, mut to_client) = client.into_split();
    let (mut from_server, mut to_server) = upstream.into_split();
    tokio::spawn(async move { copy(&mut from_client, &mut to_server).await });
    let mut packet = [0; PACKET];
    let mut free_at = Instant::now();
    while let Ok(length @ 1..) = from_server.read(&mut packet).await {
        free_at = free_at.max(Instant::now()) + Duration::from_nanos(length as u64 * 8 * 1_000_000_000 / bits);
        sleep_until(free_at).await;
        if to_client.write_all(&packet[..length]).await.is_err() {
            return;
        }
    }
}

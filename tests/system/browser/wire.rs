//! Parses a recorded connection: HTTP/1.1 exchanges (RFC 9112) and, after an upgrade, WebSocket messages (RFC 6455).

use std::io::Read;

use flate2::read::GzDecoder;

use super::proxy::Connection;

/// Something that the browser received.
#[derive(Debug)]
pub enum Received {
    /// An answer to a request.
    Answer {
        /// Path of the request.
        path: String,
        /// Status line and headers.
        head: String,
        /// Body.
        body: Vec<u8>,
    },
    /// A text message of a WebSocket.
    Text(String),
    /// A binary message of a WebSocket.
    Binary(Vec<u8>),
}

/// Everything that the browser received on `connection`. A part that was cut off is returned as far as it came.
pub fn take_apart(connection: &Connection) -> Vec<Received> {
    let paths = paths(&connection.asked);
    let mut rest = connection.answered.as_slice();
    let mut received = Vec::new();
    for path in paths {
        let Some(end) = find(rest, b"\r\n\r\n") else { break };
        let head = String::from_utf8_lossy(&rest[..end]).into_owned();
        rest = &rest[end + 4..];
        if head.starts_with("HTTP/1.1 101") {
            received.push(Received::Answer { path, head, body: Vec::new() });
            messages(rest, &mut received);
            return received;
        }

        let (body, length) = body(&head, rest);
        rest = &rest[length..];
        received.push(Received::Answer { path, head, body });
    }

    assert!(find(rest, b"\r\n\r\n").is_none(), "an answer without a request");
    received
}

/// Paths of the requests. A body is never mistaken for a request: it is JSON, without lines that end in `HTTP/1.1`.
fn paths(asked: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(asked);
    let targets = text.split("\r\n").filter_map(|line| line.strip_suffix(" HTTP/1.1"));
    targets.filter_map(|line| line.rsplit(' ').next()).map(str::to_owned).collect()
}

fn body(head: &str, rest: &[u8]) -> (Vec<u8>, usize) {
    let header = |name: &str| {
        head.lines().find_map(|line| {
            let (key, value) = line.split_once(':')?;
            key.eq_ignore_ascii_case(name).then(|| value.trim().to_owned())
        })
    };

    let (body, length) = if header("transfer-encoding").is_some() {
        chunks(rest)
    } else {
        let length = header("content-length").map_or(0, |length| length.parse().unwrap());
        let length = usize::min(length, rest.len());
        (rest[..length].to_vec(), length)
    };

    // Only what is read can be searched.
    match header("content-encoding").as_deref() {
        None => (body, length),
        Some("gzip") => {
            let mut unpacked = Vec::new();
            // The last answer may have been cut off when the browser went away.
            let _ = GzDecoder::new(body.as_slice()).read_to_end(&mut unpacked);
            (unpacked, length)
        }
        Some(other) => panic!("an answer in {other} cannot be searched"),
    }
}

fn chunks(rest: &[u8]) -> (Vec<u8>, usize) {
    let mut body = Vec::new();
    let mut at = 0;
    while let Some(end) = find(&rest[at..], b"\r\n") {
        let size = std::str::from_utf8(&rest[at..at + end]).unwrap();
        let size = usize::from_str_radix(size, 16).unwrap();
        let start = at + end + 2;
        let stop = usize::min(start + size, rest.len());
        body.extend_from_slice(&rest[start..stop]);
        at = usize::min(stop + 2, rest.len());
        if size == 0 {
            break;
        }
    }

    (body, at)
}

/// Parses WebSocket messages. The server's are not masked and, here, not split into fragments.
fn messages(mut rest: &[u8], received: &mut Vec<Received>) {
    while rest.len() >= 2 {
        let opcode = rest[0] & 0x0f;
        assert_eq!(rest[0] & 0xf0, 0x80, "a whole message without extensions");
        let (length, start) = match rest[1] {
            126 if rest.len() >= 4 => (usize::from(u16::from_be_bytes([rest[2], rest[3]])), 4),
            127 if rest.len() >= 10 => {
                (usize::try_from(u64::from_be_bytes(rest[2..10].try_into().unwrap())).unwrap(), 10)
            }
            short @ 0..126 => (usize::from(short), 2),
            _ => return,
        };

        let stop = usize::min(start + length, rest.len());
        let payload = rest[start..stop].to_vec();
        match opcode {
            1 => received.push(Received::Text(String::from_utf8_lossy(&payload).into_owned())),
            2 => received.push(Received::Binary(payload)),
            _ => {}
        }

        rest = &rest[stop..];
    }
}

fn find(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    bytes.windows(pattern.len()).position(|window| window == pattern)
}

//! A client's HTTP/2 frames, and the statuses of the answers.

// Kinds of frames and their flags (RFC 9113, 6).
const DATA: u8 = 0;
const HEADERS: u8 = 1;
const RST_STREAM: u8 = 3;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
const GOAWAY: u8 = 7;
const WINDOW_UPDATE: u8 = 8;
const END_STREAM: u8 = 1;
const END_HEADERS: u8 = 4;

/// First byte of an answer's head with status 200 (RFC 7541, appendix A).
pub const STATUS_200: u8 = 0x88;
/// First byte of an answer's head with status 500.
pub const STATUS_500: u8 = 0x8E;

/// The bytes with which every connection begins (RFC 9113, 3.4).
pub fn opening() -> Vec<u8> {
    [b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", frame(SETTINGS, 0, 0, b"").as_slice()].concat()
}

/// A request with the key `key`, and with `body` unless that is empty.
pub fn request(stream: u32, method: &str, path: &str, key: &str, body: &[u8]) -> Vec<u8> {
    let head = head(method, path, key);
    if body.is_empty() {
        return frame(HEADERS, END_HEADERS | END_STREAM, stream, &head);
    }
    [frame(HEADERS, END_HEADERS, stream, &head), frame(DATA, END_STREAM, stream, body)].concat()
}

/// Frames that are not requests: `SETTINGS`, `WINDOW_UPDATE`, `PING`, `RST_STREAM` and `GOAWAY`.
pub fn asides() -> Vec<u8> {
    let frames = [
        frame(SETTINGS, 0, 0, &[0, 4, 0, 0, 255, 255]),
        frame(WINDOW_UPDATE, 0, 0, &[0, 0, 255, 255]),
        frame(PING, 0, 0, b"8 bytes."),
        frame(RST_STREAM, 0, 1, &[0, 0, 0, 8]),
        frame(GOAWAY, 0, 0, &[0; 8]),
    ];
    frames.concat()
}

/// First byte of the head of each answer in `frames`. It tells the status if that is a common one.
pub fn statuses(mut frames: &[u8]) -> Vec<Option<u8>> {
    let mut statuses = Vec::new();
    while let Some((&[high, middle, low, kind, _, _, _, _, _], rest)) = frames.split_first_chunk() {
        let length = u32::from_be_bytes([0, high, middle, low]) as usize;
        let Some((payload, rest)) = rest.split_at_checked(length) else { break };
        if kind == HEADERS {
            statuses.push(payload.first().copied());
        }
        frames = rest;
    }
    statuses
}

/// A frame (RFC 9113, 4.1).
fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = &(payload.len() as u32).to_be_bytes()[1..];
    [length, &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// A request's head: each field as a literal without indexing (RFC 7541, 6.2.2).
fn head(method: &str, path: &str, key: &str) -> Vec<u8> {
    let key = format!("Bearer {key}");
    let fields = [
        (":method", method),
        (":scheme", "https"),
        (":authority", "localhost"),
        (":path", path),
        ("authorization", &key),
        ("content-type", "application/json"),
    ];
    let text = |text: &str| [&[text.len() as u8], text.as_bytes()].concat();
    fields.iter().flat_map(|(name, value)| [vec![0], text(name), text(value)].concat()).collect()
}

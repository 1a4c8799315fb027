//! The messages of `/live`, in both directions.

use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message};
use bytes::{BufMut, Bytes, BytesMut};
use serde::{Deserialize, Serialize};

/// A message from a page.
#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub(super) enum PageMessage {
    /// The page is done with this frame.
    Drawn {
        frame: u64,
        /// Milliseconds for which the page had it.
        #[serde(default)]
        held: f64,
        /// Whether it was on screen: a page that falls behind leaves out all but the newest picture.
        #[serde(default = "yes")]
        shown: bool,
    },
    /// Whether the page is visible.
    Visible { visible: bool },
    /// The whole picture, including the parts outside the view, covers this many pixels of the screen from left to
    /// right.
    Screen { width: u32 },
    /// Whether depth maps are to come with the pictures. Not for a surgeon's page.
    Depths { wanted: bool },
}

const fn yes() -> bool {
    true
}

/// A text message to a page.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub(super) enum ServerMessage<S, T> {
    Session { view: Option<S> },
    Status(T),
    Beat,
}

/// The message that closes the connection, with a code and a reason.
pub(super) fn close(code: u16, reason: &'static str) -> Message {
    Message::Close(Some(CloseFrame { code, reason: reason.into() }))
}

/// `value` as a text message; `None` if it cannot be serialised.
pub(super) fn tell(value: &impl Serialize) -> Option<Message> {
    let text = serde_json::to_string(value)
        .inspect_err(|error| tracing::error!(%error, "state could not be serialised"))
        .ok()?;
    Some(Message::Text(text.into()))
}

/// The message of a frame: header length, header, JPEG; `None` if the header cannot be packed.
pub(super) fn pack(header: &impl Serialize, jpeg: &[u8]) -> Option<Bytes> {
    let header = serde_json::to_vec(header).ok()?;
    let length = u16::try_from(header.len()).ok()?;
    let mut message = BytesMut::with_capacity(2 + header.len() + jpeg.len());
    message.put_u16_le(length);
    message.put_slice(&header);
    message.put_slice(jpeg);
    Some(message.freeze())
}

/// `age` in milliseconds, rounded to one decimal.
pub(super) fn tenth_millis(age: Duration) -> f64 {
    (age.as_secs_f64() * 1e4).round() / 10.0
}

/// `travel` in milliseconds, rounded to whole tens.
pub(super) fn whole_tens(travel: Duration) -> f64 {
    (travel.as_secs_f64() * 1e2).round() * 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_packed_as_documented() {
        let message = pack(&serde_json::json!({"frame": 7}), &[0xff, 0xd8]).unwrap();
        assert_eq!(&message[..], b"\x0b\x00{\"frame\":7}\xff\xd8");
    }

    #[test]
    fn an_age_is_given_in_tenths_of_a_millisecond() {
        assert!((tenth_millis(Duration::from_micros(1_260)) - 1.3).abs() < 1e-9);
    }
}

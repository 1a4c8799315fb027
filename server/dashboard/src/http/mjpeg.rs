//! `/stream.mjpeg`: plain motion JPEG, for programs and for browsers without scripts.
//!
//! The headers of the next part are sent directly after each frame. A browser shows a part only when it sees the end of
//! it, so it would otherwise be a frame late.

use axum::body::Body;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use bytes::Bytes;
use futures_util::{Stream, StreamExt, stream};

use super::AppState;
use super::admission::{Ground, over};
use super::connections::ended;
use super::people::SignedIn;
use super::roles::Roles;
use parfocal_imaging::Size;

const KIND: &str = "multipart/x-mixed-replace; boundary=parfocal-frame";
const FIRST_PART: &[u8] = b"--parfocal-frame\r\nContent-Type: image/jpeg\r\n\r\n";
const NEXT_PART: &[u8] = b"\r\n--parfocal-frame\r\nContent-Type: image/jpeg\r\n\r\n";

/// The live picture as an endless motion JPEG, one pixel per mosaic cell.
#[utoipa::path(get, path = "/stream.mjpeg", tag = "stream", responses(
    (status = 200, description = "Motion JPEG", content_type = "multipart/x-mixed-replace"),
    (status = 403, description = "No role is held")))]
pub(super) async fn mjpeg(State(app): State<AppState>, roles: Roles, SignedIn(person): SignedIn) -> impl IntoResponse {
    let ground = roles.ground(roles.own(), person);
    let parts = parts(app, ground).map(Ok::<_, std::convert::Infallible>);
    ([(CONTENT_TYPE, KIND)], Body::from_stream(parts))
}

/// The stream's bytes, until a request that was let in on this `ground` may no longer stay.
fn parts(app: AppState, ground: Option<Ground>) -> impl Stream<Item = Bytes> {
    let mut shutdown = app.shutdown.clone();
    let over = over(AppState::clone(&app), ground);
    let viewer = app.live.viewer(Size::Cell, false);

    let frames = stream::unfold((app, viewer), async |(app, mut viewer)| {
        let frame = viewer.next().await?;
        app.metrics.frames_sent.inc();
        app.metrics.bytes_sent.inc_by(frame.picture.jpeg.len() as u64);
        Some((frame.picture.jpeg.clone(), (app, viewer)))
    });

    let frames = frames.flat_map(|jpeg| stream::iter([jpeg, Bytes::from_static(NEXT_PART)]));
    stream::iter([Bytes::from_static(FIRST_PART)])
        .chain(frames)
        .take_until(async move { ended(&mut shutdown).await })
        .take_until(over)
}

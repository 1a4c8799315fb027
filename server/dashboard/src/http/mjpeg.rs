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
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::admission::over;
use super::connections::ended;
use super::credentials::Pass;
use super::error::Error;
use super::people::SignedIn;
use super::roles::Roles;
use parfocal_imaging::Size;
use parfocal_records::accounts::Token;

const KIND: &str = "multipart/x-mixed-replace; boundary=parfocal-frame";
const FIRST_PART: &[u8] = b"--parfocal-frame\r\nContent-Type: image/jpeg\r\n\r\n";
const NEXT_PART: &[u8] = b"\r\n--parfocal-frame\r\nContent-Type: image/jpeg\r\n\r\n";

/// The live picture as an endless motion JPEG, one pixel per mosaic cell.
#[utoipa::path(get, path = "/stream.mjpeg", tag = "stream", responses(
    (status = 200, description = "Motion JPEG", content_type = "multipart/x-mixed-replace"),
    (status = 403, description = "No role is held")))]
async fn mjpeg(
    State(app): State<AppState>,
    roles: Roles,
    SignedIn(person): SignedIn,
) -> Result<impl IntoResponse, Error> {
    // If the browser's only role comes from a surgeon's link, the stream ends when the link is no longer valid. If it
    // comes from an account alone, it ends with the sign-in.
    let pass = roles.pass().filter(|_| roles.is_surgeon_alone());
    let role = roles.choose(None)?;
    let token = person.filter(|_| roles.by_account_alone(role)).map(|person| person.token);
    let parts = parts(app, pass, token).map(Ok::<_, std::convert::Infallible>);
    Ok(([(CONTENT_TYPE, KIND)], Body::from_stream(parts)))
}

fn parts(app: AppState, pass: Option<Pass>, token: Option<Token>) -> impl Stream<Item = Bytes> {
    let mut shutdown = app.shutdown.clone();
    let over = over(AppState::clone(&app), pass, token);
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

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(mjpeg))
}

//! The body of a request: how large it may be, and that it is read to its end, also where the handler did not need it.
//!
//! A refusal often needs no more than the head. If the rest stayed unread, the server would close the connection after
//! the answer. A client that has just sent its next request on it would get no answer to that.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, HttpBody};
use axum::extract::Request;
use axum::http::header::{CONNECTION, HeaderValue};
use axum::http::{StatusCode, Version};
use axum::middleware::Next;
use axum::response::Response;
use bytes::Bytes;
use hyper::body::{Frame, SizeHint};
use tokio::time::timeout;

/// Largest request body in bytes: the longest comment in JSON, with some margin.
pub const LIMIT: usize = 256 * 1024;

/// Time for the rest of a body to arrive. Most clients send it together with the head.
const REST_WITHIN: Duration = Duration::from_secs(1);

/// A request's body, which its handler may drop before it was read to its end.
#[derive(Clone)]
struct SharedBody(Arc<Mutex<Body>>);

impl HttpBody for SharedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut body = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Pin::new(&mut *body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).size_hint()
    }
}

/// Answers once the body was read. If too much is left or it comes too slowly, the answer says that the connection will
/// be closed.
pub async fn read_on(request: Request, next: Next) -> Response {
    // In HTTP/2 each request has a stream of its own, so an unread body stops no other request.
    if request.version() == Version::HTTP_2 || request.body().is_end_stream() {
        return next.run(request).await;
    }

    let (head, body) = request.into_parts();
    let body = SharedBody(Arc::new(Mutex::new(body)));
    let mut response = next.run(Request::from_parts(head, Body::new(body.clone()))).await;

    let is_switching = response.status() == StatusCode::SWITCHING_PROTOCOLS;
    let rest = axum::body::to_bytes(Body::new(body), LIMIT);
    if !is_switching && !matches!(timeout(REST_WITHIN, rest).await, Ok(Ok(_))) {
        response.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

//! What an encrypted server answers on unencrypted connections: how to trust it, static files, and a redirect to the
//! encrypted page. Nothing else, and nothing that needs a key.

use axum::Router;
use axum::extract::{Request, State};
use axum::http::Method;
use axum::http::header::HOST;
use axum::http::uri::Authority;
use axum::middleware;
use axum::response::{IntoResponse, Redirect, Response};
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;

use super::error::{self, Error};
use super::{AppState, routes, security};

/// The routes for unencrypted connections. None of them reads a body or waits for anything.
pub(super) fn router(app: AppState) -> Router {
    let (router, _) = routes::unencrypted().split_for_parts();

    let layers = ServiceBuilder::new()
        .layer(middleware::from_fn(security::headers))
        .layer(middleware::from_fn(error::render))
        .layer(CatchPanicLayer::custom(|_| Error::Internal.into_response()));

    router.fallback(on_to_the_encrypted_page).layer(layers).with_state(app)
}

/// Redirects a browser to the same address, encrypted. A request that changes something is refused instead, so that the
/// author of the program that sent it learns that others can read what it sends.
async fn on_to_the_encrypted_page(State(app): State<AppState>, request: Request) -> Result<Response, Error> {
    let asked = request.headers().get(HOST).and_then(|host| host.to_str().ok());
    let asked = asked.and_then(|host| host.parse::<Authority>().ok());
    let host = asked.map_or_else(|| app.address.host(), |asked| asked.as_str().to_owned());

    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return Err(Error::Unencrypted(host));
    }

    let path = request.uri().path_and_query().map_or("/", |path| path.as_str());
    // Temporary: a browser would remember a permanent redirect even if the server is later started without TLS.
    Ok(Redirect::temporary(&format!("https://{host}{path}")).into_response())
}

//! HTTP: routes, pages, streams, roles. Holds no trial rule.

mod about;
mod accounts;
mod address;
mod admission;
mod analysis;
pub mod assets;
mod backup;
mod bundle;
mod camera;
mod checks;
mod connections;
mod credentials;
mod equipment;
pub mod error;
mod export;
mod health;
mod json;
pub mod keys;
mod links;
mod live;
mod metrics;
mod mjpeg;
mod now;
mod offline;
mod openapi;
mod operator;
mod people;
mod permits;
mod plain;
mod playback;
mod ranges;
mod recording;
mod records;
mod request_body;
mod researcher;
pub mod roles;
mod routes;
pub mod security;
mod sign_in;
mod spectra;
mod state;
mod studies;
mod study_export;
mod surgeon;
mod tablet_trial;
mod tablet_trials;
mod tongue;
mod transport;
mod trust;
mod voice;

pub use address::ServerAddress;
pub use equipment::Equipment;
pub use live::OpenTablets;
pub use state::{App, AppState, Metrics};
pub use tablet_trials::TabletTrials;

use std::sync::Arc;
use std::time::Duration;

use axum::http::StatusCode;
use axum::{Extension, Router, middleware};
use tokio::net::TcpListener;
use tokio_rustls::rustls::ServerConfig;
use tower::ServiceBuilder;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::limit::RequestBodyLimitLayer;
use tower_http::timeout::TimeoutLayer;
use tower_http::trace::TraceLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;

use error::Error;
use transport::Transport;

/// Time limit for a handler to begin its answer; streams begin at once.
const TIMEOUT: Duration = Duration::from_secs(20);

/// All routes, with all layers around them.
pub fn router(app: AppState) -> Router {
    let document = openapi::Finished::default();
    let (router, api) = OpenApiRouter::with_openapi(openapi::Document::openapi())
        .merge(routes::unencrypted())
        .merge(routes::others())
        .split_for_parts();

    match openapi::document(api) {
        Ok(text) => _ = document.set(text),
        Err(error) => tracing::error!(%error, "the interface cannot be described"),
    }

    // From the outside in.
    let layers = ServiceBuilder::new()
        .layer(TraceLayer::new_for_http().make_span_with(span))
        .layer(middleware::from_fn(request_body::read_on))
        .layer(middleware::from_fn(security::headers))
        .layer(middleware::from_fn(error::render))
        .layer(CatchPanicLayer::custom(|_| axum::response::IntoResponse::into_response(Error::Internal)))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), security::guard))
        .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, TIMEOUT))
        .layer(RequestBodyLimitLayer::new(request_body::LIMIT))
        .layer(Extension(document));

    router.fallback(|| async { StatusCode::NOT_FOUND }).layer(layers).with_state(app)
}

/// Logs only the path of a request: the query may contain a key.
fn span<B>(request: &axum::http::Request<B>) -> tracing::Span {
    tracing::debug_span!("request", method = %request.method(), path = request.uri().path())
}

/// Serves `app` on `listener`, encrypted if `tls` is given, until `app.shutdown` turns true. Connections may outlast
/// this call: each holds a clone of `app.shutdown` until its requests under way are answered.
pub async fn run(listener: TcpListener, app: AppState, tls: Option<Arc<ServerConfig>>) {
    let shutdown = app.shutdown.clone();
    let reporting = tokio::spawn(live::report_tablets(Arc::clone(&app)));
    let transport = match tls {
        Some(tls) => {
            Transport::Encrypted { tls: tls.into(), pages: router(Arc::clone(&app)), plain: plain::router(app) }
        }
        None => Transport::Plain { pages: router(app) },
    };
    connections::serve(listener, transport, shutdown).await;
    reporting.abort();
}

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
mod researcher;
pub mod roles;
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
use utoipa_axum::routes;

use error::Error;
use transport::Transport;

/// Largest request body in bytes: the longest comment in JSON, with some margin.
const BODY_LIMIT: usize = 256 * 1024;

/// Time limit for a handler to begin its answer; streams begin at once.
const TIMEOUT: Duration = Duration::from_secs(20);

/// All routes, with all layers around them.
pub fn router(app: AppState) -> Router {
    let document = openapi::Finished::default();
    let (router, api) = OpenApiRouter::with_openapi(openapi::Document::openapi())
        .merge(unencrypted_routes())
        .merge(routes())
        .split_for_parts();

    match openapi::document(api) {
        Ok(text) => _ = document.set(text),
        Err(error) => tracing::error!(%error, "the interface cannot be described"),
    }

    // From the outside in.
    let layers = ServiceBuilder::new()
        .layer(TraceLayer::new_for_http().make_span_with(span))
        .layer(middleware::from_fn(security::headers))
        .layer(middleware::from_fn(error::render))
        .layer(CatchPanicLayer::custom(|_| axum::response::IntoResponse::into_response(Error::Internal)))
        .layer(middleware::from_fn_with_state(Arc::clone(&app), security::guard))
        .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, TIMEOUT))
        .layer(RequestBodyLimitLayer::new(BODY_LIMIT))
        .layer(Extension(document));

    router.fallback(|| async { StatusCode::NOT_FOUND }).layer(layers).with_state(app)
}

/// The routes that an encrypted server also has on unencrypted connections. They need no key.
fn unencrypted_routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(trust::page))
        .routes(routes!(trust::certificate))
        .routes(routes!(trust::profile))
        .routes(routes!(trust::check))
        .routes(routes!(assets::asset))
}

/// All other routes.
fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(roles::enter))
        .routes(routes!(roles::start))
        .routes(routes!(sign_in::page))
        .routes(routes!(sign_in::sign_in))
        .routes(routes!(sign_in::sign_out))
        .routes(routes!(accounts::people_page))
        .routes(routes!(accounts::list, accounts::make))
        .routes(routes!(accounts::change))
        .routes(routes!(surgeon::page))
        .routes(routes!(surgeon::session))
        .routes(routes!(surgeon::act))
        .routes(routes!(surgeon::patch))
        .routes(routes!(surgeon::comment))
        .routes(routes!(surgeon::answer))
        .routes(routes!(surgeon::holding))
        .routes(routes!(tablet_trial::tablet_page))
        .routes(routes!(tablet_trial::tried))
        .routes(routes!(offline::worker))
        .routes(routes!(voice::keep_piece))
        .routes(routes!(voice::recording))
        .routes(routes!(operator::page))
        .routes(routes!(operator::link))
        .routes(routes!(operator::choices))
        .routes(routes!(operator::focus))
        .routes(routes!(operator::patch))
        .routes(routes!(operator::add_participant))
        .routes(routes!(operator::session))
        .routes(routes!(operator::create))
        .routes(routes!(operator::consent))
        .routes(routes!(operator::act))
        .routes(routes!(operator::dismiss))
        .routes(routes!(camera::offer))
        .routes(routes!(camera::change))
        .routes(routes!(checks::checks))
        .routes(routes!(recording::status))
        .routes(routes!(recording::order))
        .routes(routes!(spectra::spectra))
        .routes(routes!(researcher::list_page))
        .routes(routes!(researcher::session_page))
        .routes(routes!(researcher::list))
        .routes(routes!(researcher::session))
        .routes(routes!(researcher::course))
        .routes(routes!(researcher::timeline))
        .routes(routes!(researcher::chain_head))
        .routes(routes!(researcher::unblind))
        .routes(routes!(playback::recordings))
        .routes(routes!(playback::frame))
        .routes(routes!(playback::spectrum))
        .routes(routes!(records::correct))
        .routes(routes!(records::erase))
        .routes(routes!(records::erase_all))
        .routes(routes!(records::withdraw))
        .routes(routes!(studies::studies_page))
        .routes(routes!(studies::study_page))
        .routes(routes!(studies::list_studies, studies::plan_study))
        .routes(routes!(studies::study))
        .routes(routes!(studies::change_study))
        .routes(routes!(analysis::analysis_page))
        .routes(routes!(analysis::analysis))
        .routes(routes!(analysis::analysis_zip))
        .routes(routes!(export::zip))
        .routes(routes!(export::dictionary))
        .routes(routes!(study_export::study_export, study_export::start_study_export))
        .routes(routes!(study_export::study_export_zip))
        .routes(routes!(backup::backup_state, backup::start_backup))
        .routes(routes!(backup::backup_file))
        .routes(routes!(live::live))
        .routes(routes!(mjpeg::mjpeg))
        .routes(routes!(health::healthz))
        .routes(routes!(metrics::metrics))
        .routes(routes!(openapi::openapi))
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

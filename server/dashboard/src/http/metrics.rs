//! `/metrics`: counters for Prometheus, for operator and researcher. No counter tells policies apart. A policy could be
//! guessed from times, so they are left out while a session is under way. Times of the loop and of pictures are not
//! even recorded during a setting.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};

use super::error::Error;
use super::roles::Roles;
use super::{App, AppState};
use parfocal_base::priority::Scheduling;
use parfocal_trial::role::Role;

/// The server's counters in the `OpenMetrics` text format.
#[utoipa::path(get, path = "/metrics", tag = "service", responses(
    (status = 200, description = "Counters", content_type = "application/openmetrics-text"),
    (status = 403, description = "For operator and researcher")))]
pub(super) async fn metrics(State(app): State<AppState>, roles: Roles) -> Result<impl IntoResponse, Error> {
    roles.choose(Some(Role::Operator)).or_else(|_| roles.choose(Some(Role::Researcher)))?;
    let mut text = String::new();
    encode(&mut text, &collect(&app)).map_err(|_| Error::Internal)?;
    Ok(([(CONTENT_TYPE, "application/openmetrics-text; version=1.0.0; charset=utf-8")], text))
}

fn collect(app: &App) -> Registry {
    // Borrow only briefly: the loop waits until the borrow ends.
    let status = Arc::clone(&app.control.status.borrow());
    let counts = app.live.counts();
    let telemetry = app.store.telemetry_counts();
    let mut registry = Registry::with_prefix("parfocal");

    let counters = [
        ("steps", "Steps of the control loop", status.steps),
        ("frames_lost", "Frames that the camera lost", status.camera.lost),
        (
            "lens_line_errors",
            "Errors on the line to the lens: replies damaged, late or missing, and noise",
            status.lens.line_errors,
        ),
        ("frames_skipped", "Frames that the imaging thread had no time for", app.control.frames.overwritten()),
        ("telemetry_dropped", "Telemetry records dropped because the writer fell behind", status.telemetry_dropped),
        ("telemetry_written", "Telemetry records on disk", telemetry.written.load(Ordering::Relaxed)),
        (
            "telemetry_lost",
            "Telemetry records given up because the disk failed",
            telemetry.lost.load(Ordering::Relaxed),
        ),
    ];

    for (name, help, value) in counters {
        registry.register(name, help, ConstCounter::new(value));
    }

    registry.register("frames_sent", "Frames sent to viewers", app.metrics.frames_sent.clone());
    registry.register_with_unit("stream", "Frames sent to viewers", Unit::Bytes, app.metrics.bytes_sent.clone());
    registry.register("frames_encoded", "Frames made into JPEG", counts.encoded.clone());
    registry.register_with_unit("jpeg", "JPEG made", Unit::Bytes, counts.jpeg_bytes.clone());
    registry.register("viewers", "Viewers that want pictures now", counts.viewers.clone());

    if !app.blinded() {
        register_times(&mut registry, app);
    }

    let gauges = [
        ("steps_per_second", "Steps of the control loop over the last second", status.steps_per_second),
        ("camera_fps", "Frames a second from the camera", status.camera.fps),
        ("camera_working", "Whether the camera delivers frames", f64::from(u8::from(status.camera.working))),
        ("lens_working", "Whether the lens takes commands", f64::from(u8::from(status.lens.working))),
        (
            "real_time",
            "Whether the control loop runs at real-time priority",
            f64::from(u8::from(status.priority == Scheduling::RealTime)),
        ),
    ];

    for (name, help, value) in gauges {
        registry.register(name, help, ConstGauge::new(value));
    }
    registry
}

/// Registers the histograms of times.
fn register_times(registry: &mut Registry, app: &App) {
    let counts = app.live.counts();
    let latency = counts.latency.clone();
    registry.register_with_unit("latency", "Time from exposure to lens command", Unit::Seconds, latency);

    let steps = counts.steps.clone();
    registry.register_with_unit("step", "Time to compute a step's focal power", Unit::Seconds, steps);

    let making = counts.making.clone();
    registry.register_with_unit("picture", "Time to develop and encode a picture", Unit::Seconds, making);

    let writes = app.store.writes().times().clone();
    registry.register_with_unit("database_write", "Time of a write to the database", Unit::Seconds, writes);
}

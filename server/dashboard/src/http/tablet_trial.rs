//! The page that a tablet opens once, and that tries what a trial needs of it. The operator's page tells the result.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use askama::Template;
use axum::Json;
use axum::extract::State;
use axum::http::header::USER_AGENT;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{Html, IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::error::{Error, ErrorBody};
use super::json::JsonBody;
use super::roles::SurgeonsTablet;
use super::security::{Nonce, PERMISSIONS_POLICY, WITH_MICROPHONE};
use crate::doctor::{TabletPart, TriedTablet};
use parfocal_base::ids::DeviceId;

/// Results of so many tablets are kept; of more, nobody would read them.
const MOST: usize = 24;

/// The results of the tablets that were tried since the server's start. Clone freely.
#[derive(Debug, Clone, Default)]
pub struct TabletTrials(Arc<Mutex<BTreeMap<DeviceId, TriedTablet>>>);

impl TabletTrials {
    /// The results, one for each tablet.
    #[must_use]
    pub fn all(&self) -> Vec<TriedTablet> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).values().cloned().collect()
    }

    fn note(&self, device: DeviceId, tried: TriedTablet) {
        let mut trials = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if trials.len() >= MOST && !trials.contains_key(&device) {
            let oldest = trials.iter().min_by_key(|(_, tried)| tried.at).map(|(device, _)| *device);
            if let Some(device) = oldest {
                trials.remove(&device);
            }
        }
        trials.insert(device, tried);
    }
}

#[derive(Template)]
#[template(path = "tablet.html")]
struct Page {
    nonce: String,
}

/// The page that tries a tablet.
#[utoipa::path(get, path = "/tablet", tag = "surgeon",
    responses((status = 200, description = "The page", content_type = "text/html")))]
async fn page(_: SurgeonsTablet, Nonce(nonce): Nonce) -> Result<Response, Error> {
    let html = Page { nonce }.render().map_err(|_| Error::Internal)?;
    let mut response = Html(html).into_response();
    response.headers_mut().insert(PERMISSIONS_POLICY, WITH_MICROPHONE);
    Ok(response)
}

/// What a tablet found out about itself.
#[derive(Debug, Deserialize, ToSchema)]
struct TabletTrial {
    /// The tablet.
    device: DeviceId,
    /// What was tried.
    tried: Vec<TriedPart>,
}

/// One thing that was tried on a tablet.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, ToSchema)]
struct TriedPart {
    /// What was tried.
    part: TabletPart,
    /// Whether it works.
    works: bool,
}

/// Notes what works on a surgeon's tablet, for the operator's page. It is forgotten when the server ends.
#[utoipa::path(post, path = "/api/surgeon/tablet-trials", tag = "surgeon", request_body = TabletTrial, responses(
    (status = 200, description = "Noted", body = bool),
    (status = 422, description = "Not what the page sends", body = ErrorBody)))]
async fn tried(
    _: SurgeonsTablet,
    State(app): State<AppState>,
    headers: HeaderMap,
    JsonBody(trial): JsonBody<TabletTrial>,
) -> Result<(StatusCode, Json<bool>), Error> {
    let user_agent = headers.get(USER_AGENT).and_then(|agent| agent.to_str().ok()).unwrap_or_default().to_owned();
    let failing = trial.tried.iter().filter(|tried| !tried.works).map(|tried| tried.part).collect();
    app.tablet_trials.note(trial.device, TriedTablet { user_agent, at: app.clock.wall(), failing });
    Ok((StatusCode::OK, Json(true)))
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(page)).routes(routes!(tried))
}

#[cfg(test)]
mod tests {
    use super::*;
    use jiff::Timestamp;
    use uuid::Uuid;

    #[test]
    fn a_tablet_that_is_tried_again_has_one_result_and_the_oldest_make_room() {
        let trials = TabletTrials::default();
        let note = |number: u32, second: i64| {
            let at = Timestamp::from_second(second).unwrap();
            let tried = TriedTablet { user_agent: String::new(), at, failing: Vec::new() };
            trials.note(DeviceId(Uuid::from_u128(u128::from(number))), tried);
        };
        for number in 0..30 {
            note(number, i64::from(number));
        }
        note(29, 100);
        let kept = trials.all();
        assert_eq!(kept.len(), MOST);
        assert_eq!(kept.iter().map(|tried| tried.at.as_second()).min(), Some(6));
    }
}

//! What the operator's and the researcher's pages get on `/live`: the surgeon's, and what the loop does. While a session
//! is under way not even they are told which policy runs, nor what gives it away: how the focal power moves (fixed never,
//! hill-climbers by 0.05 each frame), how long a step takes, the metric, by its scale, and the belief, which few have.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use super::App;
use super::live::Audience;
use super::live_surgeon::{SurgeonFrame, coarse};
use crate::autofocus::PolicyName;
use crate::camera::{CameraHealth, CameraOffer};
use crate::control::{ControlStatus, Hold};
use crate::lens::{FocalPower, LensHealth};
use crate::live::{EncodedFrame, Insight};
use crate::trial::view::OperatorView;

/// An operator's or researcher's page.
pub(super) struct ForOperator;

/// What goes with each picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OperatorFrame {
    #[serde(flatten)]
    picture: SurgeonFrame,
    /// Why the lens was held, if it was.
    held: Option<Hold>,
    /// What the loop did with the frame; each null while a session is under way.
    #[serde(flatten)]
    seen: Seen,
}

/// What tells policies apart.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct Seen {
    /// Focal power asked for after this frame.
    asked: Option<FocalPower>,
    /// Focal power that the frame was exposed at.
    measured: Option<FocalPower>,
    /// The policy's focus metric.
    metric: Option<f64>,
    /// Probability of each of equally wide slices of 0..=1 to hold the optimum, where the policy has a belief.
    belief: Option<Arc<[f32]>>,
}

impl Seen {
    fn new(insight: &Insight) -> Self {
        Self {
            asked: Some(insight.asked),
            measured: insight.measured,
            metric: insight.metric,
            belief: insight.belief.clone(),
        }
    }
}

/// The loop's state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OperatorStatus {
    camera: CameraHealth,
    camera_offer: CameraOffer,
    lens: LensHealth,
    /// Policy in charge, if one is and it may be told.
    policy: Option<PolicyName>,
    /// Last focal power asked for; not while a session is under way.
    focal_power: Option<FocalPower>,
    /// Why the lens is being held, if it is. A policy that fails is the operator's business, session or not.
    held: Option<Hold>,
    /// The hold in words, and what to do.
    message: Option<Arc<str>>,
    steps_per_second: f64,
    steps: u64,
    telemetry_dropped: u64,
    /// Median latency from exposure to lens command, microseconds; not while a session is under way.
    latency_p50_micros: Option<u32>,
    /// 99th percentile of the same.
    latency_p99_micros: Option<u32>,
}

impl OperatorStatus {
    fn new(status: &ControlStatus, blinded: bool) -> Self {
        Self {
            camera: status.camera.clone(),
            camera_offer: status.camera_offer.clone(),
            lens: status.lens.clone(),
            policy: status.policy.clone().filter(|_| !blinded),
            focal_power: (!blinded).then_some(status.focal_power),
            held: status.held,
            message: status.message.clone(),
            steps_per_second: status.steps_per_second,
            steps: status.steps,
            telemetry_dropped: status.telemetry_dropped,
            latency_p50_micros: (!blinded).then_some(status.latency_p50_micros),
            latency_p99_micros: (!blinded).then_some(status.latency_p99_micros),
        }
    }
}

impl Audience for ForOperator {
    type Header = OperatorFrame;
    type Session = OperatorView;
    type Status = OperatorStatus;

    fn header(frame: &EncodedFrame, age_ms: f64, app: &App) -> OperatorFrame {
        let (age, seen) =
            if app.blinded() { (coarse(age_ms), Seen::default()) } else { (age_ms, Seen::new(&frame.insight)) };
        OperatorFrame { picture: SurgeonFrame::new(&frame.picture, age, app), held: frame.insight.held, seen }
    }

    fn sessions(app: &App) -> watch::Receiver<Option<Arc<OperatorView>>> {
        app.operator_view.clone()
    }

    fn status(status: &ControlStatus, app: &App) -> OperatorStatus {
        OperatorStatus::new(status, app.blinded())
    }
}

//! What the operator's and the researcher's pages get on `/live`: what the surgeon's page gets, and what the loop
//! does. While a session is under way, even they do not get the policy, nor anything that gives it away: how the
//! focal power moves (`fixed` never, hill-climbers by 0.05 each frame), how long a step takes, the metric (by its
//! scale), the belief, which few policies have, whether by it the patch is held in focus, and the depth map.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use tokio::sync::watch;

use super::audience::{Audience, Journey};
use super::surgeon::{SurgeonFrame, coarse};
use super::tablets::TabletSign;
use crate::http::App;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::priority::Scheduling;
use parfocal_base::step::Hold;
use parfocal_devices::camera::{CameraHealth, CameraOffer};
use parfocal_devices::lens::LensHealth;
use parfocal_pipeline::control::{ControlStatus, FocusLock, Following};
use parfocal_pipeline::live::{DepthMap, DepthMaps, EncodedFrame, Insight};
use parfocal_trial::permission::{self, HoldTold};
use parfocal_trial::view::OperatorView;

/// An operator's or researcher's page.
pub(super) struct ForOperator;

/// What is sent with each picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OperatorFrame {
    #[serde(flatten)]
    picture: SurgeonFrame,
    /// Why the lens was held, if it was; while a session is under way, never a reason that lies with the policy.
    held: Option<Hold>,
    /// What the loop did with the frame; every field is null while a session is under way, and while the lens stands
    /// where one has left it.
    #[serde(flatten)]
    seen: RevealingValues,
}

/// The values that could reveal the policy.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
struct RevealingValues {
    /// Focal power asked for after this frame.
    asked: Option<FocalPower>,
    /// Focal power at which the frame was exposed.
    measured: Option<FocalPower>,
    /// The policy's focus metric.
    metric: Option<f64>,
    /// The policy's belief, if it has one: for equally wide slices of 0..=1, the probability that each holds the
    /// optimum.
    belief: Option<Arc<[f32]>>,
    /// At which focal power each place of the picture is in focus, if the page has asked for it.
    depths: Option<Arc<DepthMap>>,
}

impl RevealingValues {
    fn new(insight: &Insight, depths: Option<Arc<DepthMap>>) -> Self {
        Self {
            asked: Some(insight.asked),
            measured: insight.measured,
            metric: insight.metric,
            belief: insight.belief.clone(),
            depths,
        }
    }
}

/// Status of the control loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OperatorStatus {
    camera: CameraHealth,
    camera_offer: CameraOffer,
    lens: LensHealth,
    /// Policy in charge, if there is one and it may be told.
    policy: Option<PolicyName>,
    /// Last focal power asked for; not while a session is under way, nor while the lens stands where one has left it.
    focal_power: Option<FocalPower>,
    /// Why the lens is being held, if it is; while a session is under way, see [`told_in_session`].
    held: Option<Hold>,
    /// The hold in words, and what to do.
    message: Option<Arc<str>>,
    steps_per_second: f64,
    steps: u64,
    telemetry_dropped: u64,
    /// Median latency from exposure to lens command, microseconds; not while a session is under way.
    latency_p50_micros: Option<u32>,
    /// 99th percentile of that latency.
    latency_p99_micros: Option<u32>,
    /// Priority of the loop compared with other programs on the machine.
    priority: Priority,
    /// What the policy's belief says of the focus; not while a session is under way.
    lock: Option<FocusLock>,
    /// Whether the patch follows the tissue; not while a session is under way.
    following: Option<Following>,
    /// When the server's certificate expires. The page cannot reach the server after that.
    certificate_until: Option<Timestamp>,
    /// The surgeon's tablet.
    tablet: TabletSign,
}

/// A [`Scheduling`], with what it means and what to do, in words.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Priority {
    standing: Scheduling,
    message: &'static str,
}

impl OperatorStatus {
    fn new(status: &ControlStatus, blinded: bool, certificate_until: Option<Timestamp>, tablet: TabletSign) -> Self {
        let (held, message) = match status.held {
            Some(hold) if blinded => told_in_session(hold, status.held_for, status.message.as_ref()),
            held => (held, status.message.clone()),
        };
        // After a session, what its last policy has left hides for as long as the lens stands there.
        let hidden = blinded || status.left_by_session;

        Self {
            camera: status.camera.clone(),
            camera_offer: status.camera_offer.clone(),
            lens: status.lens.clone(),
            policy: status.policy.clone().filter(|_| !blinded),
            focal_power: (!hidden).then_some(status.focal_power),
            held,
            message,
            steps_per_second: status.steps_per_second,
            steps: status.steps,
            telemetry_dropped: status.telemetry_dropped,
            latency_p50_micros: (!hidden).then_some(status.latency_p50_micros),
            latency_p99_micros: (!hidden).then_some(status.latency_p99_micros),
            priority: Priority { standing: status.priority, message: status.priority.words() },
            lock: (!hidden).then_some(status.lock),
            following: (!blinded).then_some(status.following),
            certificate_until,
            tablet,
        }
    }
}

/// The parts of a hold, which has lasted for `held_for`, and of its message that may be shown while a session is under
/// way.
fn told_in_session(hold: Hold, held_for: Duration, message: Option<&Arc<str>>) -> (Option<Hold>, Option<Arc<str>>) {
    match permission::hold_told(hold.caused_by_policy(), held_for) {
        HoldTold::Fully => (Some(hold), message.cloned()),
        HoldTold::WithoutReason => {
            let words = "the focus has been held for some time; if it stays so, abort the session";
            (Some(Hold::PolicySlow), Some(Arc::from(words)))
        }
        HoldTold::Not => (None, None),
    }
}

impl Audience for ForOperator {
    type Header = OperatorFrame;
    type Session = OperatorView;
    type Status = OperatorStatus;

    const LEADS: bool = false;

    fn depth_maps(app: &App) -> Option<DepthMaps> {
        Some(app.live.depth_maps())
    }

    fn header(frame: &EncodedFrame, journey: Journey, depths: Option<Arc<DepthMap>>, app: &App) -> OperatorFrame {
        // Ask only once: a session may begin between two questions.
        let blinded = app.blinded();
        let (journey, seen) = if blinded || frame.insight.left_by_session {
            (coarse(journey), RevealingValues::default())
        } else {
            (journey, RevealingValues::new(&frame.insight, depths))
        };
        let held = frame.insight.held.filter(|hold| !(blinded && hold.caused_by_policy()));

        OperatorFrame { picture: SurgeonFrame::new(&frame.picture, journey, app), held, seen }
    }

    fn sessions(app: &App) -> watch::Receiver<Option<Arc<OperatorView>>> {
        app.operator_view.clone()
    }

    fn status(status: &ControlStatus, app: &App) -> OperatorStatus {
        let tablet = app.tablets.sign(app.clock.now());
        OperatorStatus::new(status, app.blinded(), app.address.certificate_until(), tablet)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_policys_holds_are_shown_in_a_session_only_if_they_last_and_then_all_alike() {
        let message: Arc<str> = Arc::from("the policy is starting");
        let told = |hold, seconds| told_in_session(hold, Duration::from_secs(seconds), Some(&message));
        let policys = [Hold::PolicyPanicked, Hold::PolicyNonsense, Hold::PolicySlow, Hold::PolicyUnavailable];
        for hold in policys {
            assert_eq!(told(hold, 1), (None, None));
            assert_eq!(told(hold, 10), told(policys[0], 10));
            assert!(told(hold, 10).1.is_some_and(|told| !told.contains("policy")));
        }

        for hold in [Hold::LensFailed, Hold::CameraFailed, Hold::Paused] {
            assert_eq!(told(hold, 0), (Some(hold), Some(Arc::clone(&message))));
        }
    }
}

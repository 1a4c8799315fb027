//! What the operator's and the researcher's pages get on `/live`: the surgeon's, and what the loop does. While a session
//! is under way not even they are told the policy's name, nor what gives it away: the metric, by its scale, and the
//! belief, which few policies have.

use std::sync::Arc;

use serde::Serialize;
use tokio::sync::watch;

use super::App;
use super::live::Audience;
use super::live_surgeon::SurgeonFrame;
use crate::control::{ControlStatus, Hold};
use crate::lens::FocalPower;
use crate::live::{EncodedFrame, Insight};
use crate::trial::view::OperatorView;

/// An operator's or researcher's page.
pub(super) struct ForOperator;

/// What goes with each picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct OperatorFrame {
    #[serde(flatten)]
    picture: SurgeonFrame,
    /// Focal power asked for after this frame.
    asked: FocalPower,
    /// Focal power that the frame was exposed at.
    measured: Option<FocalPower>,
    /// The policy's focus metric; not while a session is under way.
    metric: Option<f64>,
    /// Why the lens was held, if it was.
    held: Option<Hold>,
    /// Probability of each of equally wide slices of 0..=1 to hold the optimum, where the policy has a belief; not while a
    /// session is under way.
    belief: Option<Arc<[f32]>>,
}

impl OperatorFrame {
    fn new(picture: SurgeonFrame, insight: &Insight, blinded: bool) -> Self {
        Self {
            picture,
            asked: insight.asked,
            measured: insight.measured,
            metric: insight.metric.filter(|_| !blinded),
            held: insight.held,
            belief: insight.belief.clone().filter(|_| !blinded),
        }
    }
}

impl Audience for ForOperator {
    type Header = OperatorFrame;
    type Session = OperatorView;
    type Status = ControlStatus;

    fn header(frame: &EncodedFrame, age_ms: f64, app: &App) -> OperatorFrame {
        OperatorFrame::new(SurgeonFrame::new(&frame.picture, age_ms, app), &frame.insight, app.blinded())
    }

    fn sessions(app: &App) -> watch::Receiver<Option<Arc<OperatorView>>> {
        app.operator_view.clone()
    }

    fn status(status: &ControlStatus, app: &App) -> ControlStatus {
        let policy = status.policy.clone().filter(|_| !app.blinded());
        ControlStatus { policy, ..status.clone() }
    }
}

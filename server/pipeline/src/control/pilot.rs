//! The pilot: asks the policy in charge, and replaces its instance if it fails.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::advice::{Advice, Failure};
use super::runner::Runner;
use parfocal_autofocus::{Fault, FieldOfView, Observation, PolicyError, Registry};
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::step::Hold;

/// Time from a failure to the next attempt. Long enough not to flood the log; short enough that the loop recovers well
/// within a second after the cause is gone.
const RETRY: Duration = Duration::from_millis(200);
/// Longest time for an answer of an instance that has answered before. After that the instance is abandoned.
const HUNG: Duration = Duration::from_millis(250);
/// Longest time for the first answer of a new instance, which may have to load.
const STARTING: Duration = Duration::from_millis(500);
/// While so many abandoned threads still hang, a failed policy is not started again.
const MOST_HUNG: usize = 4;
/// While so many hang, a newly chosen policy is not started either.
const MOST_HUNG_AT_ALL: usize = 32;

/// Why the lens is held, and what is being done. The words do not name the policy, so that they can be shown during a
/// blinded session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HoldReason {
    /// The kind of reason.
    pub hold: Hold,
    /// The reason in words, and what to do.
    pub message: Arc<str>,
}

impl HoldReason {
    /// A reason of kind `hold`.
    pub fn new(hold: Hold, message: &str) -> Self {
        Self { hold, message: message.into() }
    }
}

/// Keeps at most one policy in charge, on a runner's thread.
pub struct Pilot {
    registry: Arc<Registry>,
    clock: Arc<dyn Clock>,
    /// Longest wait for an answer: one frame period.
    patience: Duration,
    policy: Option<PolicyName>,
    runner: Option<Runner>,
    failed: Option<(Moment, HoldReason)>,
    hung: Vec<JoinHandle<()>>,
    /// Whether the instance in charge must forget what it saw before it is asked again.
    forgets: bool,
}

impl Pilot {
    /// A pilot without a policy. It will wait at most `patience` for an answer.
    pub fn new(registry: Registry, clock: Arc<dyn Clock>, patience: Duration) -> Self {
        let registry = Arc::new(registry);
        Self { registry, clock, patience, policy: None, runner: None, failed: None, hung: Vec::new(), forgets: false }
    }

    /// Puts a new instance of `policy` in charge, or no policy.
    pub fn engage(&mut self, policy: Option<PolicyName>) {
        self.dismiss();
        self.failed = None;
        self.policy = policy;
        if self.policy.is_some() {
            // A failure to start is reported at the first question, which tries again.
            let _ = self.start(MOST_HUNG_AT_ALL);
        }
    }

    /// Makes the policy forget what it has seen before it is asked again.
    pub const fn forget(&mut self) {
        self.forgets = true;
    }

    /// Waits at most `patience`, one frame period, for each answer from now on.
    pub const fn wait_at_most(&mut self, patience: Duration) {
        self.patience = patience;
    }

    /// The policy in charge.
    pub const fn policy(&self) -> Option<&PolicyName> {
        self.policy.as_ref()
    }

    /// The field of view of the policy in charge.
    pub fn field_of_view(&self) -> FieldOfView {
        self.runner.as_ref().map_or(FieldOfView::Wide, Runner::field_of_view)
    }

    /// Asks the policy for advice on `seen`. Waits at most one frame period.
    ///
    /// # Errors
    /// If there is no advice to follow.
    pub fn ask(&mut self, seen: &Observation<'_>) -> Result<Advice, HoldReason> {
        let now = self.clock.now();
        if self.runner.is_none() {
            self.restart(now)?;
        }
        self.clear_late_answer(now)?;

        let Some(runner) = &mut self.runner else { return Err(self.starting()) };
        let proven = runner.proven;
        runner.ask(now, seen, std::mem::take(&mut self.forgets));

        match runner.answer(self.patience) {
            Some(Ok(advice)) => {
                self.failed = None;
                Ok(advice)
            }
            Some(Err(failure)) => Err(self.fail(now, &failure)),
            None => Err(if proven { slow() } else { self.starting() }),
        }
    }

    /// Handles an instance that is still busy with an earlier frame. It may take a while longer; its late answer is
    /// discarded.
    fn clear_late_answer(&mut self, now: Moment) -> Result<(), HoldReason> {
        let Some(runner) = &mut self.runner else { return Ok(()) };
        let Some(since) = runner.open_since() else { return Ok(()) };
        let proven = runner.proven;
        let limit = if proven { HUNG } else { STARTING };

        match runner.answer(Duration::ZERO) {
            Some(Ok(_late)) => Ok(()),
            Some(Err(failure)) => Err(self.fail(now, &failure)),
            None if now.since(since) < limit => Err(if proven { slow() } else { self.starting() }),
            None => Err(self.give_up(now, slow())),
        }
    }

    fn restart(&mut self, now: Moment) -> Result<(), HoldReason> {
        if let Some((since, reason)) = &self.failed
            && now.since(*since) < RETRY
        {
            return Err(reason.clone());
        }
        self.start(MOST_HUNG).map_err(|reason| self.give_up(now, reason))
    }

    fn start(&mut self, most_hung: usize) -> Result<(), HoldReason> {
        let Some(name) = self.policy.clone() else { return Err(starting()) };
        self.hung.retain(|thread| !thread.is_finished());
        if self.hung.len() >= most_hung {
            return Err(HoldReason::new(
                Hold::PolicySlow,
                "the policy hangs again and again; the lens is held. Choose another policy",
            ));
        }

        // A new instance has seen nothing yet.
        self.forgets = false;
        let runner = Runner::start(self.registry.clone(), name, self.clock.clone());
        self.runner = Some(runner.map_err(|error| {
            tracing::error!(%error, "no thread for a policy");
            HoldReason::new(Hold::PolicySlow, "the system has no thread left for the policy; the lens is held")
        })?);
        Ok(())
    }

    /// Gives up the instance in charge after `failure`.
    fn fail(&mut self, now: Moment, failure: &Failure) -> HoldReason {
        let reason = hold_reason(failure).unwrap_or_else(|| self.starting());
        self.give_up(now, reason)
    }

    fn give_up(&mut self, now: Moment, reason: HoldReason) -> HoldReason {
        self.dismiss();
        self.failed = Some((now, reason.clone()));
        reason
    }

    /// The reason for a hold while an instance starts: why the one before failed, which it may do again, or else that
    /// it is starting.
    fn starting(&self) -> HoldReason {
        self.failed.as_ref().map_or_else(starting, |(_, reason)| reason.clone())
    }

    fn dismiss(&mut self) {
        if let Some(runner) = self.runner.take() {
            self.hung.push(runner.abandon());
            self.hung.retain(|thread| !thread.is_finished());
        }
    }
}

/// The reason for a hold after `failure`; `None` if the policy is only starting. Only the debug log gets the details:
/// the operator of a blinded session may read the log, and only some policies fail in these ways. Outside a session
/// the status shows the kind of failure.
fn hold_reason(failure: &Failure) -> Option<HoldReason> {
    tracing::debug!(%failure, "the policy gave no advice");
    let (hold, message) = match failure {
        Failure::Unavailable(PolicyError::Starting { failed: None, .. }) => return None,
        Failure::Outside(Fault::Late) => return Some(slow()),
        Failure::Panicked(_)
        | Failure::Outside(Fault::Ended(_))
        | Failure::Unavailable(PolicyError::Starting { failed: Some(_), .. }) => {
            (Hold::PolicyPanicked, "the policy failed and is being restarted; the lens is held")
        }
        Failure::Outside(Fault::Nonsense(_)) | Failure::InvalidTarget(_) => (
            Hold::PolicyNonsense,
            "the policy returned an invalid focal power and is being restarted; the lens is held",
        ),
        Failure::Unavailable(_) => (
            Hold::PolicyUnavailable,
            "the policy cannot run here; the lens is held. `parfocal policies` shows the reason",
        ),
    };
    Some(HoldReason::new(hold, message))
}

fn slow() -> HoldReason {
    HoldReason::new(Hold::PolicySlow, "the policy takes longer than a frame; the lens is held until it keeps up")
}

fn starting() -> HoldReason {
    HoldReason::new(Hold::PolicySlow, "the policy is starting; the lens is held")
}

//! The pilot: asks the policy in charge, checks what it answers, and replaces an instance that fails.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::Hold;
use super::runner::{Answer, Runner};
use crate::autofocus::{Decision, Observation, PolicyName, Registry};
use crate::clock::{Clock, Moment};
use crate::lens::FocalPower;

/// Time from a failure to the next attempt: long enough not to flood the log, short enough that the loop is back well
/// within a second of the reason's end.
const RETRY: Duration = Duration::from_millis(200);
/// An instance that has answered before may be late by this much before it is given up.
const HUNG: Duration = Duration::from_millis(250);
/// A fresh instance may take this long for its first answer: it may have to load.
const STARTING: Duration = Duration::from_millis(500);
/// While this many given-up threads still hang, a failed policy is not tried again.
const MOST_HUNG: usize = 4;
/// While this many hang, a newly chosen policy is not tried either.
const MOST_HUNG_AT_ALL: usize = 32;
/// A belief longer than this is not shown.
const LONGEST_BELIEF: usize = 4096;

/// Why the policy's advice cannot be followed, and what is being done. The words do not name the policy, so that they
/// may be shown during a blinded session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HoldReason {
    /// The kind.
    pub hold: Hold,
    /// In words.
    pub message: Arc<str>,
}

impl HoldReason {
    /// A reason of kind `hold`.
    #[must_use]
    pub fn new(hold: Hold, message: &str) -> Self {
        Self { hold, message: message.into() }
    }
}

/// Advice that can be followed.
#[derive(Debug, Clone, PartialEq)]
pub struct Advice {
    /// Where to go.
    pub target: FocalPower,
    /// The policy's focus metric, if it has one and it is a number.
    pub metric: Option<f64>,
    /// The policy's belief, if it has one.
    pub belief: Option<Arc<[f32]>>,
    /// Time the policy's step took.
    pub took: Duration,
}

/// Has at most one policy in charge, on a runner's thread.
pub struct Pilot {
    registry: Arc<Registry>,
    clock: Arc<dyn Clock>,
    /// How long an answer is waited for: one frame.
    patience: Duration,
    policy: Option<PolicyName>,
    runner: Option<Runner>,
    failed: Option<(Moment, HoldReason)>,
    hung: Vec<JoinHandle<()>>,
}

impl Pilot {
    /// Nobody in charge; answers will be waited for `patience` long.
    pub fn new(registry: Registry, clock: Arc<dyn Clock>, patience: Duration) -> Self {
        let registry = Arc::new(registry);
        Self { registry, clock, patience, policy: None, runner: None, failed: None, hung: Vec::new() }
    }

    /// Puts a fresh instance of `policy` in charge, or nobody.
    pub fn engage(&mut self, policy: Option<PolicyName>) {
        self.dismiss();
        self.failed = None;
        self.policy = policy;
        if self.policy.is_some() {
            // A failure to start is met again, and reported, at the first question.
            let _ = self.start(MOST_HUNG_AT_ALL);
        }
    }

    /// The policy in charge.
    pub const fn policy(&self) -> Option<&PolicyName> {
        self.policy.as_ref()
    }

    /// What the policy advises on seeing this; waits at most one frame.
    ///
    /// # Errors
    /// Why there is no advice to follow.
    pub fn ask(&mut self, seen: &Observation<'_>) -> Result<Advice, HoldReason> {
        let now = self.clock.now();
        if self.runner.is_none() {
            self.restart(now)?;
        }
        self.clear_late_answer(now)?;
        let Some(runner) = &mut self.runner else { return Err(starting()) };
        runner.ask(now, seen);
        let proven = runner.proven;
        match runner.answer(self.patience) {
            Some(answer) => {
                let advice = check(answer).map_err(|reason| self.fail(now, reason))?;
                self.failed = None;
                Ok(advice)
            }
            None => Err(if proven { slow() } else { starting() }),
        }
    }

    /// An instance still busy with an earlier frame is left to it for a while; its answer, being late, is thrown away.
    fn clear_late_answer(&mut self, now: Moment) -> Result<(), HoldReason> {
        let Some(runner) = &mut self.runner else { return Ok(()) };
        let Some(since) = runner.open_since() else { return Ok(()) };
        let (limit, reason) = if runner.proven { (HUNG, slow()) } else { (STARTING, starting()) };
        match runner.answer(Duration::ZERO) {
            Some(late) => check(late).map(drop).map_err(|reason| self.fail(now, reason)),
            None if now.since(since) < limit => Err(reason),
            None => Err(self.fail(now, slow())),
        }
    }

    fn restart(&mut self, now: Moment) -> Result<(), HoldReason> {
        if let Some((since, reason)) = &self.failed
            && now.since(*since) < RETRY
        {
            return Err(reason.clone());
        }
        self.start(MOST_HUNG).map_err(|reason| self.fail(now, reason))
    }

    fn start(&mut self, most_hung: usize) -> Result<(), HoldReason> {
        let Some(name) = self.policy.clone() else { return Err(starting()) };
        self.hung.retain(|thread| !thread.is_finished());
        if self.hung.len() >= most_hung {
            return Err(HoldReason::new(
                Hold::PolicySlow,
                "the policy hangs again and again; the lens is held: choose another one",
            ));
        }
        let runner = Runner::start(self.registry.clone(), name, self.clock.clone());
        self.runner = Some(runner.map_err(|error| {
            tracing::error!(%error, "no thread for a policy");
            HoldReason::new(Hold::PolicySlow, "the system has no thread left for the policy; the lens is held")
        })?);
        Ok(())
    }

    fn fail(&mut self, now: Moment, reason: HoldReason) -> HoldReason {
        self.dismiss();
        self.failed = Some((now, reason.clone()));
        reason
    }

    fn dismiss(&mut self) {
        if let Some(runner) = self.runner.take() {
            self.hung.push(runner.abandon());
            self.hung.retain(|thread| !thread.is_finished());
        }
    }
}

/// The one place where a policy's answer becomes something to act on. What went wrong is logged for those who debug alone: the operator
/// of a blinded session sits before the log, and only some policies fail so. The status tells it outside sessions.
fn check(answer: Answer) -> Result<Advice, HoldReason> {
    match answer {
        Answer::Decided { decision, took } => checked(decision, took),
        Answer::Panicked(message) => {
            tracing::debug!(message, "the policy panicked");
            Err(HoldReason::new(
                Hold::PolicyPanicked,
                "the policy failed and is being started afresh; the lens is held",
            ))
        }
        Answer::Unavailable(error) => {
            tracing::debug!(%error, "the policy cannot be had");
            Err(HoldReason::new(
                Hold::PolicyUnavailable,
                "the policy cannot run here; the lens is held: `parfocal policies` tells why",
            ))
        }
    }
}

fn checked(decision: Decision, took: Duration) -> Result<Advice, HoldReason> {
    let Ok(target) = FocalPower::new(decision.target) else {
        tracing::debug!(target = decision.target, "the policy asked for what is no focal power");
        return Err(HoldReason::new(
            Hold::PolicyNonsense,
            "the policy asked for what is no focal power and is being started afresh; the lens is held",
        ));
    };
    let metric = decision.metric.filter(|metric| metric.is_finite());
    let sound = |belief: &Arc<[f32]>| belief.len() <= LONGEST_BELIEF && belief.iter().all(|p| p.is_finite());
    Ok(Advice { target, metric, belief: decision.belief.filter(sound), took })
}

fn slow() -> HoldReason {
    HoldReason::new(Hold::PolicySlow, "the policy takes longer than a frame; the lens is held until it keeps up")
}

fn starting() -> HoldReason {
    HoldReason::new(Hold::PolicySlow, "the policy is starting; the lens is held")
}

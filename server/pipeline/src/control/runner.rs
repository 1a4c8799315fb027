//! A thread that runs one instance of a policy, so that an instance that hangs or panics stops nothing else.

use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::thread::{Pid, gettid};

use super::advice::{Advice, Failure};
use parfocal_autofocus::{FieldOfView, Observation, Policy, PolicyError, Registry, networks};
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::guarded;
use parfocal_base::priority::{self, ThreadRole};
use parfocal_imaging::View;

/// A copy of an observation for the policy's thread.
#[derive(Debug)]
struct Question {
    view: View,
    focal_power: FocalPower,
    /// Whether the policy must forget what it saw before.
    anew: bool,
}

/// The outcome of a question.
type StepResult = Result<Advice, Failure>;

/// One instance of a policy on its own thread. At most one question is open at a time. Dropping the runner ends the
/// thread as soon as the policy's step returns. The drop does not wait.
#[derive(Debug)]
pub struct Runner {
    questions: SyncSender<Question>,
    answers: Receiver<StepResult>,
    thread: JoinHandle<()>,
    /// The thread's number, once the thread runs.
    id: Arc<OnceLock<Pid>>,
    /// The instance's field of view, once the instance is built.
    field_of_view: Arc<OnceLock<FieldOfView>>,
    /// Whether the thread has real-time priority.
    urgent: bool,
    asked_at: Option<Moment>,
    /// Whether the instance has answered at least once. Until then it may be loading.
    pub proven: bool,
}

/// Name of the threads on which policies run.
const THREAD: &str = "policy";

impl Runner {
    /// Starts a new instance of policy `name`. It is built on its own thread.
    ///
    /// # Errors
    /// If the system has no thread left.
    pub fn start(registry: Arc<Registry>, name: PolicyName, clock: Arc<dyn Clock>) -> io::Result<Self> {
        let (questions, questions_in) = sync_channel(1);
        let (answers_out, answers) = sync_channel(1);
        let id = Arc::new(OnceLock::new());
        let id_of_thread = id.clone();
        let field_of_view = Arc::new(OnceLock::new());
        let field_of_instance = field_of_view.clone();

        let thread = std::thread::Builder::new().name(THREAD.into()).spawn(move || {
            let _ = id_of_thread.set(gettid());
            priority::prefer();
            networks::compute_on_this_thread();
            let build = || instance(&registry, &name, &field_of_instance);
            serve(build, &*clock, &questions_in, &answers_out);
        })?;

        Ok(Self { questions, answers, thread, id, field_of_view, urgent: false, asked_at: None, proven: false })
    }

    /// The instance's field of view. It is unknown while the instance is being built, for a few frames; until then it
    /// is taken to be wide.
    pub fn field_of_view(&self) -> FieldOfView {
        self.field_of_view.get().copied().unwrap_or(FieldOfView::Wide)
    }

    /// Asks the policy and does not wait. The thread has real-time priority until [`Self::answer`] stops waiting for
    /// it. If `anew`, the policy first forgets what it saw before.
    pub fn ask(&mut self, now: Moment, seen: &Observation<'_>, anew: bool) {
        self.hurry();
        self.asked_at = Some(now);
        // If the thread has ended, the reason is among the answers.
        let _ = self.questions.try_send(Question { view: seen.view.clone(), focal_power: seen.focal_power, anew });
    }

    /// Time at which the open question was asked; `None` if no question is open.
    pub const fn open_since(&self) -> Option<Moment> {
        self.asked_at
    }

    /// Waits for the answer to the open question, for at most `timeout`; `None` if it did not come.
    pub fn answer(&mut self, timeout: Duration) -> Option<Result<Advice, Failure>> {
        let answer = match self.answers.recv_timeout(timeout) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => {
                self.take_time();
                return None;
            }
            Err(RecvTimeoutError::Disconnected) => Err(Failure::Panicked("its thread ended".into())),
        };

        self.asked_at = None;
        self.proven = true;
        Some(answer)
    }

    /// Abandons the thread. It ends when the policy's step returns, if ever. If an answer is missing, the policy may be
    /// spinning, so its thread gets the lowest priority. Otherwise the thread ends at once.
    pub fn abandon(self) -> JoinHandle<()> {
        if self.asked_at.is_some()
            && let Some(thread) = self.running()
        {
            priority::abandon_thread(thread);
        }
        self.thread
    }

    /// Gives the policy's thread priority over everything except the loop and the devices. The thread keeps it between
    /// frames, while it waits.
    fn hurry(&mut self) {
        if !self.urgent
            && let Some(thread) = self.running()
        {
            self.urgent = priority::raise_thread(thread, ThreadRole::Policy);
        }
    }

    /// Takes the priority back: a policy that is late or spins, so that the loop no longer waits for it, must not
    /// occupy a processor.
    fn take_time(&mut self) {
        if std::mem::take(&mut self.urgent)
            && let Some(thread) = self.running()
        {
            priority::lower_thread(thread);
        }
    }

    /// The thread's number; `None` after the thread has ended, when the number may belong to another thread.
    fn running(&self) -> Option<Pid> {
        self.id.get().copied().filter(|_| !self.thread.is_finished())
    }
}

/// Builds a new instance of policy `name`, and stores its field of view in `field_of_view`.
fn instance(
    registry: &Registry,
    name: &PolicyName,
    field_of_view: &OnceLock<FieldOfView>,
) -> Result<Box<dyn Policy>, PolicyError> {
    let policy = registry.build(name)?;
    let _ = field_of_view.set(policy.field_of_view());
    Ok(policy)
}

/// Builds an instance with `build` and answers questions with it, until the questions end or it panics.
fn serve(
    build: impl FnOnce() -> Result<Box<dyn Policy>, PolicyError>,
    clock: &dyn Clock,
    questions: &Receiver<Question>,
    answers: &SyncSender<StepResult>,
) {
    let mut policy = match guarded(build) {
        Ok(Ok(policy)) => policy,
        Ok(Err(error)) => return drop(answers.send(Err(Failure::Unavailable(error)))),
        Err(message) => return drop(answers.send(Err(Failure::Panicked(message)))),
    };

    for question in questions {
        let answer = step(&mut *policy, &question, clock);
        let panicked = matches!(answer, Err(Failure::Panicked(_)));
        if answers.send(answer).is_err() || panicked {
            return;
        }
    }
}

fn step(policy: &mut dyn Policy, question: &Question, clock: &dyn Clock) -> StepResult {
    let began = clock.now();
    let seen = Observation { view: &question.view, focal_power: question.focal_power };
    let decide = || {
        if question.anew {
            policy.forget();
        }
        policy.step(&seen)
    };
    let decision = guarded(decide).map_err(Failure::Panicked)?;
    let took = clock.now().since(began);
    Advice::new(decision, took).map_err(|failure| policy.fault().map_or(failure, Failure::Outside))
}

/// From now on, keeps the message and place of a policy's panic off standard error, which the operator of a blinded
/// session may see.
pub fn keep_policies_quiet() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(THREAD) {
            usual(panic);
        }
    }));
}

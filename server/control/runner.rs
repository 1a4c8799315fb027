//! A thread that runs one instance of a policy, so that an instance that hangs or panics takes
//! nothing with it.

use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::thread::{Pid, gettid};

use super::advice::{Advice, Failure};
use crate::autofocus::{FieldOfView, Observation, Policy, PolicyError, PolicyName, Registry, networks};
use crate::clock::{Clock, Moment};
use crate::imaging::View;
use crate::lens::FocalPower;
use crate::priority::{self, Place};

/// An observation of the thread's own.
#[derive(Debug)]
struct Question {
    view: View,
    focal_power: FocalPower,
}

/// The outcome of a question.
type Answer = Result<Advice, Failure>;

/// One instance of a policy on a thread of its own. At most one question is open at a time.
/// Dropping the runner ends the thread as soon as the policy's step returns, and waits for nothing.
#[derive(Debug)]
pub struct Runner {
    questions: SyncSender<Question>,
    answers: Receiver<Answer>,
    thread: JoinHandle<()>,
    /// The thread's number, once it runs.
    id: Arc<OnceLock<Pid>>,
    /// What the instance uses of a frame, once it is made.
    field_of_view: Arc<OnceLock<FieldOfView>>,
    /// Whether the thread is at real-time priority.
    urgent: bool,
    asked_at: Option<Moment>,
    /// Whether the instance has answered once. Until then it may be loading.
    pub proven: bool,
}

/// Name of the threads that policies run on.
const THREAD: &str = "policy";

impl Runner {
    /// Starts a fresh instance of policy `name`; it is made on its own thread.
    ///
    /// # Errors
    /// When the system has no thread left.
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

    /// What the instance uses of a frame. While it is being made, which takes a few frames, nobody
    /// knows, so it is shown everything.
    pub fn field_of_view(&self) -> FieldOfView {
        self.field_of_view.get().copied().unwrap_or(FieldOfView::Wide)
    }

    /// Asks; does not wait. Until [`Self::answer`] stops waiting the thread is at real-time
    /// priority.
    pub fn ask(&mut self, now: Moment, seen: &Observation<'_>) {
        self.hurry();
        self.asked_at = Some(now);
        // A thread that has ended leaves its reason among the answers.
        let _ = self.questions.try_send(Question { view: *seen.view, focal_power: seen.focal_power });
    }

    /// When the open question was asked, if one is open.
    pub const fn open_since(&self) -> Option<Moment> {
        self.asked_at
    }

    /// Waits for the answer to the open question, for at most `timeout`; `None` when it did not
    /// come.
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

    /// Gives the thread up; it ends when the policy's step returns, if ever. One that owes an
    /// answer may be spinning, and goes behind all others; one that does not ends at once.
    pub fn abandon(self) -> JoinHandle<()> {
        if self.asked_at.is_some()
            && let Some(thread) = self.running()
        {
            priority::abandon_thread(thread);
        }
        self.thread
    }

    /// Lets the policy go before everything but the loop and the devices. It stays so between
    /// frames, while it waits.
    fn hurry(&mut self) {
        if !self.urgent
            && let Some(thread) = self.running()
        {
            self.urgent = priority::raise_thread(thread, Place::Policy);
        }
    }

    /// A policy that the loop no longer waits for, since it is late or spins, has no claim on a
    /// processor.
    fn take_time(&mut self) {
        if std::mem::take(&mut self.urgent)
            && let Some(thread) = self.running()
        {
            priority::lower_thread(thread);
        }
    }

    /// The thread's number while it has not ended: later the number may be another thread's.
    fn running(&self) -> Option<Pid> {
        self.id.get().copied().filter(|_| !self.thread.is_finished())
    }
}

/// A fresh instance of policy `name`, whose field of view is noted in `field_of_view`.
fn instance(
    registry: &Registry,
    name: &PolicyName,
    field_of_view: &OnceLock<FieldOfView>,
) -> Result<Box<dyn Policy>, PolicyError> {
    let policy = registry.build(name)?;
    let _ = field_of_view.set(policy.field_of_view());
    Ok(policy)
}

/// Makes an instance with `build` and answers questions with it, until there are no more or it panics.
fn serve(
    build: impl FnOnce() -> Result<Box<dyn Policy>, PolicyError>,
    clock: &dyn Clock,
    questions: &Receiver<Question>,
    answers: &SyncSender<Answer>,
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

fn step(policy: &mut dyn Policy, question: &Question, clock: &dyn Clock) -> Answer {
    let began = clock.now();
    let seen = Observation { view: &question.view, focal_power: question.focal_power };
    let decision = guarded(|| policy.step(&seen)).map_err(Failure::Panicked)?;
    Advice::new(decision, clock.now().since(began))
}

/// Keeps what a panicking policy says, and where in the code it stood, off the standard error from
/// now on: the operator of a blinded session may sit before it.
pub fn keep_policies_quiet() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if std::thread::current().name() != Some(THREAD) {
            usual(panic);
        }
    }));
}

/// Runs `risky`; a panic becomes its message.
pub fn guarded<T>(risky: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(risky)).map_err(|payload| message(&*payload))
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").to_owned()
}

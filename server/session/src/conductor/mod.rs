//! The conductor handles a session's events in this order: the trial's rules decide, the disk takes the events, and
//! then the control loop and the screens hear of them. So everything that anyone has seen is on disk.
//!
//! Only stopping the lens does not wait for the disk. A pause, an end and a time limit hold the
//! lens first. They are recorded as soon as the disk takes them, and until then the screens show
//! them as not recorded yet.

mod allocate;
mod circumstances;
mod consents;
mod corrections;
mod course;
mod erasures;
mod error;
mod flow;
mod keeping;
mod lens;
mod library;
mod pointing;
mod remarks;
mod studies;
mod study_changes;
mod views;
mod voice;

use std::pin::Pin;
use std::sync::Arc;

use rand_chacha::ChaCha12Rng;
use serde::Deserialize;
use tokio::sync::{Mutex, Notify, watch};
use utoipa::ToSchema;

pub(crate) use course::{Course, RunClock, outstanding};
pub(crate) use erasures::words_left;
pub use error::ConductError;
pub use library::{Library, ProtocolSummary};
pub use studies::Studies;
pub(crate) use studies::{outstanding_sessions, plan_concerns};

use parfocal_autofocus::Registry;
use parfocal_base::clock::Clock;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::{Aim, Command, ControlHandle};
use parfocal_records::store::Store;
use parfocal_trial::account::Actor;
use parfocal_trial::action::Action;
use parfocal_trial::participant;
use parfocal_trial::permission::{self, CurrentSession, Request};
use parfocal_trial::phase::Phase;
use parfocal_trial::protocol::Record;
use parfocal_trial::remark::{Holding, NewAnswer, NewComment};
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::tablet::TabletReport;
use parfocal_trial::view::{OperatorView, SurgeonView};

/// The parts that a conductor is made of.
pub struct ConductorParts {
    /// The database.
    pub store: Store,
    /// The control loop.
    pub control: ControlHandle,
    /// The available protocols.
    pub library: Library,
    /// The available policies.
    pub registry: Registry,
    /// Both clocks, monotonic and wall.
    pub clock: Arc<dyn Clock>,
    /// Random source for the orders and ids of real sessions. It must be unpredictable: the server seeds it from the
    /// system's random source.
    pub random: ChaCha12Rng,
    /// Random source for those of practice sessions, which may be predictable. Each start of the server gets a stream
    /// of its own, so that a fixed seed does not make the same ids twice in one database.
    pub practice_random: ChaCha12Rng,
}

/// Runs at most one session at a time. Clone freely.
#[derive(Clone)]
pub struct Conductor {
    shared: Arc<Shared>,
}

struct Shared {
    store: Store,
    control: ControlHandle,
    library: Library,
    studies: Studies,
    registry: Registry,
    clock: Arc<dyn Clock>,
    /// The clocks of this start of the server and of the earlier ones.
    run_clock: RunClock,
    /// The session in memory. Stopping the lens needs this lock, so never hold it while waiting for the disk.
    live: std::sync::Mutex<Live>,
    /// Held from a decision until it is on disk. So the next decision is based on what is on disk, and is written after
    /// it.
    pen: Mutex<Pen>,
    surgeon: watch::Sender<Option<Arc<SurgeonView>>>,
    operator: watch::Sender<Option<Arc<OperatorView>>>,
    /// Wakes the task that keeps time, because the next change may be due at another time now.
    changed: Notify,
    /// Wakes the task that records, because there may be something to record.
    to_record: Notify,
}

/// A study and the site at which a session is made.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, ToSchema)]
pub struct StudyPlace {
    /// The study's name.
    pub study: String,
    /// The site's name.
    pub site: String,
}

#[derive(Default)]
struct Live {
    course: Option<Course>,
    /// The session's last command to the control loop.
    commanded: Option<Command>,
    /// Where the policy was last told to look, and whether that was a session's command.
    aim: Aim,
    aimed_by_session: bool,
    /// Why the last attempt to record a stop failed; `None` if it did not.
    unrecorded_because: Option<String>,
}

impl Live {
    /// The session in memory, if it is `session`.
    fn course_of(&mut self, session: SessionId) -> Option<&mut Course> {
        self.course.as_mut().filter(|course| course.session() == session)
    }

    /// The session on the screens.
    fn shown(&self) -> Option<&Course> {
        self.course.as_ref().filter(|course| !course.dismissed)
    }

    /// The phase of the session on the screens.
    fn shown_phase(&self) -> Option<Phase> {
        self.shown().map(|course| course.state.phase())
    }

    /// Forgets a closed session once all of it is on disk.
    fn forget_what_is_done_with(&mut self) {
        self.course.take_if(|course| course.is_done_with());
    }
}

/// The right to write a session's data, with the random sources for making a session.
struct Pen {
    /// For real sessions.
    random: ChaCha12Rng,
    /// For practice.
    practice_random: ChaCha12Rng,
}

impl Conductor {
    /// Resumes the session that was under way when the server last ended, paused where it was. Time limits and prompts
    /// work only while [`Conductor::run`] is awaited.
    ///
    /// # Errors
    /// If the disk or database failed.
    pub async fn open(parts: ConductorParts) -> Result<Self, ConductError> {
        let ConductorParts { store, control, library, registry, clock, random, mut practice_random } = parts;
        practice_random.set_stream(u64::try_from(store.run()).unwrap_or_default());
        let run_clock = RunClock::of(&store).await?;

        let course = match store.reader().session_under_way().await? {
            Some(session) => Some(Course::load(store.reader(), &run_clock, session).await?),
            None => None,
        };

        let studies = Studies::of_server(&store, &library, Arc::clone(&clock));
        let shared = Shared {
            store,
            control,
            library,
            studies,
            registry,
            clock,
            run_clock,
            live: std::sync::Mutex::default(),
            pen: Mutex::new(Pen { random, practice_random }),
            surgeon: watch::Sender::new(None),
            operator: watch::Sender::new(None),
            changed: Notify::new(),
            to_record: Notify::new(),
        };

        if let Some(course) = course {
            shared.take_up(course).await?;
        }
        Ok(Self { shared: Arc::new(shared) })
    }

    /// The session under way, or one that has just ended until it is dismissed, as the surgeon may see it. The receiver
    /// gets every change.
    pub fn surgeon_view(&self) -> watch::Receiver<Option<Arc<SurgeonView>>> {
        self.shared.surgeon.subscribe()
    }

    /// The same for the operator.
    pub fn operator_view(&self) -> watch::Receiver<Option<Arc<OperatorView>>> {
        self.shared.operator.subscribe()
    }

    /// The session that has neither ended nor been closed, if there is one.
    pub fn session_under_way(&self) -> Option<SessionId> {
        let live = self.shared.live();
        live.shown().filter(|course| !course.state.phase().has_ended()).map(Course::session)
    }

    /// The session under way, and what is to be recorded of it, from its start to its end.
    pub fn to_record(&self) -> Option<(SessionId, Record)> {
        let live = self.shared.live();
        let course = live.shown()?;
        let phase = course.state.phase();
        let runs = phase != Phase::Ready && !phase.has_ended();
        (runs && course.protocol.record != Record::None).then(|| (course.session(), course.protocol.record))
    }

    /// Adds a participant; an existing one stays.
    ///
    /// # Errors
    /// If `code` is not a valid code, `by` may not add participants, or the disk failed.
    pub async fn add_participant(&self, by: Role, code: &str) -> Result<(), ConductError> {
        permission::check(by, Request::AddParticipant, CurrentSession::None)?;
        participant::check_code(code)?;
        Ok(self.shared.store.add_participant(code, self.shared.clock.wall()).await?)
    }

    /// Makes a session for `participant` by `protocol` and draws its allocation; with a `place` in a study, the session
    /// gets the next place in the list of that site. It waits for [`Action::Start`].
    ///
    /// # Errors
    /// If a session is under way already, participant or protocol is unknown, or the study allows no such session.
    pub async fn create(
        &self,
        by: impl Into<Actor>,
        participant: &str,
        protocol: &str,
        place: Option<StudyPlace>,
    ) -> Result<SessionId, ConductError> {
        let by = by.into();
        let participant = participant.to_owned();
        let protocol = protocol.to_owned();
        self.to_the_end(|shared| async move { shared.create(by, &participant, &protocol, place).await }).await
    }

    /// Carries out `action` on session `session`.
    ///
    /// # Errors
    /// If `by` may not do this, or the action does not fit the session's state.
    pub async fn act(&self, by: impl Into<Actor>, session: SessionId, action: Action) -> Result<(), ConductError> {
        let by = by.into();
        self.to_the_end(move |shared| async move { shared.act(&by, session, &action, None).await }).await
    }

    /// Unblinds one session of a study that is still blinded, signed by a person.
    ///
    /// # Errors
    /// If `by` is not the researcher, the reason names a policy, or the session's order would reveal another's.
    pub async fn unblind_in_emergency(
        &self,
        by: impl Into<Actor>,
        session: SessionId,
        signature: Signature,
        despite_outstanding: bool,
    ) -> Result<(), ConductError> {
        let by = by.into();
        let action = Action::Unblind { reason: signature.reason.clone(), despite_outstanding };
        self.to_the_end(move |shared| async move { shared.act(&by, session, &action, Some(&signature)).await }).await
    }

    /// Removes an ended session from the screens.
    ///
    /// # Errors
    /// If it has not ended, or `by` is not the operator.
    pub fn dismiss(&self, by: Role, session: SessionId) -> Result<(), ConductError> {
        let mut live = self.shared.live();
        let phase = live.course_of(session).map(|course| course.state.phase());
        permission::check(by, Request::CloseSession, CurrentSession::of(phase))?;

        if let Some(course) = live.course_of(session) {
            course.record_movement();
            course.dismissed = true;
        }
        live.forget_what_is_done_with();
        self.shared.publish(&live);
        drop(live);
        self.shared.wake();
        Ok(())
    }

    /// Stores a comment. It is on disk when this returns. A comment on a segment that has just ended stays with that
    /// segment.
    ///
    /// # Errors
    /// If the session does not exist, the text is empty or too long, or the disk failed.
    pub async fn comment(&self, comment: NewComment) -> Result<(), ConductError> {
        self.to_the_end(|shared| async move { shared.comment(comment).await }).await
    }

    /// Stores an answer. It is on disk when this returns.
    ///
    /// # Errors
    /// If the question has not been asked yet, the value does not fit it, or the disk failed.
    pub async fn answer(&self, answer: NewAnswer) -> Result<(), ConductError> {
        self.to_the_end(|shared| async move { shared.answer(answer).await }).await
    }

    /// Follows what the surgeon's tablets report: one that goes away or comes back, and what is seen on them, are
    /// recorded, and may pause the session. To be called a few times a second.
    pub async fn follow_tablets(&self, report: TabletReport) {
        self.shared.follow_tablets(&report).await;
    }

    /// Records how much of a session a surgeon's device still holds unsent.
    ///
    /// # Errors
    /// If there is no such session, or the disk failed.
    pub async fn holding(&self, holding: Holding) -> Result<(), ConductError> {
        self.to_the_end(move |shared| async move { shared.holding(holding).await }).await
    }

    /// Runs `work` to its end even if the caller is dropped, as a handler is when its browser disconnects. Otherwise
    /// memory could fall behind the disk.
    async fn to_the_end<T, F>(&self, work: impl FnOnce(Arc<Shared>) -> F) -> Result<T, ConductError>
    where
        T: Send + 'static,
        F: Future<Output = Result<T, ConductError>> + Send + 'static,
    {
        let stopped = |_| Err(ConductError::Storage("the server was stopped meanwhile; try again".to_owned()));
        // Boxed, so that a task is compiled for each type of result instead of for each kind of work.
        let work: Pin<Box<dyn Future<Output = _> + Send>> = Box::pin(work(Arc::clone(&self.shared)));
        tokio::spawn(work).await.unwrap_or_else(stopped)
    }
}

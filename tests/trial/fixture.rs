//! A conductor on a folder of its own, with manual clocks and a fake control loop that only receives commands.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use parfocal_autofocus::Registry;
use parfocal_base::FocalPower;
use parfocal_base::clock::{Clock, ManualClock};
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_base::{BlurRate, PolicyName};
use parfocal_devices::camera::{CameraHealth, CameraOffer};
use parfocal_devices::lens::LensHealth;
use parfocal_imaging::ContentArea;
use parfocal_pipeline::control::{Command, ControlHandle, ControlStatus, LatestSlot, PictureGeometry, Tap};
use parfocal_records::accounts::{Accounts, Cost, Passphrase};
use parfocal_records::store::{AccessLog, ServerRun, Store};
use parfocal_session::conductor::{ConductError, Conductor, ConductorParts, Library};
use parfocal_session::reports::Reports;
use parfocal_trial::account::{Account, AccountName, AccountRole};
use parfocal_trial::action::Action;
use parfocal_trial::phase::Phase;
use parfocal_trial::question::{AnswerValue, QuestionKind};
use parfocal_trial::remark::{CommentContent, NewAnswer, NewComment, Origin, Sight};
use parfocal_trial::role::Role;
use parfocal_trial::view::{OperatorView, SurgeonView};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha12Rng;
use tokio::sync::{mpsc, watch};
use uuid::Uuid;

pub const PARTICIPANT: &str = "S-01";

/// The passphrase of every account.
pub const PASSPHRASE: &str = "four words and a number 7";

/// A cheap cost for hashes, because most tests sign in to test something else.
pub const CHEAP: Cost = Cost { memory_kib: 64, passes: 1 };

/// A server on a folder of its own, without HTTP.
pub struct Trial {
    pub store: Store,
    pub conductor: Conductor,
    pub reports: Reports,
    pub library: Library,
    pub clock: Arc<ManualClock>,
    #[allow(dead_code, reason = "the fuzz targets serve its pages")]
    pub control: ControlHandle,
    pub commands: mpsc::UnboundedReceiver<Command>,
    keys: ChaCha12Rng,
}

pub fn a_run(clock: &ManualClock) -> ServerRun {
    ServerRun {
        wall: clock.wall(),
        at: clock.now(),
        camera: "phantom".into(),
        lens: "simulated".into(),
        calibration: "typical".into(),
        blur: BlurRate::new(6.2),
        weights: Registry::standard().weights(),
        seed: None,
    }
}

pub fn a_clock() -> ManualClock {
    let clock = ManualClock::new("2026-03-01T09:00:00Z".parse().unwrap());
    clock.advance(Duration::from_secs(1000));
    clock
}

pub fn known() -> Vec<PolicyName> {
    Registry::standard().entries().into_iter().map(|entry| entry.name).collect()
}

impl Trial {
    /// Starts a server on `folder`.
    pub async fn start(folder: &Path) -> Self {
        Self::start_with(folder, None, 7).await
    }

    /// Starts a server on `folder` with a folder of protocols and a seed.
    pub async fn start_with(folder: &Path, protocols: Option<&Path>, seed: u64) -> Self {
        let trial = Self::empty(folder, protocols, seed, a_clock()).await;
        trial.conductor.add_participant(Role::Operator, PARTICIPANT).await.unwrap();
        trial
    }

    /// The same without a participant, by `clock`.
    pub async fn empty(folder: &Path, protocols: Option<&Path>, seed: u64, clock: ManualClock) -> Self {
        let clock = Arc::new(clock);
        let store = Store::open(folder, &a_run(&clock)).await.unwrap();
        let (control, commands) = listener();
        let library = Library::load(protocols, &known()).unwrap();
        let conductor = Conductor::open(ConductorParts {
            store: store.clone(),
            control: control.clone(),
            library: library.clone(),
            registry: Registry::standard(),
            clock: clock.clone(),
            random: ChaCha12Rng::seed_from_u64(seed + u64::try_from(store.run()).unwrap() * 1000),
            practice_random: ChaCha12Rng::seed_from_u64(seed),
        })
        .await
        .unwrap();

        let keys = ChaCha12Rng::seed_from_u64(seed + u64::try_from(store.run()).unwrap() * 1000);
        let reports = Reports::open(&store, clock.clone()).await.unwrap();
        Self { store, conductor, reports, library, clock, control, commands, keys }
    }

    pub fn key(&mut self) -> IdempotencyKey {
        IdempotencyKey(Uuid::from_u64_pair(self.keys.next_u64(), self.keys.next_u64()))
    }

    /// The server's personal accounts.
    pub fn accounts(&self) -> Accounts {
        Accounts::of_server(&self.store, self.clock.clone(), CHEAP)
    }

    /// Makes an account.
    pub async fn account(&self, name: &str, role: AccountRole, display: &str) -> Account {
        let passphrase = Passphrase::new(PASSPHRASE).unwrap();
        self.accounts().add(AccountName::new(name).unwrap(), display, role, passphrase, None).await.unwrap()
    }

    /// The access log with which the researcher's page exports.
    pub fn access_log(&self) -> AccessLog {
        AccessLog::of_server(&self.store, Role::Researcher.into(), self.clock.clone())
    }

    pub fn view(&self) -> SurgeonView {
        self.conductor.surgeon_view().borrow().as_deref().unwrap().clone()
    }

    pub fn operator_view(&self) -> OperatorView {
        self.conductor.operator_view().borrow().as_deref().unwrap().clone()
    }

    /// Makes and starts a session with `protocol`.
    pub async fn begin(&self, protocol: &str) -> SessionId {
        let session = self.conductor.create(Role::Operator, PARTICIPANT, protocol, None).await.unwrap();
        self.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
        session
    }

    pub async fn surgeon(&self, action: Action) {
        self.conductor.act(Role::Surgeon, self.view().session, action).await.unwrap();
    }

    pub async fn wait(&self, time: Duration) {
        self.clock.advance(time);
        self.conductor.tick().await;
    }

    /// A comment with `text`, as the page would send it now.
    pub fn comment(&mut self, text: &str) -> NewComment {
        let view = self.view();
        NewComment {
            key: self.key(),
            session: view.session,
            segment: view.segment,
            frame: Some(1234),
            run: Some(self.store.run()),
            sight: Sight::default(),
            origin: Origin { client_millis: Some(1_772_355_600_000), ..Origin::default() },
            said: CommentContent::Text(text.to_owned()),
        }
    }

    pub async fn say(&mut self, text: &str) {
        let comment = self.comment(text);
        self.conductor.comment(comment).await.unwrap();
    }

    /// Answers every question that is asked now.
    pub async fn answer_all(&mut self) {
        let view = self.view();
        for question in &view.questions {
            let settings = u8::try_from(view.settings).unwrap();
            let value = match &question.kind {
                QuestionKind::Text => AnswerValue::Text("fine 👍".to_owned()),
                QuestionKind::Likert { points, .. } => AnswerValue::Point(*points),
                QuestionKind::VisualAnalogue { .. } => AnswerValue::Point(63),
                QuestionKind::Recognition => AnswerValue::Point(2),
                QuestionKind::Ranking { ties: false } => AnswerValue::Points((1..=settings).rev().collect()),
                QuestionKind::Ranking { ties: true } => AnswerValue::Points(vec![1; view.settings]),
                QuestionKind::NasaTlx { scales } => AnswerValue::Points(vec![11; scales.len()]),
                QuestionKind::SurgTlx { scales, pairs } => {
                    AnswerValue::Points([vec![11; scales.len()], vec![1; pairs.len()]].concat())
                }
                QuestionKind::Sus { .. } => AnswerValue::Points(vec![4, 2, 3, 1, 4, 3, 2, 2, 4, 2]),
            };

            self.answer(&question.id, value).await.unwrap();
        }
    }

    pub async fn answer(&mut self, question: &str, value: AnswerValue) -> Result<(), ConductError> {
        let view = self.view();
        let key = self.key();
        let question = question.to_owned();
        let origin = Origin::default();
        let answer = NewAnswer { key, session: view.session, segment: view.segment, question, value, origin };
        self.conductor.answer(answer).await
    }

    /// Runs one setting from its notice to the end of its questions, and returns its segment.
    pub async fn whole_setting(&mut self) -> SegmentId {
        let segment = self.view().segment.unwrap();
        self.surgeon(Action::Acknowledge { segment }).await;
        self.wait(Duration::from_secs(20)).await;
        self.say(&format!("setting {} 🔬 \"quoted\", and\na second line", self.view().setting)).await;
        self.surgeon(Action::FinishSegment { segment }).await;
        self.answer_all().await;
        if self.view().phase == Phase::Questions {
            self.surgeon(Action::FinishQuestions { segment: Some(segment) }).await;
        }
        segment
    }

    /// Runs a session with `protocol` from beginning to end.
    pub async fn whole_session(&mut self, protocol: &str) -> SessionId {
        let session = self.begin(protocol).await;
        while self.view().phase == Phase::Notice {
            self.whole_setting().await;
        }
        if self.view().phase == Phase::Closing {
            self.answer_all().await;
            self.surgeon(Action::FinishQuestions { segment: None }).await;
        }

        assert_eq!(self.view().phase, Phase::Completed);
        session
    }

    pub async fn unblind(&self, session: SessionId) {
        let reason = "the study is over; CNN won".to_owned();
        let action = Action::Unblind { reason, despite_outstanding: true };
        self.conductor.act(Role::Researcher, session, action).await.unwrap();
    }

    /// The commands that the control loop got since the last call.
    pub fn commanded(&mut self) -> Vec<Command> {
        std::iter::from_fn(|| self.commands.try_recv().ok()).collect()
    }
}

/// A fake control loop that only receives commands.
fn listener() -> (ControlHandle, mpsc::UnboundedReceiver<Command>) {
    let status = ControlStatus {
        at: parfocal_base::clock::Moment::default(),
        camera: CameraHealth {
            name: "none".into(),
            simulated: true,
            working: true,
            message: "none".into(),
            fps: 50.0,
            lost: 0,
        },
        camera_offer: CameraOffer::default(),
        lens: LensHealth {
            name: "none".into(),
            simulated: true,
            working: true,
            caution: false,
            message: "none".into(),
            line_errors: 0,
            info: None,
        },
        policy: None,
        focal_power: FocalPower::MIDDLE,
        left_by_session: false,
        held: None,
        held_for: std::time::Duration::ZERO,
        message: None,
        steps_per_second: 50.0,
        steps: 0,
        telemetry_dropped: 0,
        latency_p50_micros: 0,
        latency_p99_micros: 0,
        priority: parfocal_base::priority::Scheduling::Ordinary,
        lock: parfocal_pipeline::control::FocusLock::default(),
        following: parfocal_pipeline::control::Following::default(),
        // A circle of radius 100 in a picture of 512 x 272 cells.
        geometry: PictureGeometry {
            cells: (512, 272),
            content_area: Some(ContentArea { x: 256.0, y: 136.0, radius: 100.0, confidence: 1.0 }),
        },
    };

    let (commands, received) = mpsc::unbounded_channel();
    let status = watch::channel(Arc::new(status)).1;
    (
        ControlHandle { commands, status, frames: Arc::new(LatestSlot::default()), camera: None, tap: Tap::default() },
        received,
    )
}

//! Reports on sessions and studies, as pages and the command line show them. They read the database and change nothing;
//! what they tell depends on who asks, by the trial's rules.

mod beside;
mod session;
mod studies;
mod timeline;

use std::sync::Arc;

use parfocal_base::clock::Clock;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_records::store::{Reader, Store, StoreError};
use parfocal_trial::grace::Outstanding;
use parfocal_trial::permission;
use parfocal_trial::voice::MediaType;

use crate::conductor::{ConductError, Course, RunClock, outstanding};

pub use beside::{ConsentLine, CorrectionLine, WithdrawalLine};
pub use session::{AnswerLine, SessionDetail, SettingDetail, Unblinding};
pub use studies::{OpenStudy, SiteDetail, StudyDetail, StudyLine, StudyLogLine, StudyProtocol};
pub use timeline::{
    PauseSpan, Played, SetAside, SettingSpan, SightSpan, Timeline, TimelineComment, TimelinePoint, TimelineVoice,
};

/// Reads sessions as pages show them. Clone freely.
#[derive(Clone)]
pub struct Reports {
    reader: Reader,
    clock: Arc<dyn Clock>,
    run_clock: RunClock,
}

impl Reports {
    /// The reports of this run of the server on `store`.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn open(store: &Store, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Ok(Self { reader: store.reader().clone(), clock, run_clock: RunClock::of(store).await? })
    }

    /// Checks that the comments, answers and recordings of `session` may be read.
    ///
    /// # Errors
    /// If its participant withdrew, or the database failed.
    pub async fn check_reading(&self, session: SessionId) -> Result<(), ConductError> {
        let withdrawn = self.reader.is_withdrawn(session).await?;
        Ok(permission::check_reading(withdrawn)?)
    }

    /// The sound of a voice comment of `session`, and its media type.
    ///
    /// # Errors
    /// If there is none, it was erased, the participant withdrew, or the database failed.
    pub async fn voice_audio(
        &self,
        session: SessionId,
        comment: IdempotencyKey,
    ) -> Result<(MediaType, Vec<u8>), ConductError> {
        self.check_reading(session).await?;
        let found = self.reader.voice_audio(session, comment).await?;
        let none = || ConductError::NotFound("this session has no such recording, or it was erased".to_owned());
        found.ok_or_else(none)
    }

    async fn load(&self, session: SessionId) -> Result<Course, ConductError> {
        Course::load(&self.reader, &self.run_clock, session).await
    }

    /// What may still arrive for the session of `course` and would not count after unblinding.
    async fn outstanding(&self, course: &Course) -> Result<Option<Outstanding>, ConductError> {
        let now = self.run_clock.time(self.clock.now());
        Ok(outstanding(&self.reader, &self.run_clock.clocks, course.session(), course.grace, now).await?)
    }
}

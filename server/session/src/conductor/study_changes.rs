//! Changes to studies made by the server, which holds the right to write, beside its sessions.

use super::course::Course;
use super::studies::Studies;
use super::{ConductError, Conductor};
use parfocal_base::ids::SessionId;
use parfocal_trial::role::Role;
use parfocal_trial::study::definition::StudyName;
use parfocal_trial::study::signature::{Channel, Signature};
use parfocal_trial::study::state::Change;

impl Conductor {
    /// Reads and changes studies.
    pub fn studies(&self) -> &Studies {
        &self.shared.studies
    }

    /// The study that `session` belongs to; `None` outside studies. For the session under way it does not wait for the
    /// disk, because somebody may want to stop the lens.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn study_of(&self, session: SessionId) -> Result<Option<String>, ConductError> {
        let under_way = self.shared.live().course_of(session).map(|course| course.study.clone());
        if let Some(study) = under_way {
            return Ok(study);
        }
        Ok(self.shared.store.reader().enrolment(session).await?.map(|enrolment| enrolment.study))
    }

    /// Plans a study; see [`Studies::plan`].
    ///
    /// # Errors
    /// If the definition is malformed, a study of that name exists, or it has no such site.
    pub async fn plan_study(
        &self,
        by: Role,
        definition: String,
        sites: Vec<String>,
        signature: Signature,
    ) -> Result<StudyName, ConductError> {
        self.to_the_end(move |shared| async move {
            let _pen = shared.pen.lock().await;
            shared.studies.plan(Channel::Role(by), &definition, "the definition", &sites, signature).await
        })
        .await
    }

    /// Changes study `name`; see [`Studies::change`].
    ///
    /// # Errors
    /// If there is no such study, the rules refuse the change, or the disk failed.
    pub async fn change_study(
        &self,
        by: Role,
        name: String,
        change: Change,
        signature: Signature,
    ) -> Result<(), ConductError> {
        self.to_the_end(move |shared| async move {
            let mut pen = shared.pen.lock().await;
            // The database must know whether the session in memory has ended.
            shared.record_stops(&mut pen).await?;
            let on_screens = shared.live().course.as_ref().map(Course::session);
            let random = &mut pen.random;
            shared.studies.change(Channel::Role(by), &name, change, signature, on_screens, random).await
        })
        .await
    }
}

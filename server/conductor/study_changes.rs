//! Studies as the server changes them: with the right to write in hand, beside its sessions.

use super::course::Course;
use super::studies::Studies;
use super::{ConductError, Conductor};
use crate::ids::SessionId;
use crate::trial::role::Role;
use crate::trial::study::definition::StudyName;
use crate::trial::study::signature::{Signature, Way};
use crate::trial::study::state::Change;

impl Conductor {
    /// The studies.
    #[must_use]
    pub fn studies(&self) -> &Studies {
        &self.shared.studies
    }

    /// The study that `session` belongs to; none outside any study. Does not wait for the disk for the session under
    /// way, whose lens somebody may want to stop.
    ///
    /// # Errors
    /// When the database failed.
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
    /// When the definition is malformed, there is a study of its name, or it has no such site.
    pub async fn plan_study(
        &self,
        by: Role,
        definition: String,
        sites: Vec<String>,
        signature: Signature,
    ) -> Result<StudyName, ConductError> {
        self.to_the_end(move |shared| async move {
            let _pen = shared.pen.lock().await;
            shared.studies.plan(Way::Role(by), &definition, "the definition", &sites, signature).await
        })
        .await
    }

    /// Changes study `name`; see [`Studies::change`].
    ///
    /// # Errors
    /// When there is no such study, the rules refuse, or the disk failed.
    pub async fn change_study(
        &self,
        by: Role,
        name: String,
        change: Change,
        signature: Signature,
    ) -> Result<(), ConductError> {
        self.to_the_end(move |shared| async move {
            let mut pen = shared.pen.lock().await;
            // The database has to know whether the session in memory has ended.
            shared.record_stops(&mut pen).await?;
            let on_screens = shared.live().course.as_ref().map(Course::session);
            let random = &mut pen.random;
            shared.studies.change(Way::Role(by), &name, change, signature, on_screens, random).await
        })
        .await
    }
}

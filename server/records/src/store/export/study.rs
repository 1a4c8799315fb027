//! The study that the session of an export belongs to. If the session is outside any study, the export has the same
//! tables without rows.

use std::sync::Arc;

use super::description::{StudyEventRow, StudyRow, StudySessionRow};
use crate::store::{Enrolment, Reader, StoreError};
use parfocal_base::ids::SessionId;

/// The study of an exported session. Outside any study it is empty.
#[derive(Default)]
pub struct ExportedStudy {
    /// The row of the study.
    pub rows: Vec<StudyRow>,
    /// The place of the session in it, as a row.
    pub places: Vec<StudySessionRow>,
    /// What happened to the study as a whole, and to this session in it.
    pub events: Vec<StudyEventRow>,
    /// The definition, byte for byte.
    pub definition: Option<Arc<str>>,
}

impl ExportedStudy {
    /// The study of `session`.
    pub async fn of(reader: &Reader, session: SessionId) -> Result<Self, StoreError> {
        let Some(enrolment) = reader.enrolment(session).await? else { return Ok(Self::default()) };
        let missing = || StoreError::Damaged(format!("study {} is not there", enrolment.study));
        let study = reader.study(&enrolment.study).await?.ok_or_else(missing)?;

        let (sites, wall) = reader.export_study(&enrolment.study).await?;
        let state = study.state();
        let row = StudyRow {
            study: enrolment.study.clone(),
            title: study.definition.title,
            definition_sha256: enrolment.definition_sha256,
            sites,
            wall,
            stage: state.stage.name(),
            commitment: state.commitment,
        };

        let events = reader.export_study_events(&enrolment.study, session).await?;
        let Enrolment { study: name, site, protocol, place, .. } = enrolment;
        let place = StudySessionRow { session, study: name, site, protocol, place };
        Ok(Self { rows: vec![row], places: vec![place], events, definition: Some(study.definition.source) })
    }

    /// The keys that the study and its exported events have in the chain.
    pub fn keys(&self) -> impl Iterator<Item = String> {
        let names = self.rows.iter().map(|row| row.study.clone());
        names.chain(self.events.iter().map(|event| format!("{}/{}", event.study, event.number)))
    }
}

//! The study that the session of an export belongs to. If the session is outside any study, the export has the same
//! tables without rows.

use super::description::{StudyEventRow, StudyRow, StudySessionRow};
use crate::store::{Enrolment, Reader, StoreError, StoredStudy};
use parfocal_base::ids::SessionId;

/// The study of an exported session.
pub struct ExportedStudy {
    session: SessionId,
    enrolment: Enrolment,
    study: StoredStudy,
    events: Vec<StudyEventRow>,
    /// The row of the study.
    row: StudyRow,
}

impl ExportedStudy {
    /// The study of `session`, if it belongs to one.
    pub async fn of(reader: &Reader, session: SessionId) -> Result<Option<Self>, StoreError> {
        let Some(enrolment) = reader.enrolment(session).await? else { return Ok(None) };
        let missing = || StoreError::Damaged(format!("study {} is not there", enrolment.study));
        let study = reader.study(&enrolment.study).await?.ok_or_else(missing)?;

        let (sites, wall) = reader.export_study(&enrolment.study).await?;
        let state = study.state();
        let row = StudyRow {
            study: enrolment.study.clone(),
            title: study.definition.title.clone(),
            definition_sha256: enrolment.definition_sha256.clone(),
            sites,
            wall,
            stage: state.stage.name(),
            commitment: state.commitment,
        };

        let events = reader.export_study_events(&enrolment.study, session).await?;
        Ok(Some(Self { session, enrolment, study, events, row }))
    }

    /// The row of the study; none if the session is outside any study.
    pub fn study_rows(exported: Option<&Self>) -> Vec<StudyRow> {
        exported.map(|exported| exported.row.clone()).into_iter().collect()
    }

    /// The place of the session in its study, as a row; none outside any study.
    pub fn session_rows(exported: Option<&Self>) -> Vec<StudySessionRow> {
        let row = |exported: &Self| StudySessionRow {
            session: exported.session,
            study: exported.enrolment.study.clone(),
            site: exported.enrolment.site.clone(),
            protocol: exported.enrolment.protocol.clone(),
            place: exported.enrolment.place,
        };
        exported.map(row).into_iter().collect()
    }

    /// What happened to the study as a whole, and to this session in it.
    pub fn event_rows(exported: Option<&Self>) -> &[StudyEventRow] {
        exported.map_or(&[], |exported| &exported.events)
    }

    /// The definition, byte for byte.
    pub fn definition(&self) -> &str {
        &self.study.definition.source
    }

    /// The study's name.
    pub fn name(&self) -> &str {
        &self.enrolment.study
    }

    /// SHA-256 of the definition.
    pub fn definition_sha256(&self) -> &str {
        &self.enrolment.definition_sha256
    }

    /// The keys that the study and its exported events have in the chain.
    pub fn keys(&self) -> impl Iterator<Item = String> {
        let name = self.name().to_owned();
        let events = self.events.iter().map(move |event| format!("{}/{}", event.study, event.number));
        std::iter::once(name).chain(events)
    }
}

//! Reads studies.

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{Enrolment, StoredStudy};
use crate::store::actors::account;
use crate::store::values::{named, parsed, parsed_if_any, status};
use crate::store::{Reader, StoreError};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_trial::allocation::Seed;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::definition::Definition;
use parfocal_trial::study::event::{StudyEvent, StudyEventKind};
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::signature::{Channel, Signature};

impl Reader {
    /// The names of all studies, in the order in which they were planned.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn study_names(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT study FROM studies ORDER BY rowid").fetch_all(self.pool()).await?)
    }

    /// The whole of study `name`, or `None` if there is none.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    #[boxed]
    pub async fn study(&self, name: &str) -> Result<Option<StoredStudy>, StoreError> {
        let row = sqlx::query(
            "SELECT definition, sites, seed FROM studies LEFT JOIN study_seeds USING (study) WHERE study = ?",
        )
        .bind(name);
        let Some(row) = row.fetch_optional(self.pool()).await? else { return Ok(None) };

        let unreadable = |error: &dyn std::fmt::Display| StoreError::Damaged(format!("study {name}: {error}"));
        let protocols = self.study_protocols(name).await?;
        let definition: String = row.try_get("definition")?;
        let definition = Definition::parse(&definition, name, &protocols).map_err(|error| unreadable(&error))?;
        let sites: String = row.try_get("sites")?;
        let sites = serde_json::from_str(&sites).map_err(|error| unreadable(&error))?;
        let seed: Option<String> = row.try_get("seed")?;
        let no_seed = || unreadable(&"its seed is not 64 hexadecimal digits");

        Ok(Some(StoredStudy {
            definition,
            sites,
            seed: seed.map(|seed| Seed::from_hex(&seed).ok_or_else(no_seed)).transpose()?,
            events: self.study_events(name).await?,
            sessions: self.enrolled(name).await?,
        }))
    }

    async fn study_protocols(&self, study: &str) -> Result<Vec<Protocol>, StoreError> {
        let sql = "SELECT protocol, protocol_toml FROM study_protocols WHERE study = ? ORDER BY protocol";
        let protocol = |row: &SqliteRow| {
            Protocol::parse_kept(row.try_get("protocol_toml")?, row.try_get("protocol")?)
                .map_err(|error| StoreError::Damaged(format!("study {study}, protocol {error}")))
        };
        self.rows(sql, &study, protocol).await
    }

    /// The events of study `study`, in order.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn study_events(&self, study: &str) -> Result<Vec<StudyEvent>, StoreError> {
        let sql = "SELECT *, (SELECT account FROM actors AS a
                 WHERE a.kind = 'study-event' AND a.record = study || '/' || e.number) AS account
             FROM study_events AS e WHERE study = ? ORDER BY number";
        self.rows(sql, &study, event).await
    }

    /// The sessions of study `study`, in the order in which they were made.
    async fn enrolled(&self, study: &str) -> Result<Vec<Enrolled>, StoreError> {
        let sql = "SELECT m.session, m.site, m.protocol, m.place, s.participant,
                 EXISTS (SELECT 1 FROM events AS e WHERE e.session = m.session AND kind = 'completed') AS completed,
                 EXISTS (SELECT 1 FROM events AS e WHERE e.session = m.session AND kind = 'aborted') AS aborted,
                 EXISTS (SELECT 1 FROM events AS e WHERE e.session = m.session AND kind = 'unblinded') AS unblinded,
                 EXISTS (SELECT 1 FROM events AS e WHERE e.session = m.session AND kind = 'withdrawn') AS withdrawn,
                 nullif((SELECT new_value FROM corrections AS c WHERE c.session = m.session AND field = 'participant'
                     ORDER BY number DESC LIMIT 1), s.participant) AS corrected_participant
             FROM study_sessions AS m JOIN sessions AS s USING (session) WHERE m.study = ? ORDER BY s.rowid";
        self.rows(sql, &study, enrolled).await
    }

    /// The place of `session` in its study; `None` outside any study.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn enrolment(&self, session: SessionId) -> Result<Option<Enrolment>, StoreError> {
        let row = sqlx::query(
            "SELECT study, definition_sha256, site, protocol, place FROM study_sessions JOIN studies USING (study)
             WHERE session = ?",
        )
        .bind(session.to_string())
        .fetch_optional(self.pool())
        .await?;

        let enrolment = |row: SqliteRow| {
            Ok(Enrolment {
                study: row.try_get("study")?,
                definition_sha256: row.try_get("definition_sha256")?,
                site: row.try_get("site")?,
                protocol: row.try_get("protocol")?,
                place: place(&row)?,
            })
        };
        row.map(enrolment).transpose()
    }

    /// When the study of `session` was locked; `None` if it was not, or if the session is outside any study.
    pub(in crate::store) async fn study_locked(&self, session: SessionId) -> Result<Option<Timestamp>, StoreError> {
        let row = sqlx::query(
            "SELECT e.wall FROM study_sessions AS m JOIN study_events AS e USING (study)
             WHERE m.session = ? AND e.kind = 'locked'",
        )
        .bind(session.to_string())
        .fetch_optional(self.pool())
        .await?;
        row.map(|row| parsed(&row, "wall")).transpose()
    }
}

fn event(row: &SqliteRow) -> Result<StudyEvent, StoreError> {
    let session = parsed_if_any(row, "session")?;
    let commitment = row.try_get("commitment")?;
    let account = account(row)?;

    Ok(StudyEvent {
        number: row.try_get("number")?,
        way: named(row, "role", "an event of a study", Channel::named)?,
        signature: Signature { person: row.try_get("person")?, reason: row.try_get("reason")?, account },
        wall: parsed(row, "wall")?,
        kind: named(row, "kind", "an event of a study", |kind| StudyEventKind::of(kind, session, commitment))?,
    })
}

fn enrolled(row: &SqliteRow) -> Result<Enrolled, StoreError> {
    Ok(Enrolled {
        session: parsed(row, "session")?,
        participant: row.try_get("participant")?,
        corrected_participant: row.try_get("corrected_participant")?,
        site: row.try_get("site")?,
        protocol: row.try_get("protocol")?,
        place: place(row)?,
        status: status(row)?,
        unblinded: row.try_get("unblinded")?,
        withdrawn: row.try_get("withdrawn")?,
    })
}

fn place(row: &SqliteRow) -> Result<usize, StoreError> {
    let place: i64 = row.try_get("place")?;
    usize::try_from(place).map_err(|_| StoreError::Damaged(format!("place {place} in a list")))
}

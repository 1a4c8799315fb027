//! Writes studies, their events and their sessions.

use sqlx::sqlite::SqliteConnection;

use super::{Enrolment, NewStudy, StudyChange};
use crate::store::actors::name_actor;
use crate::store::insert::Insert;
use crate::store::session_events::insert_event;
use crate::store::values::nanoseconds;
use crate::store::{StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_trial::study::definition::StudyName;

/// Writes a new study with its first event.
#[boxed]
pub(super) async fn insert_study(
    connection: &mut SqliteConnection,
    run: Option<i64>,
    new: &NewStudy,
    planned: &StudyChange,
) -> Result<(), StoreError> {
    let study = &new.definition.name;
    let wall = new.wall.to_string();
    let sites = serde_json::to_string(&new.sites).map_err(|error| StoreError::Damaged(error.to_string()))?;

    Insert::into("studies")
        .set("study", study.as_str())
        .set("wall", &wall)
        .set("definition", &*new.definition.source)
        .set("definition_sha256", new.definition.sha256())
        .set("sites", sites)
        .execute(connection)
        .await?;

    for protocol in &new.definition.protocols {
        Insert::into("study_protocols")
            .set("study", study.as_str())
            .set("protocol", &protocol.name)
            .set("protocol_toml", &*protocol.source)
            .execute(connection)
            .await?;
    }

    chain::append(connection, "study", study.as_str(), &wall).await?;
    insert_change(connection, run, study, planned).await
}

/// Writes all of `change` of `study`.
#[boxed]
pub(super) async fn insert_change(
    connection: &mut SqliteConnection,
    run: Option<i64>,
    study: &StudyName,
    change: &StudyChange,
) -> Result<(), StoreError> {
    if let Some(seed) = change.seed {
        Insert::into("study_seeds").set("study", study.as_str()).set("seed", seed.to_hex()).execute(connection).await?;
    }

    let event = &change.event;
    let wall = event.wall.to_string();
    Insert::into("study_events")
        .set("study", study.as_str())
        .set("number", event.number)
        .set("run", run)
        .set("wall", &wall)
        .set("monotonic_ns", change.at.map(nanoseconds))
        .set("role", event.way.name())
        .set("person", &event.signature.person)
        .set("reason", &event.signature.reason)
        .set("kind", event.kind.name())
        .set("session", event.kind.session().map(|session| session.to_string()))
        .set("commitment", event.kind.commitment())
        .execute(connection)
        .await?;
    let key = format!("{study}/{}", event.number);
    chain::append(connection, "study-event", &key, &wall).await?;
    name_actor(connection, event.signature.account.as_ref(), "study-event", &key, None, &wall).await?;

    for (session, events) in &change.sessions {
        let run = run.ok_or_else(|| StoreError::Damaged("only a server records a session's events".to_owned()))?;
        for event in events {
            insert_event(connection, run, *session, event).await?;
        }
    }
    Ok(())
}

/// Records that `session`, which the transaction on `connection` has just made, belongs to a study.
pub(in crate::store) async fn enrol(
    connection: &mut SqliteConnection,
    session: SessionId,
    enrolment: &Enrolment,
    wall: &str,
) -> Result<(), StoreError> {
    Insert::into("study_sessions")
        .set("session", session.to_string())
        .set("study", &enrolment.study)
        .set("site", &enrolment.site)
        .set("protocol", &enrolment.protocol)
        .set("place", i64::try_from(enrolment.place).unwrap_or(i64::MAX))
        .execute(connection)
        .await?;
    chain::append(connection, "study-session", &session.to_string(), wall).await?;
    Ok(())
}

//! Writes studies, their events and their sessions.

use sqlx::sqlite::SqliteConnection;

use super::{Enrolment, NewStudy, StudyChange};
use crate::store::actors::name_actor;
use crate::store::session_events::insert_event;
use crate::store::values::{begin, nanoseconds};
use crate::store::{StoreError, chain};
use parfocal_base::ids::SessionId;
use parfocal_trial::study::definition::StudyName;

/// Writes a new study with its first event, or nothing.
pub(super) async fn insert_study(
    connection: &mut SqliteConnection,
    run: Option<i64>,
    new: &NewStudy,
    planned: &StudyChange,
) -> Result<(), StoreError> {
    let study = &new.definition.name;
    let wall = new.wall.to_string();
    let sites = serde_json::to_string(&new.sites).map_err(|error| StoreError::Damaged(error.to_string()))?;

    let mut transaction = begin(connection).await?;
    sqlx::query("INSERT INTO studies (study, wall, definition, definition_sha256, sites) VALUES (?, ?, ?, ?, ?)")
        .bind(study.as_str())
        .bind(&wall)
        .bind(&*new.definition.source)
        .bind(new.definition.sha256())
        .bind(sites)
        .execute(&mut *transaction)
        .await?;

    for protocol in &new.definition.protocols {
        sqlx::query("INSERT INTO study_protocols (study, protocol, protocol_toml) VALUES (?, ?, ?)")
            .bind(study.as_str())
            .bind(&protocol.name)
            .bind(&*protocol.source)
            .execute(&mut *transaction)
            .await?;
    }

    chain::append(&mut transaction, "study", study.as_str(), &wall).await?;
    insert_change(&mut transaction, run, study, planned).await?;
    Ok(transaction.commit().await?)
}

/// Writes all of `change` of `study`, or nothing.
pub(super) async fn change_study(
    connection: &mut SqliteConnection,
    run: Option<i64>,
    study: &StudyName,
    change: &StudyChange,
) -> Result<(), StoreError> {
    let mut transaction = begin(connection).await?;
    insert_change(&mut transaction, run, study, change).await?;
    Ok(transaction.commit().await?)
}

async fn insert_change(
    connection: &mut SqliteConnection,
    run: Option<i64>,
    study: &StudyName,
    change: &StudyChange,
) -> Result<(), StoreError> {
    if let Some(seed) = change.seed {
        sqlx::query("INSERT INTO study_seeds (study, seed) VALUES (?, ?)")
            .bind(study.as_str())
            .bind(seed.to_hex())
            .execute(&mut *connection)
            .await?;
    }

    let event = &change.event;
    let wall = event.wall.to_string();
    sqlx::query(
        "INSERT INTO study_events
         (study, number, run, wall, monotonic_ns, role, person, reason, kind, session, commitment)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(study.as_str())
    .bind(event.number)
    .bind(run)
    .bind(&wall)
    .bind(change.at.map(nanoseconds))
    .bind(event.way.name())
    .bind(&event.signature.person)
    .bind(&event.signature.reason)
    .bind(event.kind.name())
    .bind(event.kind.session().map(|session| session.to_string()))
    .bind(event.kind.commitment())
    .execute(&mut *connection)
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
    sqlx::query("INSERT INTO study_sessions (session, study, site, protocol, place) VALUES (?, ?, ?, ?, ?)")
        .bind(session.to_string())
        .bind(&enrolment.study)
        .bind(&enrolment.site)
        .bind(&enrolment.protocol)
        .bind(i64::try_from(enrolment.place).unwrap_or(i64::MAX))
        .execute(&mut *connection)
        .await?;
    chain::append(connection, "study-session", &session.to_string(), wall).await?;
    Ok(())
}

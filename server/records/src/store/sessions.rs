//! Creates, extends and reads sessions with their segments and events.

use std::time::Duration;

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::actors::account;
use super::chain;
use super::insert::Insert;
use super::session_events::insert_event;
use super::studies::{Enrolment, enrol};
use super::values::{named, parsed, stamp};
use super::{Reader, RunClocks, Stamp, Store, StoreError};
use parfocal_base::PolicyName;
use parfocal_base::boxed;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_trial::allocation::{Algorithm, Seed};
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::grace::{DEFAULT_GRACE, Grace};
use parfocal_trial::protocol::{Protocol, ProtocolError};
use parfocal_trial::role::Role;

/// A session to be made.
#[derive(Debug, Clone)]
pub struct NewSession {
    /// Id of the session.
    pub session: SessionId,
    /// When it is made.
    pub stamp: Stamp,
    /// Participant's code.
    pub participant: String,
    /// Protocol's name.
    pub protocol: String,
    /// Protocol's text.
    pub protocol_toml: String,
    /// SHA-256 of that text, hexadecimal.
    pub protocol_sha256: String,
    /// Whether it is practice.
    pub practice: bool,
    /// The algorithm that draws its order.
    pub algorithm: Algorithm,
    /// The seed that its order is drawn from.
    pub seed: Seed,
    /// Index in the balanced set that shares the seed, from 0.
    pub set_index: usize,
    /// SHA-256 that commits to protocol, algorithm, seed, index and order, hexadecimal.
    pub commitment: String,
    /// Its segments, in order, each with its policy.
    pub segments: Vec<(SegmentId, PolicyName)>,
}

/// A session read back.
#[derive(Debug, Clone)]
pub struct StoredSession {
    /// As it was made.
    pub made: NewSession,
    /// Number of the run that made it.
    pub run: i64,
    /// Its events so far, each with the start of the server that recorded it.
    pub events: Vec<(i64, Event)>,
    /// The study that it belongs to; `None` outside any study.
    pub study: Option<String>,
    /// When its study was locked, by the wall clock; `None` if it was not, or outside any study.
    pub study_locked: Option<Timestamp>,
}

impl StoredSession {
    /// Its protocol, whose policies this version need not have.
    ///
    /// # Errors
    /// If this version cannot read it.
    pub fn protocol(&self) -> Result<Protocol, ProtocolError> {
        Protocol::parse_kept(&self.made.protocol_toml, &self.made.protocol)
    }

    /// When the withdrawal of its participant was recorded, and by which role; `None` without a withdrawal.
    pub fn withdrawn(&self) -> Option<(Timestamp, Role)> {
        let withdrawal = self.events.iter().find(|(_, event)| matches!(event.kind, EventKind::Withdrawn { .. }));
        withdrawal.map(|(_, event)| (event.wall, event.by))
    }

    /// Decides whether what arrives for the session still counts. `clocks` are those of the server's starts.
    pub fn grace(&self, clocks: &RunClocks) -> Grace {
        let mut grace = Grace::new(self.protocol().map_or(DEFAULT_GRACE, |protocol| protocol.grace));
        for (run, event) in &self.events {
            grace.apply(&event.kind, clocks.wall(*run, event.at));
        }
        grace.locked(self.study_locked)
    }
}

impl Store {
    /// Creates a session with its first event, and with its place in a study if it has one: all of it or nothing.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn create_session(
        &self,
        new: &NewSession,
        created: &Event,
        enrolment: Option<&Enrolment>,
    ) -> Result<(), StoreError> {
        let session = new.session.to_string();
        let wall = new.stamp.wall.to_string();

        self.write(async |connection| {
            Insert::into("sessions")
                .set("session", &session)
                .recorded(self.inner.run, new.stamp)
                .set("participant", &new.participant)
                .set("protocol", &new.protocol)
                .set("protocol_toml", &new.protocol_toml)
                .set("protocol_sha256", &new.protocol_sha256)
                .set("practice", new.practice)
                .set("algorithm", new.algorithm.name())
                .set("seed", new.seed.to_hex())
                .set("set_index", i64::try_from(new.set_index).unwrap_or(i64::MAX))
                .set("commitment", &new.commitment)
                .execute(connection)
                .await?;

            for ((segment, policy), setting) in new.segments.iter().zip(1_i64..) {
                Insert::into("segments")
                    .set("segment", segment.to_string())
                    .set("session", &session)
                    .set("setting", setting)
                    .set("policy", policy.as_str())
                    .execute(connection)
                    .await?;
            }

            chain::append(connection, "session", &session, &wall).await?;
            if let Some(enrolment) = enrolment {
                enrol(connection, new.session, enrolment, &wall).await?;
            }
            insert_event(connection, self.inner.run, new.session, created).await
        })
        .await
    }

    /// Appends `events` to `session`, all or none. Appending the same events again changes nothing.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn append_events(&self, session: SessionId, events: &[Event]) -> Result<(), StoreError> {
        self.write(async |connection| {
            for event in events {
                insert_event(connection, self.inner.run, session, event).await?;
            }
            Ok(())
        })
        .await
    }

    /// Notes how long `segment`, under way in `session`, has been inspected so far.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn note_clock(
        &self,
        session: SessionId,
        segment: SegmentId,
        inspected: Duration,
    ) -> Result<(), StoreError> {
        let _turn = self.turn().await?;
        sqlx::query(
            "INSERT INTO session_clocks (session, segment, inspected_ms) VALUES (?, ?, ?)
             ON CONFLICT (session) DO UPDATE SET segment = excluded.segment, inspected_ms = excluded.inspected_ms",
        )
        .bind(session.to_string())
        .bind(segment.to_string())
        .bind(i64::try_from(inspected.as_millis()).unwrap_or(i64::MAX))
        .execute(&self.inner.telemetry)
        .await?;

        Ok(())
    }
}

impl Reader {
    /// The whole of session `session`, or `None` if there is none.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    #[boxed]
    pub async fn session(&self, session: SessionId) -> Result<Option<StoredSession>, StoreError> {
        let row = sqlx::query("SELECT * FROM sessions WHERE session = ?")
            .bind(session.to_string())
            .fetch_optional(self.pool())
            .await?;

        let Some(row) = row else { return Ok(None) };
        let made = NewSession {
            session,
            stamp: stamp(&row)?,
            participant: row.try_get("participant")?,
            protocol: row.try_get("protocol")?,
            protocol_toml: row.try_get("protocol_toml")?,
            protocol_sha256: row.try_get("protocol_sha256")?,
            practice: row.try_get("practice")?,
            algorithm: named(&row, "algorithm", "a session", Algorithm::named)?,
            seed: seed(&row)?,
            set_index: index(&row)?,
            commitment: row.try_get("commitment")?,
            segments: self.segments(session).await?,
        };

        Ok(Some(StoredSession {
            made,
            run: row.try_get("run")?,
            events: self.events(session).await?,
            study: self.enrolment(session).await?.map(|enrolment| enrolment.study),
            study_locked: self.study_locked(session).await?,
        }))
    }

    async fn segments(&self, session: SessionId) -> Result<Vec<(SegmentId, PolicyName)>, StoreError> {
        let sql = "SELECT segment, policy FROM segments WHERE session = ? ORDER BY setting";
        let segment = |row: &SqliteRow| Ok((parsed(row, "segment")?, PolicyName::new(row.try_get("policy")?)));
        self.rows(sql, &session, segment).await
    }

    /// The events of `session`, each with the start of the server that recorded it.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn events(&self, session: SessionId) -> Result<Vec<(i64, Event)>, StoreError> {
        let sql = "SELECT run, number, wall, monotonic_ns, role, payload, (SELECT account FROM actors AS a
                 WHERE a.kind = 'event' AND a.record = e.session || '/' || e.number) AS account
             FROM events AS e WHERE session = ? ORDER BY number";
        let recorded = |row: &SqliteRow| Ok((row.try_get("run")?, event(row)?));
        self.rows(sql, &session, recorded).await
    }

    /// The latest session that is neither completed nor aborted.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn session_under_way(&self) -> Result<Option<SessionId>, StoreError> {
        let row = sqlx::query(
            "SELECT session FROM sessions WHERE NOT EXISTS (
                 SELECT 1 FROM events WHERE events.session = sessions.session AND kind IN ('completed', 'aborted'))
             ORDER BY rowid DESC LIMIT 1",
        )
        .fetch_optional(self.pool())
        .await?;

        row.map(|row| parsed(&row, "session")).transpose()
    }

    /// How long `segment` had been inspected when that was last noted; zero if it never was.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn noted_clock(&self, segment: SegmentId) -> Result<Duration, StoreError> {
        let noted: Option<i64> = sqlx::query_scalar("SELECT inspected_ms FROM session_clocks WHERE segment = ?")
            .bind(segment.to_string())
            .fetch_optional(self.pool())
            .await?;

        Ok(Duration::from_millis(noted.and_then(|noted| u64::try_from(noted).ok()).unwrap_or(0)))
    }
}

fn event(row: &SqliteRow) -> Result<Event, StoreError> {
    let payload: String = row.try_get("payload")?;
    let kind: EventKind =
        serde_json::from_str(&payload).map_err(|error| StoreError::Damaged(format!("event {payload}: {error}")))?;
    let Stamp { wall, at } = stamp(row)?;
    let by = named(row, "role", "an event", Role::named)?;
    Ok(Event { number: row.try_get("number")?, by, account: account(row)?, at, wall, kind })
}

pub(super) fn seed(row: &SqliteRow) -> Result<Seed, StoreError> {
    let text: String = row.try_get("seed")?;
    Seed::from_hex(&text).ok_or_else(|| StoreError::Damaged("a seed is not 64 hexadecimal digits".to_owned()))
}

pub(super) fn index(row: &SqliteRow) -> Result<usize, StoreError> {
    let index: i64 = row.try_get("set_index")?;
    usize::try_from(index).map_err(|_| StoreError::Damaged(format!("set index {index}")))
}

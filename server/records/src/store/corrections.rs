//! Corrections: rows beside the original records, which stay unchanged.

use std::collections::BTreeMap;

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::actors::name_actor;
use super::insert::Insert;
use super::values::{named, parsed, stamp};
use super::{Reader, Stamp, Store, StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_trial::account::AccountName;
use parfocal_trial::correction::{Field, Subject};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::role::Role;

/// A correction to be recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Correction {
    /// Session of the corrected record.
    pub session: SessionId,
    /// Kind of the corrected record.
    pub subject: Subject,
    /// The key of the answer or comment, or the session's id.
    pub record: String,
    /// Which field of the record is corrected.
    pub field: Field,
    /// The value so far.
    pub old: String,
    /// The right value.
    pub new: String,
    /// Reason that the person gave.
    pub reason: String,
    /// Role of the person who corrects.
    pub by: Role,
    /// When it is recorded.
    pub stamp: Stamp,
}

/// A correction read back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredCorrection {
    /// Order of the record in the database.
    pub number: i64,
    /// Number of the run that recorded it.
    pub run: i64,
    /// The correction. Its texts are empty if they were erased.
    pub correction: Correction,
}

/// The latest correction of each field of each record of a session.
#[derive(Debug, Clone, Default)]
pub struct LatestCorrections(BTreeMap<(Subject, String, Field), String>);

impl LatestCorrections {
    /// Takes the `corrections` of a session, in the order in which they were recorded.
    pub fn of(corrections: &[StoredCorrection]) -> Self {
        let entry = |StoredCorrection { correction, .. }: &StoredCorrection| {
            ((correction.subject, correction.record.clone(), correction.field), correction.new.clone())
        };
        Self(corrections.iter().map(entry).collect())
    }

    /// The session's right participant; `None` if that was not corrected.
    pub fn participant(&self, session: SessionId) -> Option<&str> {
        self.get(Subject::Session, session.to_string(), Field::Participant)
    }

    /// The right value of the answer with this key; `None` if it was not corrected.
    pub fn value(&self, answer: &IdempotencyKey) -> Option<AnswerValue> {
        serde_json::from_str(self.get(Subject::Answer, answer.to_string(), Field::Value)?).ok()
    }

    /// The note on an answer or a comment, if it has one that was not erased.
    pub fn note(&self, subject: Subject, key: &IdempotencyKey) -> Option<&str> {
        self.get(subject, key.to_string(), Field::Note).filter(|note| !note.is_empty())
    }

    fn get(&self, subject: Subject, record: String, field: Field) -> Option<&str> {
        self.0.get(&(subject, record, field)).map(String::as_str)
    }
}

impl Store {
    /// Records a correction. `account` is `None` if nobody was signed in. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn correct(&self, correction: &Correction, account: Option<&AccountName>) -> Result<(), StoreError> {
        self.write(async |connection| {
            let number = Insert::into("corrections")
                .set("session", correction.session.to_string())
                .set("subject", correction.subject.name())
                .set("record", &correction.record)
                .set("field", correction.field.name())
                .set("old_value", &correction.old)
                .set("new_value", &correction.new)
                .set("reason", &correction.reason)
                .set("role", correction.by.name())
                .recorded(self.inner.run, correction.stamp)
                .execute(connection)
                .await?
                .to_string();

            let session = Some(correction.session);
            let wall = correction.stamp.wall.to_string();
            chain::append(connection, "correction", &number, &wall).await?;
            name_actor(connection, account, "correction", &number, session, &wall).await
        })
        .await
    }
}

impl Reader {
    /// The corrections of `session`, in the order in which they were recorded.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn corrections(&self, session: SessionId) -> Result<Vec<StoredCorrection>, StoreError> {
        self.rows("SELECT * FROM corrections WHERE session = ? ORDER BY number", &session, correction).await
    }
}

fn correction(row: &SqliteRow) -> Result<StoredCorrection, StoreError> {
    let correction = Correction {
        session: parsed(row, "session")?,
        subject: named(row, "subject", "a correction", Subject::named)?,
        record: row.try_get("record")?,
        field: named(row, "field", "a correction", Field::named)?,
        old: row.try_get("old_value")?,
        new: row.try_get("new_value")?,
        reason: row.try_get("reason")?,
        by: named(row, "role", "a correction", Role::named)?,
        stamp: stamp(row)?,
    };
    Ok(StoredCorrection { number: row.try_get("number")?, run: row.try_get("run")?, correction })
}

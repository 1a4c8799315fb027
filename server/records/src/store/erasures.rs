//! Erasure of words: from their record, from the free pages of the file, and from its log. The record and its hash
//! stay. The salt of the hash is deleted, so that nobody can test which words had that hash.

use std::collections::BTreeMap;

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::actors::name_actor;
use super::insert::Insert;
use super::scrub::scrub;
use super::values::{named, parsed, stamp};
use super::{Reader, Stamp, Store, StoreError, chain};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_trial::account::AccountName;
use parfocal_trial::erasure::Erasable;
use parfocal_trial::role::Role;

/// An erasure to be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Erasure {
    /// Session of the record.
    pub session: SessionId,
    /// Kind of the record.
    pub subject: Erasable,
    /// The record's key, as in the chain.
    pub record: String,
    /// Reason that the person gave.
    pub reason: String,
    /// Role of the person who erases.
    pub by: Role,
    /// When it is recorded.
    pub stamp: Stamp,
}

/// An erasure read back.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredErasure {
    /// Order of the record in the database.
    pub number: i64,
    /// Number of the run that recorded it.
    pub run: i64,
    /// What was erased, by whom and why.
    pub erasure: Erasure,
}

/// When the words of the records of a session were erased.
#[derive(Debug, Clone, Default)]
pub struct Erased(BTreeMap<(Erasable, String), Timestamp>);

impl Erased {
    /// Takes the `erasures` of a session.
    pub fn by(erasures: &[StoredErasure]) -> Self {
        let entry = |StoredErasure { erasure, .. }: &StoredErasure| {
            ((erasure.subject, erasure.record.clone()), erasure.stamp.wall)
        };
        Self(erasures.iter().map(entry).collect())
    }

    /// When the words of this record were erased, by the server's wall clock; `None` if they were not.
    pub fn at(&self, subject: Erasable, record: &impl ToString) -> Option<Timestamp> {
        self.0.get(&(subject, record.to_string())).copied()
    }
}

impl Store {
    /// Erases the words of all `erasures`, or of none. Words that were erased before stay so. When this returns, the
    /// words are nowhere in the database's files.
    ///
    /// # Errors
    /// If the disk or database fails, or another program has the database open. Then copies of the words may remain in
    /// free pages of the file or in its log, until [`Store::finish_erasures`] succeeds or the server starts again.
    #[boxed]
    pub async fn erase(&self, erasures: &[Erasure], account: Option<&AccountName>) -> Result<(), StoreError> {
        self.write(async |connection| {
            // Deleted content is overwritten with zeros. The setting stays with this connection; the others do not need
            // it.
            sqlx::query("PRAGMA secure_delete = ON").execute(&mut *connection).await?;
            for erasure in erasures {
                insert_erasure(connection, self.inner.run, erasure, account).await?;
            }
            Ok(())
        })
        .await?;
        self.finish_erasures().await.map(drop)
    }

    /// Removes the copies that erasures could not remove when they were made. Returns whether there may have been any.
    ///
    /// # Errors
    /// As [`Store::erase`].
    pub async fn finish_erasures(&self) -> Result<bool, StoreError> {
        // The whole database may be written anew: nobody else writes meanwhile, or waits for a connection in vain.
        let _turn = self.turn().await?;
        scrub(&self.inner.trial).await
    }
}

async fn insert_erasure(
    connection: &mut SqliteConnection,
    run: i64,
    erasure: &Erasure,
    account: Option<&AccountName>,
) -> Result<(), StoreError> {
    let known = "SELECT number FROM erasures WHERE subject = ? AND record = ?";
    let known: Option<i64> = sqlx::query_scalar(known)
        .bind(erasure.subject.name())
        .bind(&erasure.record)
        .fetch_optional(&mut *connection)
        .await?;
    if let Some(known) = known {
        // The words were erased before, but the files may still hold copies: scrub them once more.
        return note_unfinished(connection, known).await;
    }

    let number = Insert::into("erasures")
        .set("session", erasure.session.to_string())
        .set("subject", erasure.subject.name())
        .set("record", &erasure.record)
        .set("reason", &erasure.reason)
        .set("role", erasure.by.name())
        .recorded(run, erasure.stamp)
        .execute(connection)
        .await?;

    let emptied = match erasure.subject {
        Erasable::Answer => "UPDATE answers SET value = '\"\"' WHERE key = ?",
        Erasable::Comment => "UPDATE comments SET text = '' WHERE key = ?",
        Erasable::Correction => {
            "UPDATE corrections SET old_value = '', new_value = '', reason = '' WHERE CAST(number AS TEXT) = ?"
        }
        Erasable::Event => {
            "UPDATE events SET payload = json_set(payload, '$.reason', '') WHERE session || '/' || number = ?"
        }
        Erasable::StudyEvent => "UPDATE study_events SET reason = '' WHERE study || '/' || number = ?",
    };
    sqlx::query(emptied).bind(&erasure.record).execute(&mut *connection).await?;
    if erasure.subject == Erasable::Comment {
        let silenced = sqlx::query("UPDATE voice_pieces SET audio = NULL WHERE comment = ?");
        silenced.bind(&erasure.record).execute(&mut *connection).await?;
    }

    sqlx::query("DELETE FROM chain_salts WHERE number = (SELECT number FROM chain WHERE kind = ? AND key = ?)")
        .bind(erasure.subject.name())
        .bind(&erasure.record)
        .execute(&mut *connection)
        .await?;
    note_unfinished(connection, number).await?;

    let key = number.to_string();
    let wall = erasure.stamp.wall.to_string();
    chain::append(connection, "erasure", &key, &wall).await?;
    name_actor(connection, account, "erasure", &key, Some(erasure.session), &wall).await
}

async fn note_unfinished(connection: &mut SqliteConnection, number: i64) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO unfinished_erasures (number) VALUES (?) ON CONFLICT DO NOTHING")
        .bind(number)
        .execute(connection)
        .await?;
    Ok(())
}

impl Reader {
    /// The number of erasures in the database.
    ///
    /// # Errors
    /// If the database fails.
    pub(super) async fn count_erasures(&self) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar("SELECT count(*) FROM erasures").fetch_one(self.pool()).await?)
    }

    /// The erasures in `session`, in the order in which they were made.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn erasures(&self, session: SessionId) -> Result<Vec<StoredErasure>, StoreError> {
        self.rows("SELECT * FROM erasures WHERE session = ? ORDER BY number", &session, erasure).await
    }
}

fn erasure(row: &SqliteRow) -> Result<StoredErasure, StoreError> {
    let erasure = Erasure {
        session: parsed(row, "session")?,
        subject: named(row, "subject", "an erasure", Erasable::named)?,
        record: row.try_get("record")?,
        reason: row.try_get("reason")?,
        by: named(row, "role", "an erasure", Role::named)?,
        stamp: stamp(row)?,
    };
    Ok(StoredErasure { number: row.try_get("number")?, run: row.try_get("run")?, erasure })
}

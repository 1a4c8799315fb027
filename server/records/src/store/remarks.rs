//! Comments and answers. Each is kept once, however often it is sent, and never changed.

use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::chain;
use super::values::{begin, moment, nanoseconds, parsed, stamp};
use super::{Answer, Comment, DeviceReport, Reader, Stamp, Store, StoreError};
use parfocal_base::ids::{IdempotencyKey, SegmentId, SessionId};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::{CommentContent, Holding, Origin, WaitClock};

/// The outcome of keeping a comment or an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeepOutcome {
    /// It is on disk now.
    New,
    /// It was on disk already, because it was sent before.
    Before,
    /// Its key belongs to another comment or answer.
    KeyTaken,
}

impl Store {
    /// Keeps a comment. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn keep_comment(&self, comment: &Comment) -> Result<KeepOutcome, StoreError> {
        let turn = self.turn().await;
        let mut connection = self.inner.trial.acquire().await?;
        let kept = insert_comment(&mut connection, self.inner.run, comment).await;
        turn.end(connection, &kept);
        kept
    }

    /// Keeps an answer. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn keep_answer(&self, answer: &Answer) -> Result<KeepOutcome, StoreError> {
        let turn = self.turn().await;
        let mut connection = self.inner.trial.acquire().await?;
        let kept = insert_answer(&mut connection, self.inner.run, answer).await;
        turn.end(connection, &kept);
        kept
    }

    /// Notes how many comments and answers of a session a surgeon's device still holds, at `stamp`.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn note_holding(&self, holding: &Holding, stamp: Stamp) -> Result<(), StoreError> {
        let _turn = self.turn().await;
        sqlx::query(
            "INSERT INTO surgeon_devices (session, device, holding, run, monotonic_ns) VALUES (?, ?, ?, ?, ?)
             ON CONFLICT (session, device) DO UPDATE
             SET holding = excluded.holding, run = excluded.run, monotonic_ns = excluded.monotonic_ns",
        )
        .bind(holding.session.to_string())
        .bind(holding.device.to_string())
        .bind(holding.holding)
        .bind(self.inner.run)
        .bind(nanoseconds(stamp.at))
        .execute(&self.inner.telemetry)
        .await?;

        Ok(())
    }
}

async fn insert_comment(
    connection: &mut SqliteConnection,
    run: i64,
    comment: &Comment,
) -> Result<KeepOutcome, StoreError> {
    let wall = comment.stamp.wall.to_string();
    let (kind, text) = said_columns(&comment.said);

    let mut transaction = begin(connection).await?;
    let done = sqlx::query(
        "INSERT INTO comments (key, session, segment, run, wall, monotonic_ns, device, sequence,
             client_millis, waited_ms, waited_by, late, frame, frame_run, kind, text)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO NOTHING",
    )
    .bind(comment.key.to_string())
    .bind(comment.session.to_string())
    .bind(comment.segment.map(|segment| segment.to_string()))
    .bind(run)
    .bind(&wall)
    .bind(nanoseconds(comment.stamp.at))
    .bind(comment.origin.device.map(|device| device.to_string()))
    .bind(comment.origin.sequence)
    .bind(comment.origin.client_millis)
    .bind(comment.origin.waited_millis)
    .bind(comment.origin.waited_by.map(WaitClock::name))
    .bind(comment.late)
    .bind(comment.frame.map(u64::cast_signed))
    .bind(comment.frame_run)
    .bind(kind)
    .bind(text)
    .execute(&mut *transaction)
    .await?;

    if done.rows_affected() == 1 {
        chain::append(&mut transaction, "comment", &comment.key.to_string(), &wall).await?;
        transaction.commit().await?;
        return Ok(KeepOutcome::New);
    }

    // Sent again, or another comment under the same key?
    let row = sqlx::query("SELECT session, kind, text FROM comments WHERE key = ?")
        .bind(comment.key.to_string())
        .fetch_one(&mut *transaction)
        .await?;

    let same = parsed::<SessionId>(&row, "session")? == comment.session
        && (said(&row)? == comment.said || is_erased(&mut transaction, "comment", &comment.key).await?);
    Ok(if same { KeepOutcome::Before } else { KeepOutcome::KeyTaken })
}

async fn insert_answer(
    connection: &mut SqliteConnection,
    run: i64,
    answer: &Answer,
) -> Result<KeepOutcome, StoreError> {
    let wall = answer.stamp.wall.to_string();
    let value = serde_json::to_string(&answer.value).map_err(|error| StoreError::Damaged(error.to_string()))?;

    let mut transaction = begin(connection).await?;
    let done = sqlx::query(
        "INSERT INTO answers (key, session, segment, question, value, run, wall, monotonic_ns, device, sequence,
             client_millis, waited_ms, waited_by, late)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (key) DO NOTHING",
    )
    .bind(answer.key.to_string())
    .bind(answer.session.to_string())
    .bind(answer.segment.map(|segment| segment.to_string()))
    .bind(&answer.question)
    .bind(&value)
    .bind(run)
    .bind(&wall)
    .bind(nanoseconds(answer.stamp.at))
    .bind(answer.origin.device.map(|device| device.to_string()))
    .bind(answer.origin.sequence)
    .bind(answer.origin.client_millis)
    .bind(answer.origin.waited_millis)
    .bind(answer.origin.waited_by.map(WaitClock::name))
    .bind(answer.late)
    .execute(&mut *transaction)
    .await?;

    if done.rows_affected() == 1 {
        chain::append(&mut transaction, "answer", &answer.key.to_string(), &wall).await?;
        transaction.commit().await?;
        return Ok(KeepOutcome::New);
    }

    // Sent again, or another answer under the same key?
    let row = sqlx::query("SELECT session, segment, question, value FROM answers WHERE key = ?")
        .bind(answer.key.to_string())
        .fetch_one(&mut *transaction)
        .await?;

    let kept: String = row.try_get("value")?;
    let same = parsed::<SessionId>(&row, "session")? == answer.session
        && segment(&row)? == answer.segment
        && row.try_get::<String, _>("question")? == answer.question
        && (kept == value || is_erased(&mut transaction, "answer", &answer.key).await?);
    Ok(if same { KeepOutcome::Before } else { KeepOutcome::KeyTaken })
}

/// Whether the words of the comment or answer with this key were erased. If a tablet sends them again, the server
/// answers that they are kept, so that the tablet deletes its copy.
pub(super) async fn is_erased(
    connection: &mut SqliteConnection,
    subject: &str,
    key: &IdempotencyKey,
) -> Result<bool, StoreError> {
    let erased = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM erasures WHERE subject = ? AND record = ?)");
    Ok(erased.bind(subject).bind(key.to_string()).fetch_one(connection).await?)
}

impl Reader {
    /// The comments of `session`, in the order they were kept, each with the start of the server that kept it.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn comments(&self, session: SessionId) -> Result<Vec<(i64, Comment)>, StoreError> {
        let rows = sqlx::query("SELECT * FROM comments WHERE session = ? ORDER BY number")
            .bind(session.to_string())
            .fetch_all(self.pool())
            .await?;

        rows.iter().map(|row| Ok((row.try_get("run")?, comment(row)?))).collect()
    }

    /// The surgeons' devices on which something of `session` was said or that reported what they hold of it, each with
    /// its last report.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn surgeon_devices(&self, session: SessionId) -> Result<Vec<DeviceReport>, StoreError> {
        let rows = sqlx::query(
            "SELECT d.device, t.holding, t.run, t.monotonic_ns
             FROM (SELECT device FROM surgeon_devices WHERE session = ?1
                 UNION SELECT device FROM comments WHERE session = ?1
                 UNION SELECT device FROM answers WHERE session = ?1) AS d
             LEFT JOIN surgeon_devices AS t ON t.session = ?1 AND t.device = d.device
             WHERE d.device IS NOT NULL ORDER BY d.device",
        )
        .bind(session.to_string())
        .fetch_all(self.pool())
        .await?;

        let report = |row: &SqliteRow| {
            let holding: Option<u32> = row.try_get("holding")?;
            let told = match holding {
                Some(holding) => Some((holding, row.try_get("run")?, moment(row.try_get("monotonic_ns")?))),
                None => None,
            };

            Ok(DeviceReport { device: parsed(row, "device")?, told })
        };

        rows.iter().map(report).collect()
    }

    /// The answers of `session`, changed ones included, in the order they were kept, each with the start of the server
    /// that kept it.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn answers(&self, session: SessionId) -> Result<Vec<(i64, Answer)>, StoreError> {
        let rows = sqlx::query("SELECT * FROM answers WHERE session = ? ORDER BY number")
            .bind(session.to_string())
            .fetch_all(self.pool())
            .await?;

        rows.iter().map(|row| Ok((row.try_get("run")?, answer(row)?))).collect()
    }
}

fn comment(row: &SqliteRow) -> Result<Comment, StoreError> {
    let frame: Option<i64> = row.try_get("frame")?;
    Ok(Comment {
        key: parsed::<IdempotencyKey>(row, "key")?,
        session: parsed(row, "session")?,
        segment: segment(row)?,
        frame: frame.map(i64::cast_unsigned),
        frame_run: row.try_get("frame_run")?,
        origin: origin(row)?,
        late: row.try_get("late")?,
        stamp: stamp(row)?,
        said: said(row)?,
    })
}

fn answer(row: &SqliteRow) -> Result<Answer, StoreError> {
    let value: String = row.try_get("value")?;
    let value: AnswerValue =
        serde_json::from_str(&value).map_err(|error| StoreError::Damaged(format!("answer {value}: {error}")))?;
    Ok(Answer {
        key: parsed::<IdempotencyKey>(row, "key")?,
        session: parsed(row, "session")?,
        segment: segment(row)?,
        question: row.try_get("question")?,
        value,
        origin: origin(row)?,
        late: row.try_get("late")?,
        stamp: stamp(row)?,
    })
}

fn origin(row: &SqliteRow) -> Result<Origin, StoreError> {
    let device: Option<String> = row.try_get("device")?;
    let waited_by: Option<String> = row.try_get("waited_by")?;
    let origin = Origin {
        device: device.map(|_| parsed(row, "device")).transpose()?,
        sequence: row.try_get("sequence")?,
        client_millis: row.try_get("client_millis")?,
        waited_millis: row.try_get("waited_ms")?,
        waited_by: waited_by.as_deref().and_then(WaitClock::named),
    };

    // Records of older versions name no clock. It was the wall clock.
    Ok(origin.plausible())
}

fn segment(row: &SqliteRow) -> Result<Option<SegmentId>, StoreError> {
    let text: Option<String> = row.try_get("segment")?;
    text.map(|_| parsed(row, "segment")).transpose()
}

fn said(row: &SqliteRow) -> Result<CommentContent, StoreError> {
    let kind: String = row.try_get("kind")?;
    let text: Option<String> = row.try_get("text")?;
    match (kind.as_str(), text) {
        ("text", Some(text)) => Ok(CommentContent::Text(text)),
        ("quick", Some(text)) => Ok(CommentContent::Quick(text)),
        ("mark", None) => Ok(CommentContent::Mark),
        // An erasure leaves an empty text.
        ("voice", None) => Ok(CommentContent::Voice),
        ("voice", Some(text)) if text.is_empty() => Ok(CommentContent::Voice),
        _ => Err(StoreError::Damaged(format!("comment of kind '{kind}'"))),
    }
}

/// A comment's kind and text, as in the database and in exports.
pub(super) fn said_columns(said: &CommentContent) -> (&'static str, Option<&str>) {
    match said {
        CommentContent::Text(text) => ("text", Some(text)),
        CommentContent::Quick(text) => ("quick", Some(text)),
        CommentContent::Mark => ("mark", None),
        CommentContent::Voice => ("voice", None),
    }
}

//! Comments and answers. Each is kept once, however often it is sent, and never changed.

use std::borrow::Cow;
use std::collections::BTreeMap;

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::chain;
use super::insert::Insert;
use super::values::{moment, nanoseconds, parsed, parsed_if_any, stamp};
use super::{Answer, Comment, DeviceReport, Reader, Stamp, Store, StoreError};
use parfocal_base::boxed;
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::{CommentContent, Holding, Origin, Sight, WaitClock};

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
    #[boxed]
    pub async fn keep_comment(&self, comment: &Comment) -> Result<KeepOutcome, StoreError> {
        let key = comment.key.to_string();
        let (kind, text) = said_columns(&comment.said);

        self.write(async |connection| {
            let is_new = Insert::into("comments")
                .set("key", &key)
                .set("session", comment.session.to_string())
                .set("segment", comment.segment.map(|segment| segment.to_string()))
                .recorded(self.inner.run, comment.stamp)
                .entered(&comment.origin)
                .set("late", comment.late)
                .set("frame", comment.frame.map(u64::cast_signed))
                .set("frame_run", comment.frame_run)
                .set("picture_width", comment.sight.picture_width)
                .set("pictures_per_second", comment.sight.pictures_per_second)
                .set("kind", kind)
                .set("text", text.as_deref())
                .execute_once(connection)
                .await?;

            if is_new {
                chain::append(connection, "comment", &key, &comment.stamp.wall.to_string()).await?;
                return Ok(KeepOutcome::New);
            }

            // Sent again, or another comment under the same key?
            let row = sqlx::query("SELECT session, kind, text FROM comments WHERE key = ?")
                .bind(&key)
                .fetch_one(&mut *connection)
                .await?;

            let same = parsed::<SessionId>(&row, "session")? == comment.session
                && (said(&row)? == comment.said || is_erased(connection, "comment", &key).await?);
            Ok(if same { KeepOutcome::Before } else { KeepOutcome::KeyTaken })
        })
        .await
    }

    /// Keeps an answer. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn keep_answer(&self, answer: &Answer) -> Result<KeepOutcome, StoreError> {
        let key = answer.key.to_string();
        let value = serde_json::to_string(&answer.value).map_err(|error| StoreError::Damaged(error.to_string()))?;

        self.write(async |connection| {
            let is_new = Insert::into("answers")
                .set("key", &key)
                .set("session", answer.session.to_string())
                .set("segment", answer.segment.map(|segment| segment.to_string()))
                .set("question", &answer.question)
                .set("value", &value)
                .recorded(self.inner.run, answer.stamp)
                .entered(&answer.origin)
                .set("late", answer.late)
                .execute_once(connection)
                .await?;

            if is_new {
                chain::append(connection, "answer", &key, &answer.stamp.wall.to_string()).await?;
                return Ok(KeepOutcome::New);
            }

            // Sent again, or another answer under the same key?
            let row = sqlx::query("SELECT session, segment, question, value FROM answers WHERE key = ?")
                .bind(&key)
                .fetch_one(&mut *connection)
                .await?;

            let same = parsed::<SessionId>(&row, "session")? == answer.session
                && parsed_if_any(&row, "segment")? == answer.segment
                && row.try_get::<String, _>("question")? == answer.question
                && (row.try_get::<String, _>("value")? == value || is_erased(connection, "answer", &key).await?);
            Ok(if same { KeepOutcome::Before } else { KeepOutcome::KeyTaken })
        })
        .await
    }

    /// Notes how many comments and answers of a session a surgeon's device still holds, at `stamp`.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn note_holding(&self, holding: &Holding, stamp: Stamp) -> Result<(), StoreError> {
        let _turn = self.turn().await?;
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

/// Whether the words of the comment or answer with this key were erased. If a tablet sends them again, the server
/// answers that they are kept, so that the tablet deletes its copy.
pub(super) async fn is_erased(connection: &mut SqliteConnection, subject: &str, key: &str) -> Result<bool, StoreError> {
    let erased = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM erasures WHERE subject = ? AND record = ?)");
    Ok(erased.bind(subject).bind(key).fetch_one(connection).await?)
}

impl Reader {
    /// The comments of `session`, in the order they were kept, each with the start of the server that kept it.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn comments(&self, session: SessionId) -> Result<Vec<(i64, Comment)>, StoreError> {
        let kept = |row: &SqliteRow| Ok((row.try_get("run")?, comment(row)?));
        self.rows("SELECT * FROM comments WHERE session = ? ORDER BY number", &session, kept).await
    }

    /// The surgeons' devices that sent comments or answers of `session`, or reported how many they hold, each with its
    /// last report.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn surgeon_devices(&self, session: SessionId) -> Result<Vec<DeviceReport>, StoreError> {
        let sql = "SELECT d.device, t.holding, t.run, t.monotonic_ns
             FROM (SELECT device FROM surgeon_devices WHERE session = ?1
                 UNION SELECT device FROM comments WHERE session = ?1
                 UNION SELECT device FROM answers WHERE session = ?1) AS d
             LEFT JOIN surgeon_devices AS t ON t.session = ?1 AND t.device = d.device
             WHERE d.device IS NOT NULL ORDER BY d.device";
        let report = |row: &SqliteRow| {
            let holding: Option<u32> = row.try_get("holding")?;
            let report = match holding {
                Some(holding) => Some((holding, row.try_get("run")?, moment(row.try_get("monotonic_ns")?))),
                None => None,
            };

            Ok(DeviceReport { device: parsed(row, "device")?, report })
        };
        self.rows(sql, &session, report).await
    }

    /// The answers of `session`, changed ones included, in the order they were kept, each with the start of the server
    /// that kept it.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn answers(&self, session: SessionId) -> Result<Vec<(i64, Answer)>, StoreError> {
        let kept = |row: &SqliteRow| Ok((row.try_get("run")?, answer(row)?));
        self.rows("SELECT * FROM answers WHERE session = ? ORDER BY number", &session, kept).await
    }
}

/// The comments that the surgeon took back, each with when that was kept. A withdrawal that came too late to count is
/// none.
pub fn withdrawn(comments: &[(i64, Comment)]) -> BTreeMap<IdempotencyKey, Timestamp> {
    let withdrawn = |(_, comment): &(i64, Comment)| match comment.said {
        CommentContent::Withdrawal(key) if !comment.late => Some((key, comment.stamp.wall)),
        _ => None,
    };
    comments.iter().filter_map(withdrawn).collect()
}

fn comment(row: &SqliteRow) -> Result<Comment, StoreError> {
    let frame: Option<i64> = row.try_get("frame")?;
    Ok(Comment {
        key: parsed(row, "key")?,
        session: parsed(row, "session")?,
        segment: parsed_if_any(row, "segment")?,
        frame: frame.map(i64::cast_unsigned),
        frame_run: row.try_get("frame_run")?,
        sight: Sight {
            picture_width: row.try_get("picture_width")?,
            pictures_per_second: row.try_get("pictures_per_second")?,
        },
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
        key: parsed(row, "key")?,
        session: parsed(row, "session")?,
        segment: parsed_if_any(row, "segment")?,
        question: row.try_get("question")?,
        value,
        origin: origin(row)?,
        late: row.try_get("late")?,
        stamp: stamp(row)?,
    })
}

fn origin(row: &SqliteRow) -> Result<Origin, StoreError> {
    let waited_by: Option<String> = row.try_get("waited_by")?;
    Ok(Origin {
        device: parsed_if_any(row, "device")?,
        sequence: row.try_get("sequence")?,
        client_millis: row.try_get("client_millis")?,
        waited_millis: row.try_get("waited_ms")?,
        waited_by: waited_by.as_deref().and_then(WaitClock::named),
    })
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
        ("withdrawal", Some(_)) => Ok(CommentContent::Withdrawal(parsed(row, "text")?)),
        _ => Err(StoreError::Damaged(format!("comment of kind '{kind}'"))),
    }
}

/// A comment's kind and text, as in the database and in exports.
pub(super) fn said_columns(said: &CommentContent) -> (&'static str, Option<Cow<'_, str>>) {
    match said {
        CommentContent::Text(text) => ("text", Some(text.into())),
        CommentContent::Quick(text) => ("quick", Some(text.into())),
        CommentContent::Mark => ("mark", None),
        CommentContent::Voice => ("voice", None),
        CommentContent::Withdrawal(key) => ("withdrawal", Some(key.to_string().into())),
    }
}

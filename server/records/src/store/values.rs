//! Values as the database keeps them.

use jiff::Timestamp;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{Stamp, StoreError};
use parfocal_base::clock::Moment;
use parfocal_trial::phase::SessionStatus;

/// A moment as the database keeps it. The range is 292 years of uptime.
pub(super) fn nanoseconds(at: Moment) -> i64 {
    i64::try_from(at.as_nanos()).unwrap_or(i64::MAX)
}

/// The moment at `nanoseconds`. A sound database has no negative ones; here they become zero.
pub(super) fn moment(nanoseconds: i64) -> Moment {
    Moment::from_nanos(u64::try_from(nanoseconds).unwrap_or(0))
}

/// The times of a row by both clocks.
pub(super) fn stamp(row: &SqliteRow) -> Result<Stamp, StoreError> {
    Ok(Stamp { wall: parsed::<Timestamp>(row, "wall")?, at: moment(row.try_get("monotonic_ns")?) })
}

/// Column `column` of `row`, parsed from text.
pub(super) fn parsed<T>(row: &SqliteRow, column: &str) -> Result<T, StoreError>
where
    T: std::str::FromStr<Err: std::fmt::Display>,
{
    let text: String = row.try_get(column)?;
    text.parse().map_err(|error| StoreError::Damaged(format!("column {column}, '{text}': {error}")))
}

/// Column `column` of `row`, parsed from text; `None` if it is empty.
pub(super) fn parsed_if_any<T>(row: &SqliteRow, column: &str) -> Result<Option<T>, StoreError>
where
    T: std::str::FromStr<Err: std::fmt::Display>,
{
    let text: Option<String> = row.try_get(column)?;
    text.map(|_| parsed(row, column)).transpose()
}

/// What column `column` of `row` names; `known` finds it by its name. Errors call the record `of`.
pub(super) fn named<T>(
    row: &SqliteRow,
    column: &str,
    of: &str,
    known: impl FnOnce(&str) -> Option<T>,
) -> Result<T, StoreError> {
    let name: String = row.try_get(column)?;
    known(&name).ok_or_else(|| StoreError::Damaged(format!("{of} has the unknown {column} '{name}'")))
}

/// The state of a session, from the columns `completed` and `aborted`.
pub(super) fn status(row: &SqliteRow) -> Result<SessionStatus, StoreError> {
    Ok(match (row.try_get("completed")?, row.try_get("aborted")?) {
        (_, true) => SessionStatus::Aborted,
        (true, false) => SessionStatus::Completed,
        (false, false) => SessionStatus::UnderWay,
    })
}

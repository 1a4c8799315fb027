//! Values as the database keeps them.

use jiff::Timestamp;
use sqlx::sqlite::{SqliteConnection, SqliteRow};
use sqlx::{Connection, Row, Sqlite, Transaction};

use super::{Stamp, StoreError};
use parfocal_base::clock::Moment;

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

/// Begins a transaction that has the right to write from its beginning, so that nobody else writes between its reads
/// and its writes.
pub(super) async fn begin(connection: &mut SqliteConnection) -> Result<Transaction<'_, Sqlite>, StoreError> {
    Ok(connection.begin_with("BEGIN IMMEDIATE").await?)
}

//! INSERT statements that name each value's column beside the value.

use sqlx::sqlite::{Sqlite, SqliteArguments, SqliteConnection, SqliteQueryResult};
use sqlx::{Arguments, AssertSqlSafe, Encode, Type};

use super::values::nanoseconds;
use super::{Stamp, StoreError};
use parfocal_trial::remark::{Origin, WaitClock};

/// A row to be inserted.
pub(super) struct Insert {
    table: &'static str,
    columns: Vec<&'static str>,
    values: SqliteArguments,
    failed: Option<sqlx::Error>,
}

impl Insert {
    /// A row of `table`, without any column yet.
    pub(super) fn into(table: &'static str) -> Self {
        Self { table, columns: Vec::new(), values: SqliteArguments::default(), failed: None }
    }

    /// The same row with `value` in `column`.
    pub(super) fn set<'v>(mut self, column: &'static str, value: impl Encode<'v, Sqlite> + Type<Sqlite>) -> Self {
        self.columns.push(column);
        if let Err(error) = self.values.add(value) {
            self.failed = Some(sqlx::Error::Encode(error));
        }
        self
    }

    /// The same row with the run that records it, and when, by both clocks.
    pub(super) fn recorded(self, run: i64, stamp: Stamp) -> Self {
        self.set("run", run).set("wall", stamp.wall.to_string()).set("monotonic_ns", nanoseconds(stamp.at))
    }

    /// The same row with where and when it was entered on a surgeon's device.
    pub(super) fn entered(self, origin: &Origin) -> Self {
        self.set("device", origin.device.map(|device| device.to_string()))
            .set("sequence", origin.sequence)
            .set("client_millis", origin.client_millis)
            .set("waited_ms", origin.waited_millis)
            .set("waited_by", origin.waited_by.map(WaitClock::name))
    }

    /// Inserts it. Returns the row's number.
    pub(super) async fn execute(self, connection: &mut SqliteConnection) -> Result<i64, StoreError> {
        Ok(self.run(connection, "").await?.last_insert_rowid())
    }

    /// Inserts it unless there is a row with the same `key`. Returns whether it was inserted.
    pub(super) async fn execute_once(self, connection: &mut SqliteConnection) -> Result<bool, StoreError> {
        Ok(self.run(connection, " ON CONFLICT (key) DO NOTHING").await?.rows_affected() == 1)
    }

    async fn run(self, connection: &mut SqliteConnection, end: &str) -> Result<SqliteQueryResult, StoreError> {
        if let Some(error) = self.failed {
            return Err(error.into());
        }
        let columns = self.columns.join(", ");
        let marks = vec!["?"; self.columns.len()].join(", ");
        let sql = format!("INSERT INTO {} ({columns}) VALUES ({marks}){end}", self.table);
        Ok(sqlx::query_with(AssertSqlSafe(sql), self.values).execute(connection).await?)
    }
}

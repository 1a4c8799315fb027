//! Rows of an export that come straight from the database, where each column has the name that it has in the export.

use jiff::Timestamp;
use sqlx::sqlite::{Sqlite, SqliteRow};
use sqlx::{Decode, Row as _, Type};

use super::table::{Cell, Row};
use crate::store::StoreError;
use crate::store::values::{named, parsed, parsed_if_any};
use parfocal_base::ids::{IdempotencyKey, SessionId};
use parfocal_trial::role::Role;

/// A row that comes straight from the database. The macro `table!` implements this trait for a `stored row`.
pub trait StoredRow: Row + Sized {
    /// The row of the export that `row` of the database is.
    fn read(row: &SqliteRow) -> Result<Self, StoreError>;
}

/// A type that a field of such a row may have.
pub trait StoredCell: Cell + Sized {
    /// The cell in column `column` of `row`.
    fn read(row: &SqliteRow, column: &str) -> Result<Self, StoreError>;
}

macro_rules! stored_cells {
    ($($read:ident: $($cell:ty),+;)+) => {
        $($(
            impl StoredCell for $cell {
                fn read(row: &SqliteRow, column: &str) -> Result<Self, StoreError> {
                    $read(row, column)
                }
            }
        )+)+
    };
}

stored_cells! {
    as_kept: bool, f64, i64, u32, String, Option<f64>, Option<i64>, Option<String>;
    parsed: IdempotencyKey, SessionId, Timestamp;
    parsed_if_any: Option<SessionId>, Option<Timestamp>;
    role: Role;
}

fn as_kept<'r, T: Decode<'r, Sqlite> + Type<Sqlite>>(row: &'r SqliteRow, column: &str) -> Result<T, StoreError> {
    Ok(row.try_get(column)?)
}

fn role(row: &SqliteRow, column: &str) -> Result<Role, StoreError> {
    named(row, column, "a record", Role::named)
}

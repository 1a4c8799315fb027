//! The database's name and its schema.

use sqlx::migrate::Migrator;
use sqlx::sqlite::SqlitePool;

use super::StoreError;

/// The migrations, each with its way down.
pub static MIGRATOR: Migrator = sqlx::migrate!("./migrations");

/// Name of the database in the data folder.
pub(super) const DATABASE: &str = "parfocal.db";

/// Refuses a database whose tables or columns are named by bytes that are no text. `sqlx` panics over such a name, in
/// a thread of its own, and whoever asked may then wait for ever.
pub(super) async fn check_names(pool: &SqlitePool) -> Result<(), StoreError> {
    let statements = "SELECT CAST(sql AS BLOB) FROM sqlite_schema WHERE sql IS NOT NULL";
    let statements: Vec<Vec<u8>> = sqlx::query_scalar(statements).fetch_all(pool).await?;
    match statements.iter().find_map(|statement| std::str::from_utf8(statement).err()) {
        Some(error) => Err(StoreError::Damaged(format!("its schema is no text: {error}"))),
        None => Ok(()),
    }
}

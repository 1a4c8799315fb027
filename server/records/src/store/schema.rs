//! The database's name and its schema.

use std::path::{Path, PathBuf};

use sqlx::migrate::Migrator;
use sqlx::sqlite::SqlitePool;

use super::StoreError;

/// The migrations, each with its reverse.
pub static MIGRATOR: Migrator = sqlx::migrate!("../../migrations");

/// Name of the database in the data folder.
pub(super) const DATABASE: &str = "parfocal.db";

/// Refuses a database with names of tables or columns that are not UTF-8. `sqlx` panics on such a name in a thread of
/// its own, and the caller may then wait forever.
pub(super) async fn check_names(pool: &SqlitePool) -> Result<(), StoreError> {
    let statements = "SELECT CAST(sql AS BLOB) FROM sqlite_schema WHERE sql IS NOT NULL";
    let statements: Vec<Vec<u8>> = sqlx::query_scalar(statements).fetch_all(pool).await?;
    match statements.iter().find_map(|statement| std::str::from_utf8(statement).err()) {
        Some(error) => Err(StoreError::Damaged(format!("its schema is not UTF-8 text: {error}"))),
        None => Ok(()),
    }
}

/// The path of the file whose name is that of `path` and then `suffix`, such as that of a database's log.
pub(super) fn sibling(path: &Path, suffix: &str) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(name + suffix)
}

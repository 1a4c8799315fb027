//! The database's name and its schema.

use sqlx::migrate::Migrator;

/// The migrations, each with its way down.
pub static MIGRATOR: Migrator = sqlx::migrate!("./migrations");

/// Name of the database in the data folder.
pub(super) const DATABASE: &str = "parfocal.db";

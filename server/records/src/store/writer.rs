//! The writer of records: the server, or a command beside it.

use std::path::Path;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

use super::writes::write_on;
use super::{Reader, Store, StoreError};

/// Writes records. Clone freely.
#[derive(Clone)]
pub(super) enum Writer {
    /// Within the server, in turns with everything else that it writes.
    Server(Store),
    /// From the command line, whether or not a server runs. It has a reader of its own.
    CommandLine(SqlitePool, Reader),
}

impl Writer {
    /// Opens the database `file` for a command, and checks its version.
    pub(super) async fn of_command(file: &Path) -> Result<Self, StoreError> {
        let reader = Reader::open_checked(file).await?;
        let options = SqliteConnectOptions::new()
            .filename(file)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5))
            .pragma("wal_autocheckpoint", "0")
            .synchronous(SqliteSynchronous::Full);
        let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options).await?;
        Ok(Self::CommandLine(pool, reader))
    }

    /// The run of the server that writes; `None` for a command.
    pub(super) fn run(&self) -> Option<i64> {
        match self {
            Self::Server(store) => Some(store.run()),
            Self::CommandLine(..) => None,
        }
    }

    /// The reader of the same database.
    pub(super) fn reader(&self) -> &Reader {
        match self {
            Self::Server(store) => store.reader(),
            Self::CommandLine(_, reader) => reader,
        }
    }

    /// Writes records in a transaction: all of them are on disk when this returns, or none is written if it fails.
    pub(super) async fn write<T>(
        &self,
        write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        match self {
            Self::Server(store) => store.write(write).await,
            Self::CommandLine(pool, _) => write_on(pool, write).await,
        }
    }

    /// Closes its connections, unless they are the server's.
    pub(super) async fn close(&self) {
        if let Self::CommandLine(pool, reader) = self {
            reader.close().await;
            pool.close().await;
        }
    }
}

//! The book of studies: written by the server, or by a command while no server runs.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

use super::writing::{change_study, insert_study};
use super::{NewStudy, StudyChange};
use crate::store::lock::FolderLock;
use crate::store::schema::DATABASE;
use crate::store::values::drop_if_failed;
use crate::store::{Reader, Store, StoreError};
use parfocal_trial::study::definition::StudyName;

/// Writes studies. Clone freely.
#[derive(Clone)]
pub struct StudyBook {
    way: Backend,
    reader: Reader,
}

#[derive(Clone)]
enum Backend {
    /// Within the server.
    Server(Store),
    /// From the command line. The lock keeps servers out, so that no server decides on data that is being changed.
    CommandLine { pool: SqlitePool, _lock: Arc<FolderLock> },
}

impl StudyBook {
    /// The book of the server.
    #[must_use]
    pub fn of_server(store: &Store) -> Self {
        Self { way: Backend::Server(store.clone()), reader: store.reader().clone() }
    }

    /// Opens the book of data folder `folder` for a command.
    ///
    /// # Errors
    /// If there is no database, a server has it open, or it is of another version.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        let file = folder.join(DATABASE);
        if !file.is_file() {
            return Err(StoreError::Missing(file));
        }

        let lock = Arc::new(FolderLock::of(folder)?);
        let reader = Reader::open(folder).await?;
        let options = SqliteConnectOptions::new()
            .filename(&file)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5))
            .synchronous(SqliteSynchronous::Full);
        let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options).await?;
        Ok(Self { way: Backend::CommandLine { pool, _lock: lock }, reader })
    }

    /// The run of the server that writes in it; `None` for a command.
    #[must_use]
    pub fn run(&self) -> Option<i64> {
        match &self.way {
            Backend::Server(store) => Some(store.run()),
            Backend::CommandLine { .. } => None,
        }
    }

    /// The reader of the same database.
    #[must_use]
    pub const fn reader(&self) -> &Reader {
        &self.reader
    }

    /// Writes a new study with its first event. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn plan(&self, new: &NewStudy, planned: &StudyChange) -> Result<(), StoreError> {
        let (pool, _turn) = match &self.way {
            Backend::Server(store) => (&store.inner.trial, Some(store.turn().await)),
            Backend::CommandLine { pool, .. } => (pool, None),
        };

        let mut connection = pool.acquire().await?;
        let done = insert_study(&mut connection, self.run(), new, planned).await;
        drop_if_failed(connection, &done);
        done
    }

    /// Writes all of `change` of `study`, or nothing. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn change(&self, study: &StudyName, change: &StudyChange) -> Result<(), StoreError> {
        let (pool, _turn) = match &self.way {
            Backend::Server(store) => (&store.inner.trial, Some(store.turn().await)),
            Backend::CommandLine { pool, .. } => (pool, None),
        };

        let mut connection = pool.acquire().await?;
        let done = change_study(&mut connection, self.run(), study, change).await;
        drop_if_failed(connection, &done);
        done
    }

    /// Closes its connections, unless they are the server's.
    pub async fn close(&self) {
        if let Backend::CommandLine { pool, .. } = &self.way {
            self.reader.close().await;
            pool.close().await;
        }
    }
}

//! The book of studies: written by the server, or by a command while no server runs.

use std::path::Path;
use std::sync::Arc;

use super::writing::{insert_change, insert_study};
use super::{NewStudy, StudyChange};
use crate::store::lock::FolderLock;
use crate::store::reader::there;
use crate::store::schema::DATABASE;
use crate::store::writer::Writer;
use crate::store::{Reader, Store, StoreError};
use parfocal_trial::study::definition::StudyName;

/// Writes studies. Clone freely.
#[derive(Clone)]
pub struct StudyBook {
    writer: Writer,
    /// Keeps servers out while a command writes, so that no server decides on data that is being changed.
    _lock: Option<Arc<FolderLock>>,
}

impl StudyBook {
    /// The book of the server.
    pub fn of_server(store: &Store) -> Self {
        Self { writer: Writer::Server(store.clone()), _lock: None }
    }

    /// Opens the book of data folder `folder` for a command.
    ///
    /// # Errors
    /// If there is no database, a server has it open, or it is of another version.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        let file = folder.join(DATABASE);
        there(&file)?;
        let lock = Arc::new(FolderLock::of(folder)?);
        Ok(Self { writer: Writer::of_command(&file).await?, _lock: Some(lock) })
    }

    /// The run of the server that writes in it; `None` for a command.
    pub fn run(&self) -> Option<i64> {
        self.writer.run()
    }

    /// The reader of the same database.
    pub fn reader(&self) -> &Reader {
        self.writer.reader()
    }

    /// Writes a new study with its first event. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn plan(&self, new: &NewStudy, planned: &StudyChange) -> Result<(), StoreError> {
        self.writer.write(async |connection| insert_study(connection, self.run(), new, planned).await).await
    }

    /// Writes all of `change` of `study`, or nothing. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn change(&self, study: &StudyName, change: &StudyChange) -> Result<(), StoreError> {
        self.writer.write(async |connection| insert_change(connection, self.run(), study, change).await).await
    }

    /// Closes its connections, unless they are the server's.
    pub async fn close(&self) {
        self.writer.close().await;
    }
}

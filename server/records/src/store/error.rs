//! Errors of the disk and the database. Each message says what the reader can do.

use std::path::{Path, PathBuf};

use sqlx::migrate::MigrateError;

/// A failure of the store. Nothing was acknowledged; what was acknowledged before is safe.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another server uses the folder.
    #[error(
        "the data folder {} is in use by another parfocal server (process {process}); \
         stop that one, or choose another folder with --data-dir",
        .folder.display()
    )]
    InUse {
        /// The data folder.
        folder: PathBuf,
        /// Process id of the other server.
        process: String,
    },
    /// The database was made by a newer version.
    #[error(
        "the database was made by a newer version of parfocal (migration {version} is unknown here); \
         install that version or choose another folder with --data-dir; nothing was changed"
    )]
    Newer {
        /// The migration that this version does not have.
        version: i64,
    },
    /// The database was made by an older version, and is open for reading only.
    #[error("the database is of another version of parfocal; start `parfocal serve` on it once to update it")]
    Outdated,
    /// The file has no tables.
    #[error(
        "the database has no tables: it was probably copied while a server ran, without the file beside it whose name \
         ends in -wal and which holds the latest records; make the copy with `parfocal backup`, which needs no second \
         file, or copy that file too"
    )]
    WithoutLog,
    /// The file has nothing in it.
    #[error("{} is empty: it was cut short while it was written or copied; copy it again", .0.display())]
    Empty(PathBuf),
    /// The folder cannot be used.
    #[error("the data folder {} cannot be used: {reason}", .folder.display())]
    Folder {
        /// The data folder.
        folder: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// There is no database.
    #[error(
        "there is no database {}; start `parfocal serve` once, which makes it, or name the server's data folder with \
         --data-dir",
        .0.display()
    )]
    Missing(PathBuf),
    /// The database of a running server was deleted or moved away.
    #[error(
        "the database was deleted or moved away from the data folder {} while the server runs, and nothing can be \
         saved; put it back there, or end the server and restore a backup with `parfocal restore`",
        .0.display()
    )]
    Gone(PathBuf),
    /// The disk is full.
    #[error("the disk is full; make room and try again; what was saved before is safe")]
    Full,
    /// The disk or file cannot be written.
    #[error("the database cannot be written: the disk or the file is read-only; make it writable and try again")]
    ReadOnly,
    /// The disk failed in another way.
    #[error("the disk failed ({0}); check that it has room and works, and try again; what was saved before is safe")]
    Disk(String),
    /// The file is not a database, or is damaged.
    #[error("the database is damaged ({0}); keep a copy of the data folder before anything else")]
    Damaged(String),
    /// The file cannot be opened.
    #[error(
        "the database cannot be opened; you must be able to write to it and to its folder: \
         run this as the user that runs the server, change their permissions, or copy the data folder to a place where \
         you can write and name it with --data-dir"
    )]
    Shut,
    /// Words were erased from their records, but not yet from the files.
    #[error(
        "the words are erased from their record, but copies may stand in the database's log as long as another \
         program reads the database, such as an export or a backup; end that program and erase again, or leave it to \
         the server, which tries again every hour"
    )]
    ErasureUnfinished,
    /// Another program has locked the database.
    #[error("another program has locked the database; close it and try again")]
    Locked,
    /// Any other error of the database.
    #[error("the database failed: {0}")]
    Database(sqlx::Error),
}

impl StoreError {
    /// Whether the disk or the database failed, and did not merely refuse a request.
    pub const fn is_of_the_disk(&self) -> bool {
        match self {
            Self::Gone(_)
            | Self::Full
            | Self::ReadOnly
            | Self::Disk(_)
            | Self::Damaged(_)
            | Self::Shut
            | Self::Locked => true,
            Self::Database(error) => matches!(error, sqlx::Error::Io(_) | sqlx::Error::PoolTimedOut),
            Self::InUse { .. }
            | Self::Newer { .. }
            | Self::Outdated
            | Self::WithoutLog
            | Self::Empty(_)
            | Self::Folder { .. }
            | Self::Missing(_)
            | Self::ErasureUnfinished => false,
        }
    }

    pub(super) fn folder(folder: &Path, error: &std::io::Error) -> Self {
        let reason = match error.kind() {
            std::io::ErrorKind::PermissionDenied => {
                "you may not write there; change its permissions or choose another folder with --data-dir".to_owned()
            }
            std::io::ErrorKind::ReadOnlyFilesystem => {
                "its disk is read-only; choose another folder with --data-dir".to_owned()
            }
            std::io::ErrorKind::StorageFull => {
                "its disk is full; make room or choose another with --data-dir".to_owned()
            }
            _ => format!("{error}; choose another folder with --data-dir"),
        };

        Self::Folder { folder: folder.to_owned(), reason }
    }
}

/// Why a check of a database failed.
#[derive(Debug, thiserror::Error)]
pub(super) enum Wrong {
    /// Something that was found is wrong, in words.
    #[error("{0}")]
    Found(String),
    /// The database cannot be read.
    #[error("{0}")]
    Database(#[from] StoreError),
}

impl Wrong {
    /// The same, where what was found is wrong with `what`.
    pub(super) fn with(self, what: impl std::fmt::Display) -> Self {
        match self {
            Self::Found(problem) => Self::Found(format!("{what}: {problem}")),
            Self::Database(error) => Self::Database(error),
        }
    }
}

impl From<String> for Wrong {
    fn from(found: String) -> Self {
        Self::Found(found)
    }
}

impl From<&str> for Wrong {
    fn from(found: &str) -> Self {
        Self::Found(found.to_owned())
    }
}

impl From<sqlx::Error> for Wrong {
    fn from(error: sqlx::Error) -> Self {
        Self::Database(error.into())
    }
}

/// `SQLITE_IOERR_SHMSIZE`: there is no room to enlarge the file that a database's connections share.
const NO_ROOM_TO_SHARE: u32 = 4874;

/// By `SQLite`'s result codes (sqlite.org/rescode.html). The lowest byte of an extended code is its primary code.
impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        let code = error
            .as_database_error()
            .and_then(sqlx::error::DatabaseError::code)
            .and_then(|code| code.parse::<u32>().ok());

        if code == Some(NO_ROOM_TO_SHARE) {
            return Self::Full;
        }
        match code.map(|code| code & 0xff) {
            Some(13) => Self::Full,
            Some(10) => Self::Disk(error.to_string()),
            Some(8) => Self::ReadOnly,
            Some(14) => Self::Shut,
            Some(5 | 6) => Self::Locked,
            Some(11 | 26) => Self::Damaged(error.to_string()),
            _ => Self::Database(error),
        }
    }
}

impl From<MigrateError> for StoreError {
    fn from(error: MigrateError) -> Self {
        match error {
            MigrateError::VersionMissing(version) => Self::Newer { version },
            MigrateError::Execute(error) | MigrateError::ExecuteMigration(error, _) => error.into(),
            other => Self::Damaged(other.to_string()),
        }
    }
}

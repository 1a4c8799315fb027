//! Checks whether the database's file is whole.

use std::path::Path;

use parfocal_records::store::StoreError;

use super::finding::Finding;

const DATABASE: &str = "database";

/// The finding about the database in the data folder `data`, whose size in bytes was `found`; `None` if the database is
/// missing because the folder itself does not exist.
pub fn database(data: &Path, found: Result<u64, StoreError>) -> Option<Finding> {
    let folder = data.display();
    Some(match found {
        Err(StoreError::Missing(_)) if !data.is_dir() => return None,
        Err(StoreError::Missing(_)) => Finding::advice(
            DATABASE,
            format!("There is no database in {folder} yet."),
            "The server makes it at its first start; or name the folder that has it: --data-dir DIR.",
        ),
        Ok(bytes) => Finding::well(DATABASE, format!("The database of {:.1} MB is whole.", bytes as f64 / 1e6)),
        Err(StoreError::Damaged(detail)) => Finding::wrong(
            DATABASE,
            format!("The database is damaged ({detail})."),
            "Begin no session. End the server, keep a copy of the data folder, and put the latest backup in the \
             database's place: parfocal restore FILE",
        ),
        Err(StoreError::Newer { .. }) => Finding::wrong(
            DATABASE,
            "The database was made by a newer version of parfocal.",
            "Install that version, or name another folder: --data-dir DIR.",
        ),
        Err(error) => Finding::wrong(
            DATABASE,
            format!("The database cannot be read: {error}."),
            "Run this as the user that runs the server, and check the disk.",
        ),
    })
}

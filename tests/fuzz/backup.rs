//! A backup or a database, which is verified before it is used. An input is a place in the file (four bytes) and the
//! bytes that are written there. So the file stays a database, but the content of its rows is wrong.

use std::fs;
use std::time::Duration;

use parfocal_records::store::verify_database;
use parfocal_trial::action::Action;
use parfocal_trial::role::Role;
use tempfile::TempDir;
use tokio::runtime::{Builder, Runtime};
use tokio::time::timeout;

use super::fixture::Trial;

/// Bytes of the file that a seed holds.
const PIECE: usize = 64;

/// A verification that takes longer counts as hanging. Most take a few milliseconds.
const LONGEST: Duration = Duration::from_mins(1);

/// A thread's own copy of the database, and the runtime that verifies it.
struct Database {
    folder: TempDir,
    whole: Vec<u8>,
    runtime: Runtime,
}

thread_local! {
    static DATABASE: Database = make();
}

/// A database with a part of it overwritten is verified, or refused.
pub fn backup(bytes: &[u8]) {
    let Some((place, content)) = bytes.split_first_chunk::<4>() else { return };
    DATABASE.with(|database| {
        let file = database.folder.path().join("backup.db");
        let mut changed = database.whole.clone();
        let place = u32::from_le_bytes(*place) as usize % changed.len();
        for (byte, new) in changed[place..].iter_mut().zip(content) {
            *byte = *new;
        }

        fs::write(&file, changed).unwrap();
        let verified = database.runtime.block_on(async { timeout(LONGEST, verify_database(&file, None)).await });
        if let Ok(checks) = verified.expect("verification ends") {
            assert!(!checks.is_empty());
        }
    });
}

/// Pieces of the database, in order.
pub fn pieces() -> Vec<Vec<u8>> {
    DATABASE.with(|database| {
        let pieces = database.whole.chunks(PIECE).enumerate();
        // Most of a small database's pages is free space.
        let filled = pieces.filter(|(_, piece)| piece.iter().any(|byte| *byte != 0));
        filled.map(|(number, piece)| [&((number * PIECE) as u32).to_le_bytes(), piece].concat()).collect()
    })
}

/// The database of a server that ran a session, which was unblinded.
fn make() -> Database {
    let runtime = Builder::new_current_thread().enable_all().build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    runtime.block_on(async {
        let mut trial = Trial::start(folder.path()).await;
        let session = trial.begin("paper").await;
        trial.say("The vessel’s edge trembles").await;
        trial.whole_setting().await;
        trial.conductor.act(Role::Operator, session, Action::Abort { reason: "enough".to_owned() }).await.unwrap();
        trial.unblind(session).await;
        trial.store.close().await;
    });

    let whole = fs::read(folder.path().join("parfocal.db")).unwrap();
    Database { folder, whole, runtime }
}

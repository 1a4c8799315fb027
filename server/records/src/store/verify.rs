//! Verifies a database, whether or not a server has it open. Nothing is written.

use std::path::Path;

use sha2::{Digest, Sha256};
use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::chain::check::{BlockToCheck, ChainCheck, FoundEntry, FoundRow};
use super::chain::{Head, all, entry, hashes, unsealed};
use super::error::Wrong;
use super::export::verify::{Check, Verdict};
use super::schema::DATABASE;
use super::studies::check_studies;
use super::whole::Thoroughness;
use super::{Reader, StoreError};
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_trial::commitment::Allocation;

/// Runs every check, in order, on the database of data folder `path` or on the database file `path`. If `expected`, a
/// head known from elsewhere, is given, also checks that the chain has this head in it.
///
/// # Errors
/// If there is no database, or it is of another version.
#[boxed]
pub async fn verify_database(path: &Path, expected: Option<Head>) -> Result<Vec<Check>, StoreError> {
    let file = if path.is_dir() { path.join(DATABASE) } else { path.to_owned() };
    let snapshot = Reader::open_snapshot(&file).await?;
    let checks = checks(&snapshot, expected).await;
    snapshot.close().await;
    Ok(checks)
}

/// Runs every check on `snapshot`, which has one connection.
pub(super) async fn checks(snapshot: &Reader, expected: Option<Head>) -> Vec<Check> {
    let check = |name, outcome: Result<String, Wrong>| Check {
        name,
        verdict: outcome.map_or_else(|wrong| Verdict::Failed(wrong.to_string()), Verdict::Passed),
    };

    vec![
        check("database", whole(snapshot).await),
        check("chain", chain(snapshot, expected).await),
        check("voice", snapshot.check_voice().await),
        check("commitments", commitments(snapshot).await),
        check("studies", check_studies(snapshot).await),
    ]
}

/// Checks that the file is undamaged, by SQLite's own checks.
async fn whole(snapshot: &Reader) -> Result<String, Wrong> {
    snapshot.check_file(Thoroughness::Full).await?;
    if let Some(row) = sqlx::query("PRAGMA foreign_key_check").fetch_optional(snapshot.pool()).await? {
        let table: String = row.try_get(0)?;
        let of: String = row.try_get(2)?;
        return Err(format!("{table}: a row belongs to a row of {of} that is not there").into());
    }
    Ok("the file is whole".to_owned())
}

async fn chain(snapshot: &Reader, expected: Option<Head>) -> Result<String, Wrong> {
    const PAGE: i64 = 4096;

    let mut connection = snapshot.pool().acquire().await?;
    let mut walk = ChainCheck::new(all(&mut connection).await?, expected);
    let mut after = i64::MIN;
    loop {
        let page = sqlx::query(
            "SELECT chain.*, chain_salts.salt AS sealed_salt FROM chain LEFT JOIN chain_salts USING (number)
             WHERE number > ? ORDER BY number LIMIT ?",
        );
        let rows = page.bind(after).bind(PAGE).fetch_all(&mut *connection).await?;
        let Some(last) = rows.last() else { break };
        after = last.try_get("number")?;

        for row in &rows {
            if let Some(block) = walk.row(&found(row)?)? {
                check_block(&mut connection, &block).await?;
            }
        }
    }

    let waiting = unchained(&mut connection, &walk).await?;
    let summary = walk.end()?;
    Ok(match waiting {
        0 => summary,
        _ => format!("{summary}; the latest {waiting} steps of telemetry are not chained yet"),
    })
}

fn found(row: &SqliteRow) -> Result<FoundRow, StoreError> {
    Ok(FoundRow {
        number: row.try_get::<i64, _>("number")?.to_string(),
        previous: Some(row.try_get("previous")?),
        entry: FoundEntry::Whole(entry(row)?, row.try_get("sealed_salt")?),
        hash: row.try_get("hash")?,
    })
}

async fn check_block(connection: &mut SqliteConnection, block: &BlockToCheck) -> Result<(), Wrong> {
    let salt = block.sealed_salt.as_deref();
    let salt = salt.ok_or_else(|| format!("telemetry: the salt of block {} is missing", block.entry.key))?;
    let hashes = hashes(connection, &block.block, salt).await?;
    Ok(block.check(hashes.steps, &hashes.open, Some(&hashes.sealed))?)
}

/// How many steps of telemetry have no block yet. Only the latest run may have such steps, because the next start of
/// the server chains what a killed one left unchained.
async fn unchained(connection: &mut SqliteConnection, walk: &ChainCheck) -> Result<i64, Wrong> {
    let sessions = sqlx::query_as(
        "SELECT session, session IN (SELECT session FROM events WHERE run = (SELECT max(run) FROM events))
         FROM sessions ORDER BY rowid",
    );
    let sessions: Vec<(String, bool)> = sessions.fetch_all(&mut *connection).await?;

    let mut waiting = 0;
    for (session, latest) in sessions {
        for (segment, steps, _) in unsealed(connection, &session).await? {
            let more = steps - walk.steps(&segment);
            if !latest {
                return Err(format!("telemetry: {more} steps of segment {segment} were inserted at its end").into());
            }
            waiting += more;
        }
    }
    Ok(waiting)
}

/// Checks that each session has the protocol and the order that it was made with.
async fn commitments(snapshot: &Reader) -> Result<String, Wrong> {
    let sessions = sqlx::query_scalar("SELECT session FROM sessions ORDER BY rowid");
    let sessions: Vec<String> = sessions.fetch_all(snapshot.pool()).await?;
    for session in &sessions {
        let named = |what: &str| format!("sessions: session {session}: {what}");
        let id: SessionId = session.parse().map_err(|_| named("its id is not valid"))?;
        let stored = snapshot.session(id).await?.ok_or_else(|| named("it is not there"))?;

        let protocol_sha256: [u8; 32] = Sha256::digest(&stored.made.protocol_toml).into();
        if hex::encode(protocol_sha256) != stored.made.protocol_sha256 {
            return Err(named("its protocol was changed since it was made").into());
        }

        let allocation = Allocation {
            session: id,
            algorithm: stored.made.algorithm,
            seed: stored.made.seed,
            index: stored.made.set_index,
            protocol_sha256,
            schedule: stored.made.segments.into_iter().map(|(_, policy)| policy).collect(),
        };
        if allocation.commitment() != stored.made.commitment {
            return Err(named("its seed, place, policies or order were changed since it was made").into());
        }
    }
    Ok(format!("the orders of {} sessions are those committed to when they were made", sessions.len()))
}

//! Writes rows of the chain, in the transaction that writes their record.

use sqlx::Row;
use sqlx::sqlite::SqliteConnection;

use super::form::{Entry, Head, link, sealed};
use super::kinds::kind;
use super::records::one;
use crate::store::StoreError;
use crate::store::insert::Insert;

/// A row to be written.
pub struct NewRow<'a> {
    /// When the row is written, by the wall clock.
    pub wall: &'a str,
    /// Kind of the record.
    pub kind: &'static str,
    /// The record's key.
    pub key: &'a str,
    /// The record's session; empty if it has none.
    pub session: &'a str,
    /// Hash of the sealed columns.
    pub sealed: String,
    /// Salt of `sealed`; empty if the kind has no sealed columns.
    pub sealed_salt: String,
    /// Hash of the record.
    pub content: String,
}

/// Appends the row of the record of kind `name` with this key, which the transaction on `connection` has just written.
pub async fn append(
    connection: &mut SqliteConnection,
    name: &'static str,
    key: &str,
    wall: &str,
) -> Result<Head, StoreError> {
    let kind = kind(name).ok_or_else(|| StoreError::Damaged(format!("no records are called '{name}'")))?;
    let record = one(connection, kind, key).await?;

    let mut sealed_salt = String::new();
    let mut hidden = String::new();
    if let Some(columns) = record.sealed.as_ref().filter(|columns| !columns.is_empty()) {
        sealed_salt = salt()?;
        hidden = sealed(&sealed_salt, columns.iter().map(String::as_str));
    }

    let content = record.content(kind, &hidden);
    let session = &record.session;
    let row = NewRow { wall, kind: kind.name, key, session, sealed: hidden, sealed_salt, content };
    insert(connection, row).await
}

/// Writes a row at the end of the chain.
pub async fn insert(connection: &mut SqliteConnection, row: NewRow<'_>) -> Result<Head, StoreError> {
    let before = head(connection).await?;
    let place = match row.session {
        "" => None,
        session => Some(next_place(connection, session).await?),
    };

    let entry = Entry {
        wall: row.wall.to_owned(),
        kind: row.kind.to_owned(),
        key: row.key.to_owned(),
        session: row.session.to_owned(),
        place,
        salt: salt()?,
        sealed: row.sealed,
        content: row.content,
    };

    let number = before.number + 1;
    let hash = link(number, &before.hash, &entry.hash());
    Insert::into("chain")
        .set("number", number)
        .set("wall", &entry.wall)
        .set("kind", &entry.kind)
        .set("key", &entry.key)
        .set("session", Some(&entry.session).filter(|session| !session.is_empty()))
        .set("place", entry.place)
        .set("salt", &entry.salt)
        .set("sealed", &entry.sealed)
        .set("content", &entry.content)
        .set("previous", &before.hash)
        .set("hash", &hash)
        .execute(connection)
        .await?;

    if !row.sealed_salt.is_empty() {
        Insert::into("chain_salts").set("number", number).set("salt", &row.sealed_salt).execute(connection).await?;
    }

    Ok(Head { number, hash })
}

/// The latest row; `Head::default` if there is no row.
pub async fn head(connection: &mut SqliteConnection) -> Result<Head, StoreError> {
    let latest = sqlx::query("SELECT number, hash FROM chain ORDER BY number DESC LIMIT 1");
    match latest.fetch_optional(connection).await? {
        Some(row) => Ok(Head { number: row.try_get("number")?, hash: row.try_get("hash")? }),
        None => Ok(Head::default()),
    }
}

async fn next_place(connection: &mut SqliteConnection, session: &str) -> Result<i64, StoreError> {
    let latest = sqlx::query_scalar("SELECT max(place) FROM chain WHERE session = ?");
    let latest: Option<i64> = latest.bind(session).fetch_one(connection).await?;
    Ok(latest.unwrap_or(0) + 1)
}

/// 128 random bits, hexadecimal.
pub fn salt() -> Result<String, StoreError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| StoreError::Disk(format!("no random numbers: {error}")))?;
    Ok(hex::encode(bytes))
}

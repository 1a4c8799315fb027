//! Writes rows of the chain, in the transaction that writes their record.

use sqlx::Row;
use sqlx::sqlite::SqliteConnection;

use super::form::{Entry, Head, link, sealed};
use super::kinds::{Kind, kind};
use super::records::{Record, one};
use crate::store::StoreError;

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
    /// Whether the record is older than the chain.
    pub adopted: bool,
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
    append_record(connection, kind, key, &record, wall, false).await
}

/// Appends the row of `record`, which has this key.
pub async fn append_record(
    connection: &mut SqliteConnection,
    kind: &Kind,
    key: &str,
    record: &Record,
    wall: &str,
    adopted: bool,
) -> Result<Head, StoreError> {
    let mut sealed_salt = String::new();
    let mut hidden = String::new();
    if let Some(columns) = record.sealed.as_ref().filter(|columns| !columns.is_empty()) {
        sealed_salt = salt()?;
        hidden = sealed(&sealed_salt, columns.iter().map(String::as_str));
    }

    let content = record.content(kind, &hidden);
    let session = &record.session;
    let row = NewRow { wall, kind: kind.name, key, session, adopted, sealed: hidden, sealed_salt, content };
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
        adopted: row.adopted,
        salt: salt()?,
        sealed: row.sealed,
        content: row.content,
    };

    let number = before.number + 1;
    let hash = link(number, &before.hash, &entry.hash());
    sqlx::query(
        "INSERT INTO chain (number, wall, kind, key, session, place, adopted, salt, sealed, content, previous, hash)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(number)
    .bind(&entry.wall)
    .bind(&entry.kind)
    .bind(&entry.key)
    .bind(Some(&entry.session).filter(|session| !session.is_empty()))
    .bind(entry.place)
    .bind(entry.adopted)
    .bind(&entry.salt)
    .bind(&entry.sealed)
    .bind(&entry.content)
    .bind(&before.hash)
    .bind(&hash)
    .execute(&mut *connection)
    .await?;

    if !row.sealed_salt.is_empty() {
        sqlx::query("INSERT INTO chain_salts (number, salt) VALUES (?, ?)")
            .bind(number)
            .bind(&row.sealed_salt)
            .execute(connection)
            .await?;
    }

    Ok(Head { number, hash })
}

/// The latest row; `Head::none` if there is no row.
pub async fn head(connection: &mut SqliteConnection) -> Result<Head, StoreError> {
    let latest = sqlx::query("SELECT number, hash FROM chain ORDER BY number DESC LIMIT 1");
    match latest.fetch_optional(connection).await? {
        Some(row) => Ok(Head { number: row.try_get("number")?, hash: row.try_get("hash")? }),
        None => Ok(Head::none()),
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

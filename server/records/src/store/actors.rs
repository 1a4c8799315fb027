//! The personal account that made a record. It is a row beside the record, written in the same transaction.

use std::collections::BTreeMap;

use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::{Reader, StoreError, chain};
use parfocal_base::ids::SessionId;
use parfocal_trial::account::AccountName;

/// Records that `account` made the record of kind `kind` with this key. The transaction on `connection` writes both.
/// Does nothing if nobody was signed in. `session` is the record's session, if it has one.
pub(super) async fn name_actor(
    connection: &mut SqliteConnection,
    account: Option<&AccountName>,
    kind: &'static str,
    key: &str,
    session: Option<SessionId>,
    wall: &str,
) -> Result<(), StoreError> {
    let Some(account) = account else { return Ok(()) };
    let done = sqlx::query(
        "INSERT INTO actors (kind, record, session, account, display)
         SELECT ?, ?, ?, account, display FROM accounts WHERE account = ?",
    )
    .bind(kind)
    .bind(key)
    .bind(session.map(|session| session.to_string()))
    .bind(account.as_str())
    .execute(&mut *connection)
    .await?;

    if done.rows_affected() != 1 {
        return Err(StoreError::Damaged(format!("there is no account '{account}'")));
    }
    let number = done.last_insert_rowid().to_string();
    chain::append(connection, "actor", &number, wall).await?;
    Ok(())
}

/// The account behind the record in `row`, if somebody was signed in.
pub(super) fn account(row: &SqliteRow) -> Result<Option<AccountName>, StoreError> {
    let name: Option<String> = row.try_get("account")?;
    let account = name.map(|name| AccountName::new(&name)).transpose();
    account.map_err(|error| StoreError::Damaged(error.to_string()))
}

impl Reader {
    /// The names of the accounts that made records of `session`, by the record's kind and key.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn actors(&self, session: SessionId) -> Result<BTreeMap<(String, String), String>, StoreError> {
        let rows: Vec<(String, String, String)> =
            sqlx::query_as("SELECT kind, record, account FROM actors WHERE session = ?")
                .bind(session.to_string())
                .fetch_all(self.pool())
                .await?;
        Ok(rows.into_iter().map(|(kind, record, account)| ((kind, record), account)).collect())
    }
}

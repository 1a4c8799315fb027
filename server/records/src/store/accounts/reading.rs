//! Reads accounts and sign-ins.

use std::collections::HashMap;

use jiff::Timestamp;
use sqlx::sqlite::{SqliteExecutor, SqliteRow};
use sqlx::{AssertSqlSafe, Row};

use super::{AccountLine, PassphraseHash, StoredAccount, StoredSignIn};
use crate::store::values::{named, parsed};
use crate::store::{Reader, StoreError};
use parfocal_trial::account::{Account, AccountName, AccountRole};

/// Every column of an account, and whether another account was the last to set its passphrase. The command line counts
/// as no account, because the person may have typed the passphrase there.
const ACCOUNT: &str = "SELECT accounts.*, (
        SELECT done_by IS NOT NULL AND done_by <> account FROM account_events
        WHERE account_events.account = accounts.account AND kind IN ('added', 'passphrase-replaced')
        ORDER BY number DESC LIMIT 1
    ) AS set_by_another FROM accounts";

impl Reader {
    /// All accounts, by name.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn accounts(&self) -> Result<Vec<Account>, StoreError> {
        all_accounts(self.pool()).await
    }

    /// All accounts, by name, as a lead sees them.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn account_lines(&self) -> Result<Vec<AccountLine>, StoreError> {
        let signed_in = sqlx::query(
            "SELECT account, max(wall) AS last_signed_in FROM account_events WHERE kind = 'signed-in' GROUP BY account",
        );
        let mut last: HashMap<String, Timestamp> = HashMap::new();
        for row in signed_in.fetch_all(self.pool()).await? {
            last.insert(row.try_get("account")?, parsed(&row, "last_signed_in")?);
        }

        let rows = sqlx::query(AssertSqlSafe(format!("{ACCOUNT} ORDER BY account"))).fetch_all(self.pool()).await?;
        let line = |row: &SqliteRow| {
            let account = account(row)?;
            let last_signed_in = last.get(account.account.as_str()).copied();
            Ok(AccountLine { account, set_by_another: set_by_another(row)?, last_signed_in })
        };
        rows.iter().map(line).collect()
    }

    /// Whether any account is enabled, so that somebody can sign in.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn has_accounts(&self) -> Result<bool, StoreError> {
        let found = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM accounts WHERE disabled = 0)");
        Ok(found.fetch_one(self.pool()).await?)
    }

    /// The account of this name, with the hash of its passphrase; `None` if there is none.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn account(&self, name: &AccountName) -> Result<Option<StoredAccount>, StoreError> {
        stored_account(self.pool(), name).await
    }

    /// The sign-in whose token has this SHA-256; `None` if there is none or it was ended. Does not check whether it has
    /// expired.
    ///
    /// # Errors
    /// If the database fails or holds data that this version cannot read.
    pub async fn sign_in(&self, token_sha256: &str) -> Result<Option<StoredSignIn>, StoreError> {
        let row = sqlx::query("SELECT * FROM sign_ins JOIN accounts USING (account) WHERE token_sha256 = ?")
            .bind(token_sha256)
            .fetch_optional(self.pool())
            .await?;

        let sign_in = |row: &SqliteRow| {
            Ok(StoredSignIn { account: account(row)?, began: parsed(row, "began")?, used: parsed(row, "used")? })
        };
        row.as_ref().map(sign_in).transpose()
    }
}

/// All accounts, by name.
pub(super) async fn all_accounts(database: impl SqliteExecutor<'_>) -> Result<Vec<Account>, StoreError> {
    let rows = sqlx::query("SELECT * FROM accounts ORDER BY account").fetch_all(database).await?;
    rows.iter().map(account).collect()
}

/// The account of this name, with the hash of its passphrase; `None` if there is none.
pub(super) async fn stored_account(
    database: impl SqliteExecutor<'_>,
    name: &AccountName,
) -> Result<Option<StoredAccount>, StoreError> {
    let row = sqlx::query(AssertSqlSafe(format!("{ACCOUNT} WHERE account = ?"))).bind(name.as_str());
    let Some(row) = row.fetch_optional(database).await? else { return Ok(None) };

    let bytes = |column: &str| -> Result<Vec<u8>, StoreError> {
        let text: String = row.try_get(column)?;
        hex::decode(text).map_err(|_| StoreError::Damaged(format!("the passphrase's {column} of account {name}")))
    };
    let hash = PassphraseHash {
        memory_kib: row.try_get("memory_kib")?,
        passes: row.try_get("passes")?,
        salt: bytes("salt")?,
        hash: bytes("hash")?,
    };
    Ok(Some(StoredAccount { account: account(&row)?, hash, set_by_another: set_by_another(&row)? }))
}

fn set_by_another(row: &SqliteRow) -> Result<bool, StoreError> {
    Ok(row.try_get::<Option<bool>, _>("set_by_another")?.unwrap_or(false))
}

fn account(row: &SqliteRow) -> Result<Account, StoreError> {
    let name: String = row.try_get("account")?;
    Ok(Account {
        account: AccountName::new(&name).map_err(|_| StoreError::Damaged(format!("account '{name}'")))?,
        display: row.try_get("display")?,
        role: named(row, "role", "an account", AccountRole::named)?,
        disabled: row.try_get("disabled")?,
    })
}

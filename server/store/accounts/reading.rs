//! Accounts and sign-ins read back.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::{PassphraseHash, StoredSignIn};
use crate::store::values::parsed;
use crate::store::{Reader, StoreError};
use crate::trial::account::{Account, AccountName, AccountRole};

impl Reader {
    /// All accounts, by name.
    ///
    /// # Errors
    /// When the database failed or holds what this version cannot read.
    pub async fn accounts(&self) -> Result<Vec<Account>, StoreError> {
        let rows = sqlx::query("SELECT * FROM accounts ORDER BY account").fetch_all(self.pool()).await?;
        rows.iter().map(account).collect()
    }

    /// Whether somebody can sign in.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn has_accounts(&self) -> Result<bool, StoreError> {
        let found = sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM accounts WHERE disabled = 0)");
        Ok(found.fetch_one(self.pool()).await?)
    }

    /// The account of this name, with the hash of its passphrase.
    ///
    /// # Errors
    /// When the database failed or holds what this version cannot read.
    pub async fn account(&self, name: &AccountName) -> Result<Option<(Account, PassphraseHash)>, StoreError> {
        let row = sqlx::query("SELECT * FROM accounts WHERE account = ?").bind(name.as_str());
        let Some(row) = row.fetch_optional(self.pool()).await? else { return Ok(None) };

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
        Ok(Some((account(&row)?, hash)))
    }

    /// The sign-in whose token has this SHA-256, if it was not ended. Whether it has expired is not looked at.
    ///
    /// # Errors
    /// When the database failed or holds what this version cannot read.
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

fn account(row: &SqliteRow) -> Result<Account, StoreError> {
    let name: String = row.try_get("account")?;
    let role: String = row.try_get("role")?;
    Ok(Account {
        account: AccountName::new(&name).map_err(|_| StoreError::Damaged(format!("account '{name}'")))?,
        display: row.try_get("display")?,
        role: AccountRole::named(&role).ok_or_else(|| StoreError::Damaged(format!("unknown role '{role}'")))?,
        disabled: row.try_get("disabled")?,
    })
}

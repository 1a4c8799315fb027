//! Writes accounts and sign-ins, for the server or for a command beside it.

use std::path::Path;
use std::sync::Arc;

use sqlx::sqlite::SqliteConnection;

use super::reading::{all_accounts, stored_account};
use super::{AccountEvent, ChangedBy, PassphraseHash, StoredAccount};
use crate::store::insert::Insert;
use crate::store::schema::DATABASE;
use crate::store::values::nanoseconds;
use crate::store::writer::Writer;
use crate::store::{Reader, Store, StoreError, chain};
use parfocal_base::clock::Clock;
use parfocal_trial::account::{Account, AccountChange, AccountName};

/// Writes accounts, each change with its row in the chain. Clone freely.
#[derive(Clone)]
pub struct AccountBook {
    writer: Writer,
    clock: Arc<dyn Clock>,
}

impl AccountBook {
    /// The account book of the server.
    pub fn of_server(store: &Store, clock: Arc<dyn Clock>) -> Self {
        Self { writer: Writer::Server(store.clone()), clock }
    }

    /// Opens data folder `folder` for a command, whether or not a server has it open.
    ///
    /// # Errors
    /// If there is no database, it is of another version, or it cannot be written.
    pub async fn open(folder: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Ok(Self { writer: Writer::of_command(&folder.join(DATABASE)).await?, clock })
    }

    /// The reader of the same database.
    pub fn reader(&self) -> &Reader {
        self.writer.reader()
    }

    /// Closes its connections, unless they are the server's.
    pub async fn close(&self) {
        self.writer.close().await;
    }

    /// Creates `account` if `check`, which gets all accounts, lets it. Nobody writes between the check and the change.
    /// The account is on disk when this returns.
    ///
    /// # Errors
    /// If `check` refuses, or the disk or database fails.
    pub async fn add<E: From<StoreError>>(
        &self,
        account: &Account,
        hash: &PassphraseHash,
        by: ChangedBy<'_>,
        check: impl FnOnce(&[Account]) -> Result<(), E>,
    ) -> Result<(), E> {
        let event = AccountEvent::Added(account.role);
        self.write_checked(&account.account, &event, by, check, async |connection, _| {
            Insert::into("accounts")
                .set("account", account.account.as_str())
                .set("display", &account.display)
                .set("role", account.role.name())
                .set("disabled", account.disabled)
                .set("memory_kib", hash.memory_kib)
                .set("passes", hash.passes)
                .set("salt", hex::encode(&hash.salt))
                .set("hash", hex::encode(&hash.hash))
                .execute(connection)
                .await?;
            Ok(())
        })
        .await
    }

    /// Changes `account` if `check` lets it, as [`add`](Self::add) does. The change is on disk when this returns.
    /// `Disable` and `SignOut` also end its sign-ins.
    ///
    /// # Errors
    /// If `check` refuses, or the disk or database fails.
    pub async fn change<E: From<StoreError>>(
        &self,
        account: &AccountName,
        change: &AccountChange,
        by: ChangedBy<'_>,
        check: impl FnOnce(&[Account]) -> Result<(), E>,
    ) -> Result<(), E> {
        let name = account.as_str();
        let event = AccountEvent::Changed(change.clone());
        self.write_checked(account, &event, by, check, async |connection, _| {
            match change {
                AccountChange::Role(role) => {
                    let query = sqlx::query("UPDATE accounts SET role = ? WHERE account = ?");
                    query.bind(role.name()).bind(name).execute(connection).await?;
                }
                AccountChange::Disable => {
                    let query = sqlx::query("UPDATE accounts SET disabled = 1 WHERE account = ?");
                    query.bind(name).execute(&mut *connection).await?;
                    end_sign_ins(connection, name).await?;
                }
                AccountChange::Enable => {
                    let query = sqlx::query("UPDATE accounts SET disabled = 0 WHERE account = ?");
                    query.bind(name).execute(connection).await?;
                }
                AccountChange::SignOut => end_sign_ins(connection, name).await?,
            }
            Ok(())
        })
        .await
    }

    /// Replaces the passphrase of `account`, and ends its sign-ins.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn replace_passphrase(
        &self,
        account: &AccountName,
        hash: &PassphraseHash,
        by: ChangedBy<'_>,
    ) -> Result<(), StoreError> {
        self.writer.write(async |connection| self.append_passphrase(connection, account, hash, by).await).await
    }

    /// Records that a browser signed in to the account `checked`, after replacing its passphrase by `chosen` if one is
    /// given. `token_sha256` is the SHA-256 of the browser's token. Returns whether it did: if the account was disabled
    /// or its passphrase replaced since `checked` was read, nothing is written.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn sign_in(
        &self,
        checked: &StoredAccount,
        chosen: Option<&PassphraseHash>,
        token_sha256: &str,
    ) -> Result<bool, StoreError> {
        let name = &checked.account.account;
        let by = Some(name);

        self.writer
            .write(async |connection| {
                let now = stored_account(&mut *connection, name).await?;
                if now.is_none_or(|now| now.account.disabled || now.hash != checked.hash) {
                    return Ok(false);
                }

                if let Some(chosen) = chosen {
                    self.append_passphrase(connection, name, chosen, by).await?;
                }
                let event = AccountEvent::SignedIn;
                self.append(connection, by, &event, by, async |connection, wall| {
                    Insert::into("sign_ins")
                        .set("token_sha256", token_sha256)
                        .set("account", name.as_str())
                        .set("began", wall)
                        .set("used", wall)
                        .execute(connection)
                        .await?;
                    Ok(())
                })
                .await?;
                Ok(true)
            })
            .await
    }

    /// Ends the sign-in of `account` whose token has this SHA-256.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn sign_out(&self, account: &AccountName, token_sha256: &str) -> Result<(), StoreError> {
        self.write(Some(account), &AccountEvent::SignedOut, Some(account), async |connection, _| {
            let query = sqlx::query("DELETE FROM sign_ins WHERE token_sha256 = ?");
            query.bind(token_sha256).execute(connection).await?;
            Ok(())
        })
        .await
    }

    /// Records `event`, a failed attempt on `account`; `None` if no account has the name that was given.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn failed(&self, account: Option<&AccountName>, event: &AccountEvent) -> Result<(), StoreError> {
        self.write(account, event, None, async |_, _| Ok(())).await
    }

    /// Notes that the sign-in with this token was used now.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn note_use(&self, token_sha256: &str) -> Result<(), StoreError> {
        self.writer
            .write(async |connection| {
                sqlx::query("UPDATE sign_ins SET used = ? WHERE token_sha256 = ?")
                    .bind(self.clock.wall().to_string())
                    .bind(token_sha256)
                    .execute(connection)
                    .await?;
                Ok(())
            })
            .await
    }

    /// Writes `event` of `account` with what `apply` writes, in one transaction. `apply` also gets the time.
    async fn write(
        &self,
        account: Option<&AccountName>,
        event: &AccountEvent,
        by: ChangedBy<'_>,
        apply: impl AsyncFnOnce(&mut SqliteConnection, &str) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        self.writer.write(async |connection| self.append(connection, account, event, by, apply).await).await
    }

    /// The same if `check`, which gets all accounts, lets it. Otherwise nothing is written.
    async fn write_checked<E: From<StoreError>>(
        &self,
        account: &AccountName,
        event: &AccountEvent,
        by: ChangedBy<'_>,
        check: impl FnOnce(&[Account]) -> Result<(), E>,
        apply: impl AsyncFnOnce(&mut SqliteConnection, &str) -> Result<(), StoreError>,
    ) -> Result<(), E> {
        let checked = self.writer.write(async |connection| {
            if let Err(refused) = check(&all_accounts(&mut *connection).await?) {
                return Ok(Err(refused));
            }
            self.append(connection, Some(account), event, by, apply).await.map(Ok)
        });
        checked.await?
    }

    /// Replaces the passphrase of `account`, ends its sign-ins, and records that.
    async fn append_passphrase(
        &self,
        connection: &mut SqliteConnection,
        account: &AccountName,
        hash: &PassphraseHash,
        by: ChangedBy<'_>,
    ) -> Result<(), StoreError> {
        self.append(connection, Some(account), &AccountEvent::PassphraseReplaced, by, async |connection, _| {
            sqlx::query("UPDATE accounts SET memory_kib = ?, passes = ?, salt = ?, hash = ? WHERE account = ?")
                .bind(hash.memory_kib)
                .bind(hash.passes)
                .bind(hex::encode(&hash.salt))
                .bind(hex::encode(&hash.hash))
                .bind(account.as_str())
                .execute(&mut *connection)
                .await?;
            end_sign_ins(connection, account.as_str()).await
        })
        .await
    }

    async fn append(
        &self,
        connection: &mut SqliteConnection,
        account: Option<&AccountName>,
        event: &AccountEvent,
        by: ChangedBy<'_>,
        apply: impl AsyncFnOnce(&mut SqliteConnection, &str) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let run = self.writer.run();
        let wall = self.clock.wall().to_string();
        apply(connection, &wall).await?;

        let number = Insert::into("account_events")
            .set("run", run)
            .set("wall", &wall)
            .set("monotonic_ns", run.map(|_| nanoseconds(self.clock.now())))
            .set("account", account.map(AccountName::as_str))
            .set("kind", event.name())
            .set("done_by", by.map(AccountName::as_str))
            .set("detail", event.detail())
            .execute(connection)
            .await?;

        chain::append(connection, "account-event", &number.to_string(), &wall).await?;
        Ok(())
    }
}

async fn end_sign_ins(connection: &mut SqliteConnection, account: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM sign_ins WHERE account = ?").bind(account).execute(connection).await?;
    Ok(())
}

//! Writes accounts and sign-ins, for the server or for a command beside it.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqlitePool, SqlitePoolOptions, SqliteSynchronous};

use super::{AccountEvent, ChangedBy, PassphraseHash};
use crate::store::schema::DATABASE;
use crate::store::values::{begin, drop_if_failed, nanoseconds};
use crate::store::{Reader, Store, StoreError, chain};
use parfocal_base::clock::Clock;
use parfocal_trial::account::{Account, AccountChange, AccountName};

/// Writes accounts, each change with its row in the chain. Clone freely.
#[derive(Clone)]
pub struct AccountBook {
    way: Backend,
    reader: Reader,
    clock: Arc<dyn Clock>,
}

#[derive(Clone)]
enum Backend {
    /// Within the server.
    Server(Store),
    /// From the command line, whether or not a server runs.
    CommandLine(SqlitePool),
}

/// What is written with an event, in one transaction.
enum Write<'a> {
    Insert(&'a Account, &'a PassphraseHash),
    Change(&'a AccountChange),
    Passphrase(&'a PassphraseHash),
    SignIn { token_sha256: &'a str },
    SignOut { token_sha256: &'a str },
    Nothing,
}

impl AccountBook {
    /// The account book of the server.
    #[must_use]
    pub fn of_server(store: &Store, clock: Arc<dyn Clock>) -> Self {
        Self { way: Backend::Server(store.clone()), reader: store.reader().clone(), clock }
    }

    /// Opens data folder `folder` for a command, whether or not a server has it open.
    ///
    /// # Errors
    /// If there is no database, it is of another version, or it cannot be written.
    pub async fn open(folder: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let reader = Reader::open(folder).await?;
        let options = SqliteConnectOptions::new()
            .filename(folder.join(DATABASE))
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5))
            .pragma("wal_autocheckpoint", "0")
            .synchronous(SqliteSynchronous::Full);
        let pool = SqlitePoolOptions::new().max_connections(1).connect_with(options).await?;
        Ok(Self { way: Backend::CommandLine(pool), reader, clock })
    }

    /// The reader of the same database.
    #[must_use]
    pub const fn reader(&self) -> &Reader {
        &self.reader
    }

    /// Closes its connections, unless they are the server's.
    pub async fn close(&self) {
        if let Backend::CommandLine(pool) = &self.way {
            self.reader.close().await;
            pool.close().await;
        }
    }

    /// Creates `account`. It is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn add(&self, account: &Account, hash: &PassphraseHash, by: ChangedBy<'_>) -> Result<(), StoreError> {
        let event = AccountEvent::Added(account.role);
        self.write(Some(&account.account), &event, by, Write::Insert(account, hash)).await
    }

    /// Changes `account`. The change is on disk when this returns. `Disable` and `SignOut` also end its sign-ins.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn change(
        &self,
        account: &AccountName,
        change: &AccountChange,
        by: ChangedBy<'_>,
    ) -> Result<(), StoreError> {
        self.write(Some(account), &AccountEvent::Changed(change.clone()), by, Write::Change(change)).await
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
        self.write(Some(account), &AccountEvent::PassphraseReplaced, by, Write::Passphrase(hash)).await
    }

    /// Records that a browser signed in to `account`. `token_sha256` is the SHA-256 of its token.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn sign_in(&self, account: &AccountName, token_sha256: &str) -> Result<(), StoreError> {
        let write = Write::SignIn { token_sha256 };
        self.write(Some(account), &AccountEvent::SignedIn, Some(account), write).await
    }

    /// Ends the sign-in of `account` whose token has this SHA-256.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn sign_out(&self, account: &AccountName, token_sha256: &str) -> Result<(), StoreError> {
        let write = Write::SignOut { token_sha256 };
        self.write(Some(account), &AccountEvent::SignedOut, Some(account), write).await
    }

    /// Records `event`, a failed attempt on `account`; `None` if no account has the name that was given.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn failed(&self, account: Option<&AccountName>, event: &AccountEvent) -> Result<(), StoreError> {
        self.write(account, event, None, Write::Nothing).await
    }

    /// Notes that the sign-in with this token was used now.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn note_use(&self, token_sha256: &str) -> Result<(), StoreError> {
        let (pool, _turn) = match &self.way {
            Backend::Server(store) => (&store.inner.trial, Some(store.turn().await)),
            Backend::CommandLine(pool) => (pool, None),
        };
        sqlx::query("UPDATE sign_ins SET used = ? WHERE token_sha256 = ?")
            .bind(self.clock.wall().to_string())
            .bind(token_sha256)
            .execute(pool)
            .await?;
        Ok(())
    }

    async fn write(
        &self,
        account: Option<&AccountName>,
        event: &AccountEvent,
        by: ChangedBy<'_>,
        write: Write<'_>,
    ) -> Result<(), StoreError> {
        let (pool, run, _turn) = match &self.way {
            Backend::Server(store) => (&store.inner.trial, Some(store.run()), Some(store.turn().await)),
            Backend::CommandLine(pool) => (pool, None, None),
        };

        let mut connection = pool.acquire().await?;
        let written = self.write_on(&mut connection, run, account, event, by, write).await;
        drop_if_failed(connection, &written);
        written
    }

    async fn write_on(
        &self,
        connection: &mut SqliteConnection,
        run: Option<i64>,
        account: Option<&AccountName>,
        event: &AccountEvent,
        by: ChangedBy<'_>,
        write: Write<'_>,
    ) -> Result<(), StoreError> {
        let wall = self.clock.wall().to_string();
        let mut transaction = begin(connection).await?;
        if let Some(account) = account {
            apply(&mut transaction, account, &wall, write).await?;
        }

        let done = sqlx::query(
            "INSERT INTO account_events (run, wall, monotonic_ns, account, kind, done_by, detail)
             VALUES (?, ?, ?, ?, ?, ?, ?)",
        )
        .bind(run)
        .bind(&wall)
        .bind(run.map(|_| nanoseconds(self.clock.now())))
        .bind(account.map(AccountName::as_str))
        .bind(event.name())
        .bind(by.map(AccountName::as_str))
        .bind(event.detail())
        .execute(&mut *transaction)
        .await?;

        let number = done.last_insert_rowid().to_string();
        chain::append(&mut transaction, "account-event", &number, &wall).await?;
        Ok(transaction.commit().await?)
    }
}

async fn apply(
    connection: &mut SqliteConnection,
    account: &AccountName,
    wall: &str,
    write: Write<'_>,
) -> Result<(), StoreError> {
    let name = account.as_str();
    match write {
        Write::Insert(new, hash) => {
            sqlx::query(
                "INSERT INTO accounts (account, display, role, disabled, memory_kib, passes, salt, hash)
                 VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            )
            .bind(name)
            .bind(&new.display)
            .bind(new.role.name())
            .bind(new.disabled)
            .bind(hash.memory_kib)
            .bind(hash.passes)
            .bind(hex::encode(&hash.salt))
            .bind(hex::encode(&hash.hash))
            .execute(connection)
            .await?;
        }
        Write::Change(AccountChange::Role(role)) => {
            let query = sqlx::query("UPDATE accounts SET role = ? WHERE account = ?");
            query.bind(role.name()).bind(name).execute(connection).await?;
        }
        Write::Change(AccountChange::Disable) => {
            let query = sqlx::query("UPDATE accounts SET disabled = 1 WHERE account = ?");
            query.bind(name).execute(&mut *connection).await?;
            end_sign_ins(connection, name).await?;
        }
        Write::Change(AccountChange::Enable) => {
            let query = sqlx::query("UPDATE accounts SET disabled = 0 WHERE account = ?");
            query.bind(name).execute(connection).await?;
        }
        Write::Change(AccountChange::SignOut) => end_sign_ins(connection, name).await?,
        Write::Passphrase(hash) => {
            sqlx::query("UPDATE accounts SET memory_kib = ?, passes = ?, salt = ?, hash = ? WHERE account = ?")
                .bind(hash.memory_kib)
                .bind(hash.passes)
                .bind(hex::encode(&hash.salt))
                .bind(hex::encode(&hash.hash))
                .bind(name)
                .execute(&mut *connection)
                .await?;
            end_sign_ins(connection, name).await?;
        }
        Write::SignIn { token_sha256 } => {
            sqlx::query("INSERT INTO sign_ins (token_sha256, account, began, used) VALUES (?, ?, ?, ?)")
                .bind(token_sha256)
                .bind(name)
                .bind(wall)
                .bind(wall)
                .execute(connection)
                .await?;
        }
        Write::SignOut { token_sha256 } => {
            let query = sqlx::query("DELETE FROM sign_ins WHERE token_sha256 = ?");
            query.bind(token_sha256).execute(connection).await?;
        }
        Write::Nothing => {}
    }
    Ok(())
}

async fn end_sign_ins(connection: &mut SqliteConnection, account: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM sign_ins WHERE account = ?").bind(account).execute(connection).await?;
    Ok(())
}

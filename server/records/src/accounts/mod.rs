//! Personal accounts: making and changing them, signing in, and the browsers that are signed in. The rules are in
//! [`parfocal_trial::account`].

mod error;
mod passphrase;
mod throttle;
mod token;

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use jiff::Timestamp;
use tokio::sync::Semaphore;

pub use error::AccountError;
pub use passphrase::{Cost, Passphrase};
pub use throttle::Peer;
pub use token::Token;

use crate::store::{
    AccountBook, AccountEvent, AccountLine, FailedAttempt, PassphraseHash, Reader, Store, StoreError, StoredSignIn,
};
use parfocal_base::clock::Clock;
use parfocal_trial::account::{
    Account, AccountChange, AccountName, AccountRole, IDLE_LIMIT, SIGN_IN_LIMIT, check_change, check_display,
};
use parfocal_trial::refusal::Refusal;
use parfocal_trial::role::Role;
use throttle::Throttle;

/// How often the use of a sign-in is recorded at most: each time is a write to the disk.
const NOTED_EVERY: Duration = Duration::from_mins(1);

/// The accounts, and all operations on them. Cheap to clone.
#[derive(Clone)]
pub struct Accounts {
    book: AccountBook,
    clock: Arc<dyn Clock>,
    cost: Cost,
    throttle: Arc<Mutex<Throttle>>,
    /// Uses of sign-ins that are not on the disk yet, by the SHA-256 of the token.
    unsaved_uses: Arc<Mutex<HashMap<String, Timestamp>>>,
    /// Only one passphrase is hashed at a time, because each takes 19 MiB and a core.
    hashing: Arc<Semaphore>,
}

impl Accounts {
    /// The accounts of the running server.
    pub fn of_server(store: &Store, clock: Arc<dyn Clock>, cost: Cost) -> Self {
        Self::new(AccountBook::of_server(store, Arc::clone(&clock)), clock, cost)
    }

    /// Opens the accounts of the data folder `folder` for a command. A server may have the folder open too.
    ///
    /// # Errors
    /// If there is no database, it is not of this version, or it cannot be written.
    pub async fn open(folder: &Path, clock: Arc<dyn Clock>, cost: Cost) -> Result<Self, StoreError> {
        Ok(Self::new(AccountBook::open(folder, Arc::clone(&clock)).await?, clock, cost))
    }

    fn new(book: AccountBook, clock: Arc<dyn Clock>, cost: Cost) -> Self {
        let hashing = Arc::new(Semaphore::new(1));
        Self { book, clock, cost, throttle: Arc::default(), unsaved_uses: Arc::default(), hashing }
    }

    /// The reader of the accounts' database.
    pub fn reader(&self) -> &Reader {
        self.book.reader()
    }

    /// Closes the database connections, if it has its own.
    pub async fn close(&self) {
        self.book.close().await;
    }

    /// All accounts, by name.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn all(&self) -> Result<Vec<Account>, AccountError> {
        Ok(self.reader().accounts().await?)
    }

    /// All accounts, by name, with the details that a lead sees.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn lines(&self) -> Result<Vec<AccountLine>, AccountError> {
        Ok(self.reader().account_lines().await?)
    }

    /// Makes an account. `by` is the lead who makes it; none on the command line.
    ///
    /// # Errors
    /// If the name or the display name is already taken, the display name is not valid, or the disk failed.
    pub async fn add(
        &self,
        account: AccountName,
        display: &str,
        role: AccountRole,
        passphrase: Passphrase,
        by: Option<&AccountName>,
    ) -> Result<Account, AccountError> {
        let new = Account { account, display: check_display(display)?, role, disabled: false };
        check_new(&new, &self.all().await?)?;

        let hash = self.hash(passphrase).await?;
        // Again within the transaction: hashing takes a while, and another lead may make the same account meanwhile.
        self.book.add(&new, &hash, by, |all| check_new(&new, all)).await?;
        Ok(new)
    }

    /// Changes an account. `by` is the lead who changes it; none on the command line.
    ///
    /// # Errors
    /// If no account has this name, the change would remove the last lead, or the disk failed.
    pub async fn change(
        &self,
        name: &AccountName,
        change: &AccountChange,
        by: Option<&AccountName>,
    ) -> Result<(), AccountError> {
        let check = |all: &[Account]| {
            let account = all.iter().find(|account| account.account == *name);
            let account = account.ok_or_else(|| AccountError::unknown(name, all))?;
            Ok(check_change(account, change, all)?)
        };
        // Within the transaction: two leads who disable each other at the same moment would leave none.
        self.book.change(name, change, by, check).await
    }

    /// Replaces the passphrase of an account, and ends its sign-ins.
    ///
    /// # Errors
    /// If no account has this name, or the disk failed.
    pub async fn replace_passphrase(
        &self,
        name: &AccountName,
        passphrase: Passphrase,
        by: Option<&AccountName>,
    ) -> Result<(), AccountError> {
        let all = self.all().await?;
        if !all.iter().any(|account| account.account == *name) {
            return Err(AccountError::unknown(name, &all));
        }
        let hash = self.hash(passphrase).await?;
        Ok(self.book.replace_passphrase(name, &hash, by).await?)
    }

    /// Signs in a browser at the address `peer`, and returns its token, which the server does not store. Replaces the
    /// passphrase by `chosen` first, if one is given.
    ///
    /// # Errors
    /// If the name and the passphrase do not match, the account is disabled, a lead set the passphrase and the person
    /// chose no other, there were too many failed attempts, or the disk failed. The first two give the same message, so
    /// that nobody can find out who has an account.
    pub async fn sign_in(
        &self,
        name: &str,
        passphrase: &str,
        chosen: Option<Passphrase>,
        peer: Peer,
    ) -> Result<(Account, Token), AccountError> {
        self.wait_for_turn(name, peer).await?;

        let found = match AccountName::new(name) {
            Ok(name) => self.reader().account(&name).await?,
            Err(_) => None,
        };
        let fits = self.fits(passphrase, found.as_ref().map(|found| &found.hash)).await?;

        if let Some(found) = found.as_ref().filter(|found| fits && !found.account.disabled) {
            self.throttle().succeeded(name);
            let chosen = match chosen {
                Some(chosen) => Some(self.hash_of_another(chosen, passphrase).await?),
                None if found.set_by_another => return Err(AccountError::ChooseAnother),
                None => None,
            };

            let token = Token::random()?;
            // Hashing takes a while, and a lead may have disabled the account or replaced the passphrase meanwhile.
            if self.book.sign_in(found, chosen.as_ref(), &token.sha256()).await? {
                return Ok((found.account.clone(), token));
            }
        }

        let account = found.map(|found| found.account);
        let is_disabled = account.as_ref().is_some_and(|account| account.disabled);
        let attempt = if fits && is_disabled { FailedAttempt::Disabled } else { FailedAttempt::SignIn };
        self.failed(name, account.as_ref(), attempt, peer).await?;
        Err(AccountError::WrongPassphrase)
    }

    /// The hash of the passphrase `chosen`, which must not be the one `before`.
    async fn hash_of_another(&self, chosen: Passphrase, before: &str) -> Result<PassphraseHash, AccountError> {
        if chosen.is(before) {
            let text = "the new passphrase is the same as the old one; choose another".to_owned();
            return Err(AccountError::Refused(Refusal::Invalid(text)));
        }
        self.hash(chosen).await
    }

    /// Checks the passphrase of a signed-in person again, before an action that cannot be undone.
    ///
    /// # Errors
    /// If the passphrase is wrong, there were too many failed attempts, or the disk failed.
    pub async fn confirm(&self, account: &Account, passphrase: &str, peer: Peer) -> Result<(), AccountError> {
        let name = account.account.as_str();
        self.wait_for_turn(name, peer).await?;

        let found = self.reader().account(&account.account).await?;
        if self.fits(passphrase, found.as_ref().map(|found| &found.hash)).await? {
            self.throttle().succeeded(name);
            return Ok(());
        }
        self.failed(name, Some(account), FailedAttempt::Confirmation, peer).await?;
        Err(AccountError::WrongConfirmation)
    }

    /// The account to which the browser with `token` is signed in; none if it is not, or the sign-in has expired.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn signed_in(&self, token: &Token) -> Result<Option<Account>, AccountError> {
        let token_sha256 = token.sha256();
        let Some(found) = self.reader().sign_in(&token_sha256).await? else { return Ok(None) };
        let StoredSignIn { account, began, used } = found;
        let used = self.unsaved_uses().get(&token_sha256).map_or(used, |unsaved| used.max(*unsaved));

        // The absolute difference, so that a clock that was set back does not extend a sign-in.
        let now = self.clock.wall();
        let since = |earlier| now.duration_since(earlier).unsigned_abs();
        if account.disabled || since(began) > SIGN_IN_LIMIT || since(used) > IDLE_LIMIT {
            return Ok(None);
        }

        if since(used) > NOTED_EVERY {
            self.unsaved_uses().insert(token_sha256.clone(), now);
            let accounts = self.clone();
            // Not awaited, so that a request to stop the lens does not wait for the disk, and a full disk locks nobody
            // out.
            tokio::spawn(async move {
                match accounts.book.note_use(&token_sha256).await {
                    Ok(()) => _ = accounts.unsaved_uses().remove(&token_sha256),
                    Err(error) => tracing::warn!("a sign-in's use could not be noted: {error}"),
                }
            });
        }
        Ok(Some(account))
    }

    /// Whether the sign-in with `token` was ended, is too old, or is to an account that may no longer read as `role`.
    /// Streams such as a live view end then. A sign-in that was only unused for a while does not end them.
    ///
    /// # Errors
    /// If the database failed.
    pub async fn has_ended(&self, token: &Token, role: Role) -> Result<bool, AccountError> {
        let found = self.reader().sign_in(&token.sha256()).await?;
        let now = self.clock.wall();
        let goes_on = |StoredSignIn { account, began, .. }: StoredSignIn| {
            let is_recent = now.duration_since(began).unsigned_abs() <= SIGN_IN_LIMIT;
            !account.disabled && account.role.may_act_as(role, false) && is_recent
        };
        Ok(!found.is_some_and(goes_on))
    }

    /// Ends the sign-in of the browser with `token`. Does nothing if it has already ended.
    ///
    /// # Errors
    /// If the disk or the database failed.
    pub async fn sign_out(&self, token: &Token) -> Result<(), AccountError> {
        let token_sha256 = token.sha256();
        if let Some(found) = self.reader().sign_in(&token_sha256).await? {
            self.book.sign_out(&found.account.account, &token_sha256).await?;
        }
        Ok(())
    }

    async fn hash(&self, passphrase: Passphrase) -> Result<PassphraseHash, AccountError> {
        let cost = self.cost;
        self.hashing(move || passphrase.hash(cost)).await?
    }

    /// Whether `given` is the passphrase of `hash`. It takes equally long if there is no account, and so no hash.
    async fn fits(&self, given: &str, hash: Option<&PassphraseHash>) -> Result<bool, AccountError> {
        let given = given.to_owned();
        let hash = hash.cloned();
        let cost = self.cost;
        self.hashing(move || passphrase::fits(&given, hash.as_ref(), cost)).await?
    }

    /// Runs `work` on a thread where it may block, because it would delay the streams.
    async fn hashing<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, AccountError> {
        let stopped = || AccountError::Storage("the server was stopped meanwhile; try again".to_owned());
        let _turn = self.hashing.acquire().await.map_err(|_| stopped())?;
        tokio::task::spawn_blocking(work).await.map_err(|_| stopped())
    }

    /// Waits as long as earlier failures require.
    async fn wait_for_turn(&self, name: &str, peer: Peer) -> Result<(), AccountError> {
        let wait = self.throttle().reserve(name, peer, self.clock.now())?;
        if !wait.is_zero() {
            tokio::time::sleep(wait).await;
        }
        Ok(())
    }

    async fn failed(
        &self,
        name: &str,
        account: Option<&Account>,
        attempt: FailedAttempt,
        peer: Peer,
    ) -> Result<(), AccountError> {
        self.throttle().failed(name, peer, self.clock.now());
        tracing::warn!("an attempt to sign in failed");
        let account = account.map(|account| &account.account);
        Ok(self.book.failed(account, &AccountEvent::Failed(attempt)).await?)
    }

    fn throttle(&self) -> MutexGuard<'_, Throttle> {
        self.throttle.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn unsaved_uses(&self) -> MutexGuard<'_, HashMap<String, Timestamp>> {
        self.unsaved_uses.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Checks that the names of a `new` account are free. `all` are all accounts.
fn check_new(new: &Account, all: &[Account]) -> Result<(), AccountError> {
    for known in all {
        if known.account == new.account {
            return Err(AccountError::Taken(format!("there is an account '{}' already", new.account)));
        }
        // Signatures show only the display name, so it must be unique.
        if known.display == new.display {
            let text = format!("account '{}' has the display name '{}' already", known.account, known.display);
            return Err(AccountError::Taken(text));
        }
    }
    Ok(())
}

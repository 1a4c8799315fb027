//! Personal accounts: making and changing them, signing in, and the browsers that are signed in. The rules stand in
//! [`crate::trial::account`].

mod error;
mod passphrase;
mod throttle;
mod token;

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::Semaphore;

pub use error::AccountError;
pub use passphrase::{Cost, Passphrase};
pub use throttle::Peer;
pub use token::Token;

use crate::clock::Clock;
use crate::store::{
    AccountBook, AccountEvent, AccountLine, FailedAttempt, PassphraseHash, Reader, Store, StoreError, StoredAccount,
    StoredSignIn,
};
use crate::trial::account::{
    Account, AccountChange, AccountName, AccountRole, IDLE_LIMIT, SIGN_IN_LIMIT, check_change, check_display,
};
use crate::trial::refusal::Refusal;
use throttle::Throttle;

/// A sign-in is noted as used at most so often: each note is a write to the disk.
const NOTED_EVERY: Duration = Duration::from_mins(1);

/// Accounts, and what is done with them. Clone freely.
#[derive(Clone)]
pub struct Accounts {
    book: AccountBook,
    clock: Arc<dyn Clock>,
    cost: Cost,
    throttle: Arc<Mutex<Throttle>>,
    /// One passphrase is hashed at a time: each takes 19 MiB and a core.
    hashing: Arc<Semaphore>,
}

impl Accounts {
    /// Those of the server.
    #[must_use]
    pub fn of_server(store: &Store, clock: Arc<dyn Clock>, cost: Cost) -> Self {
        Self::new(AccountBook::of_server(store, Arc::clone(&clock)), clock, cost)
    }

    /// Those of data folder `folder`, for a command, whether or not a server has it open.
    ///
    /// # Errors
    /// When there is no database, it is not of this version, or it cannot be written.
    pub async fn open(folder: &Path, clock: Arc<dyn Clock>, cost: Cost) -> Result<Self, StoreError> {
        Ok(Self::new(AccountBook::open(folder, Arc::clone(&clock)).await?, clock, cost))
    }

    fn new(book: AccountBook, clock: Arc<dyn Clock>, cost: Cost) -> Self {
        let hashing = Arc::new(Semaphore::new(1));
        Self { book, clock, cost, throttle: Arc::default(), hashing }
    }

    /// For reading.
    #[must_use]
    pub const fn reader(&self) -> &Reader {
        self.book.reader()
    }

    /// Ends its connections where it has its own.
    pub async fn close(&self) {
        self.book.close().await;
    }

    /// All accounts, by name.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn all(&self) -> Result<Vec<Account>, AccountError> {
        Ok(self.reader().accounts().await?)
    }

    /// All accounts, by name, as a lead sees them.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn lines(&self) -> Result<Vec<AccountLine>, AccountError> {
        Ok(self.reader().account_lines().await?)
    }

    /// Makes an account. `by`: the lead who makes it; none for the command line.
    ///
    /// # Errors
    /// When there is one of this name or this display name, or the disk failed.
    pub async fn add(
        &self,
        account: AccountName,
        display: &str,
        role: AccountRole,
        passphrase: Passphrase,
        by: Option<&AccountName>,
    ) -> Result<Account, AccountError> {
        let new = Account { account, display: check_display(display)?, role, disabled: false };
        for known in self.all().await? {
            if known.account == new.account {
                return Err(AccountError::Taken(format!("there is an account '{}' already", new.account)));
            }
            // A signature shows the display name alone.
            if known.display == new.display {
                let text = format!("account '{}' has the display name '{}' already", known.account, known.display);
                return Err(AccountError::Taken(text));
            }
        }

        let hash = self.hash(passphrase).await?;
        self.book.add(&new, &hash, by).await?;
        Ok(new)
    }

    /// Changes an account.
    ///
    /// # Errors
    /// When there is none of this name, it is the last that leads, or the disk failed.
    pub async fn change(
        &self,
        name: &AccountName,
        change: &AccountChange,
        by: Option<&AccountName>,
    ) -> Result<(), AccountError> {
        let all = self.all().await?;
        let account = all.iter().find(|account| account.account == *name);
        let account = account.ok_or_else(|| AccountError::unknown(name, &all))?;
        check_change(account, change, &all)?;
        Ok(self.book.change(name, change, by).await?)
    }

    /// Replaces the passphrase of an account, and ends its sign-ins.
    ///
    /// # Errors
    /// When there is none of this name, or the disk failed.
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

    /// Signs a browser of `peer` in: its token, which is kept nowhere. Replaces the passphrase by `chosen` first, where
    /// there is one.
    ///
    /// # Errors
    /// When name and passphrase do not belong together, the account is disabled, a lead set the passphrase and the
    /// person chose no other, there were too many failed attempts, or the disk failed. The first two have the same
    /// words: nobody can find out who has an account.
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

        match found {
            Some(StoredAccount { account, set_by_another, .. }) if fits && !account.disabled => {
                self.throttle().succeeded(name, peer);
                match chosen {
                    Some(chosen) => self.choose_passphrase(&account.account, passphrase, chosen).await?,
                    None if set_by_another => return Err(AccountError::ChooseAnother),
                    None => {}
                }

                let token = Token::random()?;
                self.book.sign_in(&account.account, &token.sha256()).await?;
                Ok((account, token))
            }
            found => {
                let account = found.map(|found| found.account);
                let attempt = if fits { FailedAttempt::Disabled } else { FailedAttempt::SignIn };
                self.failed(name, account.as_ref(), attempt, peer).await?;
                Err(AccountError::WrongPassphrase)
            }
        }
    }

    /// Replaces the passphrase `before` of whoever is signing in.
    async fn choose_passphrase(
        &self,
        name: &AccountName,
        before: &str,
        chosen: Passphrase,
    ) -> Result<(), AccountError> {
        if chosen.is(before) {
            let text = "the new passphrase is the one before; choose another".to_owned();
            return Err(AccountError::Refused(Refusal::Invalid(text)));
        }
        let hash = self.hash(chosen).await?;
        Ok(self.book.replace_passphrase(name, &hash, Some(name)).await?)
    }

    /// Checks the passphrase of whoever is signed in once more, before something that cannot be undone.
    ///
    /// # Errors
    /// When it is wrong, there were too many failed attempts, or the disk failed.
    pub async fn confirm(&self, account: &Account, passphrase: &str, peer: Peer) -> Result<(), AccountError> {
        let name = account.account.as_str();
        self.wait_for_turn(name, peer).await?;

        let found = self.reader().account(&account.account).await?;
        if self.fits(passphrase, found.as_ref().map(|found| &found.hash)).await? {
            self.throttle().succeeded(name, peer);
            return Ok(());
        }
        self.failed(name, Some(account), FailedAttempt::Confirmation, peer).await?;
        Err(AccountError::WrongConfirmation)
    }

    /// The account that the browser with `token` is signed in to, if it is and that has not expired.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn signed_in(&self, token: &Token) -> Result<Option<Account>, AccountError> {
        let token_sha256 = token.sha256();
        let Some(found) = self.reader().sign_in(&token_sha256).await? else { return Ok(None) };
        let StoredSignIn { account, began, used } = found;

        // A clock that was set back makes nothing last longer.
        let now = self.clock.wall();
        let since = |earlier| now.duration_since(earlier).unsigned_abs();
        if account.disabled || since(began) > SIGN_IN_LIMIT || since(used) > IDLE_LIMIT {
            return Ok(None);
        }

        if since(used) > NOTED_EVERY {
            let book = self.book.clone();
            // Not awaited: whoever wants to stop the lens waits for no disk, and a full one keeps nobody out.
            tokio::spawn(async move {
                if let Err(error) = book.note_use(&token_sha256).await {
                    tracing::warn!("a sign-in's use could not be noted: {error}");
                }
            });
        }
        Ok(Some(account))
    }

    /// Whether the sign-in with `token` was ended, or is too old: what goes on by itself, such as a live view, ends
    /// then. That it was not used for a while ends nothing that goes on.
    ///
    /// # Errors
    /// When the database failed.
    pub async fn has_ended(&self, token: &Token) -> Result<bool, AccountError> {
        let found = self.reader().sign_in(&token.sha256()).await?;
        let now = self.clock.wall();
        let goes_on = |found: StoredSignIn| {
            !found.account.disabled && now.duration_since(found.began).unsigned_abs() <= SIGN_IN_LIMIT
        };
        Ok(!found.is_some_and(goes_on))
    }

    /// Ends the sign-in of the browser with `token`. One that has ended stays so.
    ///
    /// # Errors
    /// When the disk or database failed.
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

    /// Whether `given` is the passphrase of `hash`. Takes as long where there is no account.
    async fn fits(&self, given: &str, hash: Option<&PassphraseHash>) -> Result<bool, AccountError> {
        let given = given.to_owned();
        let hash = hash.cloned();
        let cost = self.cost;
        self.hashing(move || passphrase::fits(&given, hash.as_ref(), cost)).await?
    }

    /// Runs `work` on a thread of its own: it would hold up the streams.
    async fn hashing<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, AccountError> {
        let stopped = || AccountError::Storage("the server was stopped meanwhile; try again".to_owned());
        let _turn = self.hashing.acquire().await.map_err(|_| stopped())?;
        tokio::task::spawn_blocking(work).await.map_err(|_| stopped())
    }

    /// Waits as long as earlier failures ask for.
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

    fn throttle(&self) -> std::sync::MutexGuard<'_, Throttle> {
        self.throttle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

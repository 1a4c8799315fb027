//! `parfocal account`: makes, lists and changes personal accounts, whether or not a server runs.

use std::fmt::Write;
use std::io::{BufRead, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, Subcommand};
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcsetattr};

use super::interrupt::undo_before_the_end;
use super::output::{Failure, print, print_json, wait_for};
use parfocal_base::clock::SystemClock;
use parfocal_base::notices::tell;
use parfocal_records::accounts::{Accounts, Cost, Passphrase};
use parfocal_trial::account::{AccountChange, AccountName, AccountRole};

/// What `parfocal account` does.
#[derive(Debug, Subcommand)]
pub enum Action {
    /// Make an account. Asks for its passphrase, or reads it from standard input.
    Add(Add),
    /// List the accounts.
    List(List),
    /// Change what a person may do.
    Role {
        #[command(flatten)]
        named: NamedAccount,
        /// lead, operator, researcher or monitor.
        #[arg(value_parser = role)]
        role: AccountRole,
    },
    /// Replace a passphrase, and end all sign-ins of the account. Asks for it, or reads it from standard input.
    Passphrase(NamedAccount),
    /// Stop a person from signing in, and end all sign-ins of the account.
    Disable(NamedAccount),
    /// Let a person sign in again.
    Enable(NamedAccount),
    /// End all sign-ins of an account.
    SignOut(NamedAccount),
}

#[derive(Debug, Args)]
pub struct Add {
    #[command(flatten)]
    named: NamedAccount,
    /// What the person may do: lead, operator, researcher or monitor.
    #[arg(long, value_name = "ROLE", value_parser = role)]
    role: AccountRole,
    /// The person's name as it appears in signatures; the account's name by default.
    #[arg(long, value_name = "TEXT")]
    display: Option<String>,
}

#[derive(Debug, Args)]
pub struct NamedAccount {
    /// Name of the account: lower-case letters, digits, dots and dashes.
    #[arg(value_parser = name)]
    account: AccountName,
    #[command(flatten)]
    folder: Folder,
}

#[derive(Debug, Args)]
pub struct List {
    #[command(flatten)]
    folder: Folder,
    /// Print them as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
struct Folder {
    /// Folder of the server's database.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
}

fn name(text: &str) -> Result<AccountName, String> {
    AccountName::new(text).map_err(|error| error.to_string())
}

fn role(text: &str) -> Result<AccountRole, String> {
    AccountRole::named(text).ok_or_else(|| {
        let all = AccountRole::ALL.map(AccountRole::name).join(", ");
        format!("there is no role '{text}'; there are: {all}")
    })
}

/// Does what the arguments say.
///
/// # Errors
/// If there is no database, the passphrase is too short, or the account rules refuse the change.
pub fn run(action: &Action) -> Result<(), Failure> {
    wait_for(async {
        match action {
            Action::Add(add) => self::add(add).await,
            Action::List(list) => self::list(list).await,
            Action::Role { named, role } => change(named, &AccountChange::Role(*role)).await,
            Action::Passphrase(named) => replace_passphrase(named).await,
            Action::Disable(named) => change(named, &AccountChange::Disable).await,
            Action::Enable(named) => change(named, &AccountChange::Enable).await,
            Action::SignOut(named) => change(named, &AccountChange::SignOut).await,
        }
    })?
}

async fn add(add: &Add) -> Result<(), Failure> {
    let accounts = open(&add.named.folder.data_dir).await?;
    let account = add.named.account.clone();
    let display = add.display.clone().unwrap_or_else(|| account.to_string());

    let made = accounts.add(account, &display, add.role, ask()?, None).await?;
    finish(&accounts, &format!("account {} ({}): {}", made.account, made.display, made.role)).await
}

async fn list(list: &List) -> Result<(), Failure> {
    let accounts = open(&list.folder.data_dir).await?;
    let all = accounts.all().await?;
    if list.json {
        return print_json(&all);
    }
    if all.is_empty() {
        return print("no accounts yet\n");
    }

    let mut text = String::new();
    for account in all {
        let disabled = if account.disabled { ", disabled" } else { "" };
        let _ = writeln!(text, "{} ({}): {}{disabled}", account.account, account.display, account.role);
    }
    print(&text)
}

async fn change(named: &NamedAccount, change: &AccountChange) -> Result<(), Failure> {
    let accounts = open(&named.folder.data_dir).await?;
    accounts.change(&named.account, change, None).await?;

    let account = &named.account;
    let done = match change {
        AccountChange::Role(role) => format!("account {account} has the role {role} now"),
        AccountChange::Disable => format!("account {account} is disabled; all its sign-ins have ended"),
        AccountChange::Enable => format!("account {account} may sign in again"),
        AccountChange::SignOut => format!("all sign-ins of account {account} have ended"),
    };
    finish(&accounts, &done).await
}

async fn replace_passphrase(named: &NamedAccount) -> Result<(), Failure> {
    let accounts = open(&named.folder.data_dir).await?;
    accounts.replace_passphrase(&named.account, ask()?, None).await?;
    finish(&accounts, &format!("account {} has another passphrase; all its sign-ins have ended", named.account)).await
}

async fn open(folder: &Path) -> Result<Accounts, Failure> {
    Ok(Accounts::open(folder, Arc::new(SystemClock), Cost::default()).await?)
}

/// Prints what was done, with the chain's head.
async fn finish(accounts: &Accounts, done: &str) -> Result<(), Failure> {
    let head = accounts.reader().head().await?;
    accounts.close().await;
    print(&format!("{done}\nchain {head}\n"))
}

/// Reads the passphrase: twice from a terminal, otherwise the first line of standard input.
fn ask() -> Result<Passphrase, Failure> {
    let first = line("passphrase (10 characters or more; 15 are recommended): ")?;
    let passphrase = Passphrase::new(&first)?;
    if std::io::stdin().is_terminal() && line("repeat the passphrase: ")? != first {
        bail!("the two passphrases differ; nothing was changed; try again");
    }
    Ok(passphrase)
}

/// A line of standard input, not shown on a terminal.
fn line(prompt: &str) -> Result<String, Failure> {
    let stdin = std::io::stdin();
    let mut line = String::new();
    if stdin.is_terminal() {
        // Hide the input before prompting, so that text typed ahead is not shown either.
        let hidden = HiddenInput::begin()?;
        tell(format_args!("{prompt}"));
        let read = stdin.lock().read_line(&mut line);
        drop(hidden);
        read?;
    } else {
        stdin.lock().read_line(&mut line).map_err(|error| format!("cannot read the passphrase: {error}"))?;
    }

    Ok(line.trim_end_matches(['\r', '\n']).to_owned())
}

/// Hides what is typed on the terminal, until it is dropped.
#[must_use]
struct HiddenInput {
    before: Termios,
}

impl HiddenInput {
    fn begin() -> Result<Self, Failure> {
        let before = tcgetattr(std::io::stdin())?;
        // Ctrl-C must not leave a terminal on which nothing is shown any more.
        let shown = before.clone();
        undo_before_the_end(move || {
            let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, &shown);
        })?;

        let mut silent = before.clone();
        silent.local_modes.remove(LocalModes::ECHO);
        tcsetattr(std::io::stdin(), OptionalActions::Now, &silent)?;
        Ok(Self { before })
    }
}

impl Drop for HiddenInput {
    fn drop(&mut self) {
        let _ = tcsetattr(std::io::stdin(), OptionalActions::Now, &self.before);
    }
}

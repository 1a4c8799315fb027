//! Personal accounts: making and changing them, signing in, and the account names beside records.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::net::{IpAddr, Ipv4Addr};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};
use std::time::Duration;

use parfocal_records::accounts::{AccountError, Cost, Passphrase, Token};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::verify;
use parfocal_records::store::{Access, AccessLog, AccountBook, verify_database};
use parfocal_trial::account::{AccountChange, AccountName, AccountRole, Actor};
use parfocal_trial::action::Action;
use parfocal_trial::role::Role;
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, tcgetattr};

use crate::chain::{after, said};
use crate::exports::{failed, rows};
use crate::fixture::{PARTICIPANT, PASSPHRASE, Trial};

const PEER: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

fn name(text: &str) -> AccountName {
    AccountName::new(text).unwrap()
}

#[tokio::test]
async fn accounts_are_made_and_changed_and_somebody_always_leads() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    let lead = trial.account("a.turing", AccountRole::Lead, "Dr Alan Turing").await;

    let passphrase = || Passphrase::new(PASSPHRASE).unwrap();
    for (taken, display) in [("a.turing", "Another"), ("another", "Dr Alan Turing")] {
        let refused = accounts.add(name(taken), display, AccountRole::Operator, passphrase(), None).await;
        assert!(matches!(&refused, Err(AccountError::Taken(_))), "{taken}: {refused:?}");
    }
    let refused = accounts.add(name("b"), " ", AccountRole::Operator, passphrase(), None).await;
    assert!(matches!(refused, Err(AccountError::Refused(_))));

    for change in [AccountChange::Disable, AccountChange::Role(AccountRole::Monitor)] {
        let refused = accounts.change(&lead.account, &change, None).await.unwrap_err();
        assert!(refused.to_string().contains("the last lead who can sign in"), "{refused}");
    }
    trial.account("g.hopper", AccountRole::Lead, "Dr Grace Hopper").await;
    accounts.change(&lead.account, &AccountChange::Role(AccountRole::Monitor), None).await.unwrap();
    assert_eq!(accounts.all().await.unwrap()[0].role, AccountRole::Monitor);

    let unknown = accounts.change(&name("nobody"), &AccountChange::Disable, None).await.unwrap_err();
    assert_eq!(unknown.to_string(), "there is no account 'nobody'; there are: a.turing, g.hopper");
}

#[tokio::test]
async fn of_two_leads_who_disable_each_other_at_the_same_moment_one_stays() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    let one = trial.account("a.turing", AccountRole::Lead, "Dr Alan Turing").await;
    let other = trial.account("g.hopper", AccountRole::Lead, "Dr Grace Hopper").await;

    let (first, second) = tokio::join!(
        accounts.change(&one.account, &AccountChange::Disable, Some(&other.account)),
        accounts.change(&other.account, &AccountChange::Disable, Some(&one.account)),
    );
    assert_ne!(first.is_ok(), second.is_ok(), "{first:?} {second:?}");
    assert_eq!(accounts.all().await.unwrap().iter().filter(|account| account.disabled).count(), 1);
}

#[tokio::test]
async fn two_leads_who_make_the_same_account_at_the_same_moment_make_one() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    let make = |account: &str| {
        let passphrase = Passphrase::new(PASSPHRASE).unwrap();
        accounts.add(name(account), "Nurse Op", AccountRole::Operator, passphrase, None)
    };
    let (first, second) = tokio::join!(make("op"), make("nurse"));
    let refused = first.err().or(second.err());
    assert!(matches!(&refused, Some(AccountError::Taken(said)) if said.contains("'Nurse Op' already")), "{refused:?}");
}

#[tokio::test]
async fn a_sign_in_lasts_until_it_is_ended_or_expires() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;
    let operator = trial.account("operator", AccountRole::Operator, "Nurse Op").await;
    let sign_in = async || accounts.sign_in("operator", PASSPHRASE, None, PEER).await.unwrap().1;
    let is_in = async |token: &Token| accounts.signed_in(token).await.unwrap().is_some();

    let token = sign_in().await;
    let other = sign_in().await;
    assert_eq!(accounts.signed_in(&token).await.unwrap(), Some(operator.clone()));
    accounts.sign_out(&token).await.unwrap();
    assert!(!is_in(&token).await && is_in(&other).await, "one browser signed out, not the other");

    // Each of these ends all sign-ins of the account at once.
    for change in [AccountChange::SignOut, AccountChange::Disable] {
        let token = sign_in().await;
        accounts.change(&operator.account, &change, None).await.unwrap();
        assert!(!is_in(&token).await, "{change:?}");
    }
    let refused = accounts.sign_in("operator", PASSPHRASE, None, PEER).await.err();
    assert_eq!(refused, Some(AccountError::WrongPassphrase), "disabled");
    accounts.change(&operator.account, &AccountChange::Enable, None).await.unwrap();
    let token = sign_in().await;
    let another = Passphrase::new("another passphrase").unwrap();
    accounts.replace_passphrase(&operator.account, another, None).await.unwrap();
    assert!(!is_in(&token).await);
    let token = accounts.sign_in("operator", "another passphrase", None, PEER).await.unwrap().1;

    trial.clock.advance(Duration::from_mins(59));
    assert!(is_in(&token).await);
    trial.clock.advance(Duration::from_hours(13));
    assert!(!is_in(&token).await, "unused");
    trial.clock.set_wall("2026-02-28T09:00:00Z".parse().unwrap());
    assert!(!is_in(&token).await, "a clock set back makes nothing last longer");
}

#[tokio::test]
async fn who_goes_on_working_stays_signed_in_though_the_disk_takes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    let operator = trial.account("operator", AccountRole::Operator, "Nurse Op").await;
    let token = accounts.sign_in("operator", PASSPHRASE, None, PEER).await.unwrap().1;

    // Nothing can be written while another program holds the right to write.
    let pool = crate::storage::raw(folder.path()).await;
    let mut other = pool.acquire().await.unwrap();
    sqlx::query("BEGIN IMMEDIATE").execute(&mut *other).await.unwrap();
    for _ in 0..3 {
        trial.clock.advance(Duration::from_mins(50));
        assert_eq!(accounts.signed_in(&token).await.unwrap(), Some(operator.clone()));
    }
    trial.clock.advance(Duration::from_mins(61));
    assert_eq!(accounts.signed_in(&token).await.unwrap(), None, "unused");
}

#[tokio::test]
async fn whatever_is_wrong_has_the_same_words_and_is_recorded_without_them() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;

    let mut errors = Vec::new();
    for (name, passphrase) in [("lead", "a wrong secret 1"), ("nobody", PASSPHRASE), ("not a name!", "secret-as-name")]
    {
        errors.push(accounts.sign_in(name, passphrase, None, PEER).await.err().unwrap());
    }
    assert_eq!(errors, vec![AccountError::WrongPassphrase; 3]);
    let (_, token) = accounts.sign_in("lead", PASSPHRASE, None, PEER).await.unwrap();
    let lead = accounts.signed_in(&token).await.unwrap().unwrap();
    let refused = accounts.confirm(&lead, "a wrong secret 2", PEER).await;
    assert_eq!(refused, Err(AccountError::WrongConfirmation));
    accounts.confirm(&lead, PASSPHRASE, PEER).await.unwrap();

    let pool = crate::storage::raw(folder.path()).await;
    let sql = "SELECT coalesce(account, '-') || ' ' || kind || ' ' || coalesce(detail, '-') FROM account_events";
    let recorded: Vec<String> = sqlx::query_scalar(sql).fetch_all(&pool).await.unwrap();
    pool.close().await;
    assert_eq!(
        recorded,
        [
            "lead added lead",
            "lead attempt-failed sign-in",
            "- attempt-failed sign-in",
            "- attempt-failed sign-in",
            "lead signed-in -",
            "lead attempt-failed confirmation"
        ]
    );

    // The database's files contain neither passphrases nor tokens.
    trial.store.close().await;
    for entry in std::fs::read_dir(folder.path()).unwrap() {
        let bytes = std::fs::read(entry.unwrap().path()).unwrap();
        for secret in [PASSPHRASE, "a wrong secret", "secret-as-name", "not a name!", token.as_str()] {
            assert!(!bytes.windows(secret.len()).any(|window| window == secret.as_bytes()), "{secret}");
        }
    }
}

#[tokio::test]
async fn a_passphrase_that_is_replaced_or_disabled_while_it_is_checked_signs_nobody_in() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let accounts = trial.accounts();
    trial.account("lead", AccountRole::Lead, "Dr Lead").await;
    let operator = trial.account("operator", AccountRole::Operator, "Nurse Op").await.account;

    let book = AccountBook::of_server(&trial.store, trial.clock.clone());
    let reader = trial.store.reader();
    let checked = reader.account(&operator).await.unwrap().unwrap();
    let another = Passphrase::new("another one of hers").unwrap();
    accounts.replace_passphrase(&operator, another, Some(&name("lead"))).await.unwrap();
    assert!(!book.sign_in(&checked, None, "token").await.unwrap());
    assert!(!book.sign_in(&checked, Some(&checked.hash), "token").await.unwrap());
    assert!(reader.account(&operator).await.unwrap().unwrap() != checked, "the lead's passphrase stays");

    let checked = reader.account(&operator).await.unwrap().unwrap();
    accounts.change(&operator, &AccountChange::Disable, None).await.unwrap();
    assert!(!book.sign_in(&checked, None, "token").await.unwrap());
    assert_eq!(reader.sign_in("token").await.unwrap(), None);

    accounts.change(&operator, &AccountChange::Enable, None).await.unwrap();
    assert!(book.sign_in(&checked, None, "token").await.unwrap());
    assert_eq!(reader.sign_in("token").await.unwrap().unwrap().account.account, operator);
}

#[tokio::test]
async fn the_production_parameters_hash_and_a_hash_keeps_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let costly = parfocal_records::accounts::Accounts::of_server(&trial.store, trial.clock.clone(), Cost::default());
    let passphrase = Passphrase::new(PASSPHRASE).unwrap();
    costly.add(name("lead"), "Dr Lead", AccountRole::Lead, passphrase, None).await.unwrap();
    trial.accounts().sign_in("lead", PASSPHRASE, None, PEER).await.unwrap();

    let pool = crate::storage::raw(folder.path()).await;
    let cost: (i64, i64) = sqlx::query_as("SELECT memory_kib, passes FROM accounts").fetch_one(&pool).await.unwrap();
    assert_eq!(cost, (19 * 1024, 2), "OWASP's first choice for argon2id");
}

/// Makes a session with an operator and a researcher who are signed in.
async fn a_session(trial: &mut Trial) -> parfocal_base::ids::SessionId {
    let operator = trial.account("operator", AccountRole::Operator, "Nurse Op").await;
    let researcher = trial.account("researcher", AccountRole::Researcher, "Dr Search").await;
    let operator = Actor { role: Role::Operator, account: Some(operator.account) };
    let researcher = Actor { role: Role::Researcher, account: Some(researcher.account) };

    let session = trial.conductor.create(operator.clone(), PARTICIPANT, "paper", None).await.unwrap();
    trial.conductor.act(operator.clone(), session, Action::Start).await.unwrap();
    trial.whole_setting().await;
    // An abort stops the lens first, and is recorded after that.
    let abort = Action::Abort { reason: "the light failed".to_owned() };
    trial.conductor.act(operator, session, abort).await.unwrap();
    let access_log = AccessLog::of_server(&trial.store, researcher, trial.clock.clone());
    access_log.record(&Access::PathViewed(session)).await.unwrap();
    session
}

#[tokio::test]
async fn records_name_the_account_that_made_them_in_the_log_and_in_exports() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = a_session(&mut trial).await;

    let detail = trial.reports.session_detail(session).await.unwrap();
    let by = |text: &str| detail.log.iter().find(|line| line.text.starts_with(text)).unwrap().account.clone();
    assert_eq!(by("Session made").as_deref(), Some("operator"));
    assert_eq!(by("Session aborted").as_deref(), Some("operator"));
    assert_eq!(by("Setting 1 started"), None, "the surgeon has no account");

    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let actors = rows(&out, "actors");
    let told: Vec<_> = actors.iter().map(|row| [row["kind"].as_str(), row["display"].as_str()]).collect();
    assert_eq!(
        told,
        [["event", "Nurse Op"], ["event", "Nurse Op"], ["event", "Nurse Op"], ["access", "Dr Search"]],
        "made, started, aborted, looked at"
    );
    assert_eq!(failed(&verify(&out, None)), [""; 0]);

    let file = out.join("actors.csv");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("Nurse Op", "Nurse Other", 1)).unwrap();
    let checks = verify(&out, None);
    let found = said(&checks, "chain").unwrap_err();
    assert!(found.contains("actors: actor 1 was changed"), "{found}");
}

/// SQL that tampers with a database, and the text that the chain's check must report.
const TAMPERED: [(&str, &str); 5] = [
    ("UPDATE actors SET account = 'researcher' WHERE number = 1", "actors: actor 1 was changed"),
    ("DELETE FROM actors WHERE number = 3", "actors: actor 3 is missing"),
    ("UPDATE account_events SET kind = 'signed-out' WHERE number = 3", "account-event 3 was changed"),
    ("DELETE FROM account_events WHERE number = 4", "account-event 4 is missing"),
    (
        "INSERT INTO account_events (wall, account, kind) VALUES ('2026-03-01T09:00:00Z', 'operator', 'signed-in')",
        "account-event 5 was inserted",
    ),
];

#[tokio::test]
async fn whatever_is_changed_of_accounts_in_a_database_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    a_session(&mut trial).await;
    trial.accounts().sign_in("operator", PASSPHRASE, None, PEER).await.unwrap();
    trial.accounts().sign_in("operator", "wrong one here", None, PEER).await.err().unwrap();
    trial.store.close().await;
    drop(trial);

    assert_eq!(failed(&verify_database(folder.path(), None).await.unwrap()), [""; 0]);
    let database = folder.path().join("parfocal.db");
    for (sql, expected) in TAMPERED {
        let checks = after(&database, sql, None).await;
        let found = said(&checks, "chain").expect_err(sql);
        assert!(found.contains(expected), "{sql}: {found}");
    }
}

#[tokio::test]
async fn a_passphrase_that_is_not_typed_to_its_end_leaves_a_terminal_that_shows_what_is_typed() {
    let folder = tempfile::tempdir().unwrap();
    Trial::start(folder.path()).await.store.close().await;

    let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&controller).unwrap();
    unlockpt(&controller).unwrap();
    let path = ptsname(&controller, Vec::new()).unwrap().into_string().unwrap();
    let terminal = File::options().read(true).write(true).custom_flags(libc::O_NOCTTY).open(path).unwrap();
    let shows = || tcgetattr(&terminal).unwrap().local_modes.contains(LocalModes::ECHO);
    assert!(shows());

    let mut command = Command::new(env!("CARGO_BIN_EXE_parfocal"));
    command.args(["account", "add", "a.turing", "--role", "lead", "--data-dir"]).arg(folder.path());
    command.stdin(terminal.try_clone().unwrap()).stderr(Stdio::piped());
    let mut process = command.spawn().unwrap();
    let mut asked = String::new();
    BufReader::new(process.stderr.take().unwrap()).read_line(&mut asked).unwrap();
    assert!(asked.contains("passphrase") && !shows(), "{asked}");

    kill_process(Pid::from_child(&process), Signal::INT).unwrap();
    assert_eq!(process.wait().unwrap().signal(), Some(Signal::INT.as_raw()));
    assert!(shows());
}

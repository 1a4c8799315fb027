//! The chain: every change, removal, insertion and reordering in a database file or an export is found and named.

use std::path::{Path, PathBuf};
use std::process::Command;

use parfocal_base::clock::Clock;
use parfocal_base::ids::SessionId;
use parfocal_records::store::backup::{BackupError, Relation, backup, restore};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::{Check, Verdict, verify};
use parfocal_records::store::{
    Access, DeviceEvent, Head, MIGRATOR, Reader, Store, StoreError, look_at_database, verify_database,
};
use serde_json::Value;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};

use crate::exports::{failed, with_session};
use crate::fixture::{Trial, a_clock, a_run};

/// Makes a database with a record of every kind, which no server has open. Returns the session and the chain's head.
async fn a_database(folder: &Path) -> (SessionId, Head) {
    let (trial, session) = with_session(folder).await;
    for number in 1..=2 {
        let message = format!("was unplugged {number}");
        let at = trial.clock.now();
        let event = DeviceEvent { wall: trial.clock.wall(), at, device: "camera".to_owned(), working: false, message };
        trial.store.device_event(&event).await.unwrap();
    }
    trial.access_log().record(&Access::Entered).await.unwrap();
    trial.access_log().record(&Access::PathViewed(session)).await.unwrap();
    trial.unblind(session).await;
    let head = trial.store.reader().head().await.unwrap();
    trial.store.close().await;
    (session, head)
}

/// Opens a database as the owner of the file can: without the triggers and constraints that prevent changes.
async fn opened_by_its_owner(file: &Path) -> SqlitePool {
    let options = SqliteConnectOptions::new().filename(file).foreign_keys(false);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    let triggers: Vec<String> =
        sqlx::query_scalar("SELECT name FROM sqlite_schema WHERE type = 'trigger'").fetch_all(&pool).await.unwrap();
    for trigger in triggers {
        sqlx::query(sqlx::AssertSqlSafe(format!("DROP TRIGGER {trigger}"))).execute(&pool).await.unwrap();
    }
    pool
}

pub fn said(checks: &[Check], name: &str) -> Result<String, String> {
    match &checks.iter().find(|check| check.name == name).unwrap().verdict {
        Verdict::Passed(said) => Ok(said.clone()),
        Verdict::Failed(said) | Verdict::NotChecked(said) => Err(said.clone()),
    }
}

/// The verification's result for a copy of `database` on which `sql` was run.
pub async fn after(database: &Path, sql: &str, head: Option<&Head>) -> Vec<Check> {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.db");
    std::fs::copy(database, &copy).unwrap();
    let pool = opened_by_its_owner(&copy).await;
    sqlx::raw_sql(sqlx::AssertSqlSafe(sql.to_owned())).execute(&pool).await.unwrap_or_else(|error| {
        panic!("{sql}: {error}");
    });
    pool.close().await;
    verify_database(&copy, head.cloned()).await.unwrap()
}

/// SQL that tampers with a database, and the text that verification must report.
const TAMPERED: [(&str, &str); 47] = [
    ("UPDATE runs SET camera = 'another'", "runs: run 1 was changed"),
    ("UPDATE runs SET weights = '{}'", "runs: run 1 was changed"),
    ("UPDATE runs SET seed = 7", "runs: run 1 was changed"),
    (
        "INSERT INTO runs (wall, monotonic_ns, version, camera, lens, calibration, weights)
         VALUES ('', 0, '', '', '', '', '{}')",
        "run 2 was inserted",
    ),
    ("DELETE FROM runs", "runs: run 1 is missing"),
    ("UPDATE participants SET wall = '2020-01-01T00:00:00Z'", "participants: participant S-01 was changed"),
    ("INSERT INTO participants VALUES ('S-99', '2020-01-01T00:00:00Z')", "participant S-99 was inserted"),
    ("DELETE FROM participants", "participants: participant S-01 is missing"),
    ("UPDATE sessions SET practice = 1", "sessions: session"),
    ("UPDATE sessions SET monotonic_ns = 1", "sessions: session"),
    ("UPDATE sessions SET commitment = 'x'", "sessions: session"),
    ("DELETE FROM sessions", "sessions: session"),
    (
        "UPDATE segments SET setting = 100 WHERE setting = 2; UPDATE segments SET setting = 2 WHERE setting = 3;
         UPDATE segments SET setting = 3 WHERE setting = 100",
        "sessions: session",
    ),
    ("DELETE FROM segments WHERE setting = 6", "sessions: session"),
    ("UPDATE events SET wall = '2020-01-01T00:00:00Z' WHERE number = 3", "/3 was changed"),
    ("UPDATE events SET role = 'operator' WHERE number = 4", "/4 was changed"),
    ("UPDATE events SET payload = json_set(payload, '$.inspected_ms', 1) WHERE number = 4", "/4 was changed"),
    ("UPDATE events SET payload = json_set(payload, '$.kind', 'resumed') WHERE number = 5", "/5 was changed"),
    ("UPDATE events SET payload = json_set(payload, '$.reason', 'x') WHERE kind = 'unblinded'", "events: event"),
    ("DELETE FROM events WHERE number = 6", "/6 is missing"),
    (
        "INSERT INTO events SELECT session, 99, run, wall, monotonic_ns, role, kind, payload FROM events
         WHERE number = 1",
        "/99 was inserted",
    ),
    (
        "UPDATE events SET number = 100 WHERE number = 3; UPDATE events SET number = 3 WHERE number = 4;
         UPDATE events SET number = 4 WHERE number = 100",
        "/3 was changed",
    ),
    ("UPDATE comments SET text = 'sharper' WHERE number = 2", "comments: comment"),
    ("UPDATE comments SET late = 1 WHERE number = 2", "comments: comment"),
    ("UPDATE comments SET segment = NULL WHERE number = 2", "comments: comment"),
    ("DELETE FROM comments WHERE number = 6", "is missing"),
    (
        "INSERT INTO comments (key, session, run, wall, monotonic_ns, late, kind)
         SELECT 'k', session, run, wall, 1, 0, 'mark' FROM comments LIMIT 1",
        "comments: comment k was inserted",
    ),
    (
        "UPDATE comments SET number = 100 WHERE number = 2; UPDATE comments SET number = 2 WHERE number = 3;
         UPDATE comments SET number = 3 WHERE number = 100",
        "is not in the order in which it was kept",
    ),
    ("UPDATE answers SET value = '1' WHERE number = 1", "answers: answer"),
    ("UPDATE answers SET question = 'other' WHERE number = 1", "answers: answer"),
    ("DELETE FROM answers WHERE number = 1", "is missing"),
    (
        "INSERT INTO answers (key, session, question, value, run, wall, monotonic_ns, late)
         SELECT 'k', session, question, value, run, wall, 1, 0 FROM answers LIMIT 1",
        "answers: answer k was inserted",
    ),
    ("UPDATE device_events SET message = 'fine' WHERE number = 1", "devices: device 1 was changed"),
    ("DELETE FROM device_events WHERE number = 2", "devices: device 2 is missing"),
    ("UPDATE accesses SET kind = 'entered' WHERE number = 2", "accesses: access 2 was changed"),
    ("DELETE FROM accesses WHERE number = 2", "accesses: access 2 is missing"),
    ("UPDATE telemetry SET asked = 0.36 WHERE frame = 15", "telemetry: steps 1 to 10 of segment"),
    ("UPDATE telemetry SET metric = 12.6 WHERE frame = 15", "telemetry: steps 1 to 10 of segment"),
    ("UPDATE policies SET name = 'cnn-learned'", "telemetry: steps 1 to 10 of segment"),
    ("DELETE FROM telemetry WHERE frame = 15", "9 are there"),
    (
        "UPDATE telemetry SET number = 1000 WHERE frame = 15; UPDATE telemetry SET number = 1001 WHERE frame = 16",
        "telemetry: steps 1 to 10 of segment",
    ),
    ("UPDATE chain SET wall = '2020-01-01T00:00:00Z' WHERE number = 5", "chain: row 5"),
    ("UPDATE chain SET previous = hash WHERE number = 5", "chain: row 5"),
    ("DELETE FROM chain WHERE number = 5", "chain: row 5 is missing"),
    (
        "UPDATE chain SET number = 1000 WHERE number = 5; UPDATE chain SET number = 5 WHERE number = 6;
         UPDATE chain SET number = 6 WHERE number = 1000",
        "chain: row 5",
    ),
    ("UPDATE chain_salts SET salt = '00' WHERE number = 1", "runs: run 1 was changed"),
    ("DELETE FROM chain_salts WHERE number = 1", "runs: run 1: its salt is missing"),
];

#[tokio::test]
async fn whatever_is_changed_in_a_database_is_found_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let (_, head) = a_database(folder.path()).await;
    let checks = verify_database(folder.path(), Some(head.clone())).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert!(said(&checks, "chain").unwrap().contains(&head.to_string()));

    let database = folder.path().join("parfocal.db");
    for (sql, expected) in TAMPERED {
        let checks = after(&database, sql, None).await;
        let wrong = said(&checks, "chain").expect_err(sql);
        assert!(wrong.contains(expected), "{sql}: {wrong}");
    }

    // The chain does not cover these fields, so that it cannot unblind anything. The commitment covers them.
    for sql in [
        "UPDATE segments SET policy = 'fixed' WHERE setting = 2",
        "UPDATE sessions SET seed = printf('%064d', 1)",
        "UPDATE sessions SET set_index = 1",
        "UPDATE sessions SET protocol_toml = protocol_toml || ' '",
    ] {
        let checks = after(&database, sql, None).await;
        assert!(said(&checks, "commitments").expect_err(sql).contains("sessions: session"), "{sql}");
    }
}

#[tokio::test]
async fn a_head_that_was_noted_tells_of_what_was_cut_off_or_written_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (_, head) = a_database(folder.path()).await;
    let database = folder.path().join("parfocal.db");

    // Removes the latest event and its row in the chain.
    let cut = "DELETE FROM events WHERE kind = 'unblinded'; DELETE FROM chain_salts WHERE number = (SELECT max(number) \
               FROM chain); DELETE FROM chain WHERE number = (SELECT max(number) FROM chain)";
    assert_eq!(failed(&after(&database, cut, None).await), [""; 0], "nobody else knows that there was more");
    let wrong = said(&after(&database, cut, Some(&head)).await, "chain").unwrap_err();
    assert!(wrong.contains("cut off") && wrong.contains(&head.to_string()), "{wrong}");

    let earlier = Head { number: 3, hash: head.hash.clone() };
    let wrong = said(&after(&database, "SELECT 1", Some(&earlier)).await, "chain").unwrap_err();
    assert!(wrong.contains("row 3") && wrong.contains("the history up to it is not the one of that head"), "{wrong}");
}

#[tokio::test]
async fn steps_put_at_the_end_of_an_old_session_are_found() {
    let folder = tempfile::tempdir().unwrap();
    a_database(folder.path()).await;
    let mut trial = Trial::start(folder.path()).await;
    trial.whole_session("practice").await;
    trial.store.close().await;
    let more = "INSERT INTO telemetry (run, frame, exposed_ns, segment, asked, policy_micros, latency_micros,
            patch_x, patch_y)
        SELECT run, 999, exposed_ns, segment, 0.5, 1, 1, 240, 120 FROM telemetry WHERE segment = 2 LIMIT 1";
    let wrong = said(&after(&folder.path().join("parfocal.db"), more, None).await, "chain").unwrap_err();
    assert!(wrong.contains("telemetry: 1 steps of segment") && wrong.contains("inserted"), "{wrong}");
}

/// The verification's result for the export in `out` with `file` changed by `change`. Restores the file.
fn with_changed(out: &Path, file: &str, change: impl FnOnce(&str) -> String) -> Result<String, String> {
    let path = out.join(file);
    let before = std::fs::read_to_string(&path).unwrap();
    let changed = change(&before);
    assert_ne!(changed, before, "{file}");
    std::fs::write(&path, changed).unwrap();
    let checks = verify(out, None);
    std::fs::write(&path, before).unwrap();
    said(&checks, "chain")
}

/// A CSV file with each row replaced by the result of `keep`, which may change or drop it. Row 0 is the header.
fn by_rows(text: &str, mut keep: impl FnMut(usize, Vec<String>) -> Option<Vec<String>>) -> String {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text.as_bytes());
    let mut writer = csv::Writer::from_writer(Vec::new());
    for (number, row) in reader.records().enumerate() {
        let row = row.unwrap().iter().map(str::to_owned).collect();
        if let Some(row) = keep(number, row) {
            writer.write_record(row).unwrap();
        }
    }
    String::from_utf8(writer.into_inner().unwrap()).unwrap()
}

#[tokio::test]
async fn whatever_is_changed_in_an_export_is_found_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let (session, _) = a_database(folder.path()).await;
    let mut trial = Trial::start(folder.path()).await;
    let other = trial.whole_session("practice").await;
    let out = folder.path().join("export");
    let summary = export(&trial.access_log(), session, &out, true).await.unwrap();

    let head: Head = summary.head.parse().unwrap();
    assert_eq!(failed(&verify(&out, Some(&head))), [""; 0]);
    let wrong = Head { number: head.number, hash: "0".repeat(32) };
    assert_eq!(failed(&verify(&out, Some(&wrong))), ["chain"]);
    let later = Head { number: head.number + 1, ..head };
    assert!(said(&verify(&out, Some(&later)), "chain").unwrap_err().contains("is not in here"));

    // The export contains nothing but hashes of the other session.
    let chain = std::fs::read_to_string(out.join("chain.csv")).unwrap();
    assert!(!chain.contains(&other.to_string()) && !chain.contains("S-01"));

    // Changes the first row of each table in each column that is hashed, and then removes the row.
    for (file, columns) in [
        ("runs.csv", vec!["wall", "version", "camera"]),
        ("sessions.csv", vec!["participant", "practice", "commitment"]),
        ("segments.csv", vec!["segment"]),
        ("events.csv", vec!["wall", "role", "kind"]),
        ("comments.csv", vec!["text", "frame", "late", "kind"]),
        ("answers.csv", vec!["given_value", "question", "wall"]),
        ("devices.csv", vec!["message", "working"]),
        ("accesses.csv", vec!["role", "kind"]),
        ("telemetry.csv", vec!["asked", "exposed_ns", "held"]),
        ("policy_steps.csv", vec!["policy", "metric"]),
        ("chain.csv", vec!["wall", "content", "salt", "sealed", "hash", "entry", "key"]),
    ] {
        for column in columns {
            let mut place = None;
            let changed = with_changed(&out, file, |text| {
                by_rows(text, |number, mut row| {
                    place = place.or_else(|| row.iter().position(|name| name == column));
                    if number == 1 {
                        row[place.unwrap()] += "1";
                    }
                    Some(row)
                })
            });
            assert!(changed.is_err(), "{file}, {column}: {changed:?}");
        }

        let gone = with_changed(&out, file, |text| by_rows(text, |number, row| (number != 1).then_some(row)));
        assert!(gone.is_err(), "{file}: {gone:?}");
    }

    let gone = with_changed(&out, "comments.csv", |text| by_rows(text, |number, row| (number != 2).then_some(row)));
    assert!(
        gone.as_ref().is_err_and(|said| said.contains("comments: comment") && said.contains("missing")),
        "{gone:?}"
    );

    // Makes the comments' rows look like rows of another session, which have only a number and hashes.
    let hidden = with_changed(&out, "chain.csv", |text| {
        by_rows(text, |_, mut row| {
            if row[4] == "comment" {
                row[3..].fill(String::new());
            }
            Some(row)
        })
    });
    assert!(hidden.as_ref().is_err_and(|said| said.contains("row of session")), "{hidden:?}");

    // Cuts off the last row.
    let last = chain.lines().count() - 1;
    let cut = with_changed(&out, "chain.csv", |text| by_rows(text, |number, row| (number != last).then_some(row)));
    assert!(cut.is_err(), "{cut:?}");
}

pub fn recomputed(out: &Path) -> Result<Value, String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/trial/recompute_chain.py");
    let output = Command::new("python3").arg(script).arg(out).output().unwrap();
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    Ok(serde_json::from_slice(&output.stdout).unwrap())
}

#[tokio::test]
async fn another_program_computes_the_same_chain_from_the_document_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (session, _) = a_database(folder.path()).await;
    let mut trial = Trial::start(folder.path()).await;
    let formulas = trial.begin("practice").await;
    for text in ["=1+1", "'=quoted", "'quoted'", "\u{ff1d}1", "é\n\"🔬\""] {
        trial.say(text).await;
    }

    for (session, unblinded, withheld) in [(session, false, 8), (session, true, 1), (formulas, false, 1)] {
        let out = folder.path().join(format!("{session}-{unblinded}"));
        let summary = export(&trial.access_log(), session, &out, unblinded).await.unwrap();
        assert_eq!(failed(&verify(&out, None)), [""; 0]);
        let found = recomputed(&out).unwrap();
        assert!(found["head"].as_str().unwrap().starts_with(&summary.head), "{found} {}", summary.head);
        assert_eq!(found["withheld"], withheld, "{found}");

        let comments = std::fs::read_to_string(out.join("comments.csv")).unwrap();
        std::fs::write(out.join("comments.csv"), comments.replacen("1234", "1235", 1)).unwrap();
        assert!(recomputed(&out).unwrap_err().contains("was changed"));
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

#[tokio::test]
async fn a_backup_is_made_while_the_server_writes_and_put_back_when_it_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let (mut trial, session) = with_session(&data).await;
    let out = folder.path().join("backup.db");
    let clock = trial.clock.clone();
    let made = backup(&data, &out, clock.clone()).await.unwrap();
    assert_eq!(made.bytes, std::fs::metadata(&out).unwrap().len());
    let head: Head = made.head.parse().unwrap();
    assert_eq!(failed(&verify_database(&out, Some(head)).await.unwrap()), [""; 0]);
    let again = backup(&data, &out, clock.clone()).await.unwrap_err();
    assert!(matches!(again, BackupError::Exists(_)), "{again}");
    assert_eq!(files(folder.path()), [out.clone(), data.clone()]);

    let refused = restore(&data, &out, clock.clone()).await.unwrap_err();
    assert!(matches!(refused, BackupError::Store(StoreError::InUse { .. })), "{refused}");

    // The server continues after the backup.
    trial.whole_session("practice").await;
    let ended = trial.store.reader().head().await.unwrap();
    trial.store.close().await;
    drop(trial);

    let restored = restore(&data, &out, clock.clone()).await.unwrap();
    assert!(matches!(restored.relation, Relation::Earlier { rows } if rows > 10), "{restored:?}");
    let kept = restored.kept.unwrap();
    assert_eq!(failed(&verify_database(&kept, Some(ended.clone())).await.unwrap()), [""; 0]);
    assert_eq!(restored.replaced, Some(ended.to_string()));
    assert_eq!(failed(&verify_database(&data, None).await.unwrap()), [""; 0]);
    let wrong = said(&verify_database(&data, Some(ended)).await.unwrap(), "chain").unwrap_err();
    assert!(wrong.contains("cut off"), "{wrong}");

    let trial = Trial::start(&data).await;
    assert_eq!(trial.store.reader().comments(session).await.unwrap().len(), 6);
    trial.store.close().await;
    drop(trial);

    // By now, the replaced database has another history.
    let restored = restore(&data, &kept, clock.clone()).await.unwrap();
    assert!(matches!(restored.relation, Relation::Apart { .. }), "{restored:?}");

    // A changed backup is refused, and the present database stays.
    let pool = opened_by_its_owner(&out).await;
    sqlx::query("UPDATE comments SET text = 'sharper' WHERE number = 2").execute(&pool).await.unwrap();
    pool.close().await;
    let before = files(&data);
    let refused = restore(&data, &out, clock).await.unwrap_err();
    assert!(
        matches!(&refused, BackupError::Unsound { problem, .. } if problem.contains("comments: comment")),
        "{refused}"
    );
    assert_eq!(files(&data), before);
    assert_eq!(failed(&verify_database(&data, None).await.unwrap()), [""; 0]);
}

/// A server that was killed leaves its latest records in the log. Somebody then moves the database away, without it.
#[tokio::test]
async fn a_log_without_its_database_is_kept_and_read_into_no_other_one() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let (trial, _) = with_session(&data).await;
    let out = folder.path().join("backup.db");
    let clock = trial.clock.clone();
    backup(&data, &out, clock.clone()).await.unwrap();
    let database = data.join("parfocal.db");
    let log = data.join("parfocal.db-wal");
    let latest = std::fs::read(&log).unwrap();
    assert!(!latest.is_empty(), "the latest records are in the log");
    trial.store.close().await;
    drop(trial);
    std::fs::remove_file(&database).unwrap();
    std::fs::write(&log, &latest).unwrap();

    let refused = Store::open(&data, &a_run(&a_clock())).await.unwrap_err().to_string();
    assert!(refused.contains("parfocal.db-wal") && refused.contains("parfocal restore"), "{refused}");
    assert_eq!(std::fs::read(&log).unwrap(), latest, "nothing of it is lost");

    let restored = restore(&data, &out, clock).await.unwrap();
    assert_eq!((restored.kept, restored.relation), (None, Relation::Nothing));
    assert_eq!(failed(&verify_database(&data, None).await.unwrap()), [""; 0]);
    Store::open(&data, &a_run(&a_clock())).await.unwrap().close().await;
    let aside =
        |path: &PathBuf| path.to_string_lossy().contains("parfocal-replaced-") && path.extension().unwrap() == "db-wal";
    let aside: Vec<PathBuf> = files(&data).into_iter().filter(aside).collect();
    assert_eq!(aside.len(), 1, "{:?}", files(&data));
    assert_eq!(std::fs::read(&aside[0]).unwrap(), latest);
}

#[tokio::test]
async fn whichever_page_of_a_database_is_damaged_verification_says_so() {
    const PAGE: usize = 4096;

    let folder = tempfile::tempdir().unwrap();
    a_database(folder.path()).await;
    let file = folder.path().join("parfocal.db");
    // Removes empty pages, because damage to them harms nobody and is not found.
    let pool = crate::storage::raw(folder.path()).await;
    sqlx::query("VACUUM").execute(&pool).await.unwrap();
    pool.close().await;

    let whole = std::fs::read(&file).unwrap();
    assert!(whole.len() > 40 * PAGE);
    assert_eq!(look_at_database(folder.path()).await.unwrap(), whole.len() as u64);

    for page in 0..whole.len() / PAGE {
        let mut damaged = whole.clone();
        damaged[page * PAGE..(page + 1) * PAGE].fill(0xff);
        std::fs::write(&file, damaged).unwrap();
        match verify_database(&file, None).await {
            Ok(checks) => assert!(said(&checks, "database").unwrap_err().contains("damaged"), "{page}: {checks:?}"),
            Err(error) => assert!(matches!(error, StoreError::Damaged(_)), "{page}: {error}"),
        }
        let found = look_at_database(folder.path()).await;
        assert!(matches!(found, Err(StoreError::Damaged(_))), "{page}: {found:?}");
    }
}

/// A column name that is not valid UTF-8 made the database's driver panic, and verification wait forever.
#[tokio::test]
async fn a_column_whose_name_is_not_text_is_refused_at_every_opening() {
    let folder = tempfile::tempdir().unwrap();
    a_database(folder.path()).await;
    let file = folder.path().join("parfocal.db");
    let mut bytes = std::fs::read(&file).unwrap();
    let table = position(&bytes, b"CREATE TABLE chain ");
    let column = table + position(&bytes[table..], b"previous");
    bytes[column] = 0xff;
    std::fs::write(&file, bytes).unwrap();

    for refused in [
        verify_database(&file, None).await.map(|_| ()),
        Reader::open(folder.path()).await.map(|_| ()),
        Store::open(folder.path(), &a_run(&a_clock())).await.map(|_| ()),
    ] {
        assert!(matches!(refused, Err(StoreError::Damaged(_))), "{refused:?}");
    }
    assert!(matches!(look_at_database(folder.path()).await, Err(StoreError::Damaged(_))));
}

fn position(bytes: &[u8], part: &[u8]) -> usize {
    bytes.windows(part.len()).position(|window| window == part).unwrap()
}

#[tokio::test]
async fn a_database_is_looked_at_whatever_its_version() {
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(look_at_database(folder.path()).await, Err(StoreError::Missing(_))));
    a_database(folder.path()).await;

    let pool = crate::storage::raw(folder.path()).await;
    let version = "INSERT INTO _sqlx_migrations SELECT 9000, description, installed_on, success, checksum, \
                   execution_time FROM _sqlx_migrations LIMIT 1";
    sqlx::query(version).execute(&pool).await.unwrap();
    assert!(matches!(look_at_database(folder.path()).await, Err(StoreError::Newer { .. })));

    sqlx::query("DELETE FROM _sqlx_migrations WHERE version = 9000").execute(&pool).await.unwrap();
    MIGRATOR.undo(&pool, 0).await.unwrap();
    pool.close().await;
    look_at_database(folder.path()).await.unwrap();
}

#[tokio::test]
async fn who_looks_is_recorded_and_stands_in_the_export() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = with_session(folder.path()).await;
    trial.access_log().record(&Access::PathViewed(session)).await.unwrap();
    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let rows = crate::exports::rows(&out, "accesses");
    let told: Vec<_> =
        rows.iter().map(|row| (row["role"].as_str(), row["kind"].as_str(), row["detail"].as_str())).collect();
    assert_eq!(told, [("researcher", "path-viewed", ""), ("researcher", "exported", "blinded")]);
}

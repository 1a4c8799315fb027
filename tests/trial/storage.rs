//! The store on a real file: migrations, locks, full disks, rows that cannot be changed, and telemetry.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::{Clock, Moment};
use parfocal_base::ids::SegmentId;
use parfocal_base::step::{Hold, StepRecord};
use parfocal_dashboard::health::device_log;
use parfocal_pipeline::control::ControlStatus;
use parfocal_records::store::{DeviceEvent, MIGRATOR, Reader, Store, StoreError, telemetry, verify_database};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};
use tokio::sync::watch;

use crate::fixture::{Trial, a_clock, a_run};

pub async fn raw(folder: &std::path::Path) -> SqlitePool {
    let options = SqliteConnectOptions::new().filename(folder.join("parfocal.db")).create_if_missing(true);
    SqlitePool::connect_with(options).await.unwrap()
}

async fn schema(pool: &SqlitePool) -> BTreeSet<String> {
    let sql =
        "SELECT type || ' ' || name FROM sqlite_schema WHERE name NOT LIKE 'sqlite_%' AND name <> '_sqlx_migrations'";
    sqlx::query_scalar::<_, String>(sql).fetch_all(pool).await.unwrap().into_iter().collect()
}

/// A step as the control loop reports it.
pub fn step(frame: u64, segment: Option<SegmentId>) -> StepRecord {
    StepRecord {
        frame,
        exposed_at: Moment::from_nanos(frame * 20_000_000),
        segment,
        policy: segment.map(|_| PolicyName::new("mgm-hill-climber")),
        asked: FocalPower::nearest(0.35),
        measured: Some(FocalPower::nearest(0.3)),
        metric: Some(12.5),
        policy_micros: 17,
        latency_micros: 640,
        held: None,
        optimal: Some(FocalPower::nearest(0.4)),
        patch: (240, 120),
    }
}

#[tokio::test]
async fn migrations_go_up_and_down_and_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let pool = raw(folder.path()).await;
    MIGRATOR.run(&pool).await.unwrap();
    let up = schema(&pool).await;
    assert!(up.contains("table events") && up.contains("trigger comments_no_delete"), "{up:?}");
    MIGRATOR.undo(&pool, 0).await.unwrap();
    assert_eq!(schema(&pool).await, BTreeSet::new());
    assert!(matches!(Reader::open(folder.path()).await, Err(StoreError::Outdated)));
    assert!(matches!(verify_database(folder.path(), None).await, Err(StoreError::Outdated)));
    MIGRATOR.run(&pool).await.unwrap();
    assert_eq!(schema(&pool).await, up);
}

#[tokio::test]
async fn a_second_server_on_the_folder_is_refused_and_reading_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let refused = Store::open(folder.path(), &a_run(&a_clock())).await.unwrap_err();
    assert!(matches!(&refused, StoreError::InUse { process, .. } if *process == std::process::id().to_string()));
    let reader = Reader::open(folder.path()).await.unwrap();
    assert_eq!(reader.participants().await.unwrap().len(), 1);
    drop(trial);
    Store::open(folder.path(), &a_run(&a_clock())).await.unwrap();
}

#[tokio::test]
async fn a_database_from_a_newer_version_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    drop(Trial::start(folder.path()).await);
    let pool = raw(folder.path()).await;
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
                 VALUES (9999, 'of the future', 1, x'00', 0)";
    sqlx::query(newer).execute(&pool).await.unwrap();
    let refused = Store::open(folder.path(), &a_run(&a_clock())).await.unwrap_err();
    assert!(matches!(refused, StoreError::Newer { version: 9999 }), "{refused}");
    assert!(matches!(Reader::open(folder.path()).await, Err(StoreError::Newer { version: 9999 })));
    let runs: i64 = sqlx::query_scalar("SELECT count(*) FROM runs").fetch_one(&pool).await.unwrap();
    assert_eq!(runs, 1);
}

#[tokio::test]
async fn a_folder_that_cannot_be_used_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "no folder").unwrap();
    let refused = Store::open(&file, &a_run(&a_clock())).await.unwrap_err().to_string();
    assert!(refused.contains("file") && refused.contains("--data-dir"), "{refused}");
    std::fs::write(folder.path().join("parfocal.db"), "this is no database, whatever its name says".repeat(100))
        .unwrap();
    let refused = Store::open(folder.path(), &a_run(&a_clock())).await.unwrap_err();
    assert!(matches!(refused, StoreError::Damaged(_)), "{refused}");
    let missing = Reader::open(&folder.path().join("elsewhere")).await.unwrap_err();
    assert!(matches!(missing, StoreError::Missing(_)), "{missing}");
}

#[tokio::test]
async fn on_a_full_disk_nothing_is_acknowledged_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    trial.say("there was room").await;
    trial.store.limit_pages(1).await.unwrap();
    // The file's free pages have space for a few more.
    let mut kept = 1;
    let (comment, refused) = loop {
        let comment = trial.comment(&"no room ".repeat(1000));
        match trial.conductor.comment(comment.clone()).await {
            Ok(()) => kept += 1,
            Err(refused) => break (comment, refused),
        }
    };
    assert!(matches!(&refused, ConductError::Storage(text) if text.contains("disk is full")), "{refused}");
    assert_eq!(trial.view().comments, kept);
    trial.store.limit_pages(u32::MAX - 1).await.unwrap();
    trial.conductor.comment(comment).await.unwrap();
    assert_eq!(trial.store.reader().comments(session).await.unwrap().len(), kept + 1);
}

#[tokio::test]
async fn what_was_recorded_cannot_be_changed_or_removed() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    trial.whole_session("practice").await;

    let pool = raw(folder.path()).await;
    for table in ["sessions", "segments", "events", "comments", "answers"] {
        for sql in [format!("DELETE FROM {table}"), format!("UPDATE {table} SET session = session")] {
            let refused = sqlx::query(sqlx::AssertSqlSafe(sql.clone())).execute(&pool).await;
            assert!(refused.is_err_and(|error| error.to_string().contains("append-only")), "{sql}");
        }
    }

    // REPLACE removes the row that it replaces, found by any of the unique columns.
    let mut connection = pool.acquire().await.unwrap();
    for (table, forged) in [
        ("sessions", "seed"),
        ("segments", "policy"),
        ("events", "kind"),
        ("comments", "text"),
        ("answers", "question"),
        ("comments", "key"),
        ("answers", "key"),
    ] {
        let script = format!(
            "CREATE TEMP TABLE forged AS SELECT * FROM {table}; UPDATE forged SET {forged} = 'forged'; \
             INSERT OR REPLACE INTO {table} SELECT * FROM forged LIMIT 1"
        );

        let _refused = sqlx::raw_sql(sqlx::AssertSqlSafe(script)).execute(&mut *connection).await;
        sqlx::raw_sql("DROP TABLE temp.forged").execute(&mut *connection).await.unwrap();

        let count = format!("SELECT count(*), total(coalesce({forged}, '') = 'forged') FROM {table}");
        let (rows, changed): (i64, f64) =
            sqlx::query_as(sqlx::AssertSqlSafe(count)).fetch_one(&mut *connection).await.unwrap();
        assert!(rows > 0 && changed == 0.0, "{table}.{forged}: {changed} of {rows}");
    }
}

#[tokio::test]
async fn telemetry_is_written_with_its_segment_and_nothing_else_waits_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;

    let (sender, receiver) = tokio::sync::mpsc::channel(4096);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));

    for frame in 1..=1000 {
        let mut record = step(frame, Some(segment).filter(|_| frame > 500));
        record.metric = if frame == 501 { Some(f64::NAN) } else { record.metric };
        record.held = (frame == 502).then_some(Hold::Paused);
        sender.send(record).await.unwrap();
    }

    trial.say("meanwhile").await;

    drop(sender);
    writer.await.unwrap();
    assert_eq!(trial.store.telemetry_counts().written.load(Ordering::Relaxed), 1000);

    let pool = raw(folder.path()).await;
    let rows: i64 = sqlx::query_scalar("SELECT count(*) FROM telemetry").fetch_one(&pool).await.unwrap();
    assert_eq!(rows, 1000);

    let odd: (Option<f64>, String) = sqlx::query_as(
        "SELECT (SELECT metric FROM telemetry WHERE frame = 501), (SELECT held FROM telemetry WHERE frame = 502)",
    )
    .fetch_one(&pool)
    .await
    .unwrap();

    assert_eq!(odd, (None, "paused".to_owned()));

    let path = trial.store.reader().focal_path(session, 100).await.unwrap();
    assert_eq!(path.len(), 100, "of the 500 steps in the segment every fifth");
    assert_eq!((path[0].frame, path[1].frame, path[0].setting), (501, 506, 1));
}

#[tokio::test]
async fn who_waits_for_the_telemetry_finds_every_step_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    // Nothing is written, so nobody waits.
    trial.store.settle_telemetry().await;

    let (sender, receiver) = tokio::sync::mpsc::channel(4096);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
    let pool = raw(folder.path()).await;
    // One step, some, and more than a batch holds.
    for (first, last) in [(1, 1), (2, 5), (6, 1000)] {
        for frame in first..=last {
            sender.send(step(frame, None)).await.unwrap();
        }
        tokio::join!(trial.store.settle_telemetry(), trial.store.settle_telemetry());
        let steps: i64 = sqlx::query_scalar("SELECT count(*) FROM telemetry").fetch_one(&pool).await.unwrap();
        assert_eq!(steps, last.cast_signed());
    }

    drop(sender);
    writer.await.unwrap();
    trial.store.settle_telemetry().await;
}

#[tokio::test]
async fn a_clock_set_back_while_the_server_is_down_lets_no_step_come_before_an_earlier_one() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    let write = async |trial: &Trial, frames: u64| {
        let (sender, receiver) = tokio::sync::mpsc::channel(4096);
        let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
        for frame in 1..=frames {
            let exposed_at = trial.clock.now() + Duration::from_millis(20 * frame);
            sender.send(StepRecord { exposed_at, ..step(frame, Some(segment)) }).await.unwrap();
        }
        drop(sender);
        writer.await.unwrap();
    };
    // For 20 s the surgeon looks and says nothing, then the server is killed.
    write(&trial, 1000).await;
    drop(trial);

    // Both clocks of the server begin again where they were. The second start takes no step.
    drop(Trial::start(folder.path()).await);
    let trial = Trial::start(folder.path()).await;
    write(&trial, 50).await;

    let path = trial.store.reader().focal_path(session, 10_000).await.unwrap();
    let clocks = trial.store.reader().run_clocks().await.unwrap();
    assert_eq!(path.len(), 1050);
    assert!(path.is_sorted_by_key(|point| clocks.wall(point.run, point.exposed)));
}

#[tokio::test]
async fn old_telemetry_is_forgotten_but_never_that_of_a_setting() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();

    let (sender, receiver) = tokio::sync::mpsc::channel(4096);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
    for frame in 1..=1000 {
        sender.send(step(frame, Some(segment).filter(|_| (201..=300).contains(&frame)))).await.unwrap();
    }

    drop(sender);
    writer.await.unwrap();

    let pool = raw(folder.path()).await;
    let left = async || {
        let sql = "SELECT frame, segment IS NOT NULL FROM telemetry ORDER BY frame";
        sqlx::query_as::<_, (i64, bool)>(sql).fetch_all(&pool).await.unwrap()
    };

    let up_to = trial.store.forget_steps_outside(0, 150, 400).await.unwrap();
    assert_eq!((up_to, left().await.len()), (150, 850), "a few at a time");

    let mut looked_at = up_to;
    for _ in 0..10 {
        looked_at = trial.store.forget_steps_outside(looked_at, 150, 400).await.unwrap();
    }

    let left = left().await;
    assert_eq!(left.iter().filter(|(_, inside)| *inside).count(), 100, "all of the setting's");
    let outside: Vec<i64> = left.iter().filter(|(_, inside)| !inside).map(|(frame, _)| *frame).collect();
    assert_eq!(outside, (601..=1000).collect::<Vec<_>>(), "of the others the latest 400");
}

#[tokio::test]
async fn telemetry_that_a_failing_disk_refused_is_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;

    let pool = raw(folder.path()).await;
    let trigger = "CREATE TRIGGER broken BEFORE INSERT ON telemetry BEGIN SELECT RAISE(ABORT, 'broken'); END";
    sqlx::query(trigger).execute(&pool).await.unwrap();

    let (sender, receiver) = tokio::sync::mpsc::channel(64);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));
    sender.send(step(1, None)).await.unwrap();

    let counts = trial.store.telemetry_counts();
    while counts.failed_batches.load(Ordering::Relaxed) == 0 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }

    sqlx::query("DROP TRIGGER broken").execute(&pool).await.unwrap();
    sender.send(step(2, None)).await.unwrap();

    drop(sender);
    writer.await.unwrap();
    let frames: Vec<i64> = sqlx::query_scalar("SELECT frame FROM telemetry").fetch_all(&pool).await.unwrap();
    assert_eq!(frames, [1, 2]);
    assert_eq!(counts.lost.load(Ordering::Relaxed), 0);
}

#[tokio::test]
async fn a_devices_state_that_a_failing_disk_refused_is_recorded_later_with_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let pool = raw(folder.path()).await;
    let trigger = "CREATE TRIGGER broken BEFORE INSERT ON device_events BEGIN SELECT RAISE(ABORT, 'broken'); END";
    sqlx::query(trigger).execute(&pool).await.unwrap();

    let found = Arc::clone(&trial.control.status.borrow());
    let found_at = trial.clock.wall().to_string();
    let (status, told) = watch::channel(Arc::clone(&found));
    let recording = tokio::spawn(device_log::record(trial.store.clone(), trial.clock.clone(), told));
    tokio::task::yield_now().await;
    // Writers take turns, so the log has tried before this one is refused.
    let device = "lens".to_owned();
    let other =
        DeviceEvent { wall: trial.clock.wall(), at: trial.clock.now(), device, working: true, message: String::new() };
    trial.store.device_event(&other).await.unwrap_err();

    sqlx::query("DROP TRIGGER broken").execute(&pool).await.unwrap();
    trial.clock.advance(Duration::from_secs(5));
    status.send_replace(found);
    drop(status);
    recording.await.unwrap();

    let events = sqlx::query_as("SELECT device, wall FROM device_events ORDER BY number");
    let events: Vec<(String, String)> = events.fetch_all(&pool).await.unwrap();
    assert_eq!(events, [("camera".to_owned(), found_at.clone()), ("lens".to_owned(), found_at)]);
}

#[tokio::test]
async fn a_camera_that_comes_back_while_the_disk_hangs_is_recorded_as_having_been_away() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let pool = raw(folder.path()).await;
    let mut hanging = pool.acquire().await.unwrap();
    sqlx::query("BEGIN IMMEDIATE").execute(&mut *hanging).await.unwrap();

    let camera = |working| {
        let mut status = ControlStatus::clone(&trial.control.status.borrow());
        status.camera.working = working;
        Arc::new(status)
    };
    let (status, told) = watch::channel(camera(true));
    let recording = tokio::spawn(device_log::record(trial.store.clone(), trial.clock.clone(), told));
    for working in [true, false, true, true] {
        status.send_replace(camera(working));
        // The log is on the same thread: it has seen this before the next.
        tokio::task::yield_now().await;
        trial.clock.advance(Duration::from_secs(5));
    }
    sqlx::query("COMMIT").execute(&mut *hanging).await.unwrap();
    drop(status);
    recording.await.unwrap();

    let worked = sqlx::query_scalar("SELECT working FROM device_events WHERE device = 'camera' ORDER BY number");
    let worked: Vec<bool> = worked.fetch_all(&pool).await.unwrap();
    assert_eq!(worked, [true, false, true]);
}

//! The database of a data folder, opened for writing by one process.

use std::collections::BTreeMap;
use std::fs::DirBuilder;
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use jiff::Timestamp;
use prometheus_client::metrics::histogram::Histogram;
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use tokio::sync::Mutex;
use tokio::sync::mpsc::UnboundedSender;
use tokio::task::spawn_blocking;

use parfocal_base::boxed;
use parfocal_base::clock::Moment;
use parfocal_base::files::make_private;
use parfocal_base::{BlurRate, PolicyName};

use super::insert::Insert;
use super::lock::{FolderLock, LOCK};
use super::schema::{DATABASE, MIGRATOR, check_names};
use super::scrub::scrub;
use super::values::nanoseconds;
use super::writes::{Counts, Turn, Waiter, Writes, write_on};
use super::{Reader, Stamp, StoreError, chain};

/// A start of the server, and what it ran with.
#[derive(Debug, Clone)]
pub struct ServerRun {
    /// When the server started, by the wall clock.
    pub wall: Timestamp,
    /// When the server started, by the monotonic clock.
    pub at: Moment,
    /// Description of the camera.
    pub camera: String,
    /// Description of the lens.
    pub lens: String,
    /// The sensor's calibration, by its title.
    pub calibration: String,
    /// How fast the optic blurs, as the policies know it; `None` if they do not.
    pub blur: Option<BlurRate>,
    /// SHA-256 of each learned policy's weights, by the policy's name.
    pub weights: BTreeMap<PolicyName, String>,
    /// The seed given on the command line, if any.
    pub seed: Option<u64>,
}

/// The database of a data folder, held by this process alone. Clone freely.
#[derive(Clone, Debug)]
pub struct Store {
    pub(super) inner: Arc<Inner>,
}

#[derive(Debug)]
pub(super) struct Inner {
    /// The data folder.
    pub(super) folder: PathBuf,
    pub(super) trial: SqlitePool,
    pub(super) telemetry: SqlitePool,
    pub(super) checkpoints: SqlitePool,
    pub(super) reader: Reader,
    /// `SQLite` lets one connection write at a time, and the others poll. This queue is fair and wakes the next writer
    /// at once.
    turn: Mutex<()>,
    pub(super) run: i64,
    /// When this run began.
    pub(super) started: Stamp,
    pub(super) telemetry_counts: Counts,
    /// Where those ask who wait for telemetry to be written; `None` before its writer runs.
    pub(super) telemetry_waiters: std::sync::Mutex<Option<UnboundedSender<Waiter>>>,
    /// Width of the picture on the surgeon's tablet, pixels; 0 if none shows one.
    surgeon_picture: AtomicU32,
    pub(super) writes: Writes,
    /// Released when dropped, or by the kernel however the process ends.
    lock: Arc<FolderLock>,
}

/// A data folder that no other process can change, but whose database is not open yet.
#[derive(Debug)]
pub struct LockedFolder {
    folder: PathBuf,
    lock: FolderLock,
}

impl LockedFolder {
    /// Locks the data folder `folder`. Creates it if it does not exist.
    ///
    /// # Errors
    /// If another server uses the folder, or it cannot be made or written.
    pub fn of(folder: &Path) -> Result<Self, StoreError> {
        let made = DirBuilder::new().recursive(true).mode(0o700).create(folder);
        made.map_err(|error| StoreError::folder(folder, &error))?;

        let lock = FolderLock::of(folder)?;
        keep_private(folder);
        Ok(Self { folder: folder.to_owned(), lock })
    }
}

impl Store {
    /// Opens the data folder `folder` and records the start of `run`. Creates the folder and the database if they do
    /// not exist, and brings an older database up to date.
    ///
    /// # Errors
    /// If another server uses the folder, the database is from a newer version, or the disk cannot be written.
    pub async fn open(folder: &Path, run: &ServerRun) -> Result<Self, StoreError> {
        Self::open_locked(LockedFolder::of(folder)?, run).await
    }

    /// The same, for a data folder that this process has locked before.
    ///
    /// # Errors
    /// If the database is from a newer version, or the disk cannot be written.
    pub async fn open_locked(locked: LockedFolder, run: &ServerRun) -> Result<Self, StoreError> {
        let LockedFolder { folder, lock } = locked;
        let file = folder.join(DATABASE);
        check_log(&folder, &file)?;
        let options = SqliteConnectOptions::new()
            .filename(&file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(5))
            // A connection of its own makes checkpoints, between batches of telemetry. So none falls on a comment's
            // commit, and nobody waits for one.
            .pragma("wal_autocheckpoint", "0");

        // What people say is flushed to the disk at each commit; telemetry may lose its last seconds to a power cut.
        let trial = connect(options.clone().synchronous(SqliteSynchronous::Full)).await?;
        check_names(&trial).await?;
        MIGRATOR.run(&trial).await?;

        let relaxed = options.synchronous(SqliteSynchronous::Normal);
        let telemetry = connect(relaxed.clone()).await?;
        let checkpoints = connect(relaxed).await?;

        // From now on they must stay where they are.
        lock.check_in_place()?;

        let reader = Reader::open_file(&file).await?;
        let started = Stamp { wall: run.wall, at: run.at };
        let run = begin_run(&trial, run).await?;
        // A server that was killed while it erased words may have left copies of them.
        if let Err(error) = scrub(&trial).await {
            tracing::warn!("copies of erased words may remain in the database's files: {error}");
        }

        let inner = Inner {
            folder,
            trial,
            telemetry,
            checkpoints,
            reader,
            turn: Mutex::new(()),
            run,
            started,
            telemetry_counts: Counts::default(),
            telemetry_waiters: std::sync::Mutex::default(),
            surgeon_picture: AtomicU32::new(0),
            writes: Writes::default(),
            lock: Arc::new(lock),
        };

        Ok(Self { inner: Arc::new(inner) })
    }

    /// Number of this start of the server, from 1.
    pub fn run(&self) -> i64 {
        self.inner.run
    }

    /// The reader of the same database.
    pub fn reader(&self) -> &Reader {
        &self.inner.reader
    }

    /// How much telemetry was written or lost since the start of the server.
    pub fn telemetry_counts(&self) -> &Counts {
        &self.inner.telemetry_counts
    }

    /// Notes the width in pixels of the picture that the surgeon's tablet shows; `None` if none shows one. Telemetry has
    /// it with each step.
    pub fn note_surgeon_picture(&self, width: Option<u32>) {
        self.inner.surgeon_picture.store(width.unwrap_or(0), Ordering::Relaxed);
    }

    /// That width.
    pub(super) fn surgeon_picture(&self) -> Option<u32> {
        Some(self.inner.surgeon_picture.load(Ordering::Relaxed)).filter(|width| *width > 0)
    }

    /// Closes the database. What was acknowledged is on disk even without this.
    pub async fn close(&self) {
        self.inner.reader.close().await;
        self.inner.checkpoints.close().await;
        self.inner.telemetry.close().await;
        self.inner.trial.close().await;
    }

    /// How long writes took, and whether they failed, since the start of the server.
    pub fn writes(&self) -> &Writes {
        &self.inner.writes
    }

    /// The data folder.
    pub fn folder(&self) -> &Path {
        &self.inner.folder
    }

    /// Waits for the turn to write records.
    ///
    /// # Errors
    /// If the database was deleted or moved away.
    pub(super) async fn turn(&self) -> Result<Turn<'_>, StoreError> {
        self.turn_timed_in(&self.inner.writes.records).await
    }

    /// Waits for the turn to write telemetry.
    ///
    /// # Errors
    /// If the database was deleted or moved away.
    pub(super) async fn telemetry_turn(&self) -> Result<Turn<'_>, StoreError> {
        self.turn_timed_in(&self.inner.writes.telemetry).await
    }

    async fn turn_timed_in<'a>(&'a self, times: &'a Histogram) -> Result<Turn<'a>, StoreError> {
        let turn = self.inner.writes.begin(self.inner.turn.lock().await, times);

        // A disk that hangs must not block a thread that serves others.
        let lock = Arc::clone(&self.inner.lock);
        let checked = spawn_blocking(move || lock.check_in_place()).await;
        // Without an answer, which a runtime that ends may not give, writing shows how the disk is.
        let in_place = checked.unwrap_or(Ok(()));
        if in_place.is_err() {
            self.inner.writes.note(&in_place);
        }
        in_place.map(|()| turn)
    }

    /// Writes records, in a turn and a transaction of their own. All of them are on disk when this returns; if it
    /// fails, none is written.
    pub(super) async fn write<T>(
        &self,
        write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let turn = self.turn().await?;
        turn.write(&self.inner.trial, write).await
    }

    /// Writes telemetry, in a turn and a transaction of its own.
    pub(super) async fn write_telemetry<T>(
        &self,
        write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let turn = self.telemetry_turn().await?;
        turn.write(&self.inner.telemetry, write).await
    }

    /// Adds participant `code`. A participant that exists already stays as it is.
    ///
    /// # Errors
    /// If the disk or database fails.
    #[boxed]
    pub async fn add_participant(&self, code: &str, wall: Timestamp) -> Result<(), StoreError> {
        let wall = wall.to_string();
        self.write(async |connection| {
            let done = sqlx::query("INSERT INTO participants (code, wall) VALUES (?, ?) ON CONFLICT (code) DO NOTHING")
                .bind(code)
                .bind(&wall)
                .execute(&mut *connection)
                .await?;

            if done.rows_affected() == 1 {
                chain::append(connection, "participant", code, &wall).await?;
            }
            Ok(())
        })
        .await
    }

    /// Limits the database to `pages` pages, so that tests can simulate a full disk.
    #[doc(hidden)]
    pub async fn limit_pages(&self, pages: u32) -> Result<(), StoreError> {
        let pragma = sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {pages}"));
        sqlx::query(pragma).execute(&self.inner.trial).await?;
        Ok(())
    }
}

/// Refuses a folder whose database `file` is missing while its log is there: SQLite would make a new database and
/// delete the log, which has the latest records of the missing one.
fn check_log(folder: &Path, file: &Path) -> Result<(), StoreError> {
    let name = format!("{DATABASE}-wal");
    let bytes = |path: &Path| path.metadata().map_or(0, |metadata| metadata.len());
    if bytes(file) > 0 || bytes(&folder.join(&name)) == 0 {
        return Ok(());
    }

    let reason = format!(
        "{DATABASE} is missing or empty, but {name} with its latest records is there; put that database back beside \
         it, or restore a backup with `parfocal restore`"
    );
    Err(StoreError::Folder { folder: folder.to_owned(), reason })
}

async fn connect(options: SqliteConnectOptions) -> Result<SqlitePool, StoreError> {
    // One connection that stays open, so that its settings and prepared statements are kept.
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .min_connections(1)
        .acquire_timeout(Duration::from_secs(5))
        .idle_timeout(None)
        .max_lifetime(None)
        .test_before_acquire(false);

    Ok(pool.connect_with(options).await?)
}

/// Records the start of a run. Before that, chains the telemetry that the run before left unchained, and notes when it
/// took its last step.
async fn begin_run(trial: &SqlitePool, run: &ServerRun) -> Result<i64, StoreError> {
    let weights = serde_json::to_string(&run.weights).map_err(|error| StoreError::Damaged(error.to_string()))?;
    let wall = run.wall.to_string();

    write_on(trial, async |connection| {
        seal_what_was_left(connection, &wall).await?;
        // After a run without steps, the last step is of one whose end was noted before.
        let end = "INSERT OR IGNORE INTO run_ends (run, monotonic_ns)
             SELECT run, exposed_ns FROM telemetry ORDER BY number DESC LIMIT 1";
        sqlx::query(end).execute(&mut *connection).await?;

        let number = Insert::into("runs")
            .set("wall", &wall)
            .set("monotonic_ns", nanoseconds(run.at))
            .set("version", env!("CARGO_PKG_VERSION"))
            .set("camera", &run.camera)
            .set("lens", &run.lens)
            .set("calibration", &run.calibration)
            .set("blur", run.blur.map(BlurRate::get))
            .set("weights", weights)
            .set("seed", run.seed.map(u64::cast_signed))
            .execute(connection)
            .await?;

        chain::append(connection, "run", &number.to_string(), &wall).await?;
        Ok(number)
    })
    .await
}

/// Chains the telemetry that the latest run left unchained. A session under way has an event in every run, so the
/// sessions with an event in the latest run are enough.
async fn seal_what_was_left(connection: &mut SqliteConnection, wall: &str) -> Result<(), StoreError> {
    let sessions = sqlx::query_scalar("SELECT DISTINCT session FROM events WHERE run = (SELECT max(run) FROM events)");
    let sessions: Vec<String> = sessions.fetch_all(&mut *connection).await?;
    for session in sessions {
        chain::seal(connection, &session, wall).await?;
    }
    Ok(())
}

/// Keeps other accounts of the machine out of the folder and its files, which hold seeds, policies and what surgeons
/// said. If the rights cannot be changed, the server runs all the same
/// and logs a warning.
fn keep_private(folder: &Path) {
    let files = ["", "-wal", "-shm"].map(|suffix| folder.join(format!("{DATABASE}{suffix}")));
    for path in [folder.to_owned(), folder.join(LOCK)].into_iter().chain(files) {
        match make_private(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => tracing::warn!(
                "other accounts of this machine may be able to read {}, which holds trial data ({error}); \
                 ask its owner to remove their access, or choose a folder of your own with --data-dir",
                path.display()
            ),
            _ => {}
        }
    }
}

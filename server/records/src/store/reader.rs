//! Reads lists and timelines for the pages. Other programs can use it too while the server runs.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool, SqlitePoolOptions, SqliteRow};
use sqlx::{AssertSqlSafe, Connection as _, Row, migrate::Migrate};

use super::motion::KnownMotions;
use super::schema::{DATABASE, MIGRATOR, check_names, sibling};
use super::values::{moment, parsed, stamp, status};
use super::{PathPoint, RunClocks, SessionLine, Stamp, StoreError};
use parfocal_base::FocalPower;
use parfocal_base::ids::{SegmentId, SessionId};

/// Rows that are read ahead of the caller that takes them. With fewer, two threads wait for each other over and over
/// while telemetry is read.
const ROWS_AHEAD: usize = 1024;

/// Selects the lines of the list of sessions.
const SESSION_LINES: &str = "SELECT session, wall, participant, protocol, practice,
             (SELECT study FROM study_sessions AS m WHERE m.session = s.session) AS study,
             EXISTS (SELECT 1 FROM events AS e WHERE e.session = s.session AND kind = 'completed') AS completed,
             EXISTS (SELECT 1 FROM events AS e WHERE e.session = s.session AND kind = 'aborted') AS aborted,
             (SELECT count(*) FROM events AS e
                 WHERE e.session = s.session AND kind = 'segment-finished') AS finished,
             (SELECT count(*) FROM segments AS g WHERE g.session = s.session) AS settings,
             (SELECT count(*) FROM comments AS c WHERE c.session = s.session AND kind <> 'withdrawal'
                 AND NOT EXISTS (SELECT 1 FROM comments AS w WHERE w.session = s.session AND w.kind = 'withdrawal'
                     AND w.text = c.key AND NOT w.late)) AS comments,
             (SELECT payload ->> 'emergency' FROM events AS e WHERE e.session = s.session AND kind = 'unblinded')
                 AS emergency,
             EXISTS (SELECT 1 FROM events AS e WHERE e.session = s.session AND kind = 'withdrawn') AS withdrawn,
             nullif((SELECT new_value FROM corrections AS c WHERE c.session = s.session AND field = 'participant'
                 ORDER BY number DESC LIMIT 1), s.participant) AS corrected_participant
         FROM sessions AS s";

/// A database open for reading. Clone freely.
#[derive(Clone, Debug)]
pub struct Reader {
    pool: SqlitePool,
    /// Figures from the telemetry of sessions, kept so that it is read only once.
    pub(super) motions: KnownMotions,
}

impl Reader {
    /// Opens the database of data folder `folder`, whether or not a server has it open.
    ///
    /// # Errors
    /// If there is no database, or it is of another version.
    pub async fn open(folder: &Path) -> Result<Self, StoreError> {
        Self::open_checked(&folder.join(DATABASE)).await
    }

    /// Opens the database `file`, and checks its names and its version.
    pub(super) async fn open_checked(file: &Path) -> Result<Self, StoreError> {
        let reader = Self::open_file(there(file)?).await?;
        check_names(&reader.pool).await?;
        reader.check_version().await?;
        Ok(reader)
    }

    /// The same without the checks, for a database that the caller has made or checked.
    pub(super) async fn open_file(file: &Path) -> Result<Self, StoreError> {
        let pool = SqlitePoolOptions::new().max_connections(3).connect_with(reading(file)).await?;
        Ok(Self { pool, motions: KnownMotions::default() })
    }

    /// Opens a snapshot of the database `file`, which later writes do not change.
    pub(super) async fn open_snapshot(file: &Path) -> Result<Self, StoreError> {
        let snapshot = Self::open_snapshot_unchecked(file).await?;
        snapshot.check_version().await?;
        Ok(snapshot)
    }

    /// The same, for a database of any version.
    pub(super) async fn open_snapshot_unchecked(file: &Path) -> Result<Self, StoreError> {
        let pool = snapshot_pool(reading(there(file)?)).await?;
        Ok(Self { pool, motions: KnownMotions::default() })
    }

    /// A snapshot of the database, which later writes do not change. So everything that is read from it belongs
    /// together.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn snapshot(&self) -> Result<Self, StoreError> {
        let pool = snapshot_pool((*self.pool.connect_options()).clone()).await?;
        Ok(Self { pool, motions: Arc::clone(&self.motions) })
    }

    pub(super) async fn check_version(&self) -> Result<(), StoreError> {
        let mut connection = self.pool.acquire().await?;
        let tables: i64 = sqlx::query_scalar("SELECT count(*) FROM sqlite_master").fetch_one(&mut *connection).await?;
        if tables == 0 {
            return Err(StoreError::WithoutLog);
        }
        let applied = connection.list_applied_migrations("_sqlx_migrations").await?;
        if let Some(newer) = applied.iter().find(|migration| !MIGRATOR.version_exists(migration.version)) {
            return Err(StoreError::Newer { version: newer.version });
        }

        let missing = MIGRATOR.iter().any(|ours| !applied.iter().any(|migration| migration.version == ours.version));
        if missing { Err(StoreError::Outdated) } else { Ok(()) }
    }

    pub(super) const fn pool(&self) -> &SqlitePool {
        &self.pool
    }

    /// The rows of `sql`, each read by `read`. The only parameter of `sql` is `parameter`.
    pub(super) async fn rows<T>(
        &self,
        sql: &'static str,
        parameter: &(impl ToString + Sync),
        read: impl Fn(&SqliteRow) -> Result<T, StoreError>,
    ) -> Result<Vec<T>, StoreError> {
        let rows = sqlx::query(sql).bind(parameter.to_string()).fetch_all(&self.pool).await?;
        rows.iter().map(read).collect()
    }

    /// Size of the database in bytes, without its log.
    pub(super) async fn bytes(&self) -> Result<u64, StoreError> {
        let size = "SELECT page_count * page_size FROM pragma_page_count, pragma_page_size";
        let bytes: i64 = sqlx::query_scalar(size).fetch_one(&self.pool).await?;
        Ok(bytes.unsigned_abs())
    }

    /// Copies the database as it is now into `file`, which must be empty or must not exist.
    pub(super) async fn copy_to(&self, file: &Path) -> Result<(), StoreError> {
        let file = file.to_str().ok_or_else(|| StoreError::Disk("the file's name is not UTF-8".to_owned()))?;
        sqlx::query("VACUUM INTO ?").bind(file).execute(&self.pool).await?;
        Ok(())
    }

    /// Moves the log of the database `file` into it, as far as other programs that have it open allow.
    pub(super) async fn fold_log(file: &Path) -> Result<(), StoreError> {
        let options = SqliteConnectOptions::new().filename(file).busy_timeout(Duration::from_secs(1));
        let mut connection = sqlx::SqliteConnection::connect_with(&options).await?;
        let folded = sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&mut connection).await;
        connection.close().await?;
        Ok(folded.map(|_| ())?)
    }

    /// Closes its connections.
    pub(super) async fn close(&self) {
        self.pool.close().await;
    }

    /// The codes of the participants, in order.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn participants(&self) -> Result<Vec<String>, StoreError> {
        Ok(sqlx::query_scalar("SELECT code FROM participants ORDER BY code").fetch_all(&self.pool).await?)
    }

    /// The sessions, newest first. Practice sessions are included only if `practice` is true.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn sessions(&self, practice: bool) -> Result<Vec<SessionLine>, StoreError> {
        let sql = format!("{SESSION_LINES} WHERE practice = 0 OR ? ORDER BY s.rowid DESC");
        let rows = sqlx::query(AssertSqlSafe(sql)).bind(practice).fetch_all(&self.pool).await?;
        rows.iter().map(line).collect()
    }

    /// The line of `session` in the list; `None` if there is no such session.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn session_line(&self, session: SessionId) -> Result<Option<SessionLine>, StoreError> {
        let sql = format!("{SESSION_LINES} WHERE session = ?");
        let row = sqlx::query(AssertSqlSafe(sql)).bind(session.to_string()).fetch_optional(&self.pool).await?;
        row.as_ref().map(line).transpose()
    }

    /// The clocks at each start of the server. If the wall clock was behind when a run began, that run counts from the
    /// last known time of the run before. So later events never get earlier times.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn run_clocks(&self) -> Result<RunClocks, StoreError> {
        let rows = sqlx::query(
            "SELECT run, wall, monotonic_ns, coalesce(last_ns, monotonic_ns) AS last_ns FROM runs LEFT JOIN (
                 SELECT run, max(monotonic_ns) AS last_ns FROM (
                     SELECT run, monotonic_ns FROM events UNION ALL SELECT run, monotonic_ns FROM comments
                     UNION ALL SELECT run, monotonic_ns FROM answers UNION ALL SELECT run, monotonic_ns FROM run_ends)
                 GROUP BY run) USING (run)
             ORDER BY run",
        )
        .fetch_all(&self.pool)
        .await?;

        let mut clocks = BTreeMap::new();
        let mut known_until = Timestamp::MIN;
        for row in &rows {
            let started = stamp(row)?;
            let start = Stamp { wall: started.wall.max(known_until), at: started.at };
            let last = moment(row.try_get("last_ns")?);
            known_until = start.wall.saturating_add(last.since(start.at)).unwrap_or(start.wall);
            clocks.insert(row.try_get("run")?, start);
        }

        Ok(RunClocks(clocks))
    }

    /// The focal power of the last command to the lens in `segment`, from telemetry; `None` if no policy was asked
    /// there. Steps without a policy do not count, because the lens may be elsewhere then, as after a device was opened
    /// again.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn last_commanded(&self, segment: SegmentId) -> Result<Option<FocalPower>, StoreError> {
        let asked: Option<f64> = sqlx::query_scalar(
            "SELECT asked FROM telemetry
             WHERE segment = (SELECT number FROM segments WHERE segment = ?) AND policy IS NOT NULL
             ORDER BY number DESC LIMIT 1",
        )
        .bind(segment.to_string())
        .fetch_optional(&self.pool)
        .await?;

        Ok(asked.and_then(|asked| FocalPower::new(asked).ok()))
    }

    /// The focal path of `session`: about `points` steps of each setting, evenly spread over its steps.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn focal_path(&self, session: SessionId, points: u32) -> Result<Vec<PathPoint>, StoreError> {
        let rows = sqlx::query(
            "WITH steps AS (
                 SELECT t.*, g.setting, row_number() OVER w AS step, count(*) OVER (PARTITION BY t.segment) AS steps
                 FROM segments AS g JOIN telemetry AS t ON t.segment = g.number
                 WHERE g.session = ?1 WINDOW w AS (PARTITION BY t.segment ORDER BY t.number))
             SELECT * FROM steps WHERE (step - 1) % max(1, steps / ?2) = 0 ORDER BY setting, number",
        )
        .bind(session.to_string())
        .bind(points.max(1))
        .fetch_all(&self.pool)
        .await?;

        rows.iter().map(path_point).collect()
    }
}

/// The database `file`, or an error if it does not exist, is empty, or is in a folder that this account may not open.
pub(super) fn there(file: &Path) -> Result<&Path, StoreError> {
    match fs::metadata(file) {
        Ok(about) if about.is_file() && about.len() == 0 && !has_log(file) => Err(StoreError::Empty(file.to_owned())),
        Ok(about) if about.is_file() => Ok(file),
        Err(error) if error.kind() == ErrorKind::PermissionDenied => Err(StoreError::Shut),
        Ok(_) | Err(_) => Err(StoreError::Missing(file.to_owned())),
    }
}

/// Whether the database `file` has a log beside it, which may hold all of its records.
fn has_log(file: &Path) -> bool {
    fs::metadata(sibling(file, "-wal")).is_ok_and(|log| log.len() > 0)
}

/// How the database `file` is opened for reading.
fn reading(file: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(file)
        .read_only(true)
        .busy_timeout(Duration::from_secs(5))
        .row_buffer_size(ROWS_AHEAD)
}

/// One connection, within one transaction from its first to its last use.
async fn snapshot_pool(options: SqliteConnectOptions) -> Result<SqlitePool, StoreError> {
    let one = SqlitePoolOptions::new().max_connections(1).idle_timeout(None).max_lifetime(None);
    let pool = one.test_before_acquire(false).connect_with(options).await?;

    // The first read takes the snapshot. Both statements are executed here and not in `after_connect`. If that failed,
    // as it does on a damaged file, the pool would try again for half a minute and then report a timeout.
    sqlx::query("BEGIN").execute(&pool).await?;
    check_names(&pool).await?;
    Ok(pool)
}

fn line(row: &SqliteRow) -> Result<SessionLine, StoreError> {
    let emergency: Option<bool> = row.try_get("emergency")?;
    Ok(SessionLine {
        session: parsed(row, "session")?,
        created: parsed(row, "wall")?,
        participant: row.try_get("participant")?,
        corrected_participant: row.try_get("corrected_participant")?,
        protocol: row.try_get("protocol")?,
        practice: row.try_get("practice")?,
        study: row.try_get("study")?,
        status: status(row)?,
        finished_settings: row.try_get("finished")?,
        settings: row.try_get("settings")?,
        comments: row.try_get("comments")?,
        unblinded: emergency.is_some(),
        emergency: emergency == Some(true),
        withdrawn: row.try_get("withdrawn")?,
    })
}

fn path_point(row: &SqliteRow) -> Result<PathPoint, StoreError> {
    Ok(PathPoint {
        setting: row.try_get("setting")?,
        frame: row.try_get("frame")?,
        run: row.try_get("run")?,
        exposed: moment(row.try_get("exposed_ns")?),
        asked: row.try_get("asked")?,
        measured: row.try_get("measured")?,
        optimal: row.try_get("optimal")?,
        metric: row.try_get("metric")?,
        patch_x: row.try_get("patch_x")?,
        patch_y: row.try_get("patch_y")?,
    })
}

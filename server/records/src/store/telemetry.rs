//! Writes telemetry to SQLite, in batches and on a connection of its own, so that it delays nothing and nothing waits
//! for it. Steps that belong to no setting of a session are deleted after a while.

use std::collections::{BTreeSet, HashMap};
use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::time::Duration;

use sqlx::sqlite::SqliteConnection;
use tokio::select;
use tokio::sync::mpsc::{Receiver, UnboundedReceiver, unbounded_channel};
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::chain;
use super::values::nanoseconds;
use super::writes::Waiter;
use super::{Store, StoreError};
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_base::clock::Moment;
use parfocal_base::ids::SegmentId;
use parfocal_base::step::{Hold, StepRecord};

/// A batch is written when it is this old.
const BATCH_TIME: Duration = Duration::from_millis(250);
/// A batch is also written when it has this many records.
const BATCH_RECORDS: usize = 256;
/// Records kept for another try while the disk fails: some three minutes at 50 a second.
const MOST_WAITING: usize = 9_000;
/// A failed batch is tried again after this time if no further record comes.
const RETRY: Duration = Duration::from_secs(1);
/// Whoever reads the telemetry of a session that has just ended waits at most this long for its last steps.
const SETTLING: Duration = Duration::from_secs(5);
/// Batches between two checkpoints: about every 16 s.
const CHECKPOINT_BATCHES: u32 = 64;

/// The latest steps, which are kept even if they belong to no setting: eleven hours at 50 a second, some 110 MB.
pub const KEPT_OUTSIDE: i64 = 2_000_000;
/// Steps that are looked at between two checkpoints to delete those of no setting. This is more than arrive in that
/// time, and few enough not to delay a comment.
const LOOKED_AT: i64 = 4_000;

/// Writes incoming steps until the sender is gone. A failing disk is logged, counted and tried again; it never ends
/// this task.
pub async fn run_writer(store: Store, mut receiver: Receiver<StepRecord>) {
    let mut waiters = store.take_telemetry_waiters();
    let mut writer = Writer::default();
    let mut batches = 0_u32;
    let mut looked_at = 0;
    let mut open = true;

    while open {
        open = writer.collect(&mut receiver, &mut waiters).await;
        writer.see(store.surgeon_picture());
        writer.flush(&store).await;

        batches = batches.wrapping_add(1);
        if batches.is_multiple_of(CHECKPOINT_BATCHES) {
            match store.forget_steps_outside(looked_at, LOOKED_AT, KEPT_OUTSIDE).await {
                Ok(up_to) => looked_at = up_to,
                Err(error) => tracing::warn!("old telemetry could not be forgotten: {error}; it is tried again"),
            }

            writer.seal(&store).await;
            checkpoint(&store).await;
        }
    }

    writer.seal(&store).await;
}

#[derive(Default)]
struct Writer {
    waiting: Vec<StepRecord>,
    /// For each of them the width of the picture on the surgeon's tablet.
    seen: Vec<Option<u32>>,
    /// Who waits for these steps to be written.
    waiters: Vec<Waiter>,
    failing: bool,
    names: Names,
    /// Segments with steps that are written and not yet chained.
    unsealed: BTreeSet<SegmentId>,
    /// When the latest step that was written was exposed.
    latest: Moment,
}

impl Writer {
    /// Gathers the next batch, until it is large or old enough, or somebody waits for it. Returns `false` once the
    /// sender is gone. If an earlier batch could not be written, returns after a while even without a new record, as
    /// when the camera is silent, so that it is tried again.
    async fn collect(&mut self, steps: &mut Receiver<StepRecord>, waiters: &mut UnboundedReceiver<Waiter>) -> bool {
        let failed_before = !self.waiting.is_empty();
        select! {
            first = steps.recv() => match first {
                Some(first) => self.waiting.push(first),
                None => return false,
            },
            Some(waiter) = waiters.recv() => self.waiters.push(waiter),
            () = sleep(RETRY), if failed_before => return true,
        }

        let end = Instant::now() + BATCH_TIME;
        let enough = self.waiting.len() + BATCH_RECORDS;
        while self.waiting.len() < enough && self.waiters.is_empty() {
            let room = enough - self.waiting.len();
            select! {
                came = steps.recv_many(&mut self.waiting, room) => if came == 0 { return false },
                Some(waiter) = waiters.recv() => self.waiters.push(waiter),
                () = sleep_until(end) => break,
            }
        }

        // Who waits, waits for every step that came before them.
        while !self.waiters.is_empty()
            && let Ok(step) = steps.try_recv()
        {
            self.waiting.push(step);
        }
        true
    }

    /// Notes what the surgeon sees while the latest steps come in.
    fn see(&mut self, width: Option<u32>) {
        self.seen.resize(self.waiting.len(), width);
    }

    async fn flush(&mut self, store: &Store) {
        let counts = store.telemetry_counts();
        match self.write(store).await {
            Ok(()) => {
                counts.written.fetch_add(self.waiting.len() as u64, Ordering::Relaxed);
                self.unsealed.extend(self.waiting.iter().filter_map(|record| record.segment));
                self.latest = self.waiting.iter().map(|record| record.exposed_at).fold(self.latest, Moment::max);
                self.waiting.clear();
                self.seen.clear();
                for waiter in self.waiters.drain(..) {
                    // They may have given up.
                    let _gone = waiter.send(());
                }
                if std::mem::take(&mut self.failing) {
                    tracing::info!("telemetry is being written again");
                }
            }
            Err(error) => {
                // Numbers from a transaction that was rolled back may not exist.
                self.names = Names::default();
                counts.failed_batches.fetch_add(1, Ordering::Relaxed);
                if !std::mem::replace(&mut self.failing, true) {
                    tracing::error!("telemetry cannot be written: {error}; it is kept in memory for a while");
                }

                let too_many = self.waiting.len().saturating_sub(MOST_WAITING);
                self.waiting.drain(..too_many);
                self.seen.drain(..too_many);
                counts.lost.fetch_add(too_many as u64, Ordering::Relaxed);
            }
        }
    }

    /// Chains what was written since the last time.
    async fn seal(&mut self, store: &Store) {
        if self.unsealed.is_empty() {
            return;
        }
        match store.seal_telemetry(&self.unsealed, self.latest).await {
            Ok(()) => self.unsealed.clear(),
            Err(error) => tracing::warn!("telemetry could not be chained: {error}; it is tried again"),
        }
    }

    async fn write(&mut self, store: &Store) -> Result<(), StoreError> {
        if self.waiting.is_empty() {
            return Ok(());
        }

        let write = async |connection: &mut SqliteConnection| {
            for (record, seen) in self.waiting.iter().zip(&self.seen) {
                let segment = self.names.segment(connection, record.segment).await?;
                let policy = self.names.policy(connection, record.policy.as_ref()).await?;
                insert(connection, store.run(), record, segment, policy, *seen).await?;
            }
            Ok(())
        };
        store.write_telemetry(write).await
    }
}

impl Store {
    /// Waits until the steps that the loop has taken so far are in the database, unless the disk takes long. Until
    /// then, the telemetry of a session that has just ended lacks its last steps.
    pub async fn settle_telemetry(&self) {
        let (waiter, written) = oneshot::channel();
        let asked = {
            let waiters = self.inner.telemetry_waiters.lock().unwrap_or_else(PoisonError::into_inner);
            waiters.as_ref().is_some_and(|waiters| waiters.send(waiter).is_ok())
        };
        // The writer has ended if it does not answer; then everything is written.
        if asked && timeout(SETTLING, written).await.is_err() {
            tracing::warn!("the last telemetry is still being written");
        }
    }

    /// Those who wait for the writer from now on.
    fn take_telemetry_waiters(&self) -> UnboundedReceiver<Waiter> {
        let (sender, waiters) = unbounded_channel();
        *self.inner.telemetry_waiters.lock().unwrap_or_else(PoisonError::into_inner) = Some(sender);
        waiters
    }

    /// Deletes steps that belong to no setting of a session, among the `count` steps after step `from`, but never one
    /// of the latest `kept`. Returns the last step that it looked at, which is the next `from`.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn forget_steps_outside(&self, from: i64, count: i64, kept: i64) -> Result<i64, StoreError> {
        let _turn = self.telemetry_turn().await?;

        let bounds = sqlx::query_as(
            "SELECT (SELECT min(number) FROM telemetry WHERE number > ?), (SELECT max(number) FROM telemetry)",
        );
        let bounds = bounds.bind(from).fetch_one(&self.inner.telemetry).await?;
        let (Some(first), Some(last)): (Option<i64>, Option<i64>) = bounds else { return Ok(from) };

        let up_to = (first + count - 1).min(last - kept);
        if up_to < first {
            return Ok(from);
        }

        sqlx::query("DELETE FROM telemetry WHERE number BETWEEN ? AND ? AND segment IS NULL")
            .bind(first)
            .bind(up_to)
            .execute(&self.inner.telemetry)
            .await?;

        Ok(up_to)
    }

    /// Chains the steps of these segments that are not chained yet. The latest of them was exposed at `latest`.
    async fn seal_telemetry(&self, segments: &BTreeSet<SegmentId>, latest: Moment) -> Result<(), StoreError> {
        let started = self.inner.started;
        let wall = started.wall.saturating_add(latest.since(started.at)).unwrap_or(started.wall).to_string();

        self.write(async |connection| {
            let mut sessions: BTreeSet<String> = BTreeSet::new();
            for segment in segments {
                let session = sqlx::query_scalar("SELECT session FROM segments WHERE segment = ?");
                sessions.extend(session.bind(segment.to_string()).fetch_optional(&mut *connection).await?);
            }

            for session in sessions {
                chain::seal(connection, &session, &wall).await?;
            }
            Ok(())
        })
        .await
    }
}

async fn insert(
    connection: &mut SqliteConnection,
    run: i64,
    record: &StepRecord,
    segment: Option<i64>,
    policy: Option<i64>,
    seen: Option<u32>,
) -> Result<(), StoreError> {
    sqlx::query(
        "INSERT INTO telemetry (run, frame, exposed_ns, segment, policy, asked, measured, metric, policy_micros,
         latency_micros, held, optimal, picture_width, patch_x, patch_y)
         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(run)
    .bind(record.frame.cast_signed())
    .bind(nanoseconds(record.exposed_at))
    .bind(segment)
    .bind(policy)
    .bind(record.asked.get())
    .bind(record.measured.map(FocalPower::get))
    // SQLite has no "not a number".
    .bind(record.metric.filter(|metric| metric.is_finite()))
    .bind(record.policy_micros)
    .bind(record.latency_micros)
    .bind(record.held.map(Hold::name))
    .bind(record.optimal.map(FocalPower::get))
    .bind(seen.filter(|_| record.segment.is_some()))
    .bind(record.patch.0)
    .bind(record.patch.1)
    .execute(connection)
    .await?;
    Ok(())
}

/// The numbers that stand for segments and policies in the rows, as far as they are known.
#[derive(Default)]
struct Names {
    segments: HashMap<SegmentId, Option<i64>>,
    policies: HashMap<PolicyName, i64>,
}

impl Names {
    async fn segment(
        &mut self,
        connection: &mut SqliteConnection,
        segment: Option<SegmentId>,
    ) -> Result<Option<i64>, StoreError> {
        let Some(segment) = segment else { return Ok(None) };
        if let Some(&number) = self.segments.get(&segment) {
            return Ok(number);
        }

        let number = sqlx::query_scalar("SELECT number FROM segments WHERE segment = ?")
            .bind(segment.to_string())
            .fetch_optional(connection)
            .await?;

        self.segments.insert(segment, number);
        Ok(number)
    }

    async fn policy(
        &mut self,
        connection: &mut SqliteConnection,
        policy: Option<&PolicyName>,
    ) -> Result<Option<i64>, StoreError> {
        let Some(policy) = policy else { return Ok(None) };
        if let Some(&number) = self.policies.get(policy) {
            return Ok(Some(number));
        }

        // The update changes nothing. It makes the statement return the row even if it existed before.
        let number = sqlx::query_scalar(
            "INSERT INTO policies (name) VALUES (?) ON CONFLICT (name) DO UPDATE SET name = name RETURNING number",
        )
        .bind(policy.as_str())
        .fetch_one(connection)
        .await?;

        self.policies.insert(policy.clone(), number);
        Ok(Some(number))
    }
}

/// Moves what was written from the log into the database, as far as readers allow. It takes no turn, so writers
/// continue meanwhile.
async fn checkpoint(store: &Store) {
    if let Err(error) = sqlx::query("PRAGMA wal_checkpoint(PASSIVE)").execute(&store.inner.checkpoints).await {
        tracing::warn!("the database's log could not be moved into its file: {error}; the server tries again");
    }
}

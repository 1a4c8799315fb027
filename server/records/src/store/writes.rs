//! How writing to the database goes: how long it takes, and whether it works. Reading these figures waits for no writer
//! and no disk.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::histogram::Histogram;
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio::sync::MutexGuard;
use tokio::time::Instant;

use super::StoreError;

/// Upper bounds of the histograms' buckets, in seconds: from a solid-state disk's few milliseconds to a disk that
/// hangs.
const BUCKETS: [f64; 12] = [5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.5, 1.0, 5.0];

/// Times of writing, by what was written: `records`, which are on disk when the time ends, or `telemetry`.
pub type WriteTimes = Family<[(&'static str, &'static str); 1], Histogram>;

/// How much telemetry was written or lost since the start of the server.
#[derive(Debug, Default)]
pub struct Counts {
    /// Records written.
    pub written: AtomicU64,
    /// Failed attempts to write a batch.
    pub failed_batches: AtomicU64,
    /// Records dropped because the disk failed for too long.
    pub lost: AtomicU64,
}

/// How writing to the database went since the server's start.
#[derive(Debug)]
pub struct Writes {
    times: WriteTimes,
    /// Times of writing what people said and did, and what the chain needs.
    pub(super) records: Histogram,
    /// Times of writing batches of the control loop's steps.
    pub(super) telemetry: Histogram,
    origin: Instant,
    /// When the write under way began.
    under_way: Mark,
    /// When the first write failed since the last one that worked.
    failing: Mark,
    /// When a write failed last.
    failed: Mark,
}

impl Default for Writes {
    fn default() -> Self {
        let times = WriteTimes::new_with_constructor(|| Histogram::new(BUCKETS));
        let of = |what| times.get_or_create(&[("what", what)]).clone();
        let records = of("records");
        let telemetry = of("telemetry");

        Self {
            times,
            records,
            telemetry,
            origin: Instant::now(),
            under_way: Mark::default(),
            failing: Mark::default(),
            failed: Mark::default(),
        }
    }
}

impl Writes {
    /// Times of writing.
    #[must_use]
    pub const fn times(&self) -> &WriteTimes {
        &self.times
    }

    /// How long the write under way has taken so far; `None` if there is none.
    #[must_use]
    pub fn under_way_for(&self) -> Option<Duration> {
        self.under_way.age(self.now())
    }

    /// How long writes have been failing; `None` if the last one worked.
    #[must_use]
    pub fn failing_for(&self) -> Option<Duration> {
        self.failing.age(self.now())
    }

    /// How long ago a write last failed; `None` if none ever did.
    #[must_use]
    pub fn failed_ago(&self) -> Option<Duration> {
        self.failed.age(self.now())
    }

    /// Notes the outcome of a write. Only failures of the disk and the database count. A record that is refused is no
    /// reason to worry about the disk.
    pub(super) fn note<T>(&self, outcome: &Result<T, StoreError>) {
        match outcome {
            Ok(_) => self.failing.clear(),
            Err(error) if error.is_of_the_disk() => {
                self.failing.set_if_clear(self.now());
                self.failed.set(self.now());
            }
            Err(_) => {}
        }
    }

    /// Begins a turn of writing, whose time goes into `times`. `guard` is the right to write.
    pub(super) fn begin<'a>(&'a self, guard: MutexGuard<'a, ()>, times: &'a Histogram) -> Turn<'a> {
        self.under_way.set(self.now());
        Turn { writes: self, times, began: Instant::now(), _guard: guard }
    }

    fn now(&self) -> Duration {
        self.origin.elapsed()
    }
}

/// A writer's turn; ends when dropped.
#[derive(Debug)]
pub(super) struct Turn<'a> {
    writes: &'a Writes,
    times: &'a Histogram,
    began: Instant,
    _guard: MutexGuard<'a, ()>,
}

impl Turn<'_> {
    /// Writes in a transaction on a connection of `pool`, and notes how that went.
    pub(super) async fn write<T>(
        &self,
        pool: &SqlitePool,
        write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let outcome = write_on(pool, write).await;
        self.writes.note(&outcome);
        outcome
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.times.observe(self.began.elapsed().as_secs_f64());
        self.writes.under_way.clear();
    }
}

/// Writes in a transaction on a connection of `pool`: all that `write` writes is committed when this returns, or
/// nothing is if it fails. Then the connection is closed, and the pool opens another: a full disk can undo a
/// transaction behind the driver's back or leave it half open, and a half-open one would keep all others from writing
/// forever.
pub(super) async fn write_on<T>(
    pool: &SqlitePool,
    write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    let mut connection = pool.acquire().await?;
    let outcome = in_transaction(&mut connection, write).await;
    if outcome.is_err() {
        connection.close_on_drop();
    }
    outcome
}

async fn in_transaction<T>(
    connection: &mut SqliteConnection,
    write: impl AsyncFnOnce(&mut SqliteConnection) -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    // It has the right to write from its beginning, so that nobody else writes between its reads and its writes.
    let mut transaction = connection.begin_with("BEGIN IMMEDIATE").await?;
    let written = write(&mut transaction).await?;
    transaction.commit().await?;
    Ok(written)
}

/// A time after the origin in milliseconds, plus one; 0 for none.
#[derive(Debug, Default)]
struct Mark(AtomicU64);

impl Mark {
    fn value(at: Duration) -> u64 {
        u64::try_from(at.as_millis()).unwrap_or(u64::MAX - 1) + 1
    }

    fn set(&self, at: Duration) {
        self.0.store(Self::value(at), Ordering::Relaxed);
    }

    fn set_if_clear(&self, at: Duration) {
        // If it is set already, it stays as it is.
        let _ = self.0.compare_exchange(0, Self::value(at), Ordering::Relaxed, Ordering::Relaxed);
    }

    fn clear(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    fn age(&self, now: Duration) -> Option<Duration> {
        let at = self.0.load(Ordering::Relaxed).checked_sub(1)?;
        Some(now.saturating_sub(Duration::from_millis(at)))
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::Mutex;

    use super::*;

    #[test]
    fn a_mark_has_an_age_until_it_is_cleared_and_is_not_set_twice() {
        let at = Duration::from_secs;
        let mark = Mark::default();
        assert_eq!(mark.age(at(5)), None);
        mark.set_if_clear(at(0));
        mark.set_if_clear(at(3));
        assert_eq!(mark.age(at(5)), Some(at(5)), "since the first time");
        mark.set(at(3));
        assert_eq!(mark.age(at(5)), Some(at(2)));
        mark.clear();
        assert_eq!(mark.age(at(5)), None);
    }

    #[tokio::test]
    async fn writes_fail_from_a_failure_of_the_disk_until_one_works() {
        let writes = Writes::default();
        writes.note(&Err::<(), _>(StoreError::ErasureUnfinished));
        assert_eq!((writes.failing_for(), writes.failed_ago()), (None, None), "the disk works");

        writes.note(&Err::<(), _>(StoreError::Full));
        assert!(writes.failing_for().is_some());
        writes.note(&Ok(()));
        assert_eq!(writes.failing_for(), None);
        assert!(writes.failed_ago().is_some(), "it is remembered");
    }

    #[tokio::test]
    async fn a_write_is_under_way_until_its_turn_ends() {
        let writes = Writes::default();
        let right = Mutex::new(());
        let turn = writes.begin(right.lock().await, &writes.records);
        assert!(writes.under_way_for().is_some());
        drop(turn);
        assert_eq!(writes.under_way_for(), None);
    }
}

//! How writing to the database goes: how long it takes, and whether it works. Reading these figures waits for no writer
//! and no disk.

use std::sync::atomic::AtomicU64;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::histogram::Histogram;
use sqlx::Connection;
use sqlx::sqlite::{SqliteConnection, SqlitePool};
use tokio::sync::{MutexGuard, oneshot};
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

/// Somebody who waits for telemetry. Told when the steps that came before it are in the database.
pub(super) type Waiter = oneshot::Sender<()>;

/// How writing to the database went since the server's start.
#[derive(Debug)]
pub struct Writes {
    times: WriteTimes,
    /// Times of writing what people said and did, and what the chain needs.
    pub(super) records: Histogram,
    /// Times of writing batches of the control loop's steps.
    pub(super) telemetry: Histogram,
    marks: Mutex<Marks>,
}

#[derive(Debug, Default)]
struct Marks {
    /// When the write under way began.
    under_way: Option<Instant>,
    /// When the first write failed since the last one that worked.
    failing: Option<Instant>,
    /// When a write failed last.
    failed: Option<Instant>,
}

impl Default for Writes {
    fn default() -> Self {
        let times = WriteTimes::new_with_constructor(|| Histogram::new(BUCKETS));
        let of = |what| times.get_or_create(&[("what", what)]).clone();
        let records = of("records");
        let telemetry = of("telemetry");

        Self { times, records, telemetry, marks: Mutex::default() }
    }
}

impl Writes {
    /// Times of writing.
    pub const fn times(&self) -> &WriteTimes {
        &self.times
    }

    /// How long the write under way has taken so far; `None` if there is none.
    pub fn under_way_for(&self) -> Option<Duration> {
        self.marks().under_way.map(|began| began.elapsed())
    }

    /// How long writes have been failing; `None` if the last one worked.
    pub fn failing_for(&self) -> Option<Duration> {
        self.marks().failing.map(|since| since.elapsed())
    }

    /// How long ago a write last failed; `None` if none ever did.
    pub fn failed_ago(&self) -> Option<Duration> {
        self.marks().failed.map(|last| last.elapsed())
    }

    /// Notes the outcome of a write. Only failures of the disk and the database count. A record that is refused is no
    /// reason to worry about the disk.
    pub(super) fn note<T>(&self, outcome: &Result<T, StoreError>) {
        match outcome {
            Ok(_) => self.marks().failing = None,
            Err(error) if error.is_of_the_disk() => {
                let now = Instant::now();
                let mut marks = self.marks();
                marks.failing.get_or_insert(now);
                marks.failed = Some(now);
            }
            Err(_) => {}
        }
    }

    /// Begins a turn of writing, whose time goes into `times`. `guard` is the right to write.
    pub(super) fn begin<'a>(&'a self, guard: MutexGuard<'a, ()>, times: &'a Histogram) -> Turn<'a> {
        let began = Instant::now();
        self.marks().under_way = Some(began);
        Turn { writes: self, times, began, _guard: guard }
    }

    fn marks(&self) -> std::sync::MutexGuard<'_, Marks> {
        self.marks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A writer's turn; ends when dropped.
#[derive(Debug)]
#[must_use]
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
        self.writes.marks().under_way = None;
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

#[cfg(test)]
mod tests {
    use tokio::sync::Mutex;

    use super::*;

    #[tokio::test]
    async fn writes_fail_from_a_failure_of_the_disk_until_one_works() {
        let writes = Writes::default();
        writes.note(&Err::<(), _>(StoreError::ErasureUnfinished));
        assert_eq!((writes.failing_for(), writes.failed_ago()), (None, None), "the disk works");

        writes.note(&Err::<(), _>(StoreError::Full));
        let first = writes.marks().failing;
        writes.note(&Err::<(), _>(StoreError::Full));
        assert_eq!(writes.marks().failing, first, "since the first time, not the last");
        assert!(writes.marks().failed > first, "the last time");
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

//! Telemetry in the chain. The steps of a segment are chained in blocks, because one row for each step would be too
//! many.
//!
//! A block is hashed in two parts: the columns that every export has, and, with a salt, those that reveal the policy.

use futures_util::TryStreamExt;
use sqlx::Row;
use sqlx::sqlite::{SqliteConnection, SqliteRow};

use super::append::{NewRow, insert, salt};
use super::form::{Fields, begin_sealed, content};
use super::kinds::TELEMETRY;
use super::records::cell;
use crate::store::StoreError;

/// Most steps of a block: two and a half minutes at 50 a second.
const MOST: i64 = 8192;

/// Columns of `telemetry.csv` that are hashed.
pub const OPEN: [&str; 10] =
    ["run", "frame", "exposed_ns", "asked", "measured", "held", "optimal", "picture_width", "patch_x", "patch_y"];

/// Columns of `policy_steps.csv` that are hashed.
pub const SEALED: [&str; 5] = ["policy", "metric", "policy_micros", "latency_micros", "held"];

/// Selects the columns of both, those of `SEALED` with `step_` before their names. Gives steps `?2 + 1` to `?2 + ?3` of
/// segment `?1`.
const STEPS: &str = concat!(
    "SELECT t.run, t.frame, t.exposed_ns, t.asked, t.measured, iif(",
    held_openly!(),
    ", 'true', 'false') AS held,
        t.optimal, t.picture_width, t.patch_x, t.patch_y, p.name AS step_policy, t.metric AS step_metric,
        t.policy_micros AS step_policy_micros, t.latency_micros AS step_latency_micros, t.held AS step_held
    FROM telemetry AS t LEFT JOIN policies AS p ON p.number = t.policy
    WHERE t.segment = (SELECT number FROM segments WHERE segment = ?1) ORDER BY t.number LIMIT ?3 OFFSET ?2"
);

/// Which steps of a segment a block holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Block {
    /// Id of the segment.
    pub segment: String,
    /// Its first step, from 1.
    pub first: i64,
    /// Its last step.
    pub last: i64,
}

impl Block {
    /// The block whose row has this key, `SEGMENT/FIRST/LAST`; `None` if the key has another form.
    pub fn of(key: &str) -> Option<Self> {
        let (segment, steps) = key.split_once('/')?;
        let (first, last) = steps.split_once('/')?;
        let block = Self { segment: segment.to_owned(), first: first.parse().ok()?, last: last.parse().ok()? };
        (1 <= block.first && block.first <= block.last && block.key() == key).then_some(block)
    }

    /// Its row's key, `SEGMENT/FIRST/LAST`.
    pub fn key(&self) -> String {
        format!("{}/{}/{}", self.segment, self.first, self.last)
    }

    /// How many steps it holds.
    pub const fn steps(&self) -> i64 {
        self.last - self.first + 1
    }

    /// Its hash as a record. `open` is the hash of its open columns, `sealed` that of its sealed columns.
    pub fn content(&self, open: &str, sealed: &str) -> String {
        let first = self.first.to_string();
        let last = self.last.to_string();
        let columns = [("segment", self.segment.as_str()), ("first", &first), ("last", &last), ("steps_sha256", open)];
        content(TELEMETRY, columns, sealed)
    }
}

/// Begins the hash over open columns.
pub fn begin_open() -> Fields {
    Fields::of("parfocal-steps-1")
}

/// The hashes of a block.
pub struct Hashes {
    /// Steps of the block that were found.
    pub steps: i64,
    /// The hash of its open columns.
    pub open: String,
    /// The hash of its sealed columns.
    pub sealed: String,
}

/// Hashes the steps of `block` that the database has.
pub async fn hashes(connection: &mut SqliteConnection, block: &Block, salt: &str) -> Result<Hashes, StoreError> {
    let mut open = begin_open();
    let mut sealed = begin_sealed(salt);
    let mut steps = 0;

    let query = sqlx::query(STEPS).bind(&block.segment).bind(block.first - 1).bind(block.steps());
    let mut rows = query.fetch(connection);
    while let Some(row) = rows.try_next().await? {
        steps += 1;
        add(&mut open, &row, 0, OPEN.len())?;
        add(&mut sealed, &row, OPEN.len(), SEALED.len())?;
    }

    Ok(Hashes { steps, open: open.hex(), sealed: sealed.hex() })
}

fn add(list: &mut Fields, row: &SqliteRow, from: usize, count: usize) -> Result<(), StoreError> {
    for column in from..from + count {
        list.add(&cell(row.try_get_raw(column)?)?);
    }
    Ok(())
}

/// Chains the steps of `session` that have no block yet. Returns how many there were.
pub async fn seal(connection: &mut SqliteConnection, session: &str, wall: &str) -> Result<i64, StoreError> {
    let mut sealed_now = 0;
    for (segment, steps, sealed) in unsealed(connection, session).await? {
        let mut first = sealed + 1;
        while first <= steps {
            let block = Block { segment: segment.clone(), first, last: steps.min(first + MOST - 1) };
            let sealed_salt = salt()?;
            let hashes = hashes(connection, &block, &sealed_salt).await?;
            let row = NewRow {
                wall,
                kind: TELEMETRY,
                key: &block.key(),
                session,
                content: block.content(&hashes.open, &hashes.sealed),
                sealed: hashes.sealed,
                sealed_salt,
            };

            insert(connection, row).await?;
            sealed_now += block.steps();
            first = block.last + 1;
        }
    }
    Ok(sealed_now)
}

/// The segments of `session` that have steps without a block: id, number of steps, number of steps in blocks.
pub async fn unsealed(connection: &mut SqliteConnection, session: &str) -> Result<Vec<(String, i64, i64)>, StoreError> {
    let blocks = sqlx::query_scalar("SELECT key FROM chain WHERE session = ? AND kind = ?");
    let blocks: Vec<String> = blocks.bind(session).bind(TELEMETRY).fetch_all(&mut *connection).await?;
    let blocks: Vec<Block> = blocks.iter().filter_map(|key| Block::of(key)).collect();

    let counts = sqlx::query_as(
        "SELECT segment, (SELECT count(*) FROM telemetry AS t WHERE t.segment = g.number)
         FROM segments AS g WHERE session = ? ORDER BY setting",
    );
    let counts: Vec<(String, i64)> = counts.bind(session).fetch_all(connection).await?;

    let sealed = |segment: &str| {
        blocks.iter().filter(|block| block.segment == segment).map(|block| block.last).max().unwrap_or(0)
    };
    let segments = counts.into_iter().map(|(segment, steps)| {
        let sealed = sealed(&segment);
        (segment, steps, sealed)
    });
    Ok(segments.filter(|(_, steps, sealed)| steps > sealed).collect())
}

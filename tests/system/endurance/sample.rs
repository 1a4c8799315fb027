//! Measures a running server from outside: its memory, descriptors and database, and the loop's latency.

use std::fs;

use parfocal_pipeline::control::LatencyFigures;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{ConnectOptions, Connection};

use crate::support::Server;

/// One measurement of the server.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Seconds since the measurement began.
    pub at: f64,
    /// Memory in use (resident set), KiB.
    pub memory: u64,
    /// Number of open file descriptors.
    pub descriptors: u64,
    /// Number of threads.
    pub threads: u64,
    /// Bytes of the database.
    pub database: u64,
    /// Number of the loop's steps since the previous sample.
    pub steps: usize,
    /// 99th percentile of the time from exposure to lens command in those steps, in microseconds.
    pub p99: u32,
}

/// Samples a server.
pub struct Observer {
    process: u32,
    database: SqliteConnection,
    /// Number of the last step seen.
    last: i64,
}

impl Observer {
    /// Observes `server`; its steps count from now on.
    pub async fn of(server: &Server) -> Self {
        let file = server.data.path().join("parfocal.db");
        let mut database = SqliteConnectOptions::new().filename(file).read_only(true).connect().await.unwrap();
        let last = sqlx::query_scalar("SELECT coalesce(max(number), 0) FROM telemetry");
        let last = last.fetch_one(&mut database).await.unwrap();
        Self { process: server.id(), database, last }
    }

    /// Samples the server, `at` seconds after the beginning.
    pub async fn look(&mut self, at: f64) -> Sample {
        let steps: Vec<(i64, u32)> =
            sqlx::query_as("SELECT number, latency_micros FROM telemetry WHERE number > ? ORDER BY number")
                .bind(self.last)
                .fetch_all(&mut self.database)
                .await
                .unwrap();
        self.last = steps.last().map_or(self.last, |step| step.0);
        let mut latencies: Vec<u32> = steps.iter().map(|step| step.1).collect();
        let figures = LatencyFigures::of(&mut latencies);

        Sample {
            at,
            memory: self.status("VmRSS:"),
            descriptors: fs::read_dir(format!("/proc/{}/fd", self.process)).unwrap().count() as u64,
            threads: self.status("Threads:"),
            database: self.database_bytes().await,
            steps: figures.steps,
            p99: figures.p99,
        }
    }

    /// Number of comments on disk.
    pub async fn comments(&mut self) -> usize {
        let count: i64 =
            sqlx::query_scalar("SELECT count(*) FROM comments").fetch_one(&mut self.database).await.unwrap();
        usize::try_from(count).unwrap()
    }

    /// Closes the connection to the database.
    pub async fn close(self) {
        self.database.close().await.unwrap();
    }

    /// Size of the database in bytes, including what is still in its log.
    async fn database_bytes(&mut self) -> u64 {
        let sql = "SELECT page_count * page_size FROM pragma_page_count(), pragma_page_size()";
        let bytes: i64 = sqlx::query_scalar(sql).fetch_one(&mut self.database).await.unwrap();
        bytes.cast_unsigned()
    }

    /// A number in the process's status file.
    fn status(&self, name: &str) -> u64 {
        let text = fs::read_to_string(format!("/proc/{}/status", self.process)).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.trim().trim_end_matches(" kB").parse().unwrap()
    }
}

//! Accesses to the evidence. Each access is a record of its own, with a row in the chain.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sqlx::sqlite::SqliteConnection;

use super::actors::name_actor;
use super::chain::{self, Head};
use super::insert::Insert;
use super::schema::DATABASE;
use super::values::nanoseconds;
use super::writer::Writer;
use super::{Reader, Store, StoreError};
use parfocal_base::boxed;
use parfocal_base::clock::Clock;
use parfocal_base::ids::SessionId;
use parfocal_trial::account::{AccountName, Actor};
use parfocal_trial::role::Role;

/// An act that shows evidence to somebody, or copies it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Access {
    /// Was let in by a role's link.
    Entered,
    /// Looked at the focal path of a session, which may reveal the policies.
    PathViewed(SessionId),
    /// Looked at the recording of a session.
    RecordingViewed(SessionId),
    /// Exported a session.
    Exported {
        /// The exported session.
        session: SessionId,
        /// Whether the policies are in the export.
        unblinded: bool,
    },
    /// Looked at the analysis of a study, or downloaded it.
    AnalysisViewed {
        /// The study's name.
        study: String,
    },
    /// Copied the database, policies included.
    BackedUp,
    /// Replaced a database by a backup.
    Restored {
        /// Chain head of the replaced database; `None` if there was no readable one.
        replaced: Option<Head>,
    },
}

impl Access {
    const fn name(&self) -> &'static str {
        match self {
            Self::Entered => "entered",
            Self::PathViewed(_) => "path-viewed",
            Self::RecordingViewed(_) => "recording-viewed",
            Self::Exported { .. } => "exported",
            Self::AnalysisViewed { .. } => "analysis-viewed",
            Self::BackedUp => "backed-up",
            Self::Restored { .. } => "restored",
        }
    }

    const fn session(&self) -> Option<SessionId> {
        match self {
            Self::PathViewed(session) | Self::RecordingViewed(session) | Self::Exported { session, .. } => {
                Some(*session)
            }
            _ => None,
        }
    }

    fn detail(&self) -> Option<String> {
        match self {
            Self::Exported { unblinded, .. } => Some(if *unblinded { "unblinded" } else { "blinded" }.to_owned()),
            Self::AnalysisViewed { study } => Some(study.clone()),
            Self::Restored { replaced: Some(head) } => Some(format!("replaced {head}")),
            _ => None,
        }
    }
}

/// Records accesses to a database, in that database.
#[derive(Clone)]
pub struct AccessLog {
    writer: Writer,
    /// The data folder.
    folder: PathBuf,
    /// The person's role; `None` on the command line.
    role: Option<Role>,
    /// The person's account; `None` if nobody is signed in.
    account: Option<AccountName>,
    clock: Arc<dyn Clock>,
}

impl AccessLog {
    /// Records what `by` does through the server.
    pub fn of_server(store: &Store, by: Actor, clock: Arc<dyn Clock>) -> Self {
        let folder = store.inner.folder.clone();
        let Actor { role, account } = by;
        Self { writer: Writer::Server(store.clone()), folder, role: Some(role), account, clock }
    }

    /// Records what is done from the command line with the database of data folder `folder`, whether or not a server
    /// has it open.
    ///
    /// # Errors
    /// If there is no database, it is of another version, or it cannot be written.
    pub async fn open(folder: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        Self::open_file(&folder.join(DATABASE), clock).await
    }

    pub(super) async fn open_file(file: &Path, clock: Arc<dyn Clock>) -> Result<Self, StoreError> {
        let writer = Writer::of_command(file).await?;
        let folder = file.parent().map(Path::to_owned).unwrap_or_default();
        Ok(Self { writer, folder, role: None, account: None, clock })
    }

    /// The data folder.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The account of the person whose accesses it records; `None` if nobody is signed in.
    pub const fn account(&self) -> Option<&AccountName> {
        self.account.as_ref()
    }

    /// The reader of the same database.
    pub fn reader(&self) -> &Reader {
        self.writer.reader()
    }

    /// Records `access` and returns the chain's new head. The record is on disk when this returns.
    ///
    /// # Errors
    /// If the disk or database fails.
    pub async fn record(&self, access: &Access) -> Result<Head, StoreError> {
        let run = self.writer.run();
        self.writer.write(async |connection| self.record_on(connection, run, access).await).await
    }

    /// Closes its connections, unless they are the server's.
    pub async fn close(&self) {
        self.writer.close().await;
    }

    #[boxed]
    async fn record_on(
        &self,
        connection: &mut SqliteConnection,
        run: Option<i64>,
        access: &Access,
    ) -> Result<Head, StoreError> {
        let wall = self.clock.wall().to_string();
        let session = access.session().map(|session| session.to_string());

        // A backup may hold sign-ins that were ended since it was made. So a restore ends all sign-ins.
        if matches!(access, Access::Restored { .. }) {
            sqlx::query("DELETE FROM sign_ins").execute(&mut *connection).await?;
        }

        // Chains the session's telemetry first, so that the export can prove it.
        if let Access::Exported { session, .. } = access {
            chain::seal(connection, &session.to_string(), &wall).await?;
        }

        let number = Insert::into("accesses")
            .set("run", run)
            .set("wall", &wall)
            .set("monotonic_ns", run.map(|_| nanoseconds(self.clock.now())))
            .set("role", self.role.map_or("command-line", Role::name))
            .set("kind", access.name())
            .set("session", session)
            .set("detail", access.detail())
            .execute(connection)
            .await?
            .to_string();

        name_actor(connection, self.account.as_ref(), "access", &number, access.session(), &wall).await?;
        // Last, because the chain in an export ends with the record of that export.
        chain::append(connection, "access", &number, &wall).await
    }
}

//! What is made in the background while the server runs, to be downloaded: under each name one thing at a time. What is
//! made is kept for a while, so that an interrupted download can be repeated, and then removed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// How far something is.
#[derive(Debug, Clone)]
pub enum Stage<Progress, Made> {
    /// It is being made.
    Running(Progress),
    /// It could not be made, or was given up; with the reason, for people.
    Failed(String),
    /// It can be downloaded.
    Ready(Made),
}

/// The latest thing under a name.
struct Latest<Order, Progress, Made> {
    order: Order,
    stage: Stage<Progress, Made>,
    /// Distinguishes it from earlier ones under its name.
    number: u64,
}

type LatestByName<Order, Progress, Made> = BTreeMap<String, Latest<Order, Progress, Made>>;

/// The latest thing under each name. `Order` says what was asked for. The files of a `Made` are removed when its last
/// clone is dropped. Clones share everything.
pub struct Downloads<Order, Progress, Made> {
    folder: PathBuf,
    kept: Duration,
    latest: Arc<Mutex<LatestByName<Order, Progress, Made>>>,
}

impl<Order, Progress, Made> Clone for Downloads<Order, Progress, Made> {
    fn clone(&self) -> Self {
        Self { folder: self.folder.clone(), kept: self.kept, latest: Arc::clone(&self.latest) }
    }
}

impl<Order, Progress, Made> Downloads<Order, Progress, Made>
where
    Order: Clone + Send + 'static,
    Progress: Clone + Default + Send + 'static,
    Made: Clone + Send + 'static,
{
    /// Starts with nothing. Removes what an earlier server left in `folder`, in which things are made. What is made, or
    /// failed, is `kept` for so long.
    pub fn new(folder: PathBuf, kept: Duration) -> Self {
        match std::fs::remove_dir_all(&folder) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                tracing::warn!("{} is left from an earlier server and cannot be removed: {error}", folder.display());
            }
            _ => {}
        }
        Self { folder, kept, latest: Arc::default() }
    }

    /// The folder in which things are made.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What was last asked for under `name`, and how far it is.
    pub fn latest(&self, name: &str) -> Option<(Order, Stage<Progress, Made>)> {
        self.lock().get(name).map(|latest| (latest.order.clone(), latest.stage.clone()))
    }

    /// Begins what `making` makes under `name`, unless something is being made there. `making` fails with a reason for
    /// people. What was made there before is removed now, because the disk may not have room for both.
    pub fn start<Making>(&self, name: &str, order: Order, making: Making)
    where
        Making: Future<Output = Result<Made, String>> + Send + 'static,
    {
        let mut latest = self.lock();
        let number = match latest.get(name) {
            Some(Latest { stage: Stage::Running(_), .. }) => return,
            Some(earlier) => earlier.number + 1,
            None => 1,
        };
        let started = Latest { order, stage: Stage::Running(Progress::default()), number };
        let before = latest.insert(name.to_owned(), started);
        drop(latest);
        forget(before);

        let downloads = self.clone();
        let name = name.to_owned();
        tokio::spawn(async move {
            // All that `making` holds is dropped before the wait, so that a server that stops meanwhile can close its
            // database.
            let stage = match making.await {
                Ok(made) => Stage::Ready(made),
                Err(reason) => {
                    let folder = downloads.folder.display();
                    tracing::warn!(%folder, name, "a file to download could not be made: {reason}");
                    Stage::Failed(reason)
                }
            };
            downloads.reach(&name, stage);

            tokio::time::sleep(downloads.kept).await;
            downloads.remove(&name, number);
        });
    }

    /// Notes the `progress` of what is being made under `name`.
    pub fn report(&self, name: &str, progress: Progress) {
        self.reach(name, Stage::Running(progress));
    }

    /// Removes what was made under `name` if it `is_outdated`, for the `reason` that people then read.
    pub fn give_up(&self, name: &str, is_outdated: impl FnOnce(&Made) -> bool, reason: &str) {
        let mut latest = self.lock();
        let Some(latest_there) = latest.get_mut(name) else { return };
        let Stage::Ready(made) = &latest_there.stage else { return };
        if is_outdated(made) {
            let outdated = std::mem::replace(&mut latest_there.stage, Stage::Failed(reason.to_owned()));
            drop(latest);
            forget(Some(outdated));
        }
    }

    fn reach(&self, name: &str, stage: Stage<Progress, Made>) {
        if let Some(latest) = self.lock().get_mut(name) {
            latest.stage = stage;
        }
    }

    /// Removes what is under `name`, unless a later one than `number` has taken its place.
    fn remove(&self, name: &str, number: u64) {
        let mut latest = self.lock();
        let is_same = latest.get(name).is_some_and(|latest| latest.number == number);
        let removed = if is_same { latest.remove(name) } else { None };
        drop(latest);
        forget(removed);
    }

    fn lock(&self) -> MutexGuard<'_, LatestByName<Order, Progress, Made>> {
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Drops what may have files on a thread that may block on the disk.
fn forget<Dropped: Send + 'static>(dropped: Option<Dropped>) {
    if dropped.is_some() {
        tokio::task::spawn_blocking(move || drop(dropped));
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::oneshot;

    use super::*;

    /// Something that was made; whoever holds the other end notices when its last clone is dropped.
    type Made = Arc<oneshot::Sender<()>>;
    type Things = Downloads<&'static str, u8, Made>;

    fn made() -> (Made, oneshot::Receiver<()>) {
        let (made, dropped) = oneshot::channel();
        (Arc::new(made), dropped)
    }

    /// Waits until what was begun under `name` has ended.
    async fn ended(things: &Things, name: &str) -> Stage<u8, Made> {
        loop {
            match things.latest(name) {
                Some((_, Stage::Running(_))) => tokio::task::yield_now().await,
                Some((_, stage)) => return stage,
                None => panic!("{name} is gone"),
            }
        }
    }

    #[tokio::test]
    async fn one_thing_at_a_time_is_made_under_a_name_and_given_up_once_it_is_outdated() {
        let data = tempfile::tempdir().unwrap();
        let things = Things::new(data.path().join("things"), Duration::from_mins(1));
        let (finish, finished) = oneshot::channel();
        let (thing, dropped) = made();
        things.start("a", "first", async move { finished.await.map_err(|error| error.to_string()) });
        things.start("a", "second", async { Err("it must not begin".to_owned()) });
        things.start("b", "other", async { Err("full".to_owned()) });
        things.report("a", 7);
        assert!(matches!(things.latest("a"), Some(("first", Stage::Running(7)))));
        assert!(matches!(ended(&things, "b").await, Stage::Failed(reason) if reason == "full"));

        finish.send(thing).unwrap();
        assert!(matches!(ended(&things, "a").await, Stage::Ready(_)));
        things.give_up("a", |_| false, "outdated");
        assert!(matches!(ended(&things, "a").await, Stage::Ready(_)));
        things.give_up("a", |_| true, "outdated");
        assert!(matches!(ended(&things, "a").await, Stage::Failed(reason) if reason == "outdated"));
        assert!(dropped.await.is_err(), "nobody holds it any more");
    }

    #[tokio::test]
    async fn what_was_made_goes_when_the_next_begins_or_after_a_while_and_takes_no_later_one_with_it() {
        let data = tempfile::tempdir().unwrap();
        let folder = data.path().join("things");
        std::fs::create_dir(&folder).unwrap();
        let things = Things::new(folder.clone(), Duration::from_secs(1));
        assert!(!folder.exists(), "what an earlier server left is removed");

        let (first, first_dropped) = made();
        things.start("a", "first", async { Ok(first) });
        ended(&things, "a").await;
        let (second, second_dropped) = made();
        things.start("a", "second", async { Ok(second) });
        assert!(first_dropped.await.is_err());
        assert!(matches!(ended(&things, "a").await, Stage::Ready(_)));

        assert!(second_dropped.await.is_err());
        assert!(things.latest("a").is_none());
    }
}

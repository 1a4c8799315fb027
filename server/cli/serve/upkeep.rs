//! Work that goes on as long as the server does, whatever happens to it.

use std::time::Duration;

use tokio::task::{JoinHandle, JoinSet};
use tokio::time::sleep;

/// Time from a failure to the next attempt, so that what fails at once fills no log.
const PAUSE: Duration = Duration::from_secs(1);

/// Lets a copy of `worker` `run` in a task of its own, and another one whenever it panics: nobody waits for it, so nobody
/// would notice. `what` names it in the log.
pub fn keep_up<Worker, Work>(
    what: &'static str,
    worker: &Worker,
    run: impl Fn(Worker) -> Work + Send + 'static,
) -> JoinHandle<()>
where
    Worker: Clone + Send + 'static,
    Work: Future<Output = ()> + Send + 'static,
{
    let worker = worker.clone();
    tokio::spawn(async move {
        // When this task is aborted, so is the one in the set.
        let mut task = JoinSet::new();
        task.spawn(run(worker.clone()));
        while let Some(Err(error)) = task.join_next().await {
            tracing::error!(%error, "{what} has failed, and begins again");
            sleep(PAUSE).await;
            task.spawn(run(worker.clone()));
        }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[tokio::test]
    async fn what_panics_begins_again_and_what_ends_does_not() {
        let begun = Arc::new(AtomicU32::new(0));
        let kept = keep_up("counting", &begun, |begun| async move {
            let attempt = begun.fetch_add(1, Ordering::Relaxed);
            assert!(attempt == 1, "attempt {attempt} fails on purpose");
        });
        kept.await.unwrap();
        assert_eq!(begun.load(Ordering::Relaxed), 2);
    }

    #[tokio::test]
    async fn what_is_aborted_has_ended() {
        let works = Arc::new(());
        let kept = keep_up("waiting", &works, |held| async move {
            std::future::pending::<()>().await;
            drop(held);
        });
        tokio::task::yield_now().await;
        kept.abort();
        assert!(kept.await.unwrap_err().is_cancelled());
        tokio::task::yield_now().await;
        assert_eq!(Arc::strong_count(&works), 1);
    }
}

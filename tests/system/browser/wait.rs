//! Waits for conditions, never for fixed times.

use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(30);
const PAUSE: Duration = Duration::from_millis(100);

/// Waits until `condition` holds. Panics, naming `what`, after a long time.
pub async fn until<F: Future<Output = bool>>(what: &str, condition: impl FnMut() -> F) {
    assert!(comes_true(condition).await, "waited {PATIENCE:?} for {what}");
}

/// Waits until `condition` holds; false if it does not after a long time.
pub async fn comes_true<F: Future<Output = bool>>(mut condition: impl FnMut() -> F) -> bool {
    let held = async {
        while !condition().await {
            tokio::time::sleep(PAUSE).await;
        }
    };
    tokio::time::timeout(PATIENCE, held).await.is_ok()
}

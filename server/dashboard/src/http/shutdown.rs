//! Lets streams wait for the server's shutdown.

use tokio::sync::watch;

/// Waits until the server is asked to shut down.
pub(crate) async fn ended(shutdown: &mut watch::Receiver<bool>) {
    let _ = shutdown.wait_for(|end| *end).await;
}

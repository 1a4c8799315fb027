//! The server's end, as streams wait for it.

use tokio::sync::watch;

/// Waits until the server is to end.
pub(crate) async fn ended(shutdown: &mut watch::Receiver<bool>) {
    let _ = shutdown.wait_for(|end| *end).await;
}

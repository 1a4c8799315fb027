//! Waits for a command's asynchronous work, such as a database query.

use std::io;

/// Runs `work` to its end on this thread.
///
/// # Errors
/// If the system refuses a resource that waiting needs, such as one more open file.
pub fn wait_for<T>(work: impl Future<Output = T>) -> io::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(work))
}

//! A panic as an error, so that a thread outlives the failure of one piece of its work.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `risky` and turns a panic into an error with its message.
///
/// # Errors
/// If it panics.
pub fn guarded<T>(risky: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(risky)).map_err(|payload| message(&*payload))
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("no message").to_owned()
}

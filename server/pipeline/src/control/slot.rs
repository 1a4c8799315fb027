//! A slot that holds only the latest value. Putting never waits; taking waits for a new value.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Holds the latest value. A value that is not taken before the next one is put is dropped and counted.
#[derive(Debug)]
pub struct LatestSlot<T> {
    state: Mutex<State<T>>,
    fresh: Condvar,
}

#[derive(Debug)]
struct State<T> {
    value: Option<T>,
    overwritten: u64,
    closed: bool,
}

impl<T> Default for LatestSlot<T> {
    fn default() -> Self {
        Self { state: Mutex::new(State { value: None, overwritten: 0, closed: false }), fresh: Condvar::new() }
    }
}

impl<T> LatestSlot<T> {
    /// Puts `value` into the slot. Drops the previous value if it was not taken.
    pub fn put(&self, value: T) {
        // The old value is dropped after the lock is released, because freeing a frame takes longer than swapping it.
        let _old = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let old = state.value.replace(value);
            state.overwritten += u64::from(old.is_some());
            old
        };

        self.fresh.notify_one();
    }

    /// Waits for a value, for at most `timeout`; `None` if none came or the slot is closed and empty.
    pub fn take(&self, timeout: Duration) -> Option<T> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut state, _) = self
            .fresh
            .wait_timeout_while(state, timeout, |state| state.value.is_none() && !state.closed)
            .unwrap_or_else(PoisonError::into_inner);
        state.value.take()
    }

    /// Number of values that were overwritten before they were taken.
    pub fn overwritten(&self) -> u64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).overwritten
    }

    /// Marks that the producer has ended. Wakes the consumer, which never waits again.
    pub fn close(&self) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).closed = true;
        self.fresh.notify_all();
    }

    /// Whether the producer has ended.
    pub fn is_closed(&self) -> bool {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).closed
    }
}

//! A slot that holds the latest value: putting never waits, taking waits for something new.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Latest wins: a value not taken before the next is put is dropped and counted.
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
    /// Puts `value` in, dropping one that was not taken.
    pub fn put(&self, value: T) {
        // The old value is dropped after the lock is: freeing a frame takes longer than swapping it.
        let _old = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let old = state.value.replace(value);
            state.overwritten += u64::from(old.is_some());
            old
        };

        self.fresh.notify_one();
    }

    /// Waits for a value, for at most `timeout`; `None` when none came or the slot is closed.
    pub fn take(&self, timeout: Duration) -> Option<T> {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut state, _) = self
            .fresh
            .wait_timeout_while(state, timeout, |state| state.value.is_none() && !state.closed)
            .unwrap_or_else(PoisonError::into_inner);
        state.value.take()
    }

    /// Values that were overwritten before anyone took them.
    pub fn overwritten(&self) -> u64 {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).overwritten
    }

    /// Wakes the taker and keeps it from waiting again: the producer has ended.
    pub fn close(&self) {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).closed = true;
        self.fresh.notify_all();
    }

    /// Whether the producer has ended.
    pub fn is_closed(&self) -> bool {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).closed
    }
}

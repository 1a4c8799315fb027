//! The processes of one command. They outlive the instances of the policy, because a process may take seconds to start:
//! an instance borrows one. A thread starts them, so that nobody who drives a lens waits for a start.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Builder;
use std::time::Duration;

use super::command::Command;
use super::process::Process;
use super::settings::ProcessSettings;
use crate::Fault;
use parfocal_base::clock::Moment;
use parfocal_base::priority;

/// Time that the process of an instance that has just ended may take to come back.
const HANDOVER: Duration = Duration::from_millis(100);
/// Wait before a second start in a row; twice as long before each further one.
const BACKOFF: Duration = Duration::from_millis(200);
/// Longest wait before a start.
const LONGEST_BACKOFF: Duration = Duration::from_secs(10);
/// A process that ran so long did not fail at its start.
const SETTLED: Duration = Duration::from_secs(10);

/// Why there is no process now: why the last one failed, at its start or later, after which another one follows; `None`
/// if one is being started.
pub type Missing = Option<String>;

/// The processes. Dropping the pool ends those that nobody uses; the others end when they come back.
pub struct Pool(Arc<Shared>);

/// A borrower's way back to the pool.
pub struct Shared {
    command: Command,
    /// How they run.
    pub settings: ProcessSettings,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    idle: VecDeque<Process>,
    /// Processes that instances use.
    used: usize,
    /// Instances that wait for a process.
    waiting: usize,
    /// Processes that the thread is to start, the one in the making included.
    ordered: usize,
    /// Failures in a row.
    failures: u32,
    /// Why the last process failed, until another one is ready.
    refused: Option<String>,
    closed: bool,
}

impl Pool {
    /// A pool without processes.
    ///
    /// # Errors
    /// If the system has no thread left.
    pub fn new(command: Command, settings: ProcessSettings) -> io::Result<Self> {
        let shared = Arc::new(Shared { command, settings, state: Mutex::default(), changed: Condvar::default() });
        let keeper = Arc::clone(&shared);
        // The kernel ends a process with the thread that started it, so this one lasts as long as the pool.
        Builder::new().name("policy-keeper".into()).spawn(move || keeper.keep())?;
        Ok(Self(shared))
    }

    /// A process that nobody uses. Waits for it for at most `longest`, and if `once` only for one start.
    ///
    /// # Errors
    /// If there is none by then.
    pub fn take(&self, longest: Duration, once: bool) -> Result<(Process, Arc<Shared>), Missing> {
        self.0.take(longest, once).map(|process| (process, Arc::clone(&self.0)))
    }

    /// A process for a new instance.
    ///
    /// # Errors
    /// If there is none in the time that the settings leave.
    pub fn take_for_instance(&self) -> Result<(Process, Arc<Shared>), Missing> {
        // Where many work, nobody drives a lens, and a failure ends the work.
        self.take(self.0.settings.build, self.0.settings.many)
    }

    /// Checks that a new instance would get a process. One that an instance uses will do: where one lens is driven,
    /// that instance gives it back when another takes its place. So nobody who only asks starts a second process.
    ///
    /// # Errors
    /// If there is none in the time that the settings leave.
    pub fn check(&self) -> Result<(), Missing> {
        if self.0.lock().used > 0 {
            return Ok(());
        }
        let (process, shared) = self.take_for_instance()?;
        shared.give_back(process, None);
        Ok(())
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        let ended = {
            let mut state = self.0.lock();
            state.closed = true;
            std::mem::take(&mut state.idle)
        };
        self.0.changed.notify_all();
        // Outside the lock, because it takes a moment.
        drop(ended);
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, longest: Duration, once: bool) -> Result<Process, Missing> {
        let clock = &self.settings.clock;
        let begun = clock.now();
        let mut state = self.lock();
        state.waiting += 1;

        let outcome = loop {
            if let Some(mut process) = state.idle.pop_front() {
                if process.is_alive() {
                    state.used += 1;
                    break Ok(process);
                }
                state.failures = self.failures_after(&state, process.ready_since);
                continue;
            }

            let waited = clock.now().since(begun);
            if waited >= longest {
                break Err(state.refused.clone());
            }

            // The process of the instance before may be on its way back.
            let handover = HANDOVER.min(longest / 2);
            let coming = !self.settings.many && state.used > 0 && waited < handover;
            if !coming && state.ordered < state.waiting {
                state.ordered += 1;
                self.changed.notify_all();
            }
            let rest = if coming { handover } else { longest }.saturating_sub(waited);
            state = self.changed.wait_timeout(state, rest).unwrap_or_else(PoisonError::into_inner).0;

            if once && state.refused.is_some() {
                break Err(state.refused.clone());
            }
        };
        state.waiting -= 1;
        outcome
    }

    /// Gives a process back. One that `failed` is ended.
    pub fn give_back(&self, process: Process, failed: Option<&Fault>) {
        let ended = {
            let mut state = self.lock();
            state.used = state.used.saturating_sub(1);
            if let Some(fault) = failed {
                state.failures = self.failures_after(&state, process.ready_since);
                // Where many work, each says by itself why it failed.
                if !self.settings.many {
                    state.refused = Some(fault.to_string());
                }
            }

            // One process is enough where one lens is driven.
            if failed.is_some() || state.closed || (!self.settings.many && !state.idle.is_empty()) {
                Some(process)
            } else {
                state.idle.push_back(process);
                None
            }
        };
        self.changed.notify_all();
        drop(ended);
    }

    fn failures_after(&self, state: &State, since: Moment) -> u32 {
        let settled = self.settings.clock.now().since(since) >= SETTLED;
        if settled { 1 } else { state.failures.saturating_add(1) }
    }

    /// Starts processes as they are ordered, until the pool is closed.
    fn keep(&self) {
        if !self.settings.many {
            // As the thread of a policy that is built in does. The processes inherit it.
            priority::prefer();
        }

        let mut state = self.lock();
        loop {
            while state.ordered == 0 && !state.closed {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.closed {
                return;
            }

            let pause = backoff(state.failures);
            if !pause.is_zero() {
                let waited = self.changed.wait_timeout_while(state, pause, |state| !state.closed);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
                if state.closed {
                    return;
                }
            }

            drop(state);
            let started = Process::start(&self.command, &self.settings);
            state = self.lock();
            state.ordered = state.ordered.saturating_sub(1);
            match started {
                Ok(process) => {
                    state.refused = None;
                    // An earlier process may have come back meanwhile.
                    if !state.closed && (self.settings.many || state.idle.is_empty()) {
                        state.idle.push_back(process);
                    }
                }
                Err(reason) => {
                    state.failures = state.failures.saturating_add(1);
                    state.refused = Some(reason);
                }
            }
            self.changed.notify_all();
        }
    }
}

/// Wait before a start after so many failures in a row. The first restart is at once.
fn backoff(failures: u32) -> Duration {
    match failures {
        0 | 1 => Duration::ZERO,
        more => BACKOFF.saturating_mul(1 << (more - 2).min(8)).min(LONGEST_BACKOFF),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_fails_again_and_again_is_started_less_and_less_often() {
        let waits: Vec<u128> = (0..10).map(|failures| backoff(failures).as_millis()).collect();
        assert_eq!(waits, [0, 0, 200, 400, 800, 1600, 3200, 6400, 10_000, 10_000]);
        assert_eq!(backoff(u32::MAX), LONGEST_BACKOFF);
    }
}

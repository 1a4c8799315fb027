//! Thread priorities and locked memory, which keep the way from camera to lens short on a busy machine.
//!
//! Where the system allows it, the threads on that way run at real-time priority (`SCHED_FIFO`): they get
//! a processor as soon as there is something to do. The machine stays responsive whatever they do:
//! * A policy's thread has that priority only while the loop waits for its answer, a frame at most (see
//!   `control::runner`).
//! * Threads that they start begin at ordinary priority.
//! * When one of them keeps a processor for [`LONGEST_RUN`], the process receives [`OVERRUN`]: see
//!   [`withdraw`].
//! * Besides, the kernel has a limit of its own (`kernel.sched_rt_runtime_us`).
//!
//! This is one of the package's three modules with unsafe code, for calls that no safe crate offers: setting
//! another thread's policy with `SCHED_RESET_ON_FORK`. The two calls are sound: they take numbers, and one
//! a pointer to a value that outlives it.
#![allow(unsafe_code, reason = "see above: two system calls")]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::thread::{CapabilitySet, Pid, capabilities};
use serde::Serialize;

/// A thread's role on the way from camera to lens: its real-time priority of 1 to 99, each below the 50
/// of the kernel's own threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ThreadRole {
    /// Talks to a device: little work, but urgent.
    Wire = 30,
    /// The control loop.
    Loop = 20,
    /// A policy, which the loop must be able to interrupt.
    Policy = 10,
}

/// A thread's priority compared with other programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheduling {
    /// Before everything that is not real-time.
    RealTime,
    /// Slightly preferred, as the system allows no more.
    Preferred,
    /// Like any other thread.
    Ordinary,
    /// Like any other thread, because one kept a processor too long.
    Withdrawn,
}

impl Scheduling {
    /// The consequence for the focus and, if it could be better, what to do.
    pub const fn words(self) -> &'static str {
        match self {
            Self::RealTime => "real-time priority: other programs do not delay the focus",
            Self::Preferred | Self::Ordinary => {
                "no real-time priority: other programs can delay the focus; `parfocal serve --help` says how to \
                 allow it"
            }
            Self::Withdrawn => {
                "real-time priority was given up, because a thread kept a processor for seconds: other programs can \
                 delay the focus until the next start; please report this with the log"
            }
        }
    }
}

/// The longest that a thread at real-time priority may keep a processor without a pause. Much longer than the loop
/// waits for a policy, a frame's time.
pub const LONGEST_RUN: Duration = Duration::from_secs(2);

/// The signal that the kernel sends after a longer run.
pub const OVERRUN: i32 = libc::SIGXCPU;

/// Flag that makes the threads which a thread starts begin at ordinary priority. It cannot be cleared without
/// special rights, so it stays set under every scheduling policy.
const ALONE: i32 = libc::SCHED_RESET_ON_FORK;

/// Niceness without real-time priority.
const PREFERRED: i32 = -10;
/// Niceness of work that the loop must not wait for.
const BEHIND: i32 = 5;
/// Niceness of work that threads at [`BEHIND`] must not wait for either.
const FURTHER_BEHIND: i32 = 10;
/// Niceness of work that nobody waits for.
const LAST: i32 = 19;

static WITHDRAWN: AtomicBool = AtomicBool::new(false);

/// Raises the calling thread as far as the process may: to real-time priority (root, `CAP_SYS_NICE` or an
/// `rtprio` limit), otherwise to a lower niceness (root, or a raised limit). Threads that it starts do not
/// inherit the real-time priority.
pub fn raise(role: ThreadRole) -> Scheduling {
    if withdrawn() {
        return Scheduling::Withdrawn;
    }

    if set(None, libc::SCHED_FIFO | ALONE, role as i32) {
        return Scheduling::RealTime;
    }

    if nice(PREFERRED) { Scheduling::Preferred } else { Scheduling::Ordinary }
}

/// Like [`raise`], but threads that the calling one starts inherit the priority. For a library's own threads, whose
/// priority nobody else can set.
pub fn raise_with_children(role: ThreadRole) {
    if withdrawn() || !set(None, libc::SCHED_FIFO, role as i32) {
        nice(PREFERRED);
    }
}

/// Lowers the calling thread's niceness, if that is allowed. Other threads set its real-time priority.
pub fn prefer() {
    nice(PREFERRED);
}

/// Puts the calling thread behind others: for work that the control loop must not wait for. Needs no special
/// rights.
pub fn lower() {
    nice(BEHIND);
}

/// Puts the calling thread behind those that called [`lower`].
pub fn lower_further() {
    nice(FURTHER_BEHIND);
}

/// Gives `thread`, a thread of this process, the real-time priority of `role`; returns whether that was allowed.
pub fn raise_thread(thread: Pid, role: ThreadRole) -> bool {
    !withdrawn() && set(Some(thread), libc::SCHED_FIFO | ALONE, role as i32)
}

/// Takes `thread`'s real-time priority away.
pub fn lower_thread(thread: Pid) {
    set(Some(thread), libc::SCHED_OTHER | ALONE, 0);
}

/// Puts `thread` behind all others.
pub fn abandon_thread(thread: Pid) {
    lower_thread(thread);
    let _ = rustix::process::setpriority_process(Some(thread), LAST);
}

/// Makes the kernel send [`OVERRUN`] when a thread at real-time priority has kept a processor for
/// [`LONGEST_RUN`]. A handler must be installed first; otherwise the signal ends the process.
pub fn bound_runs() {
    let bound = u64::try_from(LONGEST_RUN.as_micros()).unwrap_or(u64::MAX);
    let maximum = getrlimit(Resource::Rttime).maximum;
    let current = maximum.map_or(bound, |most| most.min(bound));

    // If this is refused, the kernel's own limit remains.
    let _ = setrlimit(Resource::Rttime, Rlimit { current: Some(current), maximum });
}

/// Removes real-time priority from every thread, and grants it to none from then on.
pub fn withdraw() {
    // First, so that no thread is raised while the others are lowered.
    WITHDRAWN.store(true, Ordering::Relaxed);

    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    for thread in threads.filter_map(|entry| Pid::from_raw(entry.file_name().to_str()?.parse().ok()?)) {
        if real_time(thread) {
            lower_thread(thread);
        }
    }
}

/// Whether [`withdraw`] was called.
pub fn withdrawn() -> bool {
    WITHDRAWN.load(Ordering::Relaxed)
}

/// Locks the program's present and future memory against being swapped out, page by page as it is used; returns
/// whether it did. If locked memory is limited, it does not even try: allocations beyond the limit would fail.
pub fn lock_memory() -> bool {
    // Without ONFAULT all of libtorch would be read in, though the policies need little of it.
    may_lock_memory() && mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT).is_ok()
}

/// Whether this process may keep all of its memory from being swapped out.
pub fn may_lock_memory() -> bool {
    getrlimit(Resource::Memlock).current.is_none() || has(CapabilitySet::IPC_LOCK)
}

/// Whether this process may put a thread at the real-time priority of each [`ThreadRole`].
pub fn may_run_first() -> bool {
    let highest = ThreadRole::Wire as u64;
    getrlimit(Resource::Rtprio).current.is_none_or(|most| most >= highest) || has(CapabilitySet::SYS_NICE)
}

fn has(capability: CapabilitySet) -> bool {
    capabilities(None).is_ok_and(|sets| sets.effective.contains(capability))
}

fn nice(value: i32) -> bool {
    // On Linux "this process" means the calling thread alone.
    rustix::process::setpriority_process(None, value).is_ok()
}

/// Sets the scheduling policy of `thread`, or of the calling one if `None`; returns whether that was allowed.
fn set(thread: Option<Pid>, policy: i32, priority: i32) -> bool {
    let parameters = libc::sched_param { sched_priority: priority };
    let thread = thread.map_or(0, Pid::as_raw_pid);

    // SAFETY: `parameters` is a whole `sched_param` and outlives the call, which only reads it.
    unsafe { libc::sched_setscheduler(thread, policy, &raw const parameters) == 0 }
}

fn real_time(thread: Pid) -> bool {
    // SAFETY: the call takes a number and returns one.
    let policy = unsafe { libc::sched_getscheduler(thread.as_raw_pid()) };
    policy & !ALONE == libc::SCHED_FIFO
}

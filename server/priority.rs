//! Thread priorities and locked memory: what keeps the way from camera to lens short on a machine that is busy.
//!
//! Where the system allows it, the threads on that way run at real-time priority (`SCHED_FIFO`): they have a processor as
//! soon as there is something to do. The machine answers nevertheless, whatever they do:
//! * A policy's thread has that priority only while the loop waits for its answer, a frame at most (see `control::runner`).
//! * What they start themselves begins at ordinary priority.
//! * When one of them keeps a processor for [`LONGEST_RUN`], the process is sent [`OVERRUN`]: see [`withdraw`].
//! * The kernel has a bound of its own beside that (`kernel.sched_rt_runtime_us`).
//!
//! This is one of the package's two modules with unsafe code, for what no safe crate has: setting another thread's policy
//! with `SCHED_RESET_ON_FORK`. The two calls are sound: they take numbers, and one a pointer to a value that outlives it.
#![allow(unsafe_code, reason = "see above: two system calls")]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::thread::{CapabilitySet, Pid, capabilities};
use serde::Serialize;

/// A thread's place on the way from camera to lens: its real-time priority of 1 to 99, each below the 50 of the kernel's
/// own threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Speaks with a device: little work, and late at once.
    Wire = 30,
    /// The control loop.
    Loop = 20,
    /// A policy, which the loop must be able to interrupt.
    Policy = 10,
}

/// How a thread stands to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// Before all that is not real-time.
    RealTime,
    /// Preferred a little, as the system allows no more.
    Preferred,
    /// Like any other.
    Ordinary,
    /// Like any other, because a thread kept a processor too long.
    Withdrawn,
}

impl Standing {
    /// What it means for the focus and, if it could be better, what to do.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::RealTime => "real-time priority: other programs do not delay the focus",
            Self::Preferred | Self::Ordinary => {
                "no real-time priority: other programs can delay the focus; `parfocal serve --help` says how to allow it"
            }
            Self::Withdrawn => {
                "real-time priority was given up, because a thread kept a processor for seconds: other programs can delay \
                 the focus until the next start; please report this with the log"
            }
        }
    }
}

/// The longest that a thread at real-time priority may keep a processor without a pause. Longer than the second that the
/// loop waits for a policy at one frame a second.
pub const LONGEST_RUN: Duration = Duration::from_secs(2);

/// The signal that tells of a longer one.
pub const OVERRUN: i32 = libc::SIGXCPU;

/// Threads that it starts begin at ordinary priority. Without special rights this cannot be taken back, so that it stays
/// set whatever the policy.
const ALONE: i32 = libc::SCHED_RESET_ON_FORK;

/// Niceness without real-time priority.
const PREFERRED: i32 = -10;
/// Niceness of work that the loop must not wait for.
const BEHIND: i32 = 5;
/// Niceness of what nobody waits for.
const LAST: i32 = 19;

static WITHDRAWN: AtomicBool = AtomicBool::new(false);

/// Puts the calling thread before others, as far as the process may: at real-time priority (root, `CAP_SYS_NICE` or an
/// `rtprio` limit), else at a lower niceness (root, or a raised limit). Threads that it starts are not put there.
#[allow(clippy::must_use_candidate, reason = "only the loop tells how it stands")]
pub fn raise(place: Place) -> Standing {
    if withdrawn() {
        return Standing::Withdrawn;
    }
    if set(None, libc::SCHED_FIFO | ALONE, place as i32) {
        return Standing::RealTime;
    }
    if nice(PREFERRED) { Standing::Preferred } else { Standing::Ordinary }
}

/// The same, but for the threads that it starts, too: for a library's own threads, which nobody else can put there.
pub fn raise_with_children(place: Place) {
    if withdrawn() || !set(None, libc::SCHED_FIFO, place as i32) {
        nice(PREFERRED);
    }
}

/// Prefers the calling thread a little where that is allowed; its real-time priority is set by others.
pub fn prefer() {
    nice(PREFERRED);
}

/// Puts the calling thread behind others: for work that the control loop must not wait for. Needs no right.
pub fn lower() {
    nice(BEHIND);
}

/// Puts `thread`, one of this process, at the real-time priority of `place`; whether that is allowed.
#[must_use]
pub fn raise_thread(thread: Pid, place: Place) -> bool {
    !withdrawn() && set(Some(thread), libc::SCHED_FIFO | ALONE, place as i32)
}

/// Takes `thread`'s real-time priority back.
pub fn lower_thread(thread: Pid) {
    set(Some(thread), libc::SCHED_OTHER | ALONE, 0);
}

/// Puts `thread` behind all others.
pub fn abandon_thread(thread: Pid) {
    lower_thread(thread);
    let _ = rustix::process::setpriority_process(Some(thread), LAST);
}

/// From now on [`OVERRUN`] is sent when a thread at real-time priority has kept a processor for [`LONGEST_RUN`]. Somebody
/// must listen to that signal before: else it ends the process.
pub fn bound_runs() {
    let bound = u64::try_from(LONGEST_RUN.as_micros()).unwrap_or(u64::MAX);
    let maximum = getrlimit(Resource::Rttime).maximum;
    let current = maximum.map_or(bound, |most| most.min(bound));
    // Refused, the kernel's own bound is left.
    let _ = setrlimit(Resource::Rttime, Rlimit { current: Some(current), maximum });
}

/// Takes every thread's real-time priority back, and grants none any more.
pub fn withdraw() {
    WITHDRAWN.store(true, Ordering::Relaxed);
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    for thread in threads.filter_map(|entry| Pid::from_raw(entry.file_name().to_str()?.parse().ok()?)) {
        if real_time(thread) {
            lower_thread(thread);
        }
    }
}

/// Whether [`withdraw`] was called.
#[must_use]
pub fn withdrawn() -> bool {
    WITHDRAWN.load(Ordering::Relaxed)
}

/// Keeps in memory what of the program is there and what comes, page by page as it is used, where that is not limited;
/// whether it is. With a limit it is not even tried: beyond the limit memory would be refused.
#[must_use]
pub fn lock_memory() -> bool {
    let unlimited = getrlimit(Resource::Memlock).current.is_none();
    let allowed = unlimited || capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK));
    // Without ONFAULT all of libtorch would be read in, of which the policies need little.
    allowed && mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT).is_ok()
}

fn nice(value: i32) -> bool {
    // On Linux "this process" means the calling thread alone.
    rustix::process::setpriority_process(None, value).is_ok()
}

/// Gives `thread`, or the calling one, a scheduling policy; whether that is allowed.
fn set(thread: Option<Pid>, policy: i32, priority: i32) -> bool {
    let parameters = libc::sched_param { sched_priority: priority };
    let thread = thread.map_or(0, Pid::as_raw_pid);
    // SAFETY: `parameters` is a whole `sched_param` and outlives the call, which only reads it.
    unsafe { libc::sched_setscheduler(thread, policy, &raw const parameters) == 0 }
}

fn real_time(thread: Pid) -> bool {
    // SAFETY: it takes a number and gives one.
    let policy = unsafe { libc::sched_getscheduler(thread.as_raw_pid()) };
    policy & !ALONE == libc::SCHED_FIFO
}

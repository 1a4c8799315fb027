//! Thread priorities, where the system grants them without special rights.

/// Puts the calling thread before others, if the process may (root, or a `RLIMIT_NICE` that an administrator raised).
/// Without that right nothing changes: the loop then relies on sleeping most of the time, which schedulers favour.
pub fn raise() {
    nice(-10);
}

/// Puts the calling thread behind others: for work that the control loop must not wait for. Needs no right.
pub fn lower() {
    nice(5);
}

fn nice(value: i32) {
    // On Linux "this process" means the calling thread alone.
    let _ = rustix::process::setpriority_process(None, value);
}

//! The server from outside, over HTTP: who may do what, what every response carries, and how it starts and ends.

#[allow(dead_code, reason = "shared with other tests")]
#[path = "support/disk.rs"]
mod disk;
#[allow(dead_code, reason = "shared with other tests")]
mod support;

#[path = "http/blinding.rs"]
mod blinding;
#[path = "http/crowd.rs"]
mod crowd;
#[path = "http/disk.rs"]
mod failing_disk;
#[path = "http/finality.rs"]
mod finality;
#[path = "http/live.rs"]
mod live;
#[path = "http/privacy.rs"]
mod privacy;
#[path = "http/real_time.rs"]
mod real_time;
#[path = "http/restart.rs"]
mod restart;
#[path = "http/roles.rs"]
mod roles;
#[path = "http/seed.rs"]
mod seed;
#[path = "http/service.rs"]
mod service;
#[path = "http/stopping.rs"]
mod stopping;

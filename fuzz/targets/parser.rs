//! The targets of `tests/fuzz/`, run by libFuzzer, which keeps inputs that reach new code. The variable `PARFOCAL_FUZZ`
//! names one of them. No nightly toolchain is needed:
//!
//!     PARFOCAL_FUZZ=protocol cargo fuzz run --sanitizer none parser corpus/protocol

#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use targets::{TARGETS, Target};

#[path = "../../tests/trial/app.rs"]
mod app;
#[path = "../../tests/fuzz/backup.rs"]
mod backup;
#[path = "../../tests/trial/fixture.rs"]
#[allow(dead_code, reason = "the trial's tests use more of it")]
mod fixture;
#[path = "../../tests/fuzz/folders.rs"]
mod folders;
#[path = "../../tests/fuzz/http2.rs"]
mod http2;
#[path = "../../tests/fuzz/lessons.rs"]
mod lessons;
#[path = "../../tests/fuzz/packages.rs"]
mod packages;
#[path = "../../tests/fuzz/server.rs"]
mod server;
#[path = "../../tests/fuzz/targets.rs"]
mod targets;
#[path = "../../tests/system/tls/trust.rs"]
mod trust;

/// The project's folder.
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var("PARFOCAL_FUZZ").unwrap_or_default();
    let found = TARGETS.iter().find(|target| target.name == name);
    found.unwrap_or_else(|| {
        let names: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
        panic!("name a target in PARFOCAL_FUZZ: {}", names.join(", "))
    })
});

fuzz_target!(|bytes: &[u8]| (TARGET.take)(bytes));

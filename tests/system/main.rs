//! The whole system from outside: the real server, met over HTTP, encrypted, in browsers, and with a
//! camera on the wire.
//!
//! These subjects share `support`, and so are one test: `cargo test --test system http::` runs one
//! of them.

mod browser;
mod endurance;
#[cfg(feature = "aravis")]
mod gige;
mod http;
mod support;
mod tls;

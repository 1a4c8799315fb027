//! The whole system from outside: the real server over HTTP, encrypted, in browsers, and with a camera on the network.
//!
//! These subjects share `support`, so they are one test binary. `cargo test --test system http::` runs one of them.

mod browser;
mod endurance;
mod http;
#[cfg(feature = "aravis")]
mod network_camera;
mod support;
mod tls;

//! The server from outside, over HTTP: who may do what, what every response carries, and how it starts and ends.

mod support;

#[path = "http/blinding.rs"]
mod blinding;
#[path = "http/live.rs"]
mod live;
#[path = "http/roles.rs"]
mod roles;
#[path = "http/service.rs"]
mod service;

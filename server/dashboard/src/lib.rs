//! The server that people see: pages, the HTTP interface, encryption, and how well the machine is.
//!
//! [`http`] has the routes, pages, streams and roles. [`tls`] makes and renews the server's certificate. [`doctor`]
//! checks whether a machine is ready for a trial, [`health`] how the running server is.

pub mod doctor;
pub mod health;
pub mod http;
pub mod tls;

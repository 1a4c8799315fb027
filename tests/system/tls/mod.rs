//! The server encrypted: its certificates, what they are signed by, HTTP/2, and what it answers in the clear.

mod authority;
mod client;
mod given;
mod pages;
mod plain;
mod trust;
mod trust_page;

//! The server with encryption: its certificates, who signs them, HTTP/2, and its answers without encryption.

mod authority;
mod client;
mod given;
mod pages;
mod plain;
mod trust;
mod trust_page;

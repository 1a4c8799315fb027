//! Trials: protocol, allocation, the session's state machine, instruments. Pure code: callers pass in the time and the
//! random source.

#[macro_use]
mod names;

pub mod acceptance;
pub mod account;
pub mod action;
pub mod allocation;
pub mod answers;
pub mod balanced_set;
pub mod commitment;
pub mod consent;
pub mod correction;
pub mod erasure;
pub mod event;
pub mod grace;
pub mod instruments;
pub mod participant;
pub mod permission;
pub mod phase;
pub mod pointing;
pub mod protocol;
pub mod question;
pub mod reason;
pub mod refusal;
pub mod remark;
pub mod role;
pub mod session;
pub mod sight;
pub mod standing;
pub mod study;
pub mod tablet;
pub mod unblinding;
pub mod view;
pub mod voice;

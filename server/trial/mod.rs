//! Trials: protocol, allocation, the session's state machine, questionnaires. Pure: clock and random source are handed in.

pub mod action;
pub mod allocation;
pub mod answers;
pub mod commitment;
pub mod event;
pub mod grace;
pub mod participant;
pub mod phase;
pub mod protocol;
pub mod question;
pub mod remark;
pub mod role;
pub mod session;
pub mod standing;
pub mod view;

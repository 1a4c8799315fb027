//! Trials: protocol, allocation, the session's state machine, questionnaires. Pure: clock and random source are handed in.

pub mod view;

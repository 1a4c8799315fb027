//! Studies: many sessions by one plan. What is planned, which orders were drawn for it, who gets which place, and what
//! may be done when. Pure: clock and random source are handed in.

pub mod definition;
pub mod event;
pub mod lists;
pub mod places;
pub mod refusal;
pub mod signature;
pub mod stage;
pub mod state;

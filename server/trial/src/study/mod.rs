//! Studies: many sessions with one plan. Holds the definition, the drawn orders, the rules for places, and the rules
//! for what may be done when. Pure code: callers pass in the time and the random source.

pub mod concerns;
pub mod definition;
pub mod event;
pub mod lists;
pub mod places;
pub mod signature;
pub mod stage;
pub mod state;

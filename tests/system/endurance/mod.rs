//! A long day and a working week: whether the server stays the same while sessions, viewers and devices come and go.
//!
//! These tests take long, so they run only on request: `make endurance`. See docs/operations.md.

mod course;
mod day;
mod judgement;
mod sample;
mod viewers;
mod week;

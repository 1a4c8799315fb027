//! A long day and a working week: whether the server stays as it was while sessions, viewers and devices come and go.
//!
//! These tests take long, so they run only when somebody asks for them: `make endurance`. docs/operations.md says how.

mod course;
mod day;
mod judgement;
mod sample;
mod viewers;
mod week;

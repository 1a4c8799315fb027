//! The `parfocal` program's commands, as a library: `main` hands its arguments over, and tests call them.

#[macro_use(bail)]
extern crate parfocal_base;

pub mod cli;

//! The `parfocal` program's commands, as a library: `main` hands its arguments over, and tests call them.

pub mod cli;

//! Trials from outside: conductor, store and export together, on a real database file.

mod balance;
mod chain;
mod exports;
mod fixture;
mod late;
mod lens;
mod remarks;
mod sessions;
mod storage;
mod verification;

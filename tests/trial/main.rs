//! Trials from outside: conductor, store and export together, on a real database file.

mod accounts;
mod backups;
mod balance;
mod chain;
mod consent;
mod corrections;
mod emergency;
mod erasure;
mod exports;
mod fixture;
mod instruments;
mod late;
mod lens;
mod motions;
mod pointing;
mod remarks;
mod sessions;
mod storage;
mod studies;
mod tablet;
mod verification;
mod voice;

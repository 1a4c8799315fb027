//! What is kept: the database of a site, the exports of its sessions, and the personal accounts.
//!
//! [`store`] is everything that is SQLite, and the only place with SQL; it decides nothing. [`accounts`] makes and
//! changes personal accounts and says who is signed in, by the rules of `parfocal_trial::account`. [`downloads`] keeps what
//! is made in the background to be downloaded.

pub mod accounts;
pub mod downloads;
pub mod store;

//! Store: everything SQLite; the only place with SQL. Decides nothing.

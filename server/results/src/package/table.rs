//! A joined table: a table of the exports, with columns for session and site.

use parfocal_records::store::export::{Column, TABLES, Table, Type, means};

/// Column that tells the records of different databases apart.
pub const SITE: Column = means("Site of the study that recorded it; numbers such as run are counted at each site")
    .column("site", Type::String);

const SESSION: Column = means("Session's random id").column("session", Type::String);

/// Tables whose rows several exports of a site have, because they are not about the exported session alone; each row is
/// joined once. A withdrawal is of a session that has no export.
const SHARED: [&str; 6] = ["runs", "devices", "withdrawals", "studies", "study_events", "weights"];

/// Tables with a row for each frame, joined only as Parquet. The exports have them as CSV.
const LONG: [&str; 2] = ["telemetry", "policy_steps"];

/// Tables that prove a single export and have no meaning when joined.
const PROOFS: [&str; 3] = ["chain", "chain_salts", "voice_pieces"];

/// Source of a cell of a joined table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The export's site.
    Site,
    /// The export's session.
    Session,
    /// This column of the export's table.
    Cell(usize),
}

/// A table of all sessions.
#[derive(Debug, Clone)]
pub struct JoinedTable {
    /// The table as in an export.
    pub table: Table,
    /// The columns, in order, and the source of their cells.
    pub columns: Vec<(Column, Origin)>,
    /// Names of the columns that together identify a row.
    pub key: Vec<&'static str>,
    /// Whether a row may be in several exports of a site.
    pub shared: bool,
    /// Whether there is a row for each frame.
    pub long: bool,
}

impl JoinedTable {
    fn of(table: Table) -> Self {
        let shared = SHARED.contains(&table.name);
        let mut columns = vec![(SITE, Origin::Site)];
        if !shared {
            columns.push((SESSION, Origin::Session));
        }
        let before: Vec<&str> = columns.iter().map(|(column, _)| column.name).collect();
        let own = table.columns.iter().zip(0..).filter(|(column, _)| !before.contains(&column.name));
        let own: Vec<_> = own.map(|(column, place)| (*column, Origin::Cell(place))).collect();
        columns.extend(own);

        let own_key = table.key.iter().filter(|name| !before.contains(*name)).copied();
        let key = before.iter().copied().chain(own_key).collect();

        Self { table, columns, key, shared, long: LONG.contains(&table.name) }
    }

    /// The columns without the source of their cells.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().map(|(column, _)| column)
    }

    /// Whether each row belongs to one session.
    pub const fn of_sessions(&self) -> bool {
        !self.shared
    }
}

/// Every table of a package, in order.
pub fn joined_tables() -> impl Iterator<Item = JoinedTable> {
    TABLES.into_iter().filter(|table| !PROOFS.contains(&table.name)).map(JoinedTable::of)
}

/// The meaning and unit of a column in one line, as programs for statistics show it.
pub fn label(column: &Column) -> String {
    let words: Vec<&str> = column.description.split_whitespace().collect();
    let description = words.join(" ");
    if column.unit.is_empty() { description } else { format!("{description} ({})", column.unit) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_withdrawal_names_the_withdrawn_session_and_a_comment_the_exported_one() {
        let session = |name: &str| {
            let table = joined_tables().find(|table| table.table.name == name).unwrap();
            let origin = table.columns.iter().find(|(column, _)| column.name == "session").unwrap().1;
            (origin, table.key)
        };
        assert_eq!(session("withdrawals"), (Origin::Cell(0), vec!["site", "session"]));
        assert_eq!(session("comments"), (Origin::Session, vec!["site", "session", "key"]));
    }
}

//! The rows of all exports, one after another.

use std::collections::HashSet;

use super::error::PackageError;
use super::source::PackageSource;
use super::table::{JoinedTable, Origin, SITE};

/// Whether any of `sources` has the table. Blinded exports lack the tables that reveal the policies.
pub fn is_there(table: &JoinedTable, sources: &[PackageSource]) -> bool {
    sources.iter().any(|source| source.folder.join(table.table.file()).exists())
}

/// Calls `take` with the cells of each row of `table`, as they are in the exports' CSV files.
pub fn rows(
    table: &JoinedTable,
    sources: &[PackageSource],
    mut take: impl FnMut(&[&str]) -> Result<(), PackageError>,
) -> Result<(), PackageError> {
    let mut known: HashSet<Vec<String>> = HashSet::new();
    for source in sources {
        let path = source.folder.join(table.table.file());
        let mut reader = csv::Reader::from_path(&path).map_err(PackageError::unreadable(&path))?;
        let site = SITE.csv(&source.site.as_str().into());
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row).map_err(PackageError::unreadable(&path))? {
            let cell = |(_, origin): &(_, Origin)| match origin {
                Origin::Site => site.as_str(),
                Origin::Session => source.session.as_str(),
                Origin::Cell(place) => row.get(*place).unwrap_or_default(),
            };
            let cells: Vec<&str> = table.columns.iter().map(cell).collect();

            let again = table.shared && !known.insert(cells.iter().map(|&cell| cell.to_owned()).collect());
            if !again {
                take(&cells)?;
            }
        }
    }
    Ok(())
}

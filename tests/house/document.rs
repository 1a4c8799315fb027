//! The table of floors in ARCHITECTURE.md.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The floor of each crate: rows of the table whose header begins with `floor`, crates in backticks.
pub fn floors(root: &Path) -> BTreeMap<String, u32> {
    let text = fs::read_to_string(root.join("ARCHITECTURE.md")).expect("ARCHITECTURE.md is there");
    let rows = text.lines().skip_while(|line| !line.starts_with("| floor |")).skip(2);

    let mut floors = BTreeMap::new();
    for row in rows.take_while(|line| line.starts_with('|')) {
        let mut cells = row.split('|').skip(1).map(str::trim);
        let floor = cells.next().and_then(|cell| cell.parse().ok()).expect("each row begins with its floor");
        let crates = cells.next().expect("each row names its crates");
        for name in crates.split('`').skip(1).step_by(2) {
            assert!(floors.insert(name.to_owned(), floor).is_none(), "{name} stands on two floors");
        }
    }

    assert!(!floors.is_empty(), "ARCHITECTURE.md has no table with the header `| floor | room | ...`");
    floors
}

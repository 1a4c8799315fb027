//! Checks server/ against the floors of ARCHITECTURE.md: a room uses only rooms of lower floors, and no files of a room
//! use one another in a circle. Reads the source and the document, so that the two cannot drift apart.

mod circles;
mod document;
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use imports::{Import, SourceTree};

/// Circles that are allowed, each with its reason.
const ALLOWED_CIRCLES: [(&[&str], &str); 0] = [];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_table_names_every_room_and_no_other() {
    let documented: BTreeSet<String> = document::floors(root()).into_keys().collect();
    let rooms = imports::rooms(root());
    assert_eq!(documented, rooms, "left: the table in ARCHITECTURE.md; right: what is in server/");
}

#[test]
fn a_room_uses_only_rooms_of_lower_floors() {
    let floors = document::floors(root());
    let tree = SourceTree::read(root());

    let is_upward = |import: &&Import| {
        let from = import.user_room();
        let to = import.used_room();
        from != to && floors[to] >= floors[from]
    };
    let upward: Vec<String> = tree.imports.iter().filter(is_upward).map(ToString::to_string).collect();

    assert!(upward.is_empty(), "imports that do not go down a floor:\n{}", upward.join("\n"));
}

#[test]
fn no_files_of_a_room_use_one_another_in_a_circle() {
    let tree = SourceTree::read(root());
    let mut graph: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for import in tree.imports.iter().filter(|import| import.user_room() == import.used_room()) {
        graph.entry(&import.from).or_default().insert(&import.to);
    }

    let found: BTreeSet<BTreeSet<&str>> = circles::circles(&graph).into_iter().collect();
    let allowed: BTreeSet<BTreeSet<&str>> =
        ALLOWED_CIRCLES.iter().map(|(files, _)| files.iter().copied().collect()).collect();

    let explain = |circle: &BTreeSet<&str>| {
        let ties = tree.imports.iter().filter(|import| {
            import.from != import.to && circle.contains(&*import.from) && circle.contains(&*import.to)
        });
        ties.map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };

    let new: Vec<String> = found.difference(&allowed).map(explain).collect();
    assert!(new.is_empty(), "circles that ALLOWED_CIRCLES does not name:\n{}", new.join("\n\n"));
    let gone: Vec<_> = allowed.difference(&found).collect();
    assert!(gone.is_empty(), "ALLOWED_CIRCLES names circles that are not there: {gone:?}");
}

//! Checks server/ against the floors of ARCHITECTURE.md: a crate uses only crates of lower floors, and neither rooms nor
//! files of a crate use one another in a circle. Reads the source and the document, so that the two cannot drift apart.

mod circles;
mod document;
mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use imports::{Import, SourceTree};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_table_names_every_crate_and_no_other() {
    let documented: BTreeSet<String> = document::floors(root()).into_keys().collect();
    let crates = imports::crates(root());
    assert_eq!(documented, crates, "left: the table in ARCHITECTURE.md; right: what is in server/");
}

/// The compiler refuses circles; this keeps the table true.
#[test]
fn a_crate_uses_only_crates_of_lower_floors() {
    let floors = document::floors(root());

    let mut upward = Vec::new();
    for (name, floor) in &floors {
        let manifest = match &**name {
            "cli" => root().join("Cargo.toml"),
            name => root().join("server").join(name).join("Cargo.toml"),
        };
        let text = fs::read_to_string(&manifest).expect("every crate has a manifest");
        let manifest: toml::Table = text.parse().expect("cargo reads it too");
        let dependencies = manifest["dependencies"].as_table().expect("dependencies are a table");
        for used in dependencies.keys().filter_map(|key| key.strip_prefix("parfocal-")) {
            if floors[used] >= *floor {
                upward.push(format!("{name} uses {used}"));
            }
        }
    }

    assert!(upward.is_empty(), "crates that do not use lower floors only:\n{}", upward.join("\n"));
}

#[test]
fn no_rooms_of_a_crate_use_one_another_in_a_circle() {
    let tree = SourceTree::read(root());
    // The root of a crate only lists its rooms, or is its only room.
    let within = |import: &&Import| {
        import.is_within_a_crate() && !import.from_room.is_empty() && !import.to_room.is_empty() && is_shared(import)
    };
    assert_no_circles(&tree, within, |import| (&import.from_room, &import.to_room));
}

/// Whether the import lies in a crate of several rooms, which are modules of its `lib.rs` and folders.
fn is_shared(import: &Import) -> bool {
    let of_several = ["devices", "learning", "pipeline", "records", "results", "session", "dashboard"];
    of_several.iter().any(|name| import.from.starts_with(&format!("{name}/")))
}

#[test]
fn no_files_of_a_crate_use_one_another_in_a_circle() {
    let tree = SourceTree::read(root());
    assert_no_circles(&tree, |import| import.is_within_a_crate(), |import| (&import.from, &import.to));
}

/// Fails if the imports that `counts` picks form a circle among the nodes that `ends` names.
fn assert_no_circles(
    tree: &SourceTree,
    counts: impl Fn(&&Import) -> bool,
    ends: impl Fn(&Import) -> (&String, &String),
) {
    let mut graph: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for import in tree.imports.iter().filter(&counts) {
        let (from, to) = ends(import);
        graph.entry(from).or_default().insert(to);
    }

    let explain = |circle: BTreeSet<&str>| {
        let ties = tree.imports.iter().filter(&counts).filter(|import| {
            let (from, to) = ends(import);
            from != to && circle.contains(&**from) && circle.contains(&**to)
        });
        ties.map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };

    let found: Vec<String> = circles::circles(&graph).into_iter().map(explain).collect();
    assert!(found.is_empty(), "circles:\n{}", found.join("\n\n"));
}

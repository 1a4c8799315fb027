//! Which file of server/ uses which other one, read from the paths in its source. Tests within the files are left out:
//! they may use anything.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Attribute, ItemMod, ItemUse, UseTree, Visibility};

/// A module or item by its full path, from the name of its crate on.
type Name = Vec<String>;

/// One file's use of another; both by their path below server/.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Import {
    /// The file that uses the item.
    pub from: String,
    /// The file that defines the item.
    pub to: String,
    /// The item that is used, by its full path.
    pub item: String,
    /// The module right below the crate's root in which the using file is; empty for the root itself.
    pub from_room: String,
    /// The same for the file that defines the item.
    pub to_room: String,
}

impl Import {
    /// Whether both files are in one crate.
    pub fn is_within_a_crate(&self) -> bool {
        folder(&self.from) == folder(&self.to)
    }
}

impl fmt::Display for Import {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "server/{} uses {} of server/{}", self.from, self.item, self.to)
    }
}

/// The folder below server/ in which a file is: its crate.
fn folder(file: &str) -> &str {
    file.split('/').next().unwrap_or(file)
}

/// Names of all crates: the folders of server/.
pub fn crates(root: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(root.join("server")).expect("server/ is there");
    let folders = entries.map(|entry| entry.expect("server/ can be read")).filter(|entry| entry.path().is_dir());
    folders.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// All files of server/ and how they use one another.
pub struct SourceTree {
    /// Every use of another file, each once.
    pub imports: BTreeSet<Import>,
}

impl SourceTree {
    /// Reads server/ below `root`.
    pub fn read(root: &Path) -> Self {
        let server = root.join("server");
        let mut files = BTreeMap::new();
        let mut paths = BTreeMap::new();
        for path in sources(&server) {
            let below = path.strip_prefix(&server).expect("it was found there").to_string_lossy().into_owned();
            let module = module_of(&below);
            let source = fs::read_to_string(&path).expect("a source file can be read");
            let syntax = syn::parse_file(&source).unwrap_or_else(|error| panic!("server/{below}: {error}"));
            let mut collected = Paths::new(module.clone());
            collected.visit_file(&syntax);
            files.insert(module.clone(), below);
            paths.insert(module, collected);
        }

        let house = House { files: &files, paths: &paths };
        let mut imports = BTreeSet::new();
        for (module, collected) in &paths {
            for item in &collected.used {
                let Some(to) = house.file_of(item) else { continue };
                let from = files[module].clone();
                if *to != from {
                    let (from_room, to_room) = (room(module), room(&module_of(to)));
                    imports.insert(Import { from, to: to.clone(), item: item.join("::"), from_room, to_room });
                }
            }
        }

        Self { imports }
    }
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("server/ can be read") {
        let path = entry.expect("server/ can be read").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && !["build.rs", "main.rs", "tests.rs"].contains(&&*name)
        {
            found.push(path);
        }
    }

    found
}

/// The module that a file below server/ holds: `devices/src/lens/mod.rs` holds `parfocal_devices::lens`. What lies in
/// no crate's `src` belongs to the program.
fn module_of(file: &str) -> Name {
    let path = file.trim_end_matches(".rs");
    let mut parts: Name = match path.split_once("/src/") {
        Some((name, below)) => {
            [format!("parfocal_{name}")].into_iter().chain(below.split('/').map(str::to_owned)).collect()
        }
        None => ["parfocal"].into_iter().chain(path.split('/')).map(str::to_owned).collect(),
    };
    if parts.last().is_some_and(|last| last == "mod" || last == "lib") {
        parts.pop();
    }
    parts
}

fn room(module: &Name) -> String {
    module.get(1).cloned().unwrap_or_default()
}

/// What one file brings into its scope and uses.
struct Paths {
    module: Name,
    /// Names from `use`, and what they stand for: `super::Name` means these as well.
    brought_in: BTreeMap<String, Name>,
    used: BTreeSet<Name>,
}

impl Paths {
    const fn new(module: Name) -> Self {
        Self { module, brought_in: BTreeMap::new(), used: BTreeSet::new() }
    }

    /// The full path of `parts`; `None` if it is empty or goes above the crate.
    fn absolute(&self, parts: &[String]) -> Option<Name> {
        let supers = parts.iter().take_while(|part| *part == "super").count();
        if supers > 0 {
            let depth = self.module.len().checked_sub(supers)?;
            return Some([&self.module[..depth], &parts[supers..]].concat());
        }

        match parts.first().map(String::as_str) {
            Some("crate") => Some([&self.module[..1], &parts[1..]].concat()),
            Some(name) if name.starts_with("parfocal_") => Some(parts.to_vec()),
            Some("self") => Some([&self.module[..], &parts[1..]].concat()),
            // A path that begins with one of the module's own children; anything else belongs to no file and is dropped
            // later.
            Some(_) => Some([&self.module[..], parts].concat()),
            None => None,
        }
    }

    fn note_use(&mut self, tree: &UseTree, before: &[String], is_public: bool) {
        let with = |name: &dyn ToString| [before, &[name.to_string()]].concat();
        match tree {
            UseTree::Path(path) => self.note_use(&path.tree, &with(&path.ident), is_public),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.note_use(tree, before, is_public)),
            UseTree::Name(name) if name.ident == "self" => self.note_item(before, None, is_public),
            UseTree::Name(name) => self.note_item(&with(&name.ident), None, is_public),
            UseTree::Rename(rename) => self.note_item(&with(&rename.ident), Some(rename.rename.to_string()), is_public),
            UseTree::Glob(_) => self.note_item(before, None, is_public),
        }
    }

    fn note_item(&mut self, parts: &[String], renamed: Option<String>, is_public: bool) {
        let Some(item) = self.absolute(parts) else { return };
        let Some(name) = renamed.or_else(|| item.last().cloned()) else { return };
        if !is_public {
            self.used.insert(item.clone());
        }
        self.brought_in.insert(name, item);
    }
}

impl<'ast> Visit<'ast> for Paths {
    fn visit_item_mod(&mut self, module: &'ast ItemMod) {
        if !is_for_tests(&module.attrs) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        if !is_for_tests(&item.attrs) {
            self.note_use(&item.tree, &[], !matches!(item.vis, Visibility::Inherited));
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let parts: Name = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
        if parts.len() > 1
            && let Some(item) = self.absolute(&parts)
        {
            self.used.insert(item);
        }
        visit::visit_path(self, path);
    }

    /// `pub(super)` and `pub(in path)` use nothing.
    fn visit_visibility(&mut self, _: &'ast Visibility) {}
}

fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg") && attribute.parse_args::<syn::Path>().is_ok_and(|path| path.is_ident("test"))
    })
}

/// All modules, to look names up in.
struct House<'a> {
    files: &'a BTreeMap<Name, String>,
    paths: &'a BTreeMap<Name, Paths>,
}

impl<'a> House<'a> {
    /// The file that defines `item`, through any `use`; `None` if it is in no file of server/.
    fn file_of(&self, item: &[String]) -> Option<&'a String> {
        let depth = (1..=item.len()).rev().find(|&depth| self.files.contains_key(&item[..depth]))?;
        let module = &item[..depth];
        if let Some(name) = item.get(depth)
            && let Some(meant) = self.paths[module].brought_in.get(name)
            && meant != item
        {
            return self.file_of(&[meant, &item[depth + 1..]].concat());
        }
        self.files.get(module)
    }
}

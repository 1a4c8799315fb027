//! The available protocols: those that ship, and those of a folder, which take precedence.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;
use utoipa::ToSchema;

use parfocal_base::PolicyName;
use parfocal_base::files::is_systems_own;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::definition::Definition;

/// Protocols that ship, by file name.
const SHIPPED: [(&str, &str); 3] = [
    ("paper.toml", include_str!("../../../../trial-protocols/paper.toml")),
    ("practice.toml", include_str!("../../../../trial-protocols/practice.toml")),
    ("follow-up.toml", include_str!("../../../../trial-protocols/follow-up.toml")),
];

/// The available protocols, by name.
#[derive(Debug, Clone, Default)]
pub struct Library {
    protocols: BTreeMap<String, Protocol>,
}

/// A protocol for the operator to choose. Says nothing of its policies, because the operator stands beside the surgeon.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct ProtocolSummary {
    /// Name of the protocol.
    pub name: String,
    /// Title for surgeons.
    pub title: String,
    /// Title for operators and researchers.
    pub researcher_title: String,
    /// Whether its sessions are practice.
    pub practice: bool,
    /// Settings in a session.
    pub settings: usize,
    /// Longest inspection of a setting, seconds.
    pub segment_seconds: u64,
}

impl Library {
    /// The text of a study's definition to start from, for a study that `lead` unblinds; `None` if no protocol is for
    /// studies.
    pub fn study_template(&self, lead: &str) -> Option<String> {
        let protocol = self.protocols.values().find(|protocol| !protocol.practice)?;
        Some(Definition::template(protocol, lead))
    }

    /// Loads the protocols that ship and the `.toml` files of `folder`, if given; `known` are the available policies.
    ///
    /// # Errors
    /// If the folder cannot be read, or a protocol in it is malformed. The error names file, line and key.
    pub fn load(folder: Option<&Path>, known: &[PolicyName]) -> Result<Self, String> {
        let mut protocols = BTreeMap::new();
        for (file, source) in SHIPPED {
            let protocol = parse(source, file, known)?;
            protocols.insert(protocol.name.clone(), protocol);
        }

        if let Some(folder) = folder {
            protocols.extend(read_folder(folder, known)?);
        }
        Ok(Self { protocols })
    }

    /// The protocol called `name`.
    pub fn get(&self, name: &str) -> Option<&Protocol> {
        self.protocols.get(name)
    }

    /// All protocols, by name.
    pub(super) fn protocols(&self) -> Vec<Protocol> {
        self.protocols.values().cloned().collect()
    }

    /// All names, separated by commas.
    pub fn names(&self) -> String {
        self.protocols.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
    }

    /// Summaries of all protocols, ordered by name.
    pub fn summaries(&self) -> Vec<ProtocolSummary> {
        self.protocols.values().map(ProtocolSummary::of).collect()
    }
}

impl ProtocolSummary {
    pub(crate) fn of(protocol: &Protocol) -> Self {
        Self {
            name: protocol.name.clone(),
            title: protocol.title.clone(),
            researcher_title: protocol.researcher_title.clone(),
            practice: protocol.practice,
            settings: protocol.settings(),
            segment_seconds: protocol.segment_limit.as_secs(),
        }
    }
}

fn parse(source: &str, file: &str, known: &[PolicyName]) -> Result<Protocol, String> {
    Protocol::parse(source, file, known).map_err(|error| error.to_string())
}

fn read_folder(folder: &Path, known: &[PolicyName]) -> Result<BTreeMap<String, Protocol>, String> {
    let unreadable = |path: &Path| {
        let path = path.display().to_string();
        move |error: std::io::Error| format!("cannot read the protocols in {path}: {error}")
    };

    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable(folder))? {
        let path = entry.map_err(unreadable(folder))?.path();
        let is_protocol = path.extension().is_some_and(|extension| extension == "toml");
        if is_protocol && !path.file_name().is_some_and(is_systems_own) {
            files.push(path);
        }
    }

    files.sort();
    let mut protocols = BTreeMap::new();
    for path in files {
        let source = std::fs::read_to_string(&path).map_err(unreadable(&path))?;
        let protocol = parse(&source, &path.display().to_string(), known)?;
        if protocols.contains_key(&protocol.name) {
            return Err(format!(
                "{} and another file of its folder both hold a protocol called '{}'; rename one",
                path.display(),
                protocol.name
            ));
        }
        protocols.insert(protocol.name.clone(), protocol);
    }

    Ok(protocols)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Vec<PolicyName> {
        ["fixed", "mgm-hill-climber", "mgm-learned", "cnn-learned", "parfocal"].map(PolicyName::new).to_vec()
    }

    #[test]
    fn the_shipped_protocols_are_there_without_any_folder() {
        let library = Library::load(None, &known()).unwrap();
        assert_eq!(library.names(), "follow-up, paper, practice");
        assert_eq!(library.get("paper").unwrap().settings(), 6);
    }

    #[test]
    fn a_folder_adds_and_replaces_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let mine = SHIPPED[1].1.replace("name = \"practice\"", "name = \"mine\"");
        std::fs::write(folder.path().join("a.toml"), mine).unwrap();
        let shorter = SHIPPED[0].1.replace("segment_seconds = 120", "segment_seconds = 100");
        std::fs::write(folder.path().join("b.toml"), shorter).unwrap();
        std::fs::write(folder.path().join("notes.txt"), "no protocol").unwrap();
        let library = Library::load(Some(folder.path()), &known()).unwrap();
        assert_eq!(library.names(), "follow-up, mine, paper, practice");
        assert_eq!(library.get("paper").unwrap().segment_limit.as_secs(), 100);
    }

    #[test]
    fn a_malformed_file_and_a_name_used_twice_are_errors_that_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.toml"), "name = 3\n").unwrap();
        let said = Library::load(Some(folder.path()), &known()).unwrap_err();
        assert!(said.contains("a.toml, line 1: key 'name'"), "{said}");
        std::fs::write(folder.path().join("a.toml"), SHIPPED[0].1).unwrap();
        std::fs::write(folder.path().join("b.toml"), SHIPPED[0].1).unwrap();
        let said = Library::load(Some(folder.path()), &known()).unwrap_err();
        assert!(said.contains("b.toml") && said.contains("'paper'"), "{said}");
    }
}

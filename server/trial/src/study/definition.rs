//! A study's definition: the plan, written in TOML (docs/study.md) before the first session. All sites use the same
//! file, which its SHA-256 proves.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use toml::Spanned;
use utoipa::ToSchema;

use crate::allocation::Order;
use crate::protocol::fault::{Fault, ProtocolError};
use crate::protocol::{Protocol, between, identifier, text};

/// Maximum number of sites in a study.
const MOST_SITES: usize = 50;
/// Maximum number of protocols in a study.
const MOST_PROTOCOLS: usize = 10;
/// Maximum number of surgeons, and of spare places, at a site.
const MOST_PLACES: usize = 500;
/// Maximum length of a text, in characters.
const LONGEST_TEXT: usize = 4000;
/// Maximum length of a title or of a person's name, in characters.
const LONGEST_LINE: usize = 200;

/// A study's name, which identifies the study at every site: lower-case letters, digits and dashes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, ToSchema)]
#[serde(transparent)]
pub struct StudyName(String);

impl StudyName {
    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for StudyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A valid definition, with the text that it was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// Name of the study.
    pub name: StudyName,
    /// Title, shown to everyone but surgeons.
    pub title: String,
    /// Rule by which the orders of sessions are drawn. It is the same in each protocol.
    pub order: Order,
    /// Protocols of the study, each in the version with the hash that the definition names.
    pub protocols: Vec<Protocol>,
    /// Sites of the study, in the definition's order.
    pub sites: Vec<Site>,
    /// Rules for the places of aborted and withdrawn sessions, and for repeated sessions.
    pub rules: PlaceRules,
    /// Advice to the operator when a list has no place left.
    pub when_used_up: String,
    /// People who may unblind the whole study, by name or function.
    pub may_unblind: Vec<String>,
    /// Planned analysis of the study, in words.
    pub analysis: String,
    /// The TOML text, byte for byte.
    pub source: Arc<str>,
}

/// A site of a study.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Site {
    /// Name of the site: lower-case letters, digits and dashes.
    pub name: String,
    /// Title of the site.
    pub title: String,
    /// Number of surgeons planned: places of each list that are open from the beginning.
    pub surgeons: usize,
    /// Number of spare places at the end of each list. The rules open them one by one.
    pub spares: usize,
}

impl Site {
    /// Number of places in each list of the site.
    pub const fn places(&self) -> usize {
        self.surgeons + self.spares
    }
}

/// Rules for the places of aborted and withdrawn sessions, and for repeated sessions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
pub struct PlaceRules {
    /// What happens to the place of an aborted session.
    pub aborted: Replacement,
    /// What happens to the place of a session whose surgeon withdrew.
    pub withdrawn: Replacement,
    /// Whether a surgeon may have a second session with the same protocol.
    pub repeated: Repetition,
}

/// What happens to the place of a session that was aborted or withdrawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Replacement {
    /// The place stays used. Nobody takes it, and no place is added.
    Keep,
    /// The next session takes the place, with the same order, unless the order has become known.
    SamePlace,
    /// The place stays used, and one spare place at the end of the list opens.
    NextSpare,
}

/// Whether a surgeon who already has a session with a protocol may have another one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Repetition {
    /// No: the session is refused.
    Refuse,
    /// Yes: the session takes the next place, and one spare place at the end of the list opens.
    NextSpare,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Spanned<String>,
    title: Spanned<String>,
    order: Spanned<Order>,
    aborted: Replacement,
    withdrawn: Replacement,
    repeated: Repetition,
    when_used_up: Spanned<String>,
    may_unblind: Spanned<Vec<Spanned<String>>>,
    analysis: Spanned<String>,
    protocols: Spanned<Vec<FileProtocol>>,
    sites: Spanned<Vec<FileSite>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileProtocol {
    name: Spanned<String>,
    sha256: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileSite {
    name: Spanned<String>,
    title: Spanned<String>,
    surgeons: Spanned<usize>,
    spares: Spanned<usize>,
}

impl Definition {
    /// Reads a definition. Errors name `file`. `installed` are the available protocols.
    ///
    /// # Errors
    /// If the text is not a valid definition. The error describes the first fault, with its line and key.
    pub fn parse(source: &str, file: &str, installed: &[Protocol]) -> Result<Self, ProtocolError> {
        parse(source, installed).map_err(|fault| fault.in_file(file, source))
    }

    /// SHA-256 of the TOML text, in hexadecimal, as `sha256sum` prints it for the file.
    pub fn sha256(&self) -> String {
        hex::encode(Sha256::digest(self.source.as_bytes()))
    }

    /// A definition to start from, for a study by `protocol` that `lead` unblinds.
    pub fn template(protocol: &Protocol, lead: &str) -> String {
        let in_a_set = protocol.set_size();
        let surgeons = in_a_set * 12_usize.div_ceil(in_a_set);
        let order = if protocol.order == Order::Balanced { "balanced" } else { "shuffled" };
        let multiple = if in_a_set > 1 {
            format!("# A multiple of {in_a_set}, so that every order comes equally often.\n")
        } else {
            String::new()
        };
        format!(
            "# A study. docs/study.md explains each key.\n\
             name = \"my-study\"\n\
             title = \"What the study compares\"\n\
             order = \"{order}\"\n\
             aborted = \"same-place\"\n\
             withdrawn = \"next-spare\"\n\
             repeated = \"refuse\"\n\
             when_used_up = \"Call the trial office.\"\n\
             # Names of leads\u{2019} accounts, as their signatures show them.\n\
             may_unblind = [{lead}]\n\
             analysis = \"The planned analysis, in words.\"\n\
             \n\
             [[protocols]]\n\
             name = \"{name}\"\n\
             sha256 = \"{sha256}\"\n\
             \n\
             [[sites]]\n\
             name = \"my-site\"\n\
             title = \"The hospital\"\n\
             {multiple}\
             surgeons = {surgeons}\n\
             spares = {in_a_set}\n",
            lead = toml::Value::from(lead),
            name = protocol.name,
            sha256 = hex::encode(protocol.sha256()),
        )
    }

    /// The site with this name, if there is one.
    pub fn site(&self, name: &str) -> Option<&Site> {
        self.sites.iter().find(|site| site.name == name)
    }

    /// The protocol with this name, if the study has it.
    pub fn protocol(&self, name: &str) -> Option<&Protocol> {
        self.protocols.iter().find(|protocol| protocol.name == name)
    }
}

fn parse(source: &str, installed: &[Protocol]) -> Result<Definition, Fault> {
    let file: File = toml::from_str(source)?;
    identifier(&file.name, "name")?;

    Ok(Definition {
        title: text(&file.title, "title", LONGEST_LINE)?,
        order: *file.order.get_ref(),
        protocols: protocols(&file, installed)?,
        sites: sites(&file.sites)?,
        rules: PlaceRules { aborted: file.aborted, withdrawn: file.withdrawn, repeated: file.repeated },
        when_used_up: text(&file.when_used_up, "when_used_up", LONGEST_LINE)?,
        may_unblind: people(&file.may_unblind)?,
        analysis: text(&file.analysis, "analysis", LONGEST_TEXT)?,
        name: StudyName(file.name.into_inner()),
        source: source.into(),
    })
}

fn people(given: &Spanned<Vec<Spanned<String>>>) -> Result<Vec<String>, Fault> {
    let mut people = Vec::new();
    for person in given.get_ref() {
        let name = text(person, "may_unblind", LONGEST_LINE)?;
        if people.contains(&name) {
            return Err(Fault::new(person.span(), "may_unblind", format!("'{name}' is listed twice")));
        }
        people.push(name);
    }

    if people.is_empty() {
        return Err(Fault::new(given.span(), "may_unblind", "name at least one person"));
    }
    Ok(people)
}

fn sites(given: &Spanned<Vec<FileSite>>) -> Result<Vec<Site>, Fault> {
    let count = given.get_ref().len();
    if !(1..=MOST_SITES).contains(&count) {
        return Err(Fault::new(given.span(), "sites", format!("must be 1 to {MOST_SITES}, not {count}")));
    }

    let mut names = BTreeSet::new();
    let mut sites = Vec::new();
    for site in given.get_ref() {
        identifier(&site.name, "name")?;
        let name = site.name.get_ref().clone();
        if !names.insert(name.clone()) {
            return Err(Fault::new(site.name.span(), "name", format!("site '{name}' is listed twice")));
        }

        sites.push(Site {
            name,
            title: text(&site.title, "title", LONGEST_LINE)?,
            surgeons: between(&site.surgeons, "surgeons", 1..=MOST_PLACES, " surgeons")?,
            spares: between(&site.spares, "spares", 0..=MOST_PLACES, " places")?,
        });
    }
    Ok(sites)
}

fn protocols(file: &File, installed: &[Protocol]) -> Result<Vec<Protocol>, Fault> {
    let given = file.protocols.get_ref();
    let count = given.len();
    if !(1..=MOST_PROTOCOLS).contains(&count) {
        let message = format!("must be 1 to {MOST_PROTOCOLS}, not {count}");
        return Err(Fault::new(file.protocols.span(), "protocols", message));
    }

    let mut protocols: Vec<Protocol> = Vec::new();
    for named in given {
        let protocol = installed_version(named, installed)?;
        let name = &protocol.name;

        if protocols.iter().any(|known| known.name == *name) {
            return Err(Fault::new(named.name.span(), "name", format!("protocol '{name}' is listed twice")));
        }
        if protocol.practice {
            let message = format!("'{name}' is practice, which stays outside studies");
            return Err(Fault::new(named.name.span(), "name", message));
        }
        if protocol.order != *file.order.get_ref() {
            let message = format!("protocol '{name}' has another order; the study and its protocols must agree");
            return Err(Fault::new(file.order.span(), "order", message));
        }
        protocols.push(protocol.clone());
    }
    Ok(protocols)
}

/// Finds the installed protocol with the name and the hash that `named` gives.
fn installed_version<'a>(named: &FileProtocol, installed: &'a [Protocol]) -> Result<&'a Protocol, Fault> {
    let name = named.name.get_ref();
    let protocol = installed.iter().find(|protocol| protocol.name == *name).ok_or_else(|| {
        let known: Vec<&str> = installed.iter().map(|protocol| protocol.name.as_str()).collect();
        let message = format!("there is no protocol '{name}'; there are: {}", known.join(", "));
        Fault::new(named.name.span(), "name", message)
    })?;

    let here = hex::encode(protocol.sha256());
    let Some(wanted) = &named.sha256 else {
        let message = format!("is missing; for protocol '{name}' as it is here, write sha256 = \"{here}\"");
        return Err(Fault::new(named.name.span(), "sha256", message));
    };
    if !wanted.get_ref().eq_ignore_ascii_case(&here) {
        let message = format!("protocol '{name}' is here in another version, with SHA-256 {here}");
        return Err(Fault::new(wanted.span(), "sha256", message));
    }
    Ok(protocol)
}

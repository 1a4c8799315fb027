//! Checks the study in an export: the definition, the protocol and, once the study is unblinded, the commitment to all
//! orders and this session's place in them.

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::files::ExportFiles;
use super::verdict::{Outcome, Verdict};
use parfocal_trial::allocation::Seed;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::lists::{List, commitment, in_words};

/// The parts of a definition that can be read without the other protocols of the study.
#[derive(Debug, Deserialize)]
pub struct Outline {
    /// Name of the study.
    pub name: String,
    /// Title of the study.
    pub title: String,
    /// The planned analysis.
    pub analysis: String,
    /// The protocols, in order.
    pub protocols: Vec<OutlineProtocol>,
    /// The sites, in order.
    pub sites: Vec<OutlineSite>,
}

/// A protocol of a definition.
#[derive(Debug, Deserialize)]
pub struct OutlineProtocol {
    /// Name of the protocol.
    pub name: String,
    sha256: String,
}

/// A site of a definition.
#[derive(Debug, Deserialize)]
pub struct OutlineSite {
    /// Name of the site.
    pub name: String,
}

impl ExportFiles {
    /// The definition of the study in the export.
    ///
    /// # Errors
    /// If it cannot be read. The text names the file.
    pub fn outline(&self) -> Result<Outline, String> {
        toml::from_str(&self.text("study.toml")?).map_err(|error| format!("study.toml: {}", error.message()))
    }
}

/// The session's place in its study.
struct EnrolledPlace {
    site: String,
    protocol: String,
    number: String,
}

/// Checks the study in the export.
pub(super) fn study(export: &ExportFiles) -> Outcome {
    let outside = || Ok(Verdict::Passed("the session is outside any study".to_owned()));
    let Some(study) = export.cells("study_sessions.csv", "study")?.into_iter().next() else { return outside() };

    let cell = |column| {
        let cells = export.cells("study_sessions.csv", column)?;
        cells.into_iter().next().ok_or_else(|| format!("study_sessions.csv has no {column}"))
    };
    let place = EnrolledPlace { site: cell("site")?, protocol: cell("protocol")?, number: cell("place")? };
    check_definition(export, &study, &place)?;

    let commitments = export.cells("study_events.csv", "commitment")?;
    let committed = commitments.into_iter().find(|commitment| !commitment.is_empty());
    let committed = committed.ok_or("study_events.csv: the study was never opened")?;

    let Some(statement) = statement(export)? else {
        let summary =
            "definition and protocol are those of the study; its orders stay secret until all of it is unblinded";
        return Ok(Verdict::Passed(summary.to_owned()));
    };
    if commitment(&statement) != committed {
        return Err("allocation.json: the orders of the study are not those committed to when it was opened".to_owned());
    }
    check_order(export, &statement, &place)?;
    Ok(Verdict::Passed("the session has the order of its place, and all orders are those committed to".to_owned()))
}

fn check_definition(export: &ExportFiles, study: &str, place: &EnrolledPlace) -> Result<(), String> {
    let definition = export.text("study.toml")?;
    let planned = export.cells("studies.csv", "definition_sha256")?;
    if planned != [hex::encode(Sha256::digest(&definition))] {
        return Err("study.toml is not the definition that the study was planned with".to_owned());
    }

    let outline = export.outline()?;
    if outline.name != study || export.cells("studies.csv", "study")? != [study] {
        return Err("study.toml, studies.csv and study_sessions.csv name different studies".to_owned());
    }
    if !outline.sites.iter().any(|site| site.name == place.site) {
        return Err(format!("study.toml has no site '{}'", place.site));
    }

    let found = hex::encode(Sha256::digest(export.text("protocol.toml")?));
    let listed = outline.protocols.iter().find(|protocol| protocol.name == place.protocol);
    if !listed.is_some_and(|protocol| protocol.sha256.eq_ignore_ascii_case(&found)) {
        return Err("protocol.toml is not the version that study.toml names".to_owned());
    }
    Ok(())
}

/// The orders of the whole study; `None` if the export withholds them.
fn statement(export: &ExportFiles) -> Result<Option<String>, String> {
    if !export.has("allocation.json") {
        return Ok(None);
    }
    Ok(export.json("allocation.json")?["study_statement"].as_str().map(str::to_owned))
}

/// Checks that the session has the order of its place, and that the list with this place is the one drawn from the
/// seed.
fn check_order(export: &ExportFiles, statement: &str, place: &EnrolledPlace) -> Result<(), String> {
    let seed = statement.lines().find_map(|line| Seed::from_hex(line.strip_prefix("seed ")?));
    let seed = seed.ok_or("allocation.json: the study's orders have no seed")?;

    let header = format!("list {} {} ", place.site, place.protocol);
    let list = statement.lines().skip_while(|line| !line.starts_with(&header)).skip(1);
    let listed: Vec<&str> = list.map_while(|line| line.strip_prefix("place ")).collect();

    let schedule = export.cells("allocation.csv", "policy")?.join(",");
    let expected = format!("{} {schedule}", place.number);
    if !listed.contains(&expected.as_str()) {
        return Err(format!("the session's order is not that of place {} in the study's list", place.number));
    }

    let protocol = Protocol::parse_kept(&export.text("protocol.toml")?, "protocol.toml");
    let protocol = protocol.map_err(|error| error.to_string())?;
    let drawn = List::draw(&place.site, &protocol, listed.len(), seed);
    let drawn = drawn.places.iter().zip(1..).map(|(place, number)| format!("{number} {}", in_words(&place.schedule)));
    if drawn.eq(listed.iter().copied()) { Ok(()) } else { Err("the study's seed draws another list".to_owned()) }
}

//! Verification of an export: what anyone can check of it with no database and no trust in the server.

use std::collections::BTreeSet;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::description::ALL;
use super::folder::SUMS;
use crate::autofocus::PolicyName;
use crate::ids::SessionId;
use crate::trial::allocation::{Algorithm, Seed};
use crate::trial::commitment::Allocation;
use crate::trial::protocol::Protocol;

/// One thing checked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What.
    pub name: &'static str,
    /// How it came out.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// How a check came out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "detail", rename_all = "kebab-case")]
pub enum Verdict {
    /// As it should be; says what was found.
    Passed(String),
    /// Not as it should be; says where.
    Failed(String),
    /// It cannot be checked; says why.
    NotChecked(String),
}

/// Checks the export in `folder`: every check, in order.
#[must_use]
pub fn verify(folder: &Path) -> Vec<Check> {
    let check =
        |name, outcome: Result<Verdict, String>| Check { name, verdict: outcome.unwrap_or_else(Verdict::Failed) };
    vec![
        check("checksums", checksums(folder)),
        check("columns", columns(folder)),
        check("events", events(folder)),
        check("references", references(folder)),
        check("protocol", protocol(folder)),
        check("commitment", commitment(folder)),
        check("schedule", schedule(folder)),
    ]
}

type Outcome = Result<Verdict, String>;

fn checksums(folder: &Path) -> Outcome {
    let mut listed = BTreeSet::from([SUMS.to_owned()]);
    for line in text(folder, SUMS)?.lines() {
        let (sum, file) = line.split_once("  ").ok_or_else(|| format!("{SUMS}: no checksum in '{line}'"))?;
        if file.contains('/') {
            return Err(format!("{SUMS}: '{file}' is not a file of the folder"));
        }
        let content = std::fs::read(folder.join(file)).map_err(|error| format!("{file}: {error}"))?;
        if hex::encode(Sha256::digest(&content)) != sum {
            return Err(format!("{file} was changed since it was exported"));
        }
        listed.insert(file.to_owned());
    }
    for entry in std::fs::read_dir(folder).map_err(|error| error.to_string())? {
        let name = entry.map_err(|error| error.to_string())?.file_name().to_string_lossy().into_owned();
        if !listed.contains(&name) {
            return Err(format!("{name} was added since it was exported"));
        }
    }
    Ok(Verdict::Passed(format!("{} files are as they were exported", listed.len() - 1)))
}

fn columns(folder: &Path) -> Outcome {
    let mut rows = 0;
    for table in ALL {
        let file = table.file();
        if !folder.join(&file).exists() && matches!(table.name, "allocation" | "weights" | "policy_steps") {
            continue;
        }
        let mut reader = csv(folder, &file)?;
        if !reader.headers().map_err(|error| format!("{file}: {error}"))?.iter().eq(table.header()) {
            return Err(format!("{file}: its columns are not those described"));
        }
        for (row, line) in reader.records().zip(2..) {
            let row = row.map_err(|error| format!("{file}: {error}"))?;
            let mut cells = table.columns.iter().zip(&row);
            if let Some((column, cell)) = cells.find(|(column, cell)| !column.kind.accepts(cell)) {
                return Err(format!("{file}, row {line}: '{cell}' is no {}", column.name));
            }
            rows += 1;
        }
    }
    Ok(Verdict::Passed(format!("{rows} rows are as described")))
}

fn events(folder: &Path) -> Outcome {
    let numbers: Vec<u64> = cells(folder, "events.csv", "number")?.iter().filter_map(|n| n.parse().ok()).collect();
    if let Some((found, expected)) = numbers.iter().zip(1..).find(|(found, expected)| *found != expected) {
        return Err(format!("events.csv: event {expected} is missing; {found} stands in its place"));
    }
    let kinds = cells(folder, "events.csv", "kind")?;
    if kinds.first().map(String::as_str) != Some("created") {
        return Err("events.csv: the first event is not 'created'".to_owned());
    }
    Ok(Verdict::Passed(format!("{} events without a gap", numbers.len())))
}

fn references(folder: &Path) -> Outcome {
    let segments: BTreeSet<String> = cells(folder, "segments.csv", "segment")?.into_iter().collect();
    let settings: BTreeSet<String> = cells(folder, "segments.csv", "setting")?.into_iter().collect();
    for file in ["comments.csv", "answers.csv", "events.csv"] {
        let unknown = cells(folder, file, "segment")?.into_iter().find(|s| !s.is_empty() && !segments.contains(s));
        if let Some(segment) = unknown {
            return Err(format!("{file}: segment {segment} is not in segments.csv"));
        }
    }
    let unknown = cells(folder, "telemetry.csv", "setting")?.into_iter().find(|setting| !settings.contains(setting));
    unknown.map_or_else(
        || Ok(Verdict::Passed(format!("everything belongs to one of {} settings", settings.len()))),
        |setting| Err(format!("telemetry.csv: setting {setting} is not in segments.csv")),
    )
}

fn protocol(folder: &Path) -> Outcome {
    let found = hex::encode(Sha256::digest(text(folder, "protocol.toml")?));
    let expected = session_cell(folder, "protocol_sha256")?;
    if found == expected {
        Ok(Verdict::Passed("protocol.toml is the one that the session was made by".to_owned()))
    } else {
        Err("protocol.toml is not the one that the session was made by".to_owned())
    }
}

/// `allocation.json` of an unblinded export.
#[derive(Deserialize)]
struct Told {
    session: SessionId,
    algorithm: Algorithm,
    seed: Option<String>,
    index: usize,
    schedule: Vec<PolicyName>,
}

/// The allocation that an export tells, or why it does not.
fn allocation(folder: &Path) -> Result<Result<Allocation, Verdict>, String> {
    if !folder.join("allocation.json").exists() {
        return Ok(Err(Verdict::NotChecked("the export is blinded".to_owned())));
    }
    let told: Told =
        serde_json::from_str(&text(folder, "allocation.json")?).map_err(|error| format!("allocation.json: {error}"))?;
    let Some(seed) = told.seed else {
        let why = "the seed is withheld while other sessions of its balanced set are blinded";
        return Ok(Err(Verdict::NotChecked(why.to_owned())));
    };
    let seed = Seed::from_hex(&seed).ok_or("allocation.json: the seed is not 64 hexadecimal digits")?;
    let listed = cells(folder, "allocation.csv", "policy")?;
    if !listed.iter().map(String::as_str).eq(told.schedule.iter().map(PolicyName::as_str)) {
        return Err("allocation.csv and allocation.json tell different orders".to_owned());
    }
    Ok(Ok(Allocation {
        session: told.session,
        algorithm: told.algorithm,
        seed,
        index: told.index,
        protocol_sha256: Sha256::digest(text(folder, "protocol.toml")?).into(),
        schedule: told.schedule,
    }))
}

fn commitment(folder: &Path) -> Outcome {
    let allocation = match allocation(folder)? {
        Ok(allocation) => allocation,
        Err(verdict) => return Ok(verdict),
    };
    if allocation.commitment() == session_cell(folder, "commitment")? {
        Ok(Verdict::Passed("seed, order and protocol are those committed to when the session was made".to_owned()))
    } else {
        Err("seed, order or protocol are not those committed to when the session was made".to_owned())
    }
}

fn schedule(folder: &Path) -> Outcome {
    let allocation = match allocation(folder)? {
        Ok(allocation) => allocation,
        Err(verdict) => return Ok(verdict),
    };
    let protocol = Protocol::parse(&text(folder, "protocol.toml")?, "protocol.toml", &allocation.schedule)
        .map_err(|error| error.to_string())?;
    let order = allocation.algorithm.draw(allocation.seed, protocol.policies.len(), protocol.repeats, allocation.index);
    if order.iter().map(|&policy| &protocol.policies[policy]).eq(&allocation.schedule) {
        Ok(Verdict::Passed(format!("{} draws this order from the seed", allocation.algorithm)))
    } else {
        Err(format!("{} draws another order from the seed", allocation.algorithm))
    }
}

fn text(folder: &Path, file: &str) -> Result<String, String> {
    std::fs::read_to_string(folder.join(file)).map_err(|error| format!("{file}: {error}"))
}

fn csv(folder: &Path, file: &str) -> Result<csv::Reader<std::fs::File>, String> {
    csv::Reader::from_path(folder.join(file)).map_err(|error| format!("{file}: {error}"))
}

/// The cells of a column.
fn cells(folder: &Path, file: &str, column: &str) -> Result<Vec<String>, String> {
    let mut reader = csv(folder, file)?;
    let headers = reader.headers().map_err(|error| format!("{file}: {error}"))?;
    let place =
        headers.iter().position(|name| name == column).ok_or_else(|| format!("{file} has no column {column}"))?;
    reader
        .records()
        .map(|row| Ok(row.map_err(|error| format!("{file}: {error}"))?.get(place).unwrap_or_default().to_owned()))
        .collect()
}

fn session_cell(folder: &Path, column: &str) -> Result<String, String> {
    cells(folder, "sessions.csv", column)?.into_iter().next().ok_or_else(|| "sessions.csv has no session".to_owned())
}

//! Checks the allocation in an unblinded export against its other files, the commitment and the draw.

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::files::ExportFiles;
use super::verdict::{Outcome, Verdict};
use parfocal_base::PolicyName;
use parfocal_base::ids::SessionId;
use parfocal_trial::allocation::{Algorithm, Order, Seed};
use parfocal_trial::commitment::Allocation;
use parfocal_trial::protocol::Protocol;

/// `allocation.json` of an unblinded export.
#[derive(Deserialize)]
struct AllocationFile {
    session: SessionId,
    algorithm: Algorithm,
    seed: Option<String>,
    index: usize,
    schedule: Vec<PolicyName>,
}

/// The allocation in an export, or why it cannot be checked.
fn allocation(export: &ExportFiles) -> Result<Result<Allocation, Verdict>, String> {
    if !export.has("allocation.json") {
        return Ok(Err(Verdict::NotChecked("the export is blinded".to_owned())));
    }

    let file = AllocationFile::deserialize(&*export.json("allocation.json")?);
    let file = file.map_err(|error| format!("allocation.json: {error}"))?;

    for column in ["session", "setting", "segment"] {
        if export.cells("allocation.csv", column)? != export.cells("segments.csv", column)? {
            return Err(format!("allocation.csv and segments.csv have different {column}s"));
        }
    }

    let listed = export.cells("allocation.csv", "policy")?;
    if !listed.iter().map(String::as_str).eq(file.schedule.iter().map(PolicyName::as_str)) {
        return Err("allocation.csv and allocation.json have different orders".to_owned());
    }

    for (column, expected) in [("session", file.session.to_string()), ("algorithm", file.algorithm.to_string())] {
        if export.session_cell(column)? != expected {
            return Err(format!("allocation.json and sessions.csv have different {column}s"));
        }
    }

    let Some(seed) = file.seed else {
        if file.algorithm.order() != Order::Balanced {
            return Err("allocation.json withholds the seed, which is right only within a balanced set".to_owned());
        }
        let why = "the seed is withheld while other sessions of its balanced set are blinded";
        return Ok(Err(Verdict::NotChecked(why.to_owned())));
    };

    let seed = Seed::from_hex(&seed).ok_or("allocation.json: the seed is not 64 hexadecimal digits")?;

    Ok(Ok(Allocation {
        session: file.session,
        algorithm: file.algorithm,
        seed,
        index: file.index,
        protocol_sha256: Sha256::digest(export.text("protocol.toml")?).into(),
        schedule: file.schedule,
    }))
}

/// Checks that seed, order and protocol are those committed to.
pub(super) fn commitment(export: &ExportFiles) -> Outcome {
    let allocation = match allocation(export)? {
        Ok(allocation) => allocation,
        Err(verdict) => return Ok(verdict),
    };

    if allocation.commitment() == export.session_cell("commitment")? {
        Ok(Verdict::Passed("seed, order and protocol are those committed to when the session was made".to_owned()))
    } else {
        Err("seed, order or protocol are not those committed to when the session was made".to_owned())
    }
}

/// Checks that the order is the one drawn from the seed.
pub(super) fn schedule(export: &ExportFiles) -> Outcome {
    let allocation = match allocation(export)? {
        Ok(allocation) => allocation,
        Err(verdict) => return Ok(verdict),
    };

    let protocol = Protocol::parse(&export.text("protocol.toml")?, "protocol.toml", &allocation.schedule)
        .map_err(|error| error.to_string())?;

    // Without this check, a forged export could make us draw all permutations of many policies.
    if allocation.algorithm.order() != protocol.order {
        return Err(format!("{} does not draw the order that protocol.toml asks for", allocation.algorithm));
    }

    let order = allocation.algorithm.draw(allocation.seed, protocol.policies.len(), protocol.repeats, allocation.index);
    if order.iter().map(|&policy| &protocol.policies[policy]).eq(&allocation.schedule) {
        Ok(Verdict::Passed(format!("{} draws this order from the seed", allocation.algorithm)))
    } else {
        Err(format!("{} draws another order from the seed", allocation.algorithm))
    }
}

//! The orders of a study: a list for each site and protocol. All lists are drawn from one seed when the study is first
//! opened, and a commitment binds them.
//!
//! The places of a list are grouped into sets. A set has as many sessions as the algorithm balances. The seed of set
//! `n` (from 1) is the SHA-256 of four lines, each ending with a line feed: `parfocal-study-set-1`, `seed SEED`,
//! `list SITE PROTOCOL`, `set N`. So the seed of one set reveals nothing about another set.

use std::fmt::Write;

use sha2::{Digest, Sha256};

use super::definition::Definition;
use crate::allocation::{Algorithm, Seed};
use crate::protocol::Protocol;
use parfocal_base::PolicyName;

/// All orders of a study in one database.
#[derive(Debug, Clone, PartialEq)]
pub struct Lists {
    /// Name of the study.
    study: String,
    /// SHA-256 of the study's definition, in hexadecimal.
    definition_sha256: String,
    /// Seed from which all lists are drawn.
    seed: Seed,
    /// The lists by site and then by protocol, in the definition's order.
    each: Vec<List>,
}

/// The list of orders for one site and one protocol.
#[derive(Debug, Clone, PartialEq)]
pub struct List {
    /// Name of the site.
    pub site: String,
    /// Name of the protocol.
    pub protocol: String,
    /// Algorithm that drew the list.
    pub algorithm: Algorithm,
    /// Places of the list, in the order in which sessions take them.
    pub places: Vec<ListPlace>,
}

/// A place of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct ListPlace {
    /// Seed of the place's set.
    pub seed: Seed,
    /// Index of the place in its set, from 0.
    pub index: usize,
    /// Policy of each segment, in order.
    pub schedule: Vec<PolicyName>,
}

impl Lists {
    /// Draws the orders of `definition` for `sites` from `seed`.
    pub fn draw(definition: &Definition, sites: &[String], seed: Seed) -> Self {
        let here = definition.sites.iter().filter(|site| sites.contains(&site.name));
        let lists = here.flat_map(|site| {
            definition.protocols.iter().map(move |protocol| List::draw(&site.name, protocol, site.places(), seed))
        });

        Self {
            study: definition.name.as_str().to_owned(),
            definition_sha256: definition.sha256(),
            seed,
            each: lists.collect(),
        }
    }

    /// Place `number` (from 1) of the list for `site` and `protocol`; none if there is no such place.
    pub fn place(&self, site: &str, protocol: &str, number: usize) -> Option<&ListPlace> {
        let list = self.each.iter().find(|list| list.site == site && list.protocol == protocol)?;
        list.places.get(number.checked_sub(1)?)
    }

    /// The text that is hashed: lines, each ending with a line feed.
    pub fn statement(&self) -> String {
        let mut text = format!(
            "parfocal-study-commitment-1\nstudy {}\ndefinition {}\nseed {}\n",
            self.study,
            self.definition_sha256,
            self.seed.to_hex(),
        );

        for list in &self.each {
            let _ = writeln!(text, "list {} {} {}", list.site, list.protocol, list.algorithm);
            for (place, number) in list.places.iter().zip(1..) {
                let _ = writeln!(text, "place {number} {}", in_words(&place.schedule));
            }
        }
        text
    }

    /// SHA-256 of the [statement](Self::statement), in hexadecimal.
    pub fn commitment(&self) -> String {
        commitment(&self.statement())
    }
}

impl List {
    /// Draws the list for `site` and `protocol`, with `places` places. `seed` is the seed of the whole study.
    pub fn draw(site: &str, protocol: &Protocol, places: usize, seed: Seed) -> Self {
        let in_a_set = protocol.set_size();
        let place = |place: usize| {
            let seed = set_seed(seed, site, &protocol.name, place / in_a_set + 1);
            let index = place % in_a_set;
            ListPlace { seed, index, schedule: protocol.draw(seed, index) }
        };

        Self {
            site: site.to_owned(),
            protocol: protocol.name.clone(),
            algorithm: protocol.order.algorithm(),
            places: (0..places).map(place).collect(),
        }
    }
}

/// The commitment: SHA-256 of the statement of all orders, in hexadecimal.
pub fn commitment(statement: &str) -> String {
    hex::encode(Sha256::digest(statement))
}

/// The line with the commitment, to be printed, published or mailed before the first session.
pub fn commitment_line(study: &str, definition_sha256: &str, commitment: &str) -> String {
    format!("parfocal study {study} definition {definition_sha256} orders {commitment}")
}

/// An order as it is written in a statement: policy names, separated by commas.
pub fn in_words(schedule: &[PolicyName]) -> String {
    schedule.iter().map(PolicyName::as_str).collect::<Vec<_>>().join(",")
}

fn set_seed(seed: Seed, site: &str, protocol: &str, set: usize) -> Seed {
    let text = format!("parfocal-study-set-1\nseed {}\nlist {site} {protocol}\nset {set}\n", seed.to_hex());
    Seed(Sha256::digest(text).into())
}

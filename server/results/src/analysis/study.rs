//! Analyses a whole study after it was unblinded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::comparison::{Comparison, compare};
use super::error::AnalysisError;
use super::gathering::{GatheredSession, GatheredSetting, gather};
use super::outcomes::{FOCAL_ERROR, Outcome, Value, asked, asked_of_session, driven};
use super::records::{ProtocolRecords, StudyRecords};
use super::report::{
    AnalysedSession, Analysis, ProtocolAnalysis, SettingWords, SiteAnalysis, SurgeonWords, WholeSessions,
};
use super::statistics::summary;
use super::words::counted;
use super::{database, exports};
use parfocal_base::boxed;
use parfocal_records::store::{Reader, StoreError};

/// Analyses study `name` in the database of `reader`.
///
/// # Errors
/// If there is no such study, it is not unblinded, or the database failed.
#[boxed]
pub async fn analyse(reader: &Reader, name: &str) -> Result<Analysis, AnalysisError> {
    let records = database::read(reader, name).await?;
    // Permutations need much processor time, so keep them off the asynchronous threads.
    let analysed = tokio::task::spawn_blocking(move || analyse_records(records));
    Ok(analysed.await.map_err(|error| StoreError::Damaged(error.to_string()))?)
}

/// Analyses the package in `folder`, which must be verified: the sessions of all its sites together, and of each site.
///
/// # Errors
/// If the package is blinded, an export in it was made before its site unblinded the study, or a file cannot be read.
pub fn analyse_package(folder: &Path) -> Result<Analysis, AnalysisError> {
    Ok(analyse_records(exports::read(folder)?))
}

fn analyse_records(records: StudyRecords) -> Analysis {
    let seed: String = records.definition_sha256.chars().take(16).collect();
    let number = u64::from_str_radix(&seed, 16).unwrap_or(0);

    let sessions = records.protocols.iter().flat_map(|protocol| &protocol.sessions);
    let with_sessions: BTreeSet<String> = sessions.map(|(line, _)| line.site.clone()).collect();
    let missing_sites: Vec<String> =
        records.defined_sites.iter().filter(|site| !with_sessions.contains(*site)).cloned().collect();

    let mut notes = notes();
    notes.extend(records.notes);
    if !missing_sites.is_empty() {
        notes.push(format!(
            "No session of {} is here: {}. The definition has {}.",
            counted(missing_sites.len(), "site"),
            missing_sites.join(", "),
            counted(records.defined_sites.len(), "site"),
        ));
    }

    let sites = &records.defined_sites;
    let protocols = records.protocols.into_iter().map(|protocol| analyse_protocol(protocol, sites, number)).collect();
    Analysis {
        study: records.study,
        title: records.title,
        definition_sha256: records.definition_sha256,
        planned: records.planned,
        unblinded: records.unblinded,
        sites: records.sites,
        missing_sites,
        seed,
        notes,
        protocols,
    }
}

fn analyse_protocol(records: ProtocolRecords, sites: &[String], seed: u64) -> ProtocolAnalysis {
    let protocol = records.protocol;
    let (sessions, records): (Vec<AnalysedSession>, Vec<_>) = records.sessions.into_iter().unzip();
    let gathered: Vec<GatheredSession> =
        records.into_iter().flatten().map(|session| gather(&protocol, session)).collect();
    let policies: Vec<String> = protocol.policies.iter().map(|policy| policy.as_str().to_owned()).collect();

    let with_values = |outcome: &Outcome| {
        gathered
            .iter()
            .flat_map(|session| &session.settings)
            .any(|setting| setting.values.contains_key(&outcome.outcome))
    };
    let measured: Vec<Outcome> = driven().into_iter().filter(with_values).collect();
    let notes = protocol_notes(&sessions, &gathered, &measured);

    let compared: Vec<Outcome> = asked(&protocol).into_iter().chain(measured).collect();
    let whole: Vec<Outcome> = asked_of_session(&protocol);
    let all: Vec<&GatheredSession> = gathered.iter().collect();

    ProtocolAnalysis {
        protocol: protocol.name.clone(),
        researcher_title: protocol.researcher_title.clone(),
        repeats: protocol.repeats,
        surgeons: surgeons(&all),
        sessions,
        notes,
        outcomes: comparisons(&compared, &policies, &all, seed),
        by_site: by_site(sites, &gathered, &compared, &whole, &policies, seed),
        whole_sessions: whole_sessions(&whole, &all),
        words: words(&gathered),
        values: compared.iter().flat_map(|outcome| values(&all, &outcome.outcome)).collect(),
        policies,
    }
}

/// The figures of each site, in the order of `sites`; none if all sessions that count are of one site.
fn by_site(
    sites: &[String],
    gathered: &[GatheredSession],
    compared: &[Outcome],
    whole: &[Outcome],
    policies: &[String],
    seed: u64,
) -> Vec<SiteAnalysis> {
    let of_site = |site: &String| {
        let own: Vec<&GatheredSession> = gathered.iter().filter(|session| session.site == *site).collect();
        (!own.is_empty()).then(|| SiteAnalysis {
            site: site.clone(),
            sessions: own.len(),
            surgeons: surgeons(&own),
            outcomes: comparisons(compared, policies, &own, seed),
            whole_sessions: whole_sessions(whole, &own),
        })
    };

    let with_sessions: BTreeSet<&str> = gathered.iter().map(|session| session.site.as_str()).collect();
    if with_sessions.len() < 2 {
        return Vec::new();
    }
    sites.iter().filter_map(of_site).collect()
}

fn comparisons(outcomes: &[Outcome], policies: &[String], sessions: &[&GatheredSession], seed: u64) -> Vec<Comparison> {
    let of_outcome = |outcome: &Outcome| compare(outcome.clone(), policies, &values(sessions, &outcome.outcome), seed);
    outcomes.iter().map(of_outcome).collect()
}

fn surgeons(sessions: &[&GatheredSession]) -> usize {
    sessions.iter().map(|session| &session.surgeon).collect::<BTreeSet<_>>().len()
}

/// The values of `outcome` in every setting of `sessions`.
fn values(sessions: &[&GatheredSession], outcome: &str) -> Vec<Value> {
    let of_session = |session: &&GatheredSession| {
        let value = |(setting, number): (&GatheredSetting, usize)| Value {
            session: session.session,
            surgeon: session.surgeon.clone(),
            setting: number,
            policy: setting.policy.clone(),
            repeat: setting.repeat,
            outcome: outcome.to_owned(),
            value: setting.values.get(outcome).copied(),
        };
        session.settings.iter().zip(1..).map(value).collect::<Vec<_>>()
    };
    sessions.iter().flat_map(of_session).collect()
}

fn whole_sessions(outcomes: &[Outcome], sessions: &[&GatheredSession]) -> Vec<WholeSessions> {
    let of_outcome = |outcome: &Outcome| {
        let values: Vec<f64> =
            sessions.iter().filter_map(|session| session.whole.get(&outcome.outcome).copied()).collect();
        let missing = sessions.len() - values.len();
        WholeSessions { missing, summary: summary(&values), outcome: outcome.clone() }
    };
    outcomes.iter().map(of_outcome).collect()
}

fn words(gathered: &[GatheredSession]) -> Vec<SurgeonWords> {
    let mut surgeons: BTreeMap<&str, Vec<SettingWords>> = BTreeMap::new();
    for session in gathered {
        surgeons.entry(&session.surgeon).or_default().extend(session.words.iter().cloned());
    }
    let line = |(surgeon, settings): (&str, Vec<SettingWords>)| SurgeonWords { surgeon: surgeon.to_owned(), settings };
    surgeons.into_iter().map(line).filter(|line| !line.settings.is_empty()).collect()
}

fn notes() -> Vec<String> {
    [
        "Only sessions that were completed and not withdrawn count. Of several answers to a question, the one given \
         last counts, with its correction, unless it arrived too late.",
        "A surgeon is one unit of every test: the mean over all settings of a policy. A surgeon with a missing value \
         is left out of that outcome's tests between policies; the number of such surgeons is given. Repeats and \
         positions are compared over all sessions without a missing value.",
        "p values are two-sided. Holm's correction covers the pairs of one outcome. Nothing is corrected for the \
         number of outcomes: choose the main one before there are data.",
        "Intervals cover 95 %. Those of differences and effect sizes are percentile bootstrap intervals over \
         surgeons. They are not given for fewer than five surgeons.",
    ]
    .map(str::to_owned)
    .to_vec()
}

fn protocol_notes(sessions: &[AnalysedSession], gathered: &[GatheredSession], measured: &[Outcome]) -> Vec<String> {
    let mut notes = Vec::new();
    let left_out = sessions.len() - gathered.len();
    notes.push(format!("{} made, {} count, {left_out} left out.", counted(sessions.len(), "session"), gathered.len()));

    let surgeons: BTreeSet<&str> = gathered.iter().map(|session| session.surgeon.as_str()).collect();
    if surgeons.len() < gathered.len() {
        notes.push("A surgeon with several sessions counts once, by the mean over all of them.".to_owned());
    }

    if measured.is_empty() {
        notes.push("There is no telemetry: turns, travel and focal error are not known.".to_owned());
    } else if !measured.iter().any(|outcome| outcome.outcome == FOCAL_ERROR) {
        notes.push(
            "The focal error is not known: only a simulated camera knows the optimum, and it is not estimated here."
                .to_owned(),
        );
    }
    notes
}

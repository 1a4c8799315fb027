//! Analyses a whole study after it was unblinded.

use std::collections::{BTreeMap, BTreeSet};

use futures_util::{StreamExt, TryStreamExt, stream};

use super::comparison::compare;
use super::error::AnalysisError;
use super::gathering::{GatheredSession, gather};
use super::outcomes::{FOCAL_ERROR, IN_FOCUS, Observation, Outcome, asked, asked_of_session, driven};
use super::report::{AnalysedSession, Analysis, ProtocolAnalysis, SettingWords, SurgeonWords, Value, WholeSessions};
use super::statistics::summary;
use super::words::counted;
use parfocal_records::store::{Reader, RunClocks, StoredStudy};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::event::StudyEventKind;
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::stage::Stage;

/// Number of sessions that are read at a time: as many as a reader has connections.
const AT_A_TIME: usize = 3;

/// Analyses study `name` in the database of `reader`.
///
/// # Errors
/// If there is no such study, it is not unblinded, or the database failed.
pub async fn analyse(reader: &Reader, name: &str) -> Result<Analysis, AnalysisError> {
    let study = check(reader, name).await?;
    let unblinding = study.events.iter().rev().find(|event| matches!(event.kind, StudyEventKind::Unblinded));
    let unblinded = unblinding.map(|event| event.wall).unwrap_or_default();
    let definition = &study.definition;
    let definition_sha256 = definition.sha256();
    let seed: String = definition_sha256.chars().take(16).collect();
    let number = u64::from_str_radix(&seed, 16).unwrap_or(0);

    let clocks = reader.run_clocks().await?;
    let mut protocols = Vec::new();
    for protocol in &definition.protocols {
        let sessions: Vec<&Enrolled> =
            study.sessions.iter().filter(|session| session.protocol == protocol.name).collect();
        let (lines, gathered) = gather_all(reader, &clocks, protocol, sessions).await?;
        let protocol = protocol.clone();
        // Permutations need much processor time, so keep them off the asynchronous threads.
        let analysed = tokio::task::spawn_blocking(move || analyse_protocol(&protocol, lines, &gathered, number));
        protocols
            .push(analysed.await.map_err(|error| parfocal_records::store::StoreError::Damaged(error.to_string()))?);
    }

    Ok(Analysis {
        study: name.to_owned(),
        title: definition.title.clone(),
        planned: definition.analysis.clone(),
        unblinded,
        sites: study.sites.clone(),
        notes: notes(),
        definition_sha256,
        seed,
        protocols,
    })
}

/// Study `name`, if it can be analysed.
///
/// # Errors
/// If there is no such study, it is not unblinded, or the database failed.
pub async fn check(reader: &Reader, name: &str) -> Result<StoredStudy, AnalysisError> {
    let Some(study) = reader.study(name).await? else {
        let names = reader.study_names().await?;
        let known = if names.is_empty() { "none yet".to_owned() } else { names.join(", ") };
        return Err(AnalysisError::NoStudy { study: name.to_owned(), known });
    };
    match study.state().stage {
        Stage::Unblinded => Ok(study),
        stage => Err(AnalysisError::StillBlinded { study: name.to_owned(), stage }),
    }
}

async fn gather_all(
    reader: &Reader,
    clocks: &RunClocks,
    protocol: &Protocol,
    sessions: Vec<&Enrolled>,
) -> Result<(Vec<AnalysedSession>, Vec<GatheredSession>), AnalysisError> {
    let mut reading = Vec::new();
    for session in sessions {
        reading.push(gather(reader, clocks, protocol, session));
    }
    let read: Vec<_> = stream::iter(reading).buffered(AT_A_TIME).try_collect().await?;
    let (lines, gathered): (Vec<_>, Vec<Option<GatheredSession>>) = read.into_iter().unzip();
    Ok((lines, gathered.into_iter().flatten().collect()))
}

fn analyse_protocol(
    protocol: &Protocol,
    sessions: Vec<AnalysedSession>,
    gathered: &[GatheredSession],
    seed: u64,
) -> ProtocolAnalysis {
    let policies: Vec<String> = protocol.policies.iter().map(|policy| policy.as_str().to_owned()).collect();
    let with_values = |outcome: &Outcome| {
        gathered
            .iter()
            .flat_map(|session| &session.settings)
            .any(|setting| setting.values.contains_key(&outcome.outcome))
    };
    let measured: Vec<Outcome> = driven().into_iter().filter(with_values).collect();
    let notes = protocol_notes(&sessions, gathered, &measured);

    let mut outcomes = Vec::new();
    let mut values = Vec::new();
    for outcome in asked(protocol).into_iter().chain(measured) {
        let observations = observations(gathered, &outcome.outcome);
        values.extend(observations.iter().map(|one| value(one, &outcome.outcome)));
        outcomes.push(compare(outcome, &policies, &observations, seed));
    }

    ProtocolAnalysis {
        protocol: protocol.name.clone(),
        researcher_title: protocol.researcher_title.clone(),
        policies,
        repeats: protocol.repeats,
        surgeons: gathered.iter().map(|session| &session.surgeon).collect::<BTreeSet<_>>().len(),
        sessions,
        notes,
        outcomes,
        whole_sessions: asked_of_session(protocol).into_iter().map(|asked| whole(asked, gathered)).collect(),
        words: words(gathered),
        values,
    }
}

fn observations(gathered: &[GatheredSession], outcome: &str) -> Vec<Observation> {
    let of_session = |session: &GatheredSession| {
        let observation = |(setting, number): (&super::gathering::GatheredSetting, usize)| Observation {
            session: session.session,
            surgeon: session.surgeon.clone(),
            setting: number,
            policy: setting.policy.clone(),
            repeat: setting.repeat,
            value: setting.values.get(outcome).copied(),
        };
        session.settings.iter().zip(1..).map(observation).collect::<Vec<_>>()
    };
    gathered.iter().flat_map(of_session).collect()
}

fn value(one: &Observation, outcome: &str) -> Value {
    Value {
        session: one.session,
        surgeon: one.surgeon.clone(),
        setting: one.setting,
        policy: one.policy.clone(),
        repeat: one.repeat,
        outcome: outcome.to_owned(),
        value: one.value,
    }
}

fn whole(outcome: Outcome, gathered: &[GatheredSession]) -> WholeSessions {
    let values: Vec<f64> = gathered.iter().filter_map(|session| session.whole.get(&outcome.outcome).copied()).collect();
    WholeSessions { missing: gathered.len() - values.len(), summary: summary(&values), outcome }
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
         is left out of the tests of that outcome; the number of such surgeons is given.",
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

    let known = |name: &str| measured.iter().any(|outcome| outcome.outcome == name);
    if measured.is_empty() {
        notes.push("There is no telemetry: turns, travel and focal error are not known.".to_owned());
    } else if !known(FOCAL_ERROR) || !known(IN_FOCUS) {
        notes.push(
            "The focal error is not known: only a simulated camera knows the optimum, and it is not estimated here."
                .to_owned(),
        );
    }
    notes
}

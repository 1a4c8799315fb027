//! Reads from a study's package what is analysed of it: from the exports of its sessions, which prove themselves, and
//! not from the joined tables.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use jiff::Timestamp;
use serde::Deserialize;

use super::error::AnalysisError;
use super::records::{
    AnswerRecord, CommentRecord, ProtocolRecords, SessionRecords, StudyRecords, comment_words, line, withdrawn,
};
use super::report::AnalysedSession;
use crate::package::{LeftOut, PackageError, exports_of, left_out};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::LensMotion;
use parfocal_records::store::export::ExportFiles;
use parfocal_records::store::export::verify::Outline;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::AnswerValue;
use parfocal_trial::remark::CommentContent;

/// What the analysis needs of `session.json`, which has the tables of an export.
#[derive(Debug, Deserialize)]
struct Tables {
    sessions: [SessionCells; 1],
    segments: Vec<SegmentCells>,
    comments: Vec<CommentCells>,
    answers: Vec<AnswerCells>,
    events: Vec<EventCells>,
    corrections: Vec<CorrectionCells>,
    withdrawals: Vec<WithdrawalCells>,
    studies: [StudyCells; 1],
    study_sessions: [PlaceCells; 1],
    study_events: Vec<StudyEventCells>,
}

#[derive(Debug, Deserialize)]
struct SessionCells {
    session: SessionId,
    participant: String,
    status: SessionStatus,
}

#[derive(Debug, Deserialize)]
struct SegmentCells {
    segment: SegmentId,
}

#[derive(Debug, Deserialize)]
struct CommentCells {
    key: String,
    segment: Option<SegmentId>,
    kind: String,
    text: Option<String>,
    late: bool,
    erased: Option<Timestamp>,
    withdrawn: Option<Timestamp>,
}

#[derive(Debug, Deserialize)]
struct AnswerCells {
    key: String,
    segment: Option<SegmentId>,
    question: String,
    counts: bool,
    value: Option<String>,
    erased: Option<Timestamp>,
}

#[derive(Debug, Deserialize)]
struct EventCells {
    kind: String,
    emergency: Option<bool>,
}

#[derive(Debug, Deserialize)]
struct CorrectionCells {
    subject: String,
    record: String,
    field: String,
    new_value: String,
}

#[derive(Debug, Deserialize)]
struct WithdrawalCells {
    session: SessionId,
}

#[derive(Debug, Deserialize)]
struct StudyCells {
    definition_sha256: String,
    sites: String,
    stage: String,
}

#[derive(Debug, Deserialize)]
struct PlaceCells {
    site: String,
    protocol: String,
}

#[derive(Debug, Deserialize)]
struct StudyEventCells {
    kind: String,
    wall: Timestamp,
}

/// What the analysis needs of `allocation.json`.
#[derive(Debug, Deserialize)]
struct Allocation {
    schedule: Vec<String>,
}

/// The export of a session.
struct ExportedSession {
    folder: PathBuf,
    tables: Tables,
    /// The policies of its settings, in order.
    schedule: Vec<String>,
    motions: Vec<LensMotion>,
    /// Identity of its database: the hash of the first row of its chain, which is random.
    database: String,
    /// The row of the chain with the session, which tells the order in which sessions were made.
    made: i64,
}

/// The records of the verified package in `folder`.
///
/// # Errors
/// If the package is blinded, an export in it was made before its site unblinded the study, or a file cannot be read.
pub fn read(folder: &Path) -> Result<StudyRecords, AnalysisError> {
    let folders = exports_of(folder)?;
    let first = folders.first().ok_or_else(|| PackageError::empty(folder))?;
    let definition = ExportFiles::of(first).outline().map_err(PackageError::unreadable(first))?;

    let mut sessions = Vec::new();
    let mut protocols: BTreeMap<String, Protocol> = BTreeMap::new();
    for export in &folders {
        let session = ExportedSession::read(export)?;
        if let Entry::Vacant(place) = protocols.entry(session.place().protocol.clone()) {
            place.insert(protocol_of(export)?);
        }
        sessions.push(session);
    }

    let mut unblinded = Timestamp::MIN;
    for session in &sessions {
        unblinded = unblinded.max(session.unblinded(folder)?);
    }
    let sites = sites(&sessions)?;
    let left_out = left_out(folder)?;
    let gone = withdrawn_sessions(&sessions, &left_out);
    let databases = Databases::of(&sessions, &gone, &definition);
    databases.put_in_order(&mut sessions);
    let definition_sha256 = sessions.first().map(|session| session.study().definition_sha256.clone());

    let mut notes: Vec<String> = databases.note().into_iter().collect();
    let named = definition.protocols.iter().map(|one| one.name.as_str());
    let without = named.filter(|name| !protocols.contains_key(*name));
    let (withdrawn, none): (Vec<&str>, Vec<&str>) =
        without.partition(|name| left_out.iter().any(|session| session.protocol == *name));
    if !none.is_empty() {
        notes.push(format!("No session of these protocols of the definition is here: {}.", none.join(", ")));
    }
    if !withdrawn.is_empty() {
        // The package has nothing else of such a protocol, so nothing can be said about its questions.
        notes.push(format!("Every session of these protocols was withdrawn: {}.", withdrawn.join(", ")));
    }

    let mut by_protocol = Vec::new();
    for name in definition.protocols.iter().map(|one| &one.name) {
        let Some(protocol) = protocols.remove(name) else { continue };
        let (own, rest) = sessions.into_iter().partition(|session| session.place().protocol == *name);
        sessions = rest;
        by_protocol.push(protocol_records(protocol, own, &databases, &gone, &left_out));
    }

    Ok(StudyRecords {
        study: definition.name,
        title: definition.title,
        definition_sha256: definition_sha256.unwrap_or_default(),
        planned: definition.analysis,
        sites: definition.sites.iter().map(|site| site.name.clone()).filter(|site| sites.contains(site)).collect(),
        defined_sites: definition.sites.into_iter().map(|site| site.name).collect(),
        unblinded,
        notes,
        protocols: by_protocol,
    })
}

impl ExportedSession {
    fn read(folder: &Path) -> Result<Self, AnalysisError> {
        let unreadable = |reason: String| PackageError::unreadable(folder)(reason);
        let export = ExportFiles::of(folder);
        if !export.has("allocation.json") {
            return Err(AnalysisError::Refused(format!(
                "{} does not contain the policies: export the study with --unblinded once all of it is unblinded, and \
                 join it again",
                folder.display()
            )));
        }

        let allocation = export.json("allocation.json").map_err(unreadable)?;
        let allocation = Allocation::deserialize(&*allocation);
        let allocation = allocation.map_err(|error| unreadable(format!("allocation.json: {error}")))?;
        let tables = export.json("session.json").map_err(unreadable)?;
        let tables = Tables::deserialize(&*tables).map_err(|error| unreadable(format!("session.json: {error}")))?;

        let (database, made) = chained(&export, tables.sessions[0].session).map_err(unreadable)?;
        let motions = export.motions().map_err(unreadable)?;
        Ok(Self { folder: folder.to_owned(), tables, schedule: allocation.schedule, motions, database, made })
    }

    const fn session(&self) -> &SessionCells {
        &self.tables.sessions[0]
    }

    const fn study(&self) -> &StudyCells {
        &self.tables.studies[0]
    }

    const fn place(&self) -> &PlaceCells {
        &self.tables.study_sessions[0]
    }

    /// The surgeon's code, corrected if it was.
    fn code(&self) -> &str {
        let session = self.session();
        let corrected = self.corrected("session", &session.session.to_string(), "participant");
        corrected.unwrap_or(&session.participant)
    }

    /// The latest correction of `field` of a record.
    fn corrected(&self, subject: &str, record: &str, field: &str) -> Option<&str> {
        let mut latest_first = self.tables.corrections.iter().rev();
        let of_field = |correction: &&CorrectionCells| {
            correction.subject == subject && correction.record == record && correction.field == field
        };
        latest_first.find(of_field).map(|correction| correction.new_value.as_str())
    }

    /// When its site unblinded the study.
    fn unblinded(&self, package: &Path) -> Result<Timestamp, AnalysisError> {
        let mut latest_first = self.tables.study_events.iter().rev();
        let unblinding = latest_first.find(|event| event.kind == "unblinded").map(|event| event.wall);
        match unblinding {
            Some(unblinded) if self.study().stage == "unblinded" => Ok(unblinded),
            _ => Err(AnalysisError::Refused(format!(
                "{} cannot be analysed: {} was exported while the study was {} at site '{}'; unblind the study there, \
                 export it again and join it again",
                package.display(),
                self.folder.display(),
                self.study().stage,
                self.place().site
            ))),
        }
    }

    /// The line about the session, and its records if it counts. `surgeon` is what the report calls the surgeon.
    fn records(self, surgeon: &str) -> (AnalysedSession, Option<SessionRecords>) {
        let session = self.session();
        let unblinded_alone = |event: &EventCells| event.kind == "unblinded" && event.emergency == Some(true);
        let emergency = self.tables.events.iter().any(unblinded_alone);
        let line = line(session.session, &self.place().site, surgeon, session.status, emergency);
        if !line.counts {
            return (line, None);
        }

        let segments = self.tables.segments.iter().map(|row| row.segment);
        let records = SessionRecords {
            session: session.session,
            surgeon: surgeon.to_owned(),
            site: self.place().site.clone(),
            settings: segments.zip(self.schedule.iter().cloned()).collect(),
            comments: self.tables.comments.iter().filter_map(|comment| self.comment(comment)).collect(),
            answers: self.tables.answers.iter().filter_map(|answer| self.answer(answer)).collect(),
            motions: self.motions,
        };
        (line, Some(records))
    }

    fn comment(&self, comment: &CommentCells) -> Option<CommentRecord> {
        if comment.withdrawn.is_some() {
            return None;
        }
        let text = comment.text.clone().unwrap_or_default();
        let said = match comment.kind.as_str() {
            "text" => CommentContent::Text(text),
            "quick" => CommentContent::Quick(text),
            "mark" => CommentContent::Mark,
            "voice" => CommentContent::Voice,
            _ => return None,
        };
        let typed = self.corrected("comment", &comment.key, "note").filter(|note| !note.is_empty());
        let words = comment_words(said, typed, comment.late, comment.erased.is_some())?;
        Some(CommentRecord { segment: comment.segment, words })
    }

    /// The answer, if it counts.
    fn answer(&self, answer: &AnswerCells) -> Option<AnswerRecord> {
        if !answer.counts {
            return None;
        }
        let given = || serde_json::from_str::<AnswerValue>(answer.value.as_deref()?).ok();
        let corrected = self.corrected("answer", &answer.key, "value");
        Some(AnswerRecord {
            question: answer.question.clone(),
            segment: answer.segment,
            value: corrected.and_then(|value| serde_json::from_str(value).ok()).or_else(given)?,
            erased: answer.erased.is_some(),
        })
    }
}

/// The hash of the first row of the chain, and the row that has `session`.
fn chained(export: &ExportFiles, session: SessionId) -> Result<(String, i64), String> {
    let column = |name| export.place("chain.csv", name);
    let places = [column("number")?, column("hash")?, column("kind")?, column("key")?];
    let session = session.to_string();
    let mut first = None;
    let mut made = None;

    export.each_row("chain.csv", |row| {
        let [number, hash, kind, key] = places.map(|place| row.get(place).unwrap_or_default());
        if first.is_none() {
            first = Some(hash.to_owned());
        }
        if kind == "session" && key == session {
            made = number.parse().ok();
        }
        Ok(())
    })?;
    first.zip(made).ok_or_else(|| "chain.csv does not have the session".to_owned())
}

/// The names of the sites that the databases of `sessions` run.
fn sites(sessions: &[ExportedSession]) -> Result<BTreeSet<String>, AnalysisError> {
    let mut sites = BTreeSet::new();
    for session in sessions {
        let here: Result<Vec<String>, _> = serde_json::from_str(&session.study().sites);
        sites.extend(here.map_err(PackageError::unreadable(session.folder.join("studies.csv")))?);
    }
    Ok(sites)
}

/// The databases of a package's exports. Each gives codes to its surgeons on its own.
struct Databases {
    /// Each database with its sites that have sessions, in the order of the definition.
    sites: Vec<(String, Vec<String>)>,
    /// Codes that surgeons of several databases have.
    ambiguous: BTreeSet<String>,
}

impl Databases {
    /// The databases of `sessions`. The codes of sessions that are `gone` are told nowhere.
    fn of(sessions: &[ExportedSession], gone: &BTreeSet<String>, definition: &Outline) -> Self {
        let mut sites: Vec<(String, Vec<String>)> = Vec::new();
        for site in definition.sites.iter().map(|site| &site.name) {
            for session in sessions.iter().filter(|session| session.place().site == *site) {
                match sites.iter_mut().find(|(database, _)| *database == session.database) {
                    Some((_, known)) if known.contains(site) => {}
                    Some((_, known)) => known.push(site.clone()),
                    None => sites.push((session.database.clone(), vec![site.clone()])),
                }
            }
        }

        let mut databases: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for session in sessions.iter().filter(|session| !gone.contains(&session.session().session.to_string())) {
            databases.entry(session.code()).or_default().insert(&session.database);
        }
        let several = databases.into_iter().filter(|(_, databases)| databases.len() > 1);
        Self { sites, ambiguous: several.map(|(code, _)| code.to_owned()).collect() }
    }

    fn place(&self, session: &ExportedSession) -> usize {
        self.sites.iter().position(|(database, _)| *database == session.database).unwrap_or(self.sites.len())
    }

    /// Orders by database, then as they were made: the order in which an analysis of the database has them. Sums of
    /// numbers depend on their order, in the last digit.
    fn put_in_order(&self, sessions: &mut [ExportedSession]) {
        sessions.sort_by_key(|session| (self.place(session), session.made));
    }

    /// What the report calls the surgeon of `session`.
    fn surgeon(&self, session: &ExportedSession) -> String {
        let code = session.code();
        let sites = self.sites.get(self.place(session)).map(|(_, sites)| sites.join(", "));
        match sites {
            Some(sites) if self.ambiguous.contains(code) => format!("{code} ({sites})"),
            _ => code.to_owned(),
        }
    }

    fn note(&self) -> Option<String> {
        let codes: Vec<&str> = self.ambiguous.iter().map(String::as_str).collect();
        (!codes.is_empty()).then(|| {
            format!(
                "Sites with servers of their own use the same codes for their surgeons: {}. They count as different \
                 people, each named with the site.",
                codes.join(", ")
            )
        })
    }
}

/// The sessions whose participants withdrew, as any export or the package itself says.
fn withdrawn_sessions(sessions: &[ExportedSession], left_out: &[LeftOut]) -> BTreeSet<String> {
    let listed = sessions.iter().flat_map(|session| &session.tables.withdrawals);
    let listed = listed.map(|withdrawal| withdrawal.session.to_string());
    listed.chain(left_out.iter().map(|left_out| left_out.session.clone())).collect()
}

fn protocol_records(
    protocol: Protocol,
    exported: Vec<ExportedSession>,
    databases: &Databases,
    gone: &BTreeSet<String>,
    left_out: &[LeftOut],
) -> ProtocolRecords {
    let mut sessions = Vec::new();
    let mut last: BTreeMap<String, AnalysedSession> = BTreeMap::new();
    for session in exported {
        let id = session.session().session;
        if gone.contains(&id.to_string()) {
            // An export that was made before the participant withdrew.
            last.insert(id.to_string(), withdrawn(id, &session.place().site));
            continue;
        }
        let surgeon = databases.surgeon(&session);
        sessions.push(session.records(&surgeon));
    }

    for left_out in left_out.iter().filter(|left_out| left_out.protocol == protocol.name) {
        if let Ok(id) = left_out.session.parse::<SessionId>() {
            last.insert(left_out.session.clone(), withdrawn(id, &left_out.site));
        }
    }
    sessions.extend(last.into_values().map(|line| (line, None)));
    ProtocolRecords { protocol, sessions }
}

fn protocol_of(folder: &Path) -> Result<Protocol, AnalysisError> {
    const FILE: &str = "protocol.toml";
    let text = ExportFiles::of(folder).text(FILE).map_err(PackageError::unreadable(folder))?;
    let protocol = Protocol::parse_kept(&text, FILE);
    Ok(protocol.map_err(PackageError::unreadable(folder.join(FILE)))?)
}

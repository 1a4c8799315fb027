//! Reads from a database what is analysed of a study.

use futures_util::{StreamExt, TryStreamExt, stream};

use super::error::AnalysisError;
use super::records::{
    AnswerRecord, CommentRecord, ProtocolRecords, SessionRecords, StudyRecords, comment_words, line, withdrawn,
};
use super::report::AnalysedSession;
use parfocal_records::store::{
    Erased, LatestCorrections, Reader, RunClocks, StoreError, StoredSession, StoredStudy, standings,
    withdrawn as withdrawn_comments,
};
use parfocal_trial::correction::Subject;
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::EventKind;
use parfocal_trial::study::event::StudyEventKind;
use parfocal_trial::study::places::Enrolled;
use parfocal_trial::study::stage::Stage;

/// Number of sessions that are read at a time: as many as a reader has connections.
const AT_A_TIME: usize = 3;

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
        stage => Err(AnalysisError::Refused(format!(
            "study '{name}' is {}: it can be analysed once all of it is unblinded, which the people named in its \
             definition can do after it was locked",
            stage.name()
        ))),
    }
}

/// The records of study `name` in the database of `reader`.
///
/// # Errors
/// If there is no such study, it is not unblinded, or the database failed.
pub async fn read(reader: &Reader, name: &str) -> Result<StudyRecords, AnalysisError> {
    let study = check(reader, name).await?;
    let unblinding = study.events.iter().rev().find(|event| matches!(event.kind, StudyEventKind::Unblinded));
    let unblinded = unblinding.map(|event| event.wall).unwrap_or_default();
    let definition = &study.definition;

    let clocks = reader.run_clocks().await?;
    let mut protocols = Vec::new();
    for protocol in &definition.protocols {
        let of_protocol = |session: &&Enrolled| session.protocol == protocol.name;
        let mut reading = Vec::new();
        for session in in_order(&study.sessions).into_iter().filter(of_protocol) {
            reading.push(read_session(reader, &clocks, session));
        }
        let sessions = stream::iter(reading).buffered(AT_A_TIME).try_collect().await?;
        protocols.push(ProtocolRecords { protocol: protocol.clone(), sessions });
    }

    Ok(StudyRecords {
        study: name.to_owned(),
        title: definition.title.clone(),
        definition_sha256: definition.sha256(),
        planned: definition.analysis.clone(),
        defined_sites: definition.sites.iter().map(|site| site.name.clone()).collect(),
        sites: study.sites.clone(),
        unblinded,
        notes: Vec::new(),
        protocols,
    })
}

/// The sessions in the order in which they were made; withdrawn ones last, by their ids.
fn in_order(sessions: &[Enrolled]) -> Vec<&Enrolled> {
    let (mut last, mut ordered): (Vec<&Enrolled>, Vec<&Enrolled>) =
        sessions.iter().partition(|session| session.withdrawn);
    last.sort_by_key(|session| session.session.to_string());
    ordered.append(&mut last);
    ordered
}

/// The line about `session`, as its study knows it, and its records if it counts.
async fn read_session(
    reader: &Reader,
    clocks: &RunClocks,
    session: &Enrolled,
) -> Result<(AnalysedSession, Option<SessionRecords>), StoreError> {
    if session.withdrawn {
        return Ok((withdrawn(session.session, &session.site), None));
    }

    let stored = reader.session(session.session).await?;
    let stored = stored.ok_or_else(|| StoreError::Damaged(format!("session {} is not there", session.session)))?;
    let emergency = unblinded_before(&stored);
    let line = line(session.session, &session.site, session.surgeon(), session.status, emergency);
    if !line.counts {
        return Ok((line, None));
    }

    let corrections = LatestCorrections::of(&reader.corrections(session.session).await?);
    let erased = Erased::by(&reader.erasures(session.session).await?);
    let settings = stored.made.segments.iter().map(|(segment, policy)| (*segment, policy.as_str().to_owned()));

    let records = SessionRecords {
        session: session.session,
        surgeon: session.surgeon().to_owned(),
        site: session.site.clone(),
        settings: settings.collect(),
        motions: reader.motions(session.session).await?,
        comments: comments(reader, session, &corrections, &erased).await?,
        answers: answers(reader, clocks, session, &corrections, &erased).await?,
    };
    Ok((line, Some(records)))
}

/// Whether the session was unblinded alone, in an emergency.
fn unblinded_before(stored: &StoredSession) -> bool {
    let mut kinds = stored.events.iter().map(|(_, event)| &event.kind);
    kinds.any(|kind| matches!(kind, EventKind::Unblinded { emergency: true, .. }))
}

async fn comments(
    reader: &Reader,
    session: &Enrolled,
    corrections: &LatestCorrections,
    erased: &Erased,
) -> Result<Vec<CommentRecord>, StoreError> {
    let kept = reader.comments(session.session).await?;
    let withdrawn = withdrawn_comments(&kept);

    let mut comments = Vec::new();
    // A comment that the surgeon took back at once was a slip of the finger.
    for (_, comment) in kept.into_iter().filter(|(_, comment)| !withdrawn.contains_key(&comment.key)) {
        let typed = corrections.note(Subject::Comment, &comment.key);
        let erased = erased.at(Erasable::Comment, &comment.key).is_some();
        let words = comment_words(comment.said, typed, comment.late, erased);
        comments.extend(words.map(|words| CommentRecord { segment: comment.segment, words }));
    }
    Ok(comments)
}

async fn answers(
    reader: &Reader,
    clocks: &RunClocks,
    session: &Enrolled,
    corrections: &LatestCorrections,
    erased: &Erased,
) -> Result<Vec<AnswerRecord>, StoreError> {
    let answers = reader.answers(session.session).await?;
    let standings = standings(&answers, clocks);

    let mut records = Vec::new();
    for ((_, answer), standing) in answers.into_iter().zip(standings).filter(|(_, standing)| standing.counts) {
        records.push(AnswerRecord {
            value: corrections.value(&answer.key).unwrap_or(standing.value),
            erased: erased.at(Erasable::Answer, &answer.key).is_some(),
            question: answer.question,
            segment: answer.segment,
        });
    }
    Ok(records)
}

//! Checks that each session of a study took the place that was next when the session was made. For this, the events of
//! the study are replayed in the order of the chain.

use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use super::StoredStudy;
use crate::store::error::Wrong;
use crate::store::values::parsed;
use crate::store::{Reader, StoreError};
use parfocal_base::ids::SessionId;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::study::places::{Enrolled, next_place};

/// An event of a study or of one of its sessions that affects the places of later sessions.
enum Moment {
    /// The study was opened.
    Opened,
    /// The study was closed.
    Closed,
    /// The session was made.
    Made(SessionId),
    /// Something happened to the session.
    Changed(SessionId, Change),
}

/// What happened to a session.
enum Change {
    Completed,
    Aborted,
    Unblinded,
    Withdrawn,
    /// Its participant was corrected to this code.
    Corrected(String),
}

/// Replays the events of `study`, and checks that every session took the place that the rules gave it.
pub(super) async fn check_places(snapshot: &Reader, study: &StoredStudy) -> Result<(), Wrong> {
    let moments = moments(snapshot, study.definition.name.as_str()).await?;
    Ok(replay(study, &moments)?)
}

fn replay(study: &StoredStudy, moments: &[Moment]) -> Result<(), String> {
    let mut open = false;
    let mut sessions: Vec<Enrolled> = Vec::new();
    for moment in moments {
        match moment {
            Moment::Opened => open = true,
            Moment::Closed => open = false,
            Moment::Made(session) => {
                if !open {
                    return Err(format!("session {session} was made while the study was not open"));
                }
                sessions.push(made(study, &sessions, *session)?);
            }
            Moment::Changed(session, change) => {
                let changed = sessions.iter_mut().find(|enrolled| enrolled.session == *session);
                let enrolled =
                    changed.ok_or_else(|| format!("session {session} has events from before it was made"))?;
                apply(enrolled, change);
            }
        }
    }

    let replayed = |enrolled: &&Enrolled| sessions.iter().any(|session| session.session == enrolled.session);
    match study.sessions.iter().find(|enrolled| !replayed(enrolled)) {
        Some(enrolled) => Err(format!("the chain does not tell when session {} was made", enrolled.session)),
        None => Ok(()),
    }
}

/// Session `session` as it was when it was made, after the sessions `earlier`. An error if its place was not the next
/// one.
fn made(study: &StoredStudy, earlier: &[Enrolled], session: SessionId) -> Result<Enrolled, String> {
    let stored = study.sessions.iter().find(|enrolled| enrolled.session == session);
    let stored = stored.ok_or_else(|| format!("session {session} is not there"))?;
    let Enrolled { participant, site, protocol, place, .. } = stored;

    let unknown = || format!("session {session}: the study has no site '{site}'");
    let at = study.definition.site(site).ok_or_else(unknown)?;
    match next_place(&study.definition, earlier, at, protocol, participant) {
        Ok(next) if next == *place => {}
        Ok(next) => {
            return Err(format!(
                "session {session} has place {place} of the list of {site}, and place {next} was next"
            ));
        }
        Err(refusal) => return Err(format!("session {session} should have been refused: {refusal}")),
    }

    Ok(Enrolled {
        corrected_participant: None,
        status: SessionStatus::UnderWay,
        unblinded: false,
        withdrawn: false,
        ..stored.clone()
    })
}

fn apply(enrolled: &mut Enrolled, change: &Change) {
    match change {
        Change::Completed => enrolled.status = SessionStatus::Completed,
        Change::Aborted => enrolled.status = SessionStatus::Aborted,
        Change::Unblinded => enrolled.unblinded = true,
        Change::Withdrawn => enrolled.withdrawn = true,
        // A code that was corrected back is the first one again.
        Change::Corrected(participant) => {
            enrolled.corrected_participant = Some(participant.clone()).filter(|code| *code != enrolled.participant);
        }
    }
}

/// What happened to study `study` and its sessions, in the order of the chain.
async fn moments(snapshot: &Reader, study: &str) -> Result<Vec<Moment>, StoreError> {
    let sql = "SELECT c.number AS moment, e.kind AS kind, NULL AS session, NULL AS participant FROM study_events AS e
             JOIN chain AS c ON c.kind = 'study-event' AND c.key = e.study || '/' || e.number
             WHERE e.study = ?1 AND e.kind IN ('opened', 'closed')
         UNION ALL
         SELECT c.number, 'made', m.session, NULL FROM study_sessions AS m
             JOIN chain AS c ON c.kind = 'study-session' AND c.key = m.session WHERE m.study = ?1
         UNION ALL
         SELECT c.number, e.kind, e.session, NULL FROM study_sessions AS m JOIN events AS e USING (session)
             JOIN chain AS c ON c.kind = 'event' AND c.key = e.session || '/' || e.number
             WHERE m.study = ?1 AND e.kind IN ('completed', 'aborted', 'unblinded', 'withdrawn')
         UNION ALL
         SELECT c.number, 'corrected', k.session, k.new_value
             FROM study_sessions AS m JOIN corrections AS k USING (session)
             JOIN chain AS c ON c.kind = 'correction' AND c.key = CAST(k.number AS TEXT)
             WHERE m.study = ?1 AND k.field = 'participant'
         ORDER BY moment";
    let moment = |row: &SqliteRow| {
        let kind: String = row.try_get("kind")?;
        let change = match kind.as_str() {
            "opened" => return Ok(Moment::Opened),
            "closed" => return Ok(Moment::Closed),
            "made" => return Ok(Moment::Made(parsed(row, "session")?)),
            "completed" => Change::Completed,
            "aborted" => Change::Aborted,
            "unblinded" => Change::Unblinded,
            "corrected" => Change::Corrected(row.try_get("participant")?),
            _ => Change::Withdrawn,
        };
        Ok(Moment::Changed(parsed(row, "session")?, change))
    };
    snapshot.rows(sql, &study, moment).await
}

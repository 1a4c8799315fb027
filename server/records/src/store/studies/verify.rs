//! Checks that the studies of a database are as they were planned, and that their sessions have the orders that were
//! drawn.

use sqlx::Row;

use super::StoredStudy;
use super::replay::check_places;
use crate::store::{Reader, StoreError};
use parfocal_base::PolicyName;
use parfocal_trial::study::lists::Lists;
use parfocal_trial::study::places::Enrolled;

/// Checks every study in `snapshot`. The inner result says what was found or what is wrong, in words.
pub(in crate::store) async fn check_studies(snapshot: &Reader) -> Result<Result<String, String>, StoreError> {
    let names = snapshot.study_names().await?;
    let mut sessions = 0;
    for name in &names {
        match check_study(snapshot, name).await? {
            Ok(checked) => sessions += checked,
            Err(problem) => return Ok(Err(format!("studies: study {name}: {problem}"))),
        }
    }

    let studies = names.len();
    Ok(Ok(format!("studies as planned: {studies}; sessions with the next place and its order: {sessions}")))
}

/// Checks study `name`. The inner result is the number of sessions that were checked, or what is wrong.
async fn check_study(snapshot: &Reader, name: &str) -> Result<Result<usize, String>, StoreError> {
    // Reading it compares the protocols with the hashes in the definition.
    let Some(study) = snapshot.study(name).await? else { return Ok(Err("it is not there".to_owned())) };

    let row = sqlx::query("SELECT definition_sha256 FROM studies WHERE study = ?").bind(name);
    let planned: String = row.fetch_one(snapshot.pool()).await?.try_get("definition_sha256")?;
    if planned != study.definition.sha256() || study.definition.name.as_str() != name {
        return Ok(Err("its definition was changed since it was planned".to_owned()));
    }

    let lists = match committed_lists(&study) {
        Ok(lists) => lists,
        Err(problem) => return Ok(Err(problem)),
    };
    for enrolled in &study.sessions {
        if let Err(problem) = check_session(snapshot, lists.as_ref(), enrolled).await? {
            return Ok(Err(format!("session {}: {problem}", enrolled.session)));
        }
    }
    Ok(check_places(snapshot, &study).await?.map(|()| study.sessions.len()))
}

/// The orders of `study`, or an error if they are not those committed to; `None` if it was never opened.
fn committed_lists(study: &StoredStudy) -> Result<Option<Lists>, String> {
    let (seed, commitment) = match (study.seed, study.state().commitment) {
        (None, None) => return Ok(None),
        (Some(seed), Some(commitment)) => (seed, commitment),
        (None, Some(_)) => return Err("the seed of its orders is missing".to_owned()),
        (Some(_), None) => return Err("its orders were drawn, and nothing commits to them".to_owned()),
    };

    let lists = Lists::draw(&study.definition, &study.sites, seed);
    if lists.commitment() != commitment {
        return Err("its orders, sites or seed were changed since they were drawn".to_owned());
    }
    Ok(Some(lists))
}

async fn check_session(
    snapshot: &Reader,
    lists: Option<&Lists>,
    enrolled: &Enrolled,
) -> Result<Result<(), String>, StoreError> {
    let Some(stored) = snapshot.session(enrolled.session).await? else {
        return Ok(Err("it is not there".to_owned()));
    };
    let place = lists.and_then(|lists| lists.place(&enrolled.site, &enrolled.protocol, enrolled.place));
    let Some(place) = place else {
        return Ok(Err(format!("the list of {} has no place {}", enrolled.site, enrolled.place)));
    };

    let made = stored.made;
    let schedule: Vec<PolicyName> = made.segments.into_iter().map(|(_, policy)| policy).collect();
    let same = made.protocol == enrolled.protocol
        && made.seed == place.seed
        && made.set_index == place.index
        && schedule == place.schedule;
    Ok(if same { Ok(()) } else { Err(format!("its order is not that of place {} in its list", enrolled.place)) })
}

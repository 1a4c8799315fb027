//! Checks that the studies of a database are as they were planned, and that their sessions have the orders that were
//! drawn.

use sqlx::Row;

use super::StoredStudy;
use super::replay::check_places;
use crate::store::Reader;
use crate::store::error::Wrong;
use parfocal_base::PolicyName;
use parfocal_trial::study::lists::Lists;
use parfocal_trial::study::places::Enrolled;

/// Checks every study in `snapshot`. Says what was found, in words.
pub(in crate::store) async fn check_studies(snapshot: &Reader) -> Result<String, Wrong> {
    let names = snapshot.study_names().await?;
    let mut sessions = 0;
    for name in &names {
        let checked = check_study(snapshot, name).await;
        sessions += checked.map_err(|wrong| wrong.with(format_args!("studies: study {name}")))?;
    }

    let studies = names.len();
    Ok(format!("studies as planned: {studies}; sessions with the next place and its order: {sessions}"))
}

/// Checks study `name`. Returns the number of sessions that were checked.
async fn check_study(snapshot: &Reader, name: &str) -> Result<usize, Wrong> {
    // Reading it compares the protocols with the hashes in the definition.
    let study = snapshot.study(name).await?.ok_or("it is not there")?;

    let row = sqlx::query("SELECT definition_sha256 FROM studies WHERE study = ?").bind(name);
    let planned: String = row.fetch_one(snapshot.pool()).await?.try_get("definition_sha256")?;
    if planned != study.definition.sha256() || study.definition.name.as_str() != name {
        return Err("its definition was changed since it was planned".into());
    }

    let lists = committed_lists(&study)?;
    for enrolled in &study.sessions {
        let checked = check_session(snapshot, lists.as_ref(), enrolled).await;
        checked.map_err(|wrong| wrong.with(format_args!("session {}", enrolled.session)))?;
    }
    check_places(snapshot, &study).await?;
    Ok(study.sessions.len())
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

async fn check_session(snapshot: &Reader, lists: Option<&Lists>, enrolled: &Enrolled) -> Result<(), Wrong> {
    let stored = snapshot.session(enrolled.session).await?.ok_or("it is not there")?;
    let place = lists.and_then(|lists| lists.place(&enrolled.site, &enrolled.protocol, enrolled.place));
    let place = place.ok_or_else(|| format!("the list of {} has no place {}", enrolled.site, enrolled.place))?;

    let made = stored.made;
    let schedule: Vec<PolicyName> = made.segments.into_iter().map(|(_, policy)| policy).collect();
    let same = made.protocol == enrolled.protocol
        && made.seed == place.seed
        && made.set_index == place.index
        && schedule == place.schedule;
    if same { Ok(()) } else { Err(format!("its order is not that of place {} in its list", enrolled.place).into()) }
}

//! Which place a session gets under the rules in the definition.

use parfocal_base::ids::SessionId;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::refusal::Refusal;
use parfocal_trial::study::definition::Definition;
use parfocal_trial::study::places::{Enrolled, next_place};
use uuid::Uuid;

use super::{definition, protocol};

/// The study with these rules. Leeds has 2 surgeons and 2 spare places.
fn with_rules(aborted: &str, withdrawn: &str, repeated: &str) -> Definition {
    let text = definition()
        .replace("aborted = \"next-spare\"", &format!("aborted = \"{aborted}\""))
        .replace("withdrawn = \"next-spare\"", &format!("withdrawn = \"{withdrawn}\""))
        .replace("repeated = \"refuse\"", &format!("repeated = \"{repeated}\""));
    Definition::parse(&text, "study.toml", &[protocol()]).unwrap()
}

fn completed(participant: &str, place: usize) -> Enrolled {
    Enrolled {
        session: SessionId(Uuid::from_u128(place as u128)),
        participant: participant.to_owned(),
        corrected_participant: None,
        site: "leeds".to_owned(),
        protocol: "pair".to_owned(),
        place,
        status: SessionStatus::Completed,
        unblinded: false,
        withdrawn: false,
    }
}

fn aborted(participant: &str, place: usize) -> Enrolled {
    Enrolled { status: SessionStatus::Aborted, ..completed(participant, place) }
}

fn withdrawn(participant: &str, place: usize) -> Enrolled {
    Enrolled { withdrawn: true, ..completed(participant, place) }
}

fn next(definition: &Definition, sessions: &[Enrolled], participant: &str) -> Result<usize, Refusal> {
    next_place(definition, sessions, definition.site("leeds").unwrap(), "pair", participant)
}

fn is_used_up(outcome: &Result<usize, Refusal>, open: usize) -> bool {
    says(outcome, &format!("no place is left in the list of leeds: {open} of 4 were open"))
}

fn has_withdrawn(outcome: &Result<usize, Refusal>, participant: &str) -> bool {
    says(outcome, &format!("{participant} withdrew from the study"))
}

fn is_a_repetition(outcome: &Result<usize, Refusal>, participant: &str) -> bool {
    says(outcome, &format!("{participant} has a session by this protocol, and the study allows no second one"))
}

fn says(outcome: &Result<usize, Refusal>, text: &str) -> bool {
    matches!(outcome, Err(Refusal::Conflict(said)) if said.starts_with(text))
}

#[test]
fn places_are_taken_in_turn_until_the_planned_ones_are_used() {
    let study = with_rules("keep", "keep", "refuse");
    assert_eq!(next(&study, &[], "S-01"), Ok(1));
    assert_eq!(next(&study, &[completed("S-01", 1)], "S-02"), Ok(2));

    let both = [completed("S-01", 1), completed("S-02", 2)];
    let refused = next(&study, &both, "S-03");
    assert!(is_used_up(&refused, 2), "{refused:?}");
    let said = refused.unwrap_err().to_string();
    assert!(
        said.contains("no place is left in the list of leeds") && said.contains("Call the trial office."),
        "{said}"
    );
}

#[test]
fn the_lists_of_two_sites_are_apart() {
    let study = with_rules("keep", "keep", "refuse");
    let elsewhere = Enrolled { site: "london".to_owned(), ..completed("S-01", 1) };
    assert_eq!(next(&study, std::slice::from_ref(&elsewhere), "S-02"), Ok(1));
    // A surgeon who works at both sites is still one surgeon.
    assert!(is_a_repetition(&next(&study, &[elsewhere], "S-01"), "S-01"));
}

#[test]
fn what_becomes_of_an_aborted_sessions_place_is_what_the_study_says() {
    let sessions = [completed("S-01", 1), aborted("S-02", 2)];

    let refused = next(&with_rules("keep", "keep", "refuse"), &sessions, "S-03");
    assert!(is_used_up(&refused, 2), "{refused:?}");
    assert_eq!(next(&with_rules("same-place", "keep", "refuse"), &sessions, "S-03"), Ok(2));
    assert_eq!(next(&with_rules("next-spare", "keep", "refuse"), &sessions, "S-03"), Ok(3));
    // One aborted session opens only one spare place.
    let taken = [completed("S-01", 1), aborted("S-02", 2), completed("S-03", 3)];
    let refused = next(&with_rules("next-spare", "keep", "refuse"), &taken, "S-04");
    assert!(is_used_up(&refused, 3), "{refused:?}");
}

#[test]
fn no_more_places_open_than_the_list_has() {
    let study = with_rules("next-spare", "keep", "refuse");
    let sessions: Vec<Enrolled> = (1..=4).map(|place| aborted(&format!("S-0{place}"), place)).collect();
    let refused = next(&study, &sessions, "S-05");
    assert!(is_used_up(&refused, 4), "{refused:?}");
}

#[test]
fn a_place_whose_order_has_become_known_is_not_given_again() {
    let study = with_rules("same-place", "keep", "refuse");
    let known = Enrolled { unblinded: true, ..aborted("S-01", 1) };
    assert_eq!(next(&study, std::slice::from_ref(&known), "S-02"), Ok(2));
    // A spare place opens instead.
    let sessions = [known, completed("S-02", 2)];
    assert_eq!(next(&study, &sessions, "S-03"), Ok(3));

    // The order stays known if the place was given again before that, and nobody unblinded the later session.
    let [known, other] = sessions;
    let sessions = [known, aborted("S-04", 1), other];
    assert_eq!(next(&study, &sessions, "S-03"), Ok(3));
}

#[test]
fn a_place_given_again_is_given_once() {
    let study = with_rules("same-place", "keep", "refuse");
    let sessions = [aborted("S-01", 1), completed("S-02", 1)];
    assert_eq!(next(&study, &sessions, "S-03"), Ok(2));
    // Once both are unblinded, the place that was retaken opens no spare.
    let known = sessions.map(|session| Enrolled { unblinded: true, ..session });
    let all = [known[0].clone(), known[1].clone(), completed("S-03", 2)];
    let refused = next(&study, &all, "S-04");
    assert!(is_used_up(&refused, 2), "{refused:?}");
}

#[test]
fn what_becomes_of_a_withdrawn_surgeons_place_is_what_the_study_says() {
    let sessions = [completed("S-01", 1), withdrawn("S-02", 2)];
    let refused = next(&with_rules("keep", "keep", "refuse"), &sessions, "S-03");
    assert!(is_used_up(&refused, 2), "{refused:?}");
    assert_eq!(next(&with_rules("keep", "same-place", "refuse"), &sessions, "S-03"), Ok(2));
    assert_eq!(next(&with_rules("keep", "next-spare", "refuse"), &sessions, "S-03"), Ok(3));
    // A surgeon who withdrew may not have another session.
    let back = next(&with_rules("keep", "next-spare", "next-spare"), &sessions, "S-02");
    assert!(has_withdrawn(&back, "S-02"), "{back:?}");
}

#[test]
fn a_second_session_of_a_surgeon_is_what_the_study_says() {
    let sessions = [completed("S-01", 1), completed("S-02", 2)];
    let refused = next(&with_rules("keep", "keep", "refuse"), &sessions, "S-01");
    assert!(is_a_repetition(&refused, "S-01"), "{refused:?}");
    assert_eq!(next(&with_rules("keep", "keep", "next-spare"), &sessions, "S-01"), Ok(3));
    // The second session does not take the place of a planned surgeon.
    let repeated = [completed("S-01", 1), completed("S-01", 2)];
    assert_eq!(next(&with_rules("keep", "keep", "next-spare"), &repeated, "S-02"), Ok(3));

    // If an aborted session is replaced, the same surgeon may have another. If its place is kept, the surgeon may not.
    let once = [aborted("S-01", 1)];
    assert_eq!(next(&with_rules("next-spare", "keep", "refuse"), &once, "S-01"), Ok(2));
    assert!(is_a_repetition(&next(&with_rules("keep", "keep", "refuse"), &once, "S-01"), "S-01"));
}

#[test]
fn a_second_session_at_another_site_opens_a_spare_place_there() {
    let study = with_rules("keep", "keep", "next-spare");
    let elsewhere = Enrolled { site: "london".to_owned(), ..completed("S-01", 1) };
    // The second session takes no planned surgeon's place, as long as it is in the list.
    let sessions = [elsewhere, completed("S-01", 1), completed("S-02", 2)];
    assert_eq!(next(&study, &sessions, "S-03"), Ok(3));
    let all = [&sessions[..], &[completed("S-03", 3)]].concat();
    let refused = next(&study, &all, "S-04");
    assert!(is_used_up(&refused, 3), "{refused:?}");
}

#[test]
fn a_session_counts_for_the_surgeon_whose_it_was() {
    let study = with_rules("next-spare", "next-spare", "refuse");
    let of_another = |session: Enrolled| Enrolled { corrected_participant: Some("S-02".to_owned()), ..session };

    let sessions = [of_another(completed("S-01", 1))];
    assert_eq!(next(&study, &sessions, "S-01"), Ok(2));
    assert!(is_a_repetition(&next(&study, &sessions, "S-02"), "S-02"));
    let sessions = [of_another(withdrawn("S-01", 1))];
    assert_eq!(next(&study, &sessions, "S-01"), Ok(2));
    assert!(has_withdrawn(&next(&study, &sessions, "S-02"), "S-02"));
}

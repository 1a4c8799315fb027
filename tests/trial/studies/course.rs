//! A study from its plan to its end, on a real database: what is possible at each stage, and what is refused.

use std::sync::Arc;
use std::time::Duration;

use parfocal_base::ids::SessionId;
use parfocal_records::store::export::{ExportError, export};
use parfocal_session::conductor::{ConductError, Studies, StudyPlace};
use parfocal_session::reports::StudyDetail;
use parfocal_trial::action::Action;
use parfocal_trial::correction::{FieldChange, NewCorrection};
use parfocal_trial::remark::{CommentContent, NewComment, Origin, Sight};
use parfocal_trial::role::Role;
use parfocal_trial::study::signature::{Channel, Signature};
use parfocal_trial::study::stage::Stage;
use parfocal_trial::study::state::Change;
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

use super::*;
use crate::fixture::{PARTICIPANT, a_clock, known};

const LOCK: Change = Change::Lock { despite_outstanding: false };

fn refusal<T: std::fmt::Debug>(outcome: Result<T, ConductError>) -> String {
    outcome.unwrap_err().to_string()
}

#[tokio::test]
async fn a_study_goes_from_plan_to_unblinding_and_each_step_is_an_event_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    assert_eq!(detail(&trial).await.line.stage, Stage::Open);
    let commitment = detail(&trial).await.commitment_line.unwrap();
    assert!(commitment.starts_with("parfocal study scope-2026 definition "), "{commitment}");

    let first = whole(&mut trial, PARTICIPANT, "leeds").await;
    change(&trial, Change::Close).await.unwrap();
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    assert_eq!(detail(&trial).await.commitment_line.unwrap(), commitment, "the orders are drawn once");
    let second = whole(&mut trial, "S-02", "london").await;
    to_the_end(&trial).await;

    let study = detail(&trial).await;
    let log: Vec<&str> = study.log.iter().map(|line| line.text.as_str()).collect();
    assert_eq!(
        log,
        [
            "Study planned",
            "Orders drawn; study opened",
            "Study closed",
            "Study opened again",
            "Study closed",
            "Study locked",
            "Study unblinded"
        ]
    );
    assert!(study.log.iter().all(|line| !line.person.is_empty() && !line.reason.is_empty()));
    assert_eq!(study.log[6].person, STATISTICIAN);
    assert_eq!(study.line.stage, Stage::Unblinded);

    for session in [first, second] {
        let detail = trial.reports.session_detail(session).await.unwrap();
        assert_eq!(detail.line.study.as_deref(), Some(STUDY));
        assert_eq!(detail.unblinding.map(|unblinding| unblinding.emergency), Some(false));
    }
}

#[tokio::test]
async fn changes_that_the_studys_stage_does_not_allow_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let trial = a_trial(folder.path()).await;
    assert!(
        refusal(change(&trial, Change::Open { despite_concerns: true }).await)
            .contains("there is no study 'scope-2026'; there are: none yet")
    );

    plan(&trial, definition()).await.unwrap();
    let again = refusal(plan(&trial, definition()).await);
    assert!(again.contains("there is already a study 'scope-2026'"), "{again}");
    assert!(refusal(change(&trial, Change::Close).await).contains("has not been opened yet"));
    assert!(refusal(change(&trial, LOCK).await).contains("the study is planned; close it first"));
    assert!(refusal(change(&trial, Change::Unblind).await).contains("only after it was locked"));
    let early = refusal(prepare(&trial, PARTICIPANT, "leeds").await);
    assert!(early.contains("the study is planned; sessions can be made only while it is open"), "{early}");

    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    assert!(
        refusal(change(&trial, Change::Open { despite_concerns: true }).await).contains("the study is open already")
    );
    assert!(refusal(change(&trial, LOCK).await).contains("the study is open; close it first"));
    change(&trial, Change::Close).await.unwrap();
    assert!(refusal(change(&trial, Change::Close).await).contains("the study is closed already"));
    assert!(refusal(prepare(&trial, PARTICIPANT, "leeds").await).contains("the study is closed"));

    change(&trial, LOCK).await.unwrap();
    for change in [Change::Open { despite_concerns: true }, Change::Close, LOCK] {
        assert!(refusal(super::change(&trial, change).await).contains("the study is locked"), "{change:?}");
    }
    assert_eq!(detail(&trial).await.log.len(), 4, "planned, opened, closed, locked");
}

#[tokio::test]
async fn only_those_whom_the_study_names_unblind_it_and_only_the_researcher_changes_it() {
    let folder = tempfile::tempdir().unwrap();
    let trial = opened(folder.path()).await;
    change(&trial, Change::Close).await.unwrap();
    change(&trial, LOCK).await.unwrap();

    let other = refusal(change(&trial, Change::Unblind).await);
    assert!(other.contains("'Dr Lead' is not among those who may unblind this study: Trial statistician"), "{other}");
    let unblind = async |reason: &str| {
        let signature = Signature::new(STATISTICIAN, reason).unwrap();
        trial.conductor.change_study(Role::Researcher, STUDY.to_owned(), Change::Unblind, signature).await
    };
    let named = refusal(unblind("to see the MLR-hill-climber win").await);
    assert!(named.contains("the reason names the policy 'mlr-hill-climber'"), "{named}");
    unblind("the database is locked").await.unwrap();
    assert!(refusal(unblind("again").await).contains("unblinded already"));

    for role in [Role::Operator, Role::Surgeon, Role::System] {
        let change = trial.conductor.change_study(role, STUDY.to_owned(), Change::Close, signed("because"));
        assert!(matches!(change.await, Err(ConductError::Forbidden(_))), "{role:?}");
    }
    let nobody = Signature::new(" ", "because").unwrap_err();
    assert!(nobody.to_string().starts_with("say who you are, in 1 to 200 characters"), "{nobody}");
    let unreasoned = Signature::new("Dr Lead", "\n").unwrap_err();
    assert!(unreasoned.to_string().starts_with("give a reason, in 1 to 1000 characters"), "{unreasoned}");
}

#[tokio::test]
async fn sessions_take_the_places_of_their_site_in_turn_and_a_used_up_list_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    whole(&mut trial, PARTICIPANT, "leeds").await;
    whole(&mut trial, "S-02", "london").await;
    let left = aborted(&trial, "S-03", "leeds").await;
    whole(&mut trial, "S-03", "leeds").await;

    let used_up = refusal(prepare(&trial, "S-04", "leeds").await);
    assert!(used_up.contains("3 of 4 were open, all are used. Call the trial office."), "{used_up}");
    let twice = refusal(prepare(&trial, "S-02", "leeds").await);
    assert!(twice.contains("S-02 has a session by this protocol, and the study allows no second one"), "{twice}");

    // The surgeon of the first session withdraws. A spare place opens, and that surgeon may not have another session.
    let study = detail(&trial).await;
    let first = study.study_sessions[0].session;
    change(&trial, Change::Withdraw { session: first }).await.unwrap();
    let refused = export(&trial.access_log(), first, &folder.path().join("withdrawn"), false).await.unwrap_err();
    assert!(matches!(refused, ExportError::Withdrawn { .. }), "{refused}");
    assert!(refusal(change(&trial, Change::Withdraw { session: first }).await).contains("is recorded already"));
    assert!(refusal(prepare(&trial, PARTICIPANT, "london").await).contains("withdrew from the study"));
    whole(&mut trial, "S-04", "leeds").await;

    let places: Vec<(String, String, usize)> = detail(&trial)
        .await
        .study_sessions
        .into_iter()
        .map(|session| (session.participant, session.site, session.place))
        .collect();
    let place = |participant: &str, site: &str, place| (participant.to_owned(), site.to_owned(), place);
    assert_eq!(
        places,
        [
            place("S-01", "leeds", 1),
            place("S-02", "london", 1),
            place("S-03", "leeds", 2),
            place("S-03", "leeds", 3),
            place("S-04", "leeds", 4)
        ]
    );

    let unknown = Change::Withdraw { session: SessionId(uuid::Uuid::from_u128(9)) };
    assert!(refusal(change(&trial, unknown).await).contains("no such session"));
    change(&trial, Change::Close).await.unwrap();
    change(&trial, Change::Lock { despite_outstanding: true }).await.unwrap();
    assert!(refusal(change(&trial, Change::Withdraw { session: left }).await).contains("the study is locked"));
}

#[tokio::test]
async fn missing_parts_of_a_study_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let trial = opened(folder.path()).await;
    let ask = async |study: &str, site: &str, protocol: &str| {
        let place = StudyPlace { study: study.to_owned(), site: site.to_owned() };
        refusal(trial.conductor.create(Role::Operator, PARTICIPANT, protocol, Some(place)).await)
    };

    assert!(ask("another", "leeds", "pair").await.contains("there is no study 'another'; there are: scope-2026"));
    assert!(ask(STUDY, "paris", "pair").await.contains("no site 'paris' here; there are: leeds, london"));
    assert!(ask(STUDY, "leeds", "paper").await.contains("no protocol 'paper'; it has: pair"));

    let text = definition().replace(STUDY, "one-site");
    let sites = vec!["london".to_owned()];
    trial.conductor.plan_study(Role::Researcher, text, sites, signed("for London alone")).await.unwrap();
    let open = trial.conductor.change_study(
        Role::Researcher,
        "one-site".to_owned(),
        Change::Open { despite_concerns: true },
        signed("go"),
    );
    open.await.unwrap();
    assert!(ask("one-site", "leeds", "pair").await.contains("no site 'leeds' here; there are: london"));

    let text = definition().replace(STUDY, "no-site");
    let sites = vec!["paris".to_owned()];
    let planned = trial.conductor.plan_study(Role::Researcher, text, sites, signed("for Paris")).await;
    assert!(refusal(planned).contains("the study has no site 'paris'; it has: leeds, london"));
}

#[tokio::test]
async fn a_study_is_not_locked_over_a_session_or_over_words_that_may_still_come() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = prepare(&trial, PARTICIPANT, "leeds").await.unwrap();
    trial.conductor.act(Role::Operator, session, Action::Start).await.unwrap();
    for _ in 0..2 {
        trial.whole_setting().await;
    }
    let mut late = trial.comment("said after the lock");
    late.segment = None;
    change(&trial, Change::Close).await.unwrap();

    // The session is completed, but the surgeon's page still shows it.
    assert!(refusal(change(&trial, LOCK).await).contains("the session of S-01 has not ended, or is still on"));
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    let open = refusal(change(&trial, LOCK).await);
    assert!(open.contains("for 1 of its sessions") && open.contains("despite_outstanding"), "{open}");
    change(&trial, Change::Lock { despite_outstanding: true }).await.unwrap();

    // A comment that arrives now is kept, but never counts.
    trial.wait(Duration::from_secs(1)).await;
    trial.conductor.comment(late).await.unwrap();
    let comments = trial.store.reader().comments(session).await.unwrap();
    let (_, last) = comments.last().unwrap();
    assert_eq!(last.said, CommentContent::Text("said after the lock".to_owned()));
    assert!(last.late);
    assert!(!comments[0].1.late);
}

#[tokio::test]
async fn a_study_whose_words_are_all_in_is_locked_without_more_ado() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    whole(&mut trial, PARTICIPANT, "leeds").await;
    trial.clock.advance(Duration::from_hours(1));
    change(&trial, Change::Close).await.unwrap();
    change(&trial, LOCK).await.unwrap();
}

#[tokio::test]
async fn a_withdrawn_session_keeps_no_study_from_being_locked() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;
    change(&trial, Change::Close).await.unwrap();
    assert!(refusal(change(&trial, LOCK).await).contains("for 1 of its sessions"));

    change(&trial, Change::Withdraw { session }).await.unwrap();
    assert_eq!(detail(&trial).await.outstanding, 0);
    change(&trial, LOCK).await.unwrap();
}

#[tokio::test]
async fn a_session_of_a_study_takes_words_after_its_end_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;
    let comment = NewComment {
        key: trial.key(),
        session,
        segment: None,
        frame: None,
        run: None,
        sight: Sight::default(),
        origin: Origin::default(),
        said: CommentContent::Text("one more thing".to_owned()),
    };
    trial.conductor.comment(comment).await.unwrap();
    let comments = trial.store.reader().comments(session).await.unwrap();
    assert!(!comments.last().unwrap().1.late);
}

#[tokio::test]
async fn a_clock_set_back_changes_neither_the_state_nor_the_order_of_events() {
    let folder = tempfile::tempdir().unwrap();
    let trial = opened(folder.path()).await;
    let before = detail(&trial).await.log[1].at;
    trial.clock.set_wall("2020-01-01T00:00:00Z".parse().unwrap());
    change(&trial, Change::Close).await.unwrap();

    let study = detail(&trial).await;
    assert!(study.log[2].at < before, "the event tells the clock as it was");
    assert_eq!(study.line.stage, Stage::Closed);
    assert_eq!(study.log[2].text, "Study closed");
    change(&trial, LOCK).await.unwrap();
    assert_eq!(detail(&trial).await.line.stage, Stage::Locked);
}

#[tokio::test]
async fn a_command_changes_studies_while_no_server_runs() {
    let folder = tempfile::tempdir().unwrap();
    let trial = opened(folder.path()).await;
    let library = parfocal_session::conductor::Library::load(Some(folder.path()), &known()).unwrap();
    let clock = trial.clock.clone();

    let refused = Studies::open(folder.path(), &library, clock.clone()).await.map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("in use by another parfocal server"), "{refused}");
    trial.store.close().await;
    drop(trial);

    let studies = Studies::open(folder.path(), &library, clock).await.unwrap();
    let mut random = ChaCha12Rng::seed_from_u64(1);
    for change in [Change::Close, LOCK] {
        studies.change(Channel::CommandLine, STUDY, change, signed("no server"), None, &mut random).await.unwrap();
    }
    let study = StudyDetail::read(&studies, STUDY).await.unwrap();
    assert_eq!((study.line.stage, study.log[3].by), (Stage::Locked, "command-line"));
    studies.close().await;

    let nowhere = folder.path().join("elsewhere");
    let missing = Studies::open(&nowhere, &library, Arc::new(a_clock()));
    assert!(missing.await.map(|_| ()).unwrap_err().to_string().contains("there is no database"));
}

#[tokio::test]
async fn a_session_under_the_wrong_code_counts_for_the_right_surgeon_once_it_is_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, "S-02", "leeds").await;
    assert!(refusal(prepare(&trial, "S-02", "leeds").await).contains("S-02"));
    let correct = async |old: &str, new: &str| {
        let change = FieldChange::Participant { old: old.to_owned(), new: new.to_owned() };
        let correction = NewCorrection { change, reason: "the wrong code was chosen".to_owned() };
        trial.conductor.correct(Role::Researcher, session, correction).await.unwrap();
    };
    correct("S-02", "S-03").await;
    correct("S-03", "S-02").await;
    assert_eq!(detail(&trial).await.study_sessions[0].corrected_participant, None, "it is the first code again");
    correct("S-02", "S-03").await;

    assert!(refusal(prepare(&trial, "S-03", "leeds").await).contains("S-03"));
    whole(&mut trial, "S-02", "leeds").await;
    let sessions = detail(&trial).await.study_sessions;
    let told: Vec<_> = sessions.iter().map(|line| (line.corrected_participant.as_deref(), line.place)).collect();
    assert_eq!(told, [(Some("S-03"), 1), (None, 2)]);

    // The withdrawal is that of the surgeon who really had the session.
    change(&trial, Change::Withdraw { session }).await.unwrap();
    assert_eq!(detail(&trial).await.log.last().unwrap().text, "S-03 withdrew");
    assert!(refusal(prepare(&trial, "S-03", "leeds").await).contains("withdrew"));
    let checks = parfocal_records::store::verify_database(folder.path(), None).await.unwrap();
    assert_eq!(crate::exports::failed(&checks), [""; 0], "{checks:?}");
}

#[tokio::test]
async fn what_counts_in_a_locked_study_is_corrected_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    let session = whole(&mut trial, "S-02", "leeds").await;
    change(&trial, Change::Close).await.unwrap();
    change(&trial, Change::Lock { despite_outstanding: true }).await.unwrap();

    let correct = async |change| {
        let correction = NewCorrection { change, reason: "the surgeon said so on the phone".to_owned() };
        trial.conductor.correct(Role::Researcher, session, correction).await
    };
    let code = FieldChange::Participant { old: "S-02".to_owned(), new: "S-03".to_owned() };
    let refused = correct(code).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("is locked")), "{refused}");

    // A note beside a comment, such as a transcript, changes no result.
    let (_, comment) = trial.store.reader().comments(session).await.unwrap().remove(0);
    let note = FieldChange::Note { record: comment.key, old: String::new(), new: "of the monitor".to_owned() };
    correct(note).await.unwrap();
}

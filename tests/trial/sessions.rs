//! Sessions in the conductor: their course, the views of each role, the commands to the control loop, and restarts.

use std::collections::BTreeSet;
use std::task::{Context, Waker};
use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::phase::{Phase, SessionStatus};
use parfocal_trial::role::Role;

use crate::fixture::{PARTICIPANT, Trial};

#[tokio::test]
async fn a_surgeon_goes_through_six_blinded_settings_and_everything_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.whole_session("paper").await;

    let lines = trial.store.reader().sessions(false).await.unwrap();
    assert_eq!(lines.len(), 1);
    assert_eq!((lines[0].session, lines[0].status), (session, SessionStatus::Completed));
    assert_eq!((lines[0].settings, lines[0].finished_settings, lines[0].comments), (6, 6, 6));

    let detail = trial.reports.session_detail(session).await.unwrap();
    // Four questions after each of six settings, three at the end.
    assert_eq!(detail.answers.len(), 6 * 4 + 3);
    assert!(detail.settings_detail.iter().all(|setting| setting.inspected_seconds == Some(20.0)));
    let sus = detail.answers.iter().find(|answer| answer.question == "usability").unwrap();
    assert_eq!(sus.sus_score, Some(67.5));

    let timeline = trial.reports.timeline(Role::Researcher, session, 100).await.unwrap();
    let seconds: Vec<f64> = timeline.comments.iter().map(|comment| comment.seconds).collect();
    assert_eq!(seconds, [20.0, 40.0, 60.0, 80.0, 100.0, 120.0], "only inspection takes time on this trial");
    assert_eq!(timeline.comments[2].setting, Some(3));
    assert_eq!((timeline.settings[2].from, timeline.settings[2].to), (40.0, Some(60.0)));
}

#[tokio::test]
async fn nothing_that_surgeon_or_operator_get_tells_a_policy() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let mut surgeon = trial.conductor.surgeon_view();
    let mut operator = trial.conductor.operator_view();
    let session = trial.begin("paper").await;
    let mut seen = String::new();
    let mut segments = BTreeSet::new();
    for _ in 0..6 {
        segments.insert(trial.whole_setting().await);
        seen += &serde_json::to_string(surgeon.borrow_and_update().as_deref().unwrap()).unwrap();
        seen += &serde_json::to_string(operator.borrow_and_update().as_deref().unwrap()).unwrap();
    }

    // An emergency unblinding by the researcher does not change that.
    trial.unblind(session).await;
    seen += &serde_json::to_string(&trial.operator_view()).unwrap();
    seen += &serde_json::to_string(&trial.store.reader().sessions(true).await.unwrap()).unwrap();
    seen += &serde_json::to_string(&trial.library.summaries()).unwrap();
    for tell in ["mgm", "mlr", "cnn", "CNN", "hill-climb", "\"fixed", "seed", "policy"] {
        assert!(!seen.contains(tell), "'{tell}' was sent");
    }
    assert_eq!(segments.len(), 6, "segments of one policy share no id");
}

#[tokio::test]
async fn the_researcher_learns_the_policies_at_unblinding_and_not_before() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.whole_session("paper").await;
    let before = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(before.unblinding, None);
    assert!(!serde_json::to_string(&before).unwrap().contains("mgm-"));

    trial.unblind(session).await;
    let told = trial.reports.session_detail(session).await.unwrap().unblinding.unwrap();
    assert!(!told.emergency);
    let mut policies: Vec<&str> = told.policies.iter().map(PolicyName::as_str).collect();
    policies.sort_unstable();
    let twice = |name| [name, name];
    assert_eq!(policies, [twice("cnn-learned"), twice("mgm-hill-climber"), twice("mgm-learned")].concat());
}

#[tokio::test]
async fn the_control_loop_gets_each_policy_from_the_same_start_and_holds_in_between() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.whole_session("paper").await;
    trial.unblind(session).await;
    let told = trial.reports.session_detail(session).await.unwrap();
    let policies = told.unblinding.unwrap().policies;

    let mut expected = Vec::new();
    for (policy, setting) in policies.iter().zip(&told.settings_detail) {
        let start = FocalPower::MIDDLE;
        expected.push(Command::Drive { drive: Drive::Manual(start), segment: None });
        let drive = Drive::Policy { name: policy.clone(), start: Some(start) };
        expected.push(Command::Drive { drive, segment: Some(setting.segment) });
        expected.push(Command::Drive { drive: Drive::Hold { at: None }, segment: None });
    }

    // After the last setting the lens holds during the closing questions, and gets the same command again at the end.
    expected.push(Command::Drive { drive: Drive::Hold { at: None }, segment: None });
    assert_eq!(trial.commanded(), expected);
}

#[tokio::test]
async fn a_setting_ends_at_its_limit_and_prompts_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(Duration::from_secs(20)).await;
    assert_eq!(trial.view().prompt.as_deref(), Some("How does the focus feel now?"));
    assert_eq!(trial.view().remaining_seconds, Some(100.0));
    trial.wait(Duration::from_secs(15)).await;
    assert_eq!(trial.view().prompt, None);
    trial.wait(Duration::from_secs(84)).await;
    assert_eq!(trial.view().phase, Phase::Inspecting);
    trial.wait(Duration::from_secs(1)).await;
    assert_eq!(trial.view().phase, Phase::Questions);
    assert!(trial.operator_view().log[0].text.contains("120.0 s"), "{:?}", trial.operator_view().log[0]);
}

#[tokio::test]
async fn a_restarted_server_continues_at_the_same_place_and_loses_at_most_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    trial.whole_setting().await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(Duration::from_secs(30)).await;
    trial.say("before").await;
    trial.clock.advance(Duration::from_millis(900));
    drop(trial);

    let mut trial = Trial::start(folder.path()).await;
    let view = trial.view();
    assert_eq!((view.session, view.segment, view.phase), (session, Some(segment), Phase::Inspecting));
    assert_eq!((view.paused, view.may_resume, view.setting, view.comments), (true, true, 2, 2));
    assert_eq!(view.remaining_seconds, Some(90.0));
    // No step of a policy was recorded in this test, so the lens waits where the setting began.
    let start = Some(FocalPower::MIDDLE);
    assert_eq!(trial.commanded(), [Command::Drive { drive: Drive::Hold { at: start }, segment: Some(segment) }]);
    trial.surgeon(Action::Resume).await;
    let resumed = trial.commanded();
    let goes_on =
        matches!(&resumed[..], [Command::Drive { drive: Drive::Policy { start: at, .. }, .. }] if *at == start);
    assert!(goes_on, "{resumed:?}");
    trial.wait(Duration::from_secs(90)).await;
    assert_eq!(trial.view().phase, Phase::Questions);
    while trial.view().phase != Phase::Completed {
        if trial.view().phase == Phase::Notice {
            trial.whole_setting().await;
        } else {
            trial.answer_all().await;
            trial.surgeon(Action::FinishQuestions { segment: trial.view().segment }).await;
        }
    }

    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.settings_detail[1].inspected_seconds, Some(120.0));
    drop(trial);
    let trial = Trial::start(folder.path()).await;
    assert_eq!(trial.conductor.surgeon_view().borrow().as_deref(), None, "a completed session is not taken up again");
}

#[tokio::test]
async fn one_session_at_a_time_and_only_with_known_codes_and_protocols() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let create = |by, participant, protocol| trial.conductor.create(by, participant, protocol, None);
    assert!(matches!(create(Role::Surgeon, PARTICIPANT, "paper").await, Err(ConductError::Forbidden(_))));
    assert!(matches!(create(Role::Operator, "S-99", "paper").await, Err(ConductError::NotFound(_))));
    let unknown = create(Role::Operator, PARTICIPANT, "papers").await.unwrap_err();
    assert!(unknown.to_string().contains("follow-up, paper, practice"), "{unknown}");
    let session = trial.begin("paper").await;
    assert!(matches!(create(Role::Operator, PARTICIPANT, "paper").await, Err(ConductError::Conflict(_))));
    assert!(matches!(trial.conductor.dismiss(Role::Operator, session), Err(ConductError::Conflict(_))));
    let name = trial.conductor.add_participant(Role::Operator, "Dr Smith").await.unwrap_err();
    assert!(matches!(&name, ConductError::Invalid(text) if text.contains("never a name")), "{name}");
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "test".to_owned() }).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    assert_eq!(trial.conductor.surgeon_view().borrow().as_deref(), None);
    create(Role::Operator, PARTICIPANT, "paper").await.unwrap();
}

#[tokio::test]
async fn practice_never_mixes_with_real_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let practice = trial.whole_session("practice").await;
    let real = trial.whole_session("paper").await;
    let listed =
        |lines: Vec<parfocal_records::store::SessionLine>| lines.iter().map(|line| line.session).collect::<Vec<_>>();
    assert_eq!(listed(trial.store.reader().sessions(false).await.unwrap()), [real]);
    assert_eq!(listed(trial.store.reader().sessions(true).await.unwrap()), [real, practice]);
}

#[tokio::test]
async fn a_handler_that_is_dropped_midway_leaves_memory_and_disk_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    {
        let tap = trial.conductor.act(Role::Surgeon, session, Action::Acknowledge { segment });
        let mut tap = std::pin::pin!(tap);
        // Polled once and then dropped, as for a browser that disconnects at once.
        let _ = tap.as_mut().poll(&mut Context::from_waker(Waker::noop()));
    }

    let mut views = trial.conductor.surgeon_view();
    views.wait_for(|view| view.as_ref().is_some_and(|view| view.phase == Phase::Inspecting)).await.unwrap();
    assert_eq!(trial.store.reader().events(session).await.unwrap().len(), 3);
    trial.surgeon(Action::FinishSegment { segment }).await;
    assert_eq!(trial.view().phase, Phase::Questions);
}

#[tokio::test]
async fn a_pause_asked_for_while_the_session_is_being_resumed_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    let pause = |reason: &str| Action::Pause { reason: reason.to_owned() };
    trial.conductor.act(Role::Operator, session, pause("a question")).await.unwrap();
    trial.commanded();

    // Another program locks the database, so that the resumption takes a while to reach the disk.
    let database = crate::storage::raw(folder.path()).await;
    let other_program = database.begin_with("BEGIN IMMEDIATE").await.unwrap();
    let conductor = trial.conductor.clone();
    let resuming = tokio::spawn(async move { conductor.act(Role::Operator, session, Action::Resume).await });
    for _ in 0..20 {
        tokio::task::yield_now().await;
    }
    trial.conductor.act(Role::Operator, session, pause("not yet")).await.unwrap();
    other_program.rollback().await.unwrap();
    resuming.await.unwrap().unwrap();
    trial.conductor.tick().await;

    assert!(trial.view().paused && !trial.view().unrecorded);
    assert_eq!(trial.commanded(), [], "the lens is not let go in between");
    let events = trial.store.reader().events(session).await.unwrap();
    let kinds: Vec<&str> = events.iter().map(|(_, event)| event.kind.name()).collect();
    assert_eq!(kinds[3..], ["paused", "resumed", "paused"]);
}

#[tokio::test]
async fn a_stop_that_the_disk_does_not_take_is_done_all_the_same_and_recorded_once_it_does() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.commanded();
    let database = crate::storage::raw(folder.path()).await;
    let broken = "CREATE TRIGGER broken BEFORE INSERT ON events BEGIN SELECT RAISE(ABORT, 'broken'); END";
    sqlx::query(broken).execute(&database).await.unwrap();

    trial.wait(Duration::from_mins(2)).await;
    assert_eq!(trial.commanded(), [Command::Drive { drive: Drive::Hold { at: None }, segment: None }]);
    assert!(trial.view().unrecorded && trial.view().phase == Phase::Questions);
    assert!(trial.operator_view().unrecorded_because.is_some_and(|why| why.contains("broken")));
    // Only stops are reported as done before they are on disk.
    let answer = trial.answer("sharpness", parfocal_trial::question::AnswerValue::Point(4)).await;
    assert!(matches!(answer, Err(ConductError::Storage(_))), "{answer:?}");
    let finish = Action::FinishQuestions { segment: Some(segment) };
    assert!(matches!(trial.conductor.act(Role::Surgeon, session, finish).await, Err(ConductError::Storage(_))));
    trial.say("a comment is kept: its table is sound").await;

    sqlx::query("DROP TRIGGER broken").execute(&database).await.unwrap();
    trial.conductor.tick().await;
    assert!(!trial.view().unrecorded);
    assert_eq!(trial.operator_view().unrecorded_because, None);
    let events = trial.store.reader().events(session).await.unwrap();
    let kinds: Vec<&str> = events.iter().map(|(_, event)| event.kind.name()).collect();
    assert_eq!(kinds, ["created", "started", "segment-started", "segment-finished"]);
    trial.answer_all().await;
}

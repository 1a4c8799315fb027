//! Sessions through the conductor: their course, what each role sees, what the control loop is told, and restarts.

use std::collections::BTreeSet;
use std::task::{Context, Waker};
use std::time::Duration;

use parfocal::autofocus::PolicyName;
use parfocal::conductor::ConductError;
use parfocal::control::{Command, Drive};
use parfocal::lens::FocalPower;
use parfocal::store::SessionStatus;
use parfocal::trial::view::{Action, AnswerValue, NewAnswer, Phase, QuestionKind, Role, Said};

use crate::bench::{Bench, PARTICIPANT};

#[tokio::test]
async fn a_surgeon_goes_through_six_blinded_settings_and_everything_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.whole_session("paper").await;

    let lines = bench.conductor.sessions(false).await.unwrap();
    assert_eq!(lines.len(), 1);
    assert_eq!((lines[0].session, lines[0].status), (session, SessionStatus::Completed));
    assert_eq!((lines[0].settings, lines[0].finished_settings, lines[0].comments), (6, 6, 6));

    let detail = bench.conductor.session_detail(session).await.unwrap();
    // Four questions after each of six settings, three at the end.
    assert_eq!(detail.answers.len(), 6 * 4 + 3);
    assert!(detail.settings_detail.iter().all(|setting| setting.inspected_seconds == Some(20.0)));
    let sus = detail.answers.iter().find(|answer| answer.question == "usability").unwrap();
    assert_eq!(sus.sus_score, Some(67.5));

    let timeline = bench.conductor.timeline(session, 100).await.unwrap();
    let seconds: Vec<f64> = timeline.comments.iter().map(|comment| comment.seconds).collect();
    assert_eq!(seconds, [20.0, 40.0, 60.0, 80.0, 100.0, 120.0], "only inspection takes time on this bench");
    assert_eq!(timeline.comments[2].setting, Some(3));
    assert_eq!((timeline.settings[2].from, timeline.settings[2].to), (40.0, Some(60.0)));
}

#[tokio::test]
async fn a_comment_that_waited_for_the_network_stands_where_it_was_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    let segment = bench.view().segment.unwrap();
    bench.surgeon(Action::Acknowledge { segment }).await;
    bench.wait(Duration::from_secs(10)).await;
    let mut comment = bench.comment("now");
    let before = bench.store.run();
    drop(bench);

    let bench = Bench::start(folder.path()).await;
    bench.clock.advance(Duration::from_secs(40));
    comment.waited_millis = Some(30_000);
    bench.conductor.comment(comment.clone()).await.unwrap();
    // Sent once more, it has waited longer, and is still the same comment.
    comment.waited_millis = Some(31_000);
    bench.conductor.comment(comment.clone()).await.unwrap();
    comment.key.0 = uuid::Uuid::from_u128(1);
    comment.run = Some(99);
    bench.conductor.comment(comment).await.unwrap();
    let timeline = bench.conductor.timeline(session, 100).await.unwrap();
    assert_eq!(timeline.comments.len(), 2);
    assert!((timeline.comments[0].seconds - 10.0).abs() < 1e-9, "{:?}", timeline.comments[0]);
    let kept = bench.store.reader().comments(session).await.unwrap();
    assert_eq!((kept[0].0, kept[0].1.frame_run, kept[0].1.waited_ms), (before + 1, Some(before), Some(30_000)));
    assert_eq!(kept[1].1.frame_run, None, "a run that never was is not kept, the comment is");
}

#[tokio::test]
async fn nothing_that_surgeon_or_operator_get_tells_a_policy() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let (mut surgeon, mut operator) = (bench.conductor.surgeon_view(), bench.conductor.operator_view());
    let session = bench.begin("paper").await;
    let (mut seen, mut segments) = (String::new(), BTreeSet::new());
    for _ in 0..6 {
        segments.insert(bench.whole_setting().await);
        seen += &serde_json::to_string(surgeon.borrow_and_update().as_deref().unwrap()).unwrap();
        seen += &serde_json::to_string(operator.borrow_and_update().as_deref().unwrap()).unwrap();
    }
    // An emergency unblinding by the researcher changes nothing of that.
    bench.unblind(session).await;
    seen += &serde_json::to_string(&bench.operator_view()).unwrap();
    seen += &serde_json::to_string(&bench.conductor.sessions(true).await.unwrap()).unwrap();
    seen += &serde_json::to_string(&bench.conductor.protocols()).unwrap();
    for tell in ["mgm", "mlr", "cnn", "CNN", "hill-climb", "\"fixed", "seed", "policy"] {
        assert!(!seen.contains(tell), "'{tell}' was sent");
    }
    assert_eq!(segments.len(), 6, "segments of one policy share no id");
}

#[tokio::test]
async fn the_researcher_learns_the_policies_at_unblinding_and_not_before() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.whole_session("paper").await;
    let before = bench.conductor.session_detail(session).await.unwrap();
    assert_eq!(before.unblinding, None);
    assert!(!serde_json::to_string(&before).unwrap().contains("mgm-"));

    bench.unblind(session).await;
    let told = bench.conductor.session_detail(session).await.unwrap().unblinding.unwrap();
    assert!(!told.emergency);
    let mut policies: Vec<&str> = told.policies.iter().map(PolicyName::as_str).collect();
    policies.sort_unstable();
    let twice = |name| [name, name];
    assert_eq!(policies, [twice("cnn-learned"), twice("mgm-hill-climber"), twice("mgm-learned")].concat());
}

#[tokio::test]
async fn the_control_loop_is_told_each_policy_from_the_same_start_and_to_hold_in_between() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.whole_session("paper").await;
    bench.unblind(session).await;
    let told = bench.conductor.session_detail(session).await.unwrap();
    let policies = told.unblinding.unwrap().policies;

    let mut expected = Vec::new();
    for (policy, setting) in policies.iter().zip(&told.settings_detail) {
        let start = FocalPower::MIDDLE;
        expected.push(Command::Drive { drive: Drive::Manual(start), segment: None });
        let drive = Drive::Policy { name: policy.clone(), start: Some(start) };
        expected.push(Command::Drive { drive, segment: Some(setting.segment) });
        expected.push(Command::Drive { drive: Drive::Hold, segment: None });
    }
    // After the last setting the lens holds through the closing questions, and is told so again at the end.
    expected.push(Command::Drive { drive: Drive::Hold, segment: None });
    assert_eq!(bench.commanded(), expected);
}

#[tokio::test]
async fn a_setting_ends_at_its_limit_and_prompts_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench::start(folder.path()).await;
    bench.begin("paper").await;
    let segment = bench.view().segment.unwrap();
    bench.surgeon(Action::Acknowledge { segment }).await;
    bench.wait(Duration::from_secs(20)).await;
    assert_eq!(bench.view().prompt.as_deref(), Some("How does the focus feel now?"));
    assert_eq!(bench.view().remaining_seconds, Some(100.0));
    bench.wait(Duration::from_secs(15)).await;
    assert_eq!(bench.view().prompt, None);
    bench.wait(Duration::from_secs(84)).await;
    assert_eq!(bench.view().phase, Phase::Inspecting);
    bench.wait(Duration::from_secs(1)).await;
    assert_eq!(bench.view().phase, Phase::Questions);
    assert!(bench.operator_view().log[0].text.contains("120.0 s"), "{:?}", bench.operator_view().log[0]);
}

#[tokio::test]
async fn a_restarted_server_goes_on_at_the_same_place_and_forgets_at_most_a_second() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    bench.whole_setting().await;
    let segment = bench.view().segment.unwrap();
    bench.surgeon(Action::Acknowledge { segment }).await;
    bench.wait(Duration::from_secs(30)).await;
    bench.say("before").await;
    bench.clock.advance(Duration::from_millis(900));
    drop(bench);

    let mut bench = Bench::start(folder.path()).await;
    let view = bench.view();
    assert_eq!((view.session, view.segment, view.phase), (session, Some(segment), Phase::Inspecting));
    assert_eq!((view.paused, view.may_resume, view.setting, view.comments), (true, true, 2, 2));
    assert_eq!(view.remaining_seconds, Some(90.0));
    assert_eq!(bench.commanded(), [Command::Drive { drive: Drive::Hold, segment: Some(segment) }]);
    bench.surgeon(Action::Resume).await;
    let resumed = bench.commanded();
    assert!(matches!(&resumed[..], [Command::Drive { drive: Drive::Policy { start: None, .. }, .. }]), "{resumed:?}");
    bench.wait(Duration::from_secs(90)).await;
    assert_eq!(bench.view().phase, Phase::Questions);
    while bench.view().phase != Phase::Completed {
        if bench.view().phase == Phase::Notice {
            bench.whole_setting().await;
        } else {
            bench.answer_all().await;
            bench.surgeon(Action::FinishQuestions { segment: bench.view().segment }).await;
        }
    }
    let detail = bench.conductor.session_detail(session).await.unwrap();
    assert_eq!(detail.settings_detail[1].inspected_seconds, Some(120.0));
    drop(bench);
    let bench = Bench::start(folder.path()).await;
    assert_eq!(bench.conductor.surgeon_view().borrow().as_deref(), None, "a completed session is not taken up again");
}

#[tokio::test]
async fn answers_come_back_after_a_restart_and_a_changed_answer_keeps_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    let segment = bench.view().segment.unwrap();
    bench.surgeon(Action::Acknowledge { segment }).await;
    bench.surgeon(Action::FinishSegment { segment }).await;
    bench.answer("sharpness", AnswerValue::Point(2)).await.unwrap();
    bench.answer("sharpness", AnswerValue::Point(6)).await.unwrap();
    drop(bench);
    let bench = Bench::start(folder.path()).await;
    assert_eq!(bench.view().answers["sharpness"], AnswerValue::Point(6));
    assert_eq!(bench.store.reader().answers(session).await.unwrap().len(), 2);
    let detail = bench.conductor.session_detail(session).await.unwrap();
    assert_eq!(detail.answers.len(), 1);
    assert!(detail.answers[0].changed);
}

#[tokio::test]
async fn a_comment_sent_twice_is_one_and_a_key_used_for_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    let comment = bench.comment("once");
    bench.conductor.comment(comment.clone()).await.unwrap();
    bench.conductor.comment(comment.clone()).await.unwrap();
    assert_eq!(bench.view().comments, 1);
    let mut other = comment;
    other.said = Said::Text("another".to_owned());
    assert!(matches!(bench.conductor.comment(other).await, Err(ConductError::Conflict(_))));
    assert_eq!(bench.store.reader().comments(session).await.unwrap().len(), 1);
}

#[tokio::test]
async fn what_is_said_is_kept_whatever_the_state() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let first = bench.begin("paper").await;
    let early = bench.comment("on the notice");
    let segment = bench.whole_setting().await;
    bench.conductor.comment(early).await.unwrap();
    bench.conductor.act(Role::Operator, first, Action::Pause { reason: String::new() }).await.unwrap();
    bench.say("while paused").await;
    bench.conductor.act(Role::Operator, first, Action::Abort { reason: "fire alarm".to_owned() }).await.unwrap();
    let mut late = bench.comment("after the end");
    late.segment = Some(segment);
    bench.conductor.comment(late.clone()).await.unwrap();
    // Even when another session has begun.
    bench.begin("paper").await;
    late.key = bench.key();
    bench.conductor.comment(late).await.unwrap();
    let kept = bench.store.reader().comments(first).await.unwrap();
    assert_eq!(kept.len(), 5);
    assert_eq!(kept[1].1.segment, Some(segment), "a late comment stays with the segment that its page was showing");
    assert_eq!(bench.view().comments, 0);
}

#[tokio::test]
async fn emoji_are_kept_whole_and_a_megabyte_is_refused_with_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    let emoji = "👩🏽‍⚕️🔬 ≠ 🧠\u{202e}\0 Ünïcödé";
    bench.say(emoji).await;
    let kept = bench.store.reader().comments(session).await.unwrap();
    assert_eq!(kept[0].1.said, Said::Text(emoji.to_owned()));
    let megabyte = bench.comment(&"x".repeat(1_000_000));
    let refused = bench.conductor.comment(megabyte).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Invalid(text) if text.contains("16384")), "{refused}");
    let blank = bench.comment(" \n");
    assert!(matches!(bench.conductor.comment(blank).await, Err(ConductError::Invalid(_))));
}

#[tokio::test]
async fn one_session_at_a_time_and_only_with_known_codes_and_protocols() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench::start(folder.path()).await;
    let create = |by, participant, protocol| bench.conductor.create(by, participant, protocol);
    assert!(matches!(create(Role::Surgeon, PARTICIPANT, "paper").await, Err(ConductError::Forbidden(_))));
    assert!(matches!(create(Role::Operator, "S-99", "paper").await, Err(ConductError::NotFound(_))));
    let unknown = create(Role::Operator, PARTICIPANT, "papers").await.unwrap_err();
    assert!(unknown.to_string().contains("paper, practice"), "{unknown}");
    let session = bench.begin("paper").await;
    assert!(matches!(create(Role::Operator, PARTICIPANT, "paper").await, Err(ConductError::Conflict(_))));
    assert!(matches!(bench.conductor.dismiss(Role::Operator, session).await, Err(ConductError::Conflict(_))));
    let name = bench.conductor.add_participant(Role::Operator, "Dr Smith").await.unwrap_err();
    assert!(matches!(&name, ConductError::Invalid(text) if text.contains("never a name")), "{name}");
    bench.conductor.act(Role::Operator, session, Action::Abort { reason: "test".to_owned() }).await.unwrap();
    bench.conductor.dismiss(Role::Operator, session).await.unwrap();
    assert_eq!(bench.conductor.surgeon_view().borrow().as_deref(), None);
    create(Role::Operator, PARTICIPANT, "paper").await.unwrap();
}

#[tokio::test]
async fn practice_never_mixes_with_real_sessions() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let practice = bench.whole_session("practice").await;
    let real = bench.whole_session("paper").await;
    let listed = |lines: Vec<parfocal::store::SessionLine>| lines.iter().map(|line| line.session).collect::<Vec<_>>();
    assert_eq!(listed(bench.conductor.sessions(false).await.unwrap()), [real]);
    assert_eq!(listed(bench.conductor.sessions(true).await.unwrap()), [real, practice]);
    assert_eq!(bench.conductor.participants().await.unwrap()[0].sessions, 1);
}

#[tokio::test]
async fn a_handler_that_is_dropped_midway_leaves_memory_and_disk_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    let segment = bench.view().segment.unwrap();
    {
        let tap = bench.conductor.act(Role::Surgeon, session, Action::Acknowledge { segment });
        let mut tap = std::pin::pin!(tap);
        // Polled once, as by a browser that went away at once, then dropped.
        let _ = tap.as_mut().poll(&mut Context::from_waker(Waker::noop()));
    }
    let mut views = bench.conductor.surgeon_view();
    views.wait_for(|view| view.as_ref().is_some_and(|view| view.phase == Phase::Inspecting)).await.unwrap();
    assert_eq!(bench.store.reader().events(session).await.unwrap().len(), 3);
    bench.surgeon(Action::FinishSegment { segment }).await;
    assert_eq!(bench.view().phase, Phase::Questions);
}

#[tokio::test]
async fn a_questionnaire_half_filled_is_kept_item_by_item() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::start(folder.path()).await;
    let session = bench.begin("paper").await;
    while bench.view().phase == Phase::Notice {
        bench.whole_setting().await;
    }
    let view = bench.view();
    let sus = view.questions.iter().find(|question| question.kind == QuestionKind::Sus).unwrap().id.clone();
    let item = |place: usize, point: u8| {
        let mut items = vec![0; 10];
        items[place] = point;
        AnswerValue::Points(items)
    };
    let answer = NewAnswer { key: bench.key(), session, segment: None, question: sus.clone(), value: item(0, 4) };
    bench.conductor.answer(answer.clone()).await.unwrap();
    drop(bench);
    let mut bench = Bench::start(folder.path()).await;
    bench.conductor.act(Role::Surgeon, session, Action::Resume).await.unwrap();
    assert_eq!(bench.view().answers[&sus], item(0, 4), "kept over a restart");
    for (place, point) in [(1, 2), (2, 3), (3, 1), (4, 4), (5, 3), (6, 2), (7, 2), (8, 4)] {
        bench.answer(&sus, item(place, point)).await.unwrap();
    }
    // A tablet that never got the answer sends it again, after all that.
    bench.conductor.answer(answer).await.unwrap();
    for question in view.questions.iter().filter(|question| question.id != sus) {
        let value = match &question.kind {
            QuestionKind::Ranking => AnswerValue::Points(vec![2, 1, 3, 4, 5, 6]),
            _ => AnswerValue::Text("fine".to_owned()),
        };
        bench.answer(&question.id, value).await.unwrap();
    }
    let done = Action::FinishQuestions { segment: None };
    let refused = bench.conductor.act(Role::Surgeon, session, done.clone()).await.unwrap_err();
    assert!(matches!(&refused, ConductError::Conflict(text) if text.contains("still to be answered")), "{refused}");
    bench.answer(&sus, item(9, 2)).await.unwrap();
    bench.surgeon(done).await;
    let detail = bench.conductor.session_detail(session).await.unwrap();
    let kept = detail.answers.iter().find(|answer| answer.question == sus).unwrap();
    assert_eq!(kept.value, AnswerValue::Points(vec![4, 2, 3, 1, 4, 3, 2, 2, 4, 2]));
    assert_eq!(kept.sus_score, Some(67.5));
    let answers = bench.store.reader().answers(session).await.unwrap();
    assert_eq!(answers.iter().filter(|(_, answer)| answer.question == sus).count(), 10, "one for each item");
}

//! Comments and answers of surgeons: each is kept once, in every state of the session, over restarts and network gaps.

use std::time::Duration;

use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::phase::Phase;
use parfocal_trial::question::{AnswerValue, QuestionKind};
use parfocal_trial::refusal::RefusalKind;
use parfocal_trial::remark::{CommentContent, NewAnswer, Origin, WaitClock};
use parfocal_trial::role::Role;

use crate::fixture::Trial;

#[tokio::test]
async fn a_comment_that_waited_for_the_network_stands_where_it_was_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.wait(Duration::from_secs(10)).await;

    let mut comment = trial.comment("now");
    let before = trial.store.run();
    drop(trial);

    let trial = Trial::start(folder.path()).await;
    trial.clock.advance(Duration::from_secs(40));
    comment.origin.waited_millis = Some(30_000);
    trial.conductor.comment(comment.clone()).await.unwrap();
    // When it is sent again, it has waited longer, but is still the same comment.
    comment.origin.waited_millis = Some(31_000);
    trial.conductor.comment(comment.clone()).await.unwrap();

    // Another comment, which names a run that does not exist.
    comment.key.0 = uuid::Uuid::from_u128(1);
    comment.run = Some(99);
    trial.conductor.comment(comment).await.unwrap();

    let timeline = trial.reports.timeline(Role::Researcher, session, 100).await.unwrap();
    assert_eq!(timeline.comments.len(), 2);
    // In the order in which they were said: nobody knows how long the other waited.
    assert!((timeline.comments[1].seconds - 10.0).abs() < 1e-9, "{:?}", timeline.comments);

    let kept = trial.store.reader().comments(session).await.unwrap();
    assert_eq!(
        (kept[0].0, kept[0].1.frame_run, kept[0].1.origin.waited_millis),
        (before + 1, Some(before), Some(30_000))
    );

    assert_eq!(kept[1].1.frame_run, None, "a run that never was is not kept, the comment is");
}

#[tokio::test]
async fn answers_come_back_after_a_restart_and_a_changed_answer_keeps_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.surgeon(Action::FinishSegment { segment }).await;

    trial.answer("sharpness", AnswerValue::Point(2)).await.unwrap();
    trial.answer("sharpness", AnswerValue::Point(6)).await.unwrap();
    drop(trial);

    let trial = Trial::start(folder.path()).await;
    assert_eq!(trial.view().answers["sharpness"], AnswerValue::Point(6));
    assert_eq!(trial.store.reader().answers(session).await.unwrap().len(), 2);

    let detail = trial.reports.session_detail(session).await.unwrap();
    assert_eq!(detail.answers.len(), 1);
    assert!(detail.answers[0].changed);
}

#[tokio::test]
async fn a_comment_sent_twice_is_one_and_a_key_used_for_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;

    let comment = trial.comment("once");
    trial.conductor.comment(comment.clone()).await.unwrap();
    trial.conductor.comment(comment.clone()).await.unwrap();
    assert_eq!(trial.view().comments, 1);

    let mut other = comment;
    other.said = CommentContent::Text("another".to_owned());
    assert!(matches!(trial.conductor.comment(other).await, Err(ConductError::Conflict(_))));

    assert_eq!(trial.store.reader().comments(session).await.unwrap().len(), 1);
}

#[tokio::test]
async fn a_comment_that_is_taken_back_stays_in_the_record_and_counts_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    let slip = trial.comment("a slip");
    trial.conductor.comment(slip.clone()).await.unwrap();
    trial.say("meant").await;

    let mut withdrawal = trial.comment("");
    withdrawal.said = CommentContent::Withdrawal(slip.key);
    trial.conductor.comment(withdrawal.clone()).await.unwrap();
    trial.conductor.comment(withdrawal).await.unwrap();
    assert_eq!(trial.view().comments, 1);
    let shown: Vec<_> = trial.operator_view().latest_comments.into_iter().map(|line| line.said).collect();
    assert_eq!(shown, [CommentContent::Text("meant".to_owned())]);

    // The record keeps all three, and the timeline says which one was taken back.
    let kept = trial.store.reader().comments(session).await.unwrap();
    assert_eq!(kept[0].1.said, CommentContent::Text("a slip".to_owned()));
    assert_eq!(kept[2].1.said, CommentContent::Withdrawal(slip.key));
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let withdrawn: Vec<bool> = timeline.comments.iter().map(|comment| comment.withdrawn).collect();
    assert_eq!(withdrawn, [true, false]);
    let listed = trial.store.reader().session_line(session).await.unwrap().unwrap();
    assert_eq!(listed.comments, 1, "the list counts as the session's pages do");
    drop(trial);

    let trial = Trial::start(folder.path()).await;
    assert_eq!(trial.view().comments, 1, "also after a restart");
}

#[tokio::test]
async fn what_was_said_without_a_network_stands_where_it_was_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    trial.wait(Duration::from_mins(1)).await;
    trial.say("said at a minute").await;

    let mut waited = trial.comment("said at half a minute");
    waited.origin.waited_millis = Some(30_000);
    waited.origin.waited_by = Some(WaitClock::PageClock);
    trial.conductor.comment(waited).await.unwrap();

    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let said: Vec<_> = timeline.comments.iter().map(|comment| comment.seconds.round()).collect();
    assert_eq!(said, [30.0, 60.0]);
    let shown: Vec<_> = trial.operator_view().latest_comments.into_iter().map(|line| line.said).collect();
    let texts = ["said at a minute", "said at half a minute"].map(|text| CommentContent::Text(text.to_owned()));
    assert_eq!(shown, texts, "newest first");
}

#[tokio::test]
async fn what_is_said_is_kept_whatever_the_state() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let first = trial.begin("paper").await;

    let early = trial.comment("on the notice");
    let segment = trial.whole_setting().await;
    trial.conductor.comment(early).await.unwrap();

    trial.conductor.act(Role::Operator, first, Action::Pause { reason: String::new() }).await.unwrap();
    trial.say("while paused").await;

    trial.conductor.act(Role::Operator, first, Action::Abort { reason: "fire alarm".to_owned() }).await.unwrap();
    let mut late = trial.comment("after the end");
    late.segment = Some(segment);
    trial.conductor.comment(late.clone()).await.unwrap();

    // Also after another session has begun.
    trial.begin("paper").await;
    late.key = trial.key();
    trial.conductor.comment(late).await.unwrap();

    let kept = trial.store.reader().comments(first).await.unwrap();
    assert_eq!(kept.len(), 5);
    assert_eq!(kept[1].1.segment, Some(segment), "a late comment stays with the segment that its page was showing");
    assert_eq!(trial.view().comments, 0);
}

#[tokio::test]
async fn what_comes_late_is_kept_though_the_sessions_protocol_can_no_longer_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let first = trial.begin("paper").await;
    let late = trial.comment("after the upgrade");
    trial.conductor.act(Role::Operator, first, Action::Abort { reason: "upgrade".to_owned() }).await.unwrap();

    trial.begin("paper").await;

    // The first session now has a protocol that this version cannot read.
    let pool = crate::storage::raw(folder.path()).await;
    let change = "DROP TRIGGER sessions_no_update; UPDATE sessions SET protocol_toml = 'of another version'";
    sqlx::raw_sql(change).execute(&pool).await.unwrap();

    let segment = late.segment;
    trial.conductor.comment(late).await.unwrap();
    let kept = trial.store.reader().comments(first).await.unwrap();
    assert_eq!(kept.iter().map(|(_, comment)| comment.segment).collect::<Vec<_>>(), [segment]);

    let answer = |key, segment| NewAnswer {
        key,
        session: first,
        segment,
        question: "sharpness".to_owned(),
        value: AnswerValue::Point(4),
        origin: Origin::default(),
    };

    let key = trial.key();
    let other = trial.key();
    trial.conductor.answer(answer(key, segment)).await.unwrap();
    let elsewhere = trial.view().segment;
    let refused = trial.conductor.answer(answer(other, elsewhere)).await.unwrap_err();
    assert!(matches!(refused, ConductError::Said(RefusalKind::Unknown, _)), "{refused}");
    assert!(refused.to_string().contains("this session has no such setting"), "{refused}");

    let kept = trial.store.reader().answers(first).await.unwrap();
    assert_eq!(kept.iter().map(|(_, answer)| answer.value.clone()).collect::<Vec<_>>(), [AnswerValue::Point(4)]);

    let told = trial.reports.session_detail(first).await.unwrap_err().to_string();
    assert!(told.contains(&first.to_string()) && told.contains("use the version that made it"), "{told}");
}

#[tokio::test]
async fn emoji_are_kept_whole_and_a_megabyte_is_refused_with_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;

    let emoji = "👩🏽‍⚕️🔬 ≠ 🧠\u{202e}\0 Ünïcödé";
    trial.say(emoji).await;
    let kept = trial.store.reader().comments(session).await.unwrap();
    assert_eq!(kept[0].1.said, CommentContent::Text(emoji.to_owned()));

    let megabyte = trial.comment(&"x".repeat(1_000_000));
    let refused = trial.conductor.comment(megabyte).await.unwrap_err();
    assert!(matches!(refused, ConductError::Said(RefusalKind::Invalid, _)), "{refused}");
    assert!(refused.to_string().contains("the limit is 16384"), "{refused}");

    let blank = trial.comment(" \n");
    let refused = trial.conductor.comment(blank).await.unwrap_err();
    assert!(matches!(refused, ConductError::Said(RefusalKind::Invalid, _)), "{refused}");
    assert!(refused.to_string().contains("the comment is empty"), "{refused}");
}

#[tokio::test]
async fn a_questionnaire_half_filled_is_kept_item_by_item() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;

    while trial.view().phase == Phase::Notice {
        trial.whole_setting().await;
    }

    let view = trial.view();
    let sus =
        view.questions.iter().find(|question| matches!(question.kind, QuestionKind::Sus { .. })).unwrap().id.clone();
    let item = |place: usize, point: u8| {
        let mut items = vec![0; 10];
        items[place] = point;
        AnswerValue::Points(items)
    };

    let origin = Origin::default();
    let answer =
        NewAnswer { key: trial.key(), session, segment: None, question: sus.clone(), value: item(0, 4), origin };
    trial.conductor.answer(answer.clone()).await.unwrap();

    drop(trial);
    let mut trial = Trial::start(folder.path()).await;
    trial.conductor.act(Role::Surgeon, session, Action::Resume).await.unwrap();
    assert_eq!(trial.view().answers[&sus], item(0, 4), "kept over a restart");

    for (place, point) in [(1, 2), (2, 3), (3, 1), (4, 4), (5, 3), (6, 2), (7, 2), (8, 4)] {
        trial.answer(&sus, item(place, point)).await.unwrap();
    }

    // A tablet that got no confirmation sends its answer again, after all the others.
    trial.conductor.answer(answer).await.unwrap();

    for question in view.questions.iter().filter(|question| question.id != sus) {
        let value = match &question.kind {
            QuestionKind::Ranking { .. } => AnswerValue::Points(vec![2, 1, 3, 4, 5, 6]),
            _ => AnswerValue::Text("fine".to_owned()),
        };

        trial.answer(&question.id, value).await.unwrap();
    }

    let done = Action::FinishQuestions { segment: None };
    let refused = trial.conductor.act(Role::Surgeon, session, done.clone()).await.unwrap_err();
    assert!(matches!(refused, ConductError::Said(RefusalKind::Conflict, _)), "{refused}");
    assert!(refused.to_string().contains("still to be answered"), "{refused}");

    trial.answer(&sus, item(9, 2)).await.unwrap();
    trial.surgeon(done).await;

    let detail = trial.reports.session_detail(session).await.unwrap();
    let kept = detail.answers.iter().find(|answer| answer.question == sus).unwrap();
    assert_eq!(kept.value, AnswerValue::Points(vec![4, 2, 3, 1, 4, 3, 2, 2, 4, 2]));
    assert_eq!(kept.sus_score, Some(67.5));

    let answers = trial.store.reader().answers(session).await.unwrap();
    assert_eq!(answers.iter().filter(|(_, answer)| answer.question == sus).count(), 10, "one for each item");
}

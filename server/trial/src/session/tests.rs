//! Tests the state machine, also with random sequences of actions.

use std::time::Duration;

use jiff::Timestamp;
use proptest::prelude::*;
use uuid::Uuid;

use super::*;
use crate::action::Action;
use crate::question::QuestionKind;
use crate::refusal::{Refusal, RefusalKind};
use crate::role::Role;
use parfocal_base::FocalPower;

fn segment(number: usize) -> SegmentId {
    SegmentId(Uuid::from_u128(number as u128 + 1))
}

fn question(id: &str, optional: bool) -> Question {
    Question { id: id.to_owned(), text: format!("{id}?"), kind: QuestionKind::Text, optional, only_if_yes: None }
}

/// A new session by the paper's protocol, whose settings last two minutes, with other questions.
fn session(segments: usize, asks_after: bool, asks_closing: bool) -> SessionState {
    let paper = Protocol::parse_kept(include_str!("../../../../trial-protocols/paper.toml"), "paper.toml").unwrap();
    let protocol = Protocol {
        after_segment: if asks_after { vec![question("a", false), question("b", true)] } else { Vec::new() },
        closing: if asks_closing { vec![question("z", false)] } else { Vec::new() },
        ..paper
    };
    SessionState::new(Arc::new(protocol), (0..segments).map(segment).collect())
}

/// A session with its event log and a clock.
struct Run {
    state: SessionState,
    log: Vec<Event>,
    now: Moment,
}

impl Run {
    fn new(state: SessionState) -> Self {
        Self { state, log: Vec::new(), now: Moment::from_nanos(1_000_000_000) }
    }

    fn record(&mut self, by: Role, kinds: Vec<EventKind>) {
        for kind in kinds {
            let number = u32::try_from(self.log.len()).unwrap() + 1;
            let event = Event { number, by, account: None, at: self.now, wall: Timestamp::UNIX_EPOCH, kind };
            self.state.apply(&event);
            self.log.push(event);
        }
    }

    fn act(&mut self, by: Role, action: &Action) -> Result<usize, Refusal> {
        let kinds = decide(&self.state, by, action, self.now)?;
        let count = kinds.len();
        self.record(by, kinds);
        Ok(count)
    }

    fn wait(&mut self, time: Duration) {
        self.now = self.now + time;
        let kinds = decide_time(&self.state, self.now);
        self.record(Role::System, kinds);
    }

    fn restart(&mut self, known: Duration) {
        let kinds = decide_restart(&self.state, known);
        self.now = Moment::from_nanos(5);
        self.record(Role::System, kinds);
    }

    fn inspecting(asks_after: bool) -> Self {
        let mut run = Self::new(session(2, asks_after, true));
        run.act(Role::Operator, &Action::Start).unwrap();
        run.act(Role::Surgeon, &Action::Acknowledge { segment: segment(0) }).unwrap();
        run
    }
}

/// An answer that arrives at once, in time.
fn said(text: &str) -> GivenAnswer {
    let value = AnswerValue::Text(text.to_owned());
    GivenAnswer { device: None, sequence: None, at: Timestamp::UNIX_EPOCH, late: false, value }
}

const SECOND: Duration = Duration::from_secs(1);

#[test]
fn a_whole_session_goes_from_ready_to_completed() {
    let mut run = Run::new(session(2, true, true));
    run.act(Role::Operator, &Action::Start).unwrap();
    for number in 0..2 {
        let segment = segment(number);
        assert_eq!((run.state.phase(), run.state.segment()), (Phase::Notice, Some(segment)));
        run.act(Role::Surgeon, &Action::Acknowledge { segment }).unwrap();
        run.wait(SECOND);
        run.act(Role::Surgeon, &Action::FinishSegment { segment }).unwrap();
        assert_eq!(run.state.phase(), Phase::Questions);
        let early = run.act(Role::Surgeon, &Action::FinishQuestions { segment: Some(segment) }).unwrap_err();
        assert!(matches!(early, Refusal::Said(RefusalKind::Conflict, _)), "{early}");
        assert_eq!(early.to_string(), "still to be answered: a?");
        run.state.keep_answer(Some(segment), "a", said(" \n"));
        let blank = run.act(Role::Surgeon, &Action::FinishQuestions { segment: Some(segment) });
        assert_eq!(blank, Err(early), "blanks are no answer");
        run.state.keep_answer(Some(segment), "a", said("yes"));
        run.act(Role::Surgeon, &Action::FinishQuestions { segment: Some(segment) }).unwrap();
    }

    assert_eq!((run.state.phase(), run.state.segment()), (Phase::Closing, None));
    run.state.keep_answer(None, "z", said("yes"));
    run.act(Role::Surgeon, &Action::FinishQuestions { segment: None }).unwrap();
    assert_eq!(run.state.phase(), Phase::Completed);
}

#[test]
fn without_any_question_the_last_segment_completes_the_session() {
    let mut run = Run::new(session(1, false, false));
    run.act(Role::Operator, &Action::Start).unwrap();
    run.act(Role::Surgeon, &Action::Acknowledge { segment: segment(0) }).unwrap();
    run.wait(120 * SECOND);
    assert_eq!(run.state.phase(), Phase::Completed);
    assert_eq!(run.log.last().unwrap().kind, EventKind::Completed);
}

#[test]
fn the_time_limit_counts_inspection_and_not_pauses() {
    let mut run = Run::inspecting(true);
    run.wait(100 * SECOND);
    run.act(Role::Operator, &Action::Pause { reason: "instrument".to_owned() }).unwrap();
    run.wait(500 * SECOND);
    assert_eq!(run.state.inspected(run.now), 100 * SECOND);
    run.act(Role::Operator, &Action::Resume).unwrap();
    run.wait(19 * SECOND);
    assert_eq!(run.state.phase(), Phase::Inspecting);
    run.wait(SECOND);
    assert_eq!(run.state.phase(), Phase::Questions);
    let last = run.log.last().unwrap();
    assert_eq!(last.kind, EventKind::SegmentFinished { segment: segment(0), inspected_ms: 120_000 });
    assert_eq!(last.by, Role::System);
}

#[test]
fn a_double_click_and_a_stale_tab_change_nothing() {
    let mut run = Run::inspecting(false);
    assert_eq!(run.act(Role::Surgeon, &Action::Acknowledge { segment: segment(0) }), Ok(0));
    run.act(Role::Surgeon, &Action::FinishSegment { segment: segment(0) }).unwrap();
    assert_eq!(run.act(Role::Surgeon, &Action::FinishSegment { segment: segment(0) }), Ok(0));
    assert_eq!(run.act(Role::Surgeon, &Action::Acknowledge { segment: segment(0) }), Ok(0));
    assert_eq!(run.act(Role::Operator, &Action::Start), Ok(0));
    assert_eq!((run.state.phase(), run.state.segment()), (Phase::Notice, Some(segment(1))));
    let unknown = run.act(Role::Surgeon, &Action::Acknowledge { segment: segment(9) });
    assert_eq!(unknown, Err(Refusal::unknown_segment()));
}

#[test]
fn after_a_restart_the_surgeon_continues_where_the_session_was() {
    let mut run = Run::inspecting(true);
    run.wait(30 * SECOND);
    run.restart(29 * SECOND);
    assert_eq!((run.state.phase(), run.state.paused()), (Phase::Inspecting, Some(PauseCause::Restart)));
    run.wait(60 * SECOND);
    assert_eq!(run.state.inspected(run.now), 29 * SECOND);
    run.act(Role::Surgeon, &Action::Resume).unwrap();
    run.wait(91 * SECOND);
    assert_eq!(run.state.phase(), Phase::Questions);
}

#[test]
fn a_pause_by_the_operator_stays_the_operators_over_a_restart() {
    let mut run = Run::inspecting(true);
    run.act(Role::Operator, &Action::Pause { reason: String::new() }).unwrap();
    run.restart(Duration::ZERO);
    assert!(matches!(run.act(Role::Surgeon, &Action::Resume), Err(Refusal::NotAllowed(_))));
    assert_eq!(run.act(Role::Operator, &Action::Resume), Ok(1));
}

#[test]
fn a_pause_by_the_surgeon_is_ended_by_either_and_one_by_the_operator_stands_above_it() {
    let pause = Action::Pause { reason: String::new() };
    let mut run = Run::inspecting(true);
    run.act(Role::Surgeon, &pause).unwrap();
    assert_eq!((run.state.paused(), run.state.running()), (Some(PauseCause::Surgeon), false));
    assert_eq!(run.act(Role::Surgeon, &pause), Ok(0));
    assert_eq!(run.act(Role::Surgeon, &Action::Resume), Ok(1));

    run.act(Role::Surgeon, &pause).unwrap();
    assert_eq!(run.act(Role::Operator, &pause), Ok(1));
    assert_eq!(run.act(Role::Surgeon, &pause), Ok(0));
    assert!(matches!(run.act(Role::Surgeon, &Action::Resume), Err(Refusal::NotAllowed(_))));
    assert_eq!(run.act(Role::Operator, &Action::Resume), Ok(1));
}

#[test]
fn the_reason_for_a_pause_can_be_given_once_and_afterwards() {
    let pause = |reason: &str| Action::Pause { reason: reason.to_owned() };
    let give = |event, reason: &str| Action::GiveReason { event, reason: reason.to_owned() };
    let mut run = Run::inspecting(true);
    run.act(Role::Operator, &pause("")).unwrap();
    let number = run.log.last().unwrap().number;
    run.act(Role::Operator, &Action::Resume).unwrap();
    run.act(Role::Operator, &pause("the drill")).unwrap();
    assert_eq!(run.state.unreasoned(), [number]);

    assert!(matches!(run.act(Role::Operator, &give(number, " ")), Err(Refusal::Invalid(_))));
    assert!(matches!(run.act(Role::Surgeon, &give(number, "bleeding")), Err(Refusal::NotAllowed(_))));
    assert_eq!(run.act(Role::Operator, &give(number, "bleeding")), Ok(1));
    assert_eq!(run.act(Role::Operator, &give(number, " bleeding")), Ok(0), "sent again after a lost reply");
    assert!(matches!(run.act(Role::Operator, &give(number, "smoke")), Err(Refusal::Conflict(_))));
    assert!(matches!(run.act(Role::Operator, &give(1, "bleeding")), Err(Refusal::Conflict(_))));
}

#[test]
fn nobody_is_asked_for_a_reason_that_was_erased() {
    let mut run = Run::inspecting(true);
    run.act(Role::Operator, &Action::Pause { reason: "the drill".to_owned() }).unwrap();
    let mut paused = run.log.pop().unwrap();
    run.state.keep_erasure(paused.number);

    let EventKind::Paused { reason, .. } = &mut paused.kind else { panic!("{paused:?}") };
    reason.clear();
    run.log.push(paused);
    let mut state = run.state.before_all_events();
    run.log.iter().for_each(|event| state.apply(event));
    assert_eq!((state.paused(), state.unreasoned()), (Some(PauseCause::Operator), [].as_slice()));
}

#[test]
fn the_operator_focuses_by_hand_while_the_session_is_paused_and_after_an_abort() {
    let by = |run: &Run, role| decide_by_hand(&run.state, role, FocalPower::MIDDLE, None);
    let mut run = Run::inspecting(true);
    assert!(matches!(by(&run, Role::Operator), Err(Refusal::Conflict(_))));
    run.act(Role::Surgeon, &Action::Pause { reason: String::new() }).unwrap();
    assert!(by(&run, Role::Operator).is_ok());
    for role in [Role::Surgeon, Role::Researcher, Role::System] {
        assert!(matches!(by(&run, role), Err(Refusal::NotAllowed(_))), "{role:?}");
    }
    run.act(Role::Operator, &Action::Resume).unwrap();
    assert!(by(&run, Role::Operator).is_err());
    run.act(Role::Operator, &Action::Abort { reason: "bleeding".to_owned() }).unwrap();
    assert!(by(&run, Role::Operator).is_ok());
}

#[test]
fn a_restart_never_takes_back_time_that_events_tell() {
    let mut run = Run::inspecting(true);
    run.wait(50 * SECOND);
    run.act(Role::Operator, &Action::Pause { reason: String::new() }).unwrap();
    run.restart(20 * SECOND);
    assert_eq!(run.state.inspected(run.now), 50 * SECOND);
}

#[test]
fn each_role_does_its_own() {
    let id = segment(0);
    let reason = || "why".to_owned();
    let table = [
        (Action::Start, vec![Role::Operator]),
        (Action::Acknowledge { segment: id }, vec![Role::Surgeon]),
        (Action::FinishSegment { segment: id }, vec![Role::Surgeon, Role::Operator]),
        (Action::FinishQuestions { segment: None }, vec![Role::Surgeon]),
        (Action::Pause { reason: reason() }, vec![Role::Surgeon, Role::Operator]),
        (Action::Resume, vec![Role::Surgeon, Role::Operator]),
        (Action::Abort { reason: reason() }, vec![Role::Operator]),
        (Action::Unblind { reason: reason(), despite_outstanding: false }, vec![Role::Researcher]),
    ];

    let run = Run::inspecting(true);
    for (action, may) in table {
        for role in [Role::Surgeon, Role::Operator, Role::Researcher, Role::System] {
            let refused = matches!(decide(&run.state, role, &action, run.now), Err(Refusal::NotAllowed(_)));
            assert_eq!(refused, !may.contains(&role), "{role:?} {action:?}");
        }
    }
}

#[test]
fn abort_and_unblinding_need_a_reason_and_an_early_unblinding_is_marked() {
    let mut run = Run::inspecting(true);
    let unblind = Action::Unblind { reason: "adverse event".to_owned(), despite_outstanding: false };
    assert!(matches!(run.act(Role::Operator, &Action::Abort { reason: " ".to_owned() }), Err(Refusal::Invalid(_))));
    run.act(Role::Researcher, &unblind).unwrap();
    assert!(matches!(&run.log.last().unwrap().kind, EventKind::Unblinded { emergency: true, .. }));
    assert_eq!(run.act(Role::Researcher, &unblind), Ok(0));
    run.act(Role::Operator, &Action::Abort { reason: "adverse event".to_owned() }).unwrap();
    assert_eq!((run.state.phase(), run.state.ended()), (Phase::Aborted, true));
}

#[test]
fn questions_take_answers_from_when_they_are_asked_on() {
    let mut run = Run::inspecting(true);
    assert!(!run.state.takes_answers(Some(segment(0))));
    run.act(Role::Operator, &Action::FinishSegment { segment: segment(0) }).unwrap();
    assert!(run.state.takes_answers(Some(segment(0))) && !run.state.takes_answers(Some(segment(1))));
    run.act(Role::Operator, &Action::Pause { reason: String::new() }).unwrap();
    assert!(run.state.takes_answers(Some(segment(0))) && !run.state.takes_answers(None));
    // A tablet without a network may still have to send them.
    run.act(Role::Operator, &Action::Abort { reason: "the tablet is silent".to_owned() }).unwrap();
    assert!(run.state.takes_answers(Some(segment(0))) && !run.state.takes_answers(Some(segment(1))));
}

#[derive(Debug, Clone)]
enum Step {
    Act(Role, Action),
    Answer(usize),
    AnswerClosing,
    Wait(u64),
    Restart(u64),
}

fn any_step() -> impl Strategy<Value = Step> {
    let role = prop_oneof![Just(Role::Surgeon), Just(Role::Operator), Just(Role::Researcher)];
    let id = (0_usize..4).prop_map(segment);
    let action = prop_oneof![
        2 => Just(Action::Start),
        6 => id.clone().prop_map(|segment| Action::Acknowledge { segment }),
        6 => id.clone().prop_map(|segment| Action::FinishSegment { segment }),
        6 => id.prop_map(|segment| Action::FinishQuestions { segment: Some(segment) }),
        3 => Just(Action::FinishQuestions { segment: None }),
        1 => Just(Action::Pause { reason: "p".to_owned() }),
        3 => Just(Action::Resume),
        1 => Just(Action::Unblind { reason: "u".to_owned(), despite_outstanding: false }),
    ];

    prop_oneof![
        20 => (role, action).prop_map(|(role, action)| Step::Act(role, action)),
        5 => (0_usize..3).prop_map(Step::Answer),
        2 => Just(Step::AnswerClosing),
        3 => (0_u64..80).prop_map(Step::Wait),
        1 => (0_u64..130).prop_map(Step::Restart),
        1 => Just(Step::Act(Role::Operator, Action::Abort { reason: "a".to_owned() })),
    ]
}

fn take(run: &mut Run, step: Step) {
    let text = said("x");
    match step {
        Step::Act(role, action) => {
            let before = (run.state.clone(), run.log.len());
            let refused = run.act(role, &action);
            if !matches!(refused, Ok(count) if count > 0) {
                assert_eq!(before, (run.state.clone(), run.log.len()), "refused or done before: nothing changes");
            } else if !matches!(action, Action::Pause { .. } | Action::Resume) {
                assert_eq!(run.act(role, &action), Ok(0), "the same again changes nothing: {action:?}");
            }
        }
        Step::Answer(number) if run.state.takes_answers(Some(segment(number))) => {
            run.state.keep_answer(Some(segment(number)), "a", text);
        }
        Step::AnswerClosing if run.state.takes_answers(None) => run.state.keep_answer(None, "z", text),
        Step::Answer(_) | Step::AnswerClosing => {}
        Step::Wait(seconds) => run.wait(Duration::from_secs(seconds)),
        Step::Restart(known) => run.restart(Duration::from_secs(known)),
    }
}

proptest! {
    #[test]
    fn segments_run_one_at_a_time_in_order_and_a_replay_gives_the_same_state(
        steps in prop::collection::vec(any_step(), 0..150), asks_after: bool, asks_closing: bool,
    ) {
        let mut run = Run::new(session(3, asks_after, asks_closing));
        for step in steps {
            take(&mut run, step);
            prop_assert!(run.state.inspected(run.now) <= run.state.protocol().segment_limit);
            let inspecting = run.state.phase() == Phase::Inspecting && run.state.paused().is_none();
            prop_assert!(inspecting || !run.state.running());
        }

        let mut open = None;
        let mut next = 0;
        for event in &run.log {
            match event.kind {
                EventKind::SegmentStarted { segment: id } => {
                    prop_assert_eq!(open.replace(id), None, "never two segments at once");
                    prop_assert_eq!(id, segment(next), "never a segment left out or run twice");
                }
                EventKind::SegmentFinished { segment: id, inspected_ms } => {
                    prop_assert_eq!(open.take(), Some(id));
                    prop_assert!(inspected_ms <= 120_000);
                    next += 1;
                }
                EventKind::Completed => prop_assert_eq!((open, next), (None, 3)),
                _ => {}
            }
        }

        let mut replayed = session(3, asks_after, asks_closing);
        replayed.answers = run.state.answers.clone();
        run.log.iter().for_each(|event| replayed.apply(event));
        prop_assert_eq!(replayed, run.state);
    }
}

//! Choosing what is to be in focus, and holding the focus, where the protocol lets the surgeon do so.

use std::path::Path;
use std::time::Duration;

use parfocal_base::PatchPlace;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::{Aim, Command, Drive};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::{Verdict, verify};
use parfocal_session::conductor::ConductError;
use parfocal_trial::action::Action;
use parfocal_trial::event::EventKind;
use parfocal_trial::phase::Phase;
use parfocal_trial::pointing::{NewChoice, Touch};
use parfocal_trial::role::Role;

use crate::exports::rows;
use crate::fixture::Trial;

const POINTING: &str = r#"
name = "pointing"
title = "Two settings"
researcher_title = "Two hill-climbers"
policies = ["mgm-hill-climber", "mlr-hill-climber"]
repeats = 1
order = "shuffled"
segment_seconds = 60
patch = "surgeon"
hold = true
"#;

/// A server whose protocols are "pointing" and "staying", which differ in what happens to a chosen place.
async fn start(folder: &Path) -> Trial {
    let protocols = folder.join("protocols");
    std::fs::create_dir_all(&protocols).unwrap();
    std::fs::write(protocols.join("pointing.toml"), POINTING).unwrap();
    let staying = POINTING.replace("name = \"pointing\"", "name = \"staying\"\npatch_stays = true");
    std::fs::write(protocols.join("staying.toml"), staying).unwrap();
    Trial::start_with(&folder.join("data"), Some(&protocols), 7).await
}

async fn inspect(trial: &mut Trial) {
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
}

/// A touch of the picture, whose circle has its centre at (256, 136) and the radius 100.
fn touch(session: impl Into<Option<SessionId>>, x: f64, y: f64) -> NewChoice {
    NewChoice { session: session.into(), frame: 77, at: Some(Touch { x, y }), follows: None }
}

fn centre(session: impl Into<Option<SessionId>>) -> NewChoice {
    NewChoice { session: session.into(), frame: 78, at: None, follows: None }
}

fn aims(trial: &mut Trial) -> Vec<Aim> {
    let aim = |command| match command {
        Command::Aim(aim) => Some(aim),
        _ => None,
    };
    trial.commanded().into_iter().filter_map(aim).collect()
}

const fn aim(place: PatchPlace, choices: u64) -> Aim {
    Aim { place, choices, held: false, follows: false }
}

async fn kinds(trial: &Trial, session: SessionId) -> Vec<EventKind> {
    let events = trial.store.reader().events(session).await.unwrap();
    events.into_iter().map(|(_, event)| event.kind).collect()
}

#[tokio::test]
async fn a_touch_moves_the_patch_at_once_and_is_recorded_with_place_and_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("pointing").await;
    inspect(&mut trial).await;
    let segment = trial.view().segment.unwrap();
    assert!(trial.view().pointing && trial.view().holding);
    aims(&mut trial);

    let place = PatchPlace::nearest(0.4425, -0.46);
    trial.conductor.choose(Role::Surgeon, touch(session, 300.25, 90.0)).await.unwrap();
    assert_eq!(trial.commanded(), [Command::Aim(aim(place, 1))], "the policy goes on, and the lens is not moved");
    trial.conductor.choose(Role::Operator, centre(session)).await.unwrap();
    trial.conductor.choose(Role::Surgeon, centre(session)).await.unwrap();
    assert_eq!(aims(&mut trial), [aim(PatchPlace::CENTRE, 2), aim(PatchPlace::CENTRE, 3)]);

    let chosen: Vec<_> = kinds(&trial, session).await.split_off(3);
    let placed = EventKind::PatchPlaced { segment, frame: 77, x: 300.25, y: 90.0, place };
    assert_eq!(chosen, [placed, EventKind::PatchCentred { segment, frame: 78 }], "a second Centre changes nothing");

    // A touch beside the circle counts as the nearest place on it.
    trial.conductor.choose(Role::Surgeon, touch(session, 500.0, 136.0)).await.unwrap();
    assert_eq!(aims(&mut trial), [aim(PatchPlace::nearest(1.0, 0.0), 4)]);

    let out = folder.path().join("out");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let checks = verify(&out, None);
    assert!(checks.iter().all(|check| !matches!(check.verdict, Verdict::Failed(_))), "{checks:#?}");
    let row = &rows(&out, "events")[3];
    let of = |name: &str| row[name].as_str();
    assert_eq!((of("kind"), of("role"), of("setting"), of("frame")), ("patch-placed", "surgeon", "1", "77"));
    assert_eq!((of("touched_x"), of("touched_y")), ("300.25", "90.0"));
    assert_eq!((of("patch_across"), of("patch_down")), ("0.4425", "-0.46"));
    assert!(!of("wall").is_empty() && !of("monotonic_ns").is_empty());

    let timeline = trial.reports.timeline(Role::Researcher, session, 100).await.unwrap();
    let choices: Vec<_> = timeline.choices.iter().map(|choice| (choice.frame, choice.x, choice.y)).collect();
    assert_eq!(choices, [(77, Some(300.25), Some(90.0)), (78, None, None), (77, Some(500.0), Some(136.0))]);
}

#[tokio::test]
async fn each_setting_begins_at_the_centre_unless_the_protocol_lets_the_choice_stay() {
    let place = PatchPlace::nearest(0.5, 0.0);
    for (protocol, next) in [("pointing", PatchPlace::CENTRE), ("staying", place)] {
        let folder = tempfile::tempdir().unwrap();
        let mut trial = start(folder.path()).await;
        let session = trial.begin(protocol).await;
        inspect(&mut trial).await;
        trial.conductor.choose(Role::Surgeon, touch(session, 306.0, 136.0)).await.unwrap();
        trial.wait(Duration::from_mins(1)).await;
        assert_eq!(trial.view().phase, Phase::Notice);
        inspect(&mut trial).await;

        let last = aims(&mut trial).pop().unwrap();
        assert_eq!((last.place, last.choices), (next, 1), "{protocol}: that it went back is nobody's choice");
        trial.wait(Duration::from_mins(1)).await;
        assert_eq!(trial.view().phase, Phase::Completed);
        let expected: &[Aim] = if next == place { &[aim(PatchPlace::CENTRE, 1)] } else { &[] };
        assert_eq!(aims(&mut trial), expected, "{protocol}: after the end it is at the centre");
    }
}

#[tokio::test]
async fn a_chosen_place_outlives_a_restart_of_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("pointing").await;
    inspect(&mut trial).await;
    trial.conductor.choose(Role::Surgeon, touch(session, 306.0, 136.0)).await.unwrap();
    drop(trial);

    let mut trial = start(folder.path()).await;
    assert_eq!(aims(&mut trial), [aim(PatchPlace::nearest(0.5, 0.0), 0)]);
}

#[tokio::test]
async fn nobody_points_where_the_protocol_or_the_moment_does_not_allow_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("pointing").await;
    aims(&mut trial);
    let refused = async |trial: &Trial, by: Role, choice: NewChoice| match trial.conductor.choose(by, choice).await {
        Err(ConductError::Said(_, said)) => said.to_string(),
        other => format!("{other:?}"),
    };

    // During the notice, from a page that knows of no session, outside the picture, while paused.
    let notice = refused(&trial, Role::Surgeon, touch(session, 256.0, 136.0)).await;
    assert_eq!(notice, "the focus is pointed only while a setting is inspected");
    inspect(&mut trial).await;
    assert!(refused(&trial, Role::Operator, touch(None, 256.0, 136.0)).await.contains("a session is under way"));
    for (x, y) in [(-1.0, 5.0), (513.0, 5.0), (5.0, 273.0), (f64::NAN, 5.0)] {
        let outside = refused(&trial, Role::Surgeon, touch(session, x, y)).await;
        assert_eq!(outside, "the place lies outside the picture");
    }
    trial.surgeon(Action::Pause { reason: String::new() }).await;
    assert_eq!(refused(&trial, Role::Surgeon, touch(session, 256.0, 136.0)).await, "the session is paused");
    assert!(trial.conductor.choose(Role::Researcher, touch(session, 256.0, 136.0)).await.is_err());
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "over".to_owned() }).await.unwrap();
    trial.conductor.dismiss(Role::Operator, session).unwrap();
    assert_eq!(aims(&mut trial), []);

    // The paper's trial: nobody ever.
    let paper = trial.begin("paper").await;
    inspect(&mut trial).await;
    let said = refused(&trial, Role::Surgeon, touch(paper, 256.0, 136.0)).await;
    assert_eq!(said, "the protocol keeps the focus on the centre of the view");
    let segment = trial.view().segment.unwrap();
    let hold = trial.conductor.act(Role::Surgeon, paper, Action::HoldFocus { segment }).await;
    assert!(matches!(hold, Err(error) if error.to_string().contains("does not let anybody hold")));
    assert!(!trial.view().pointing && !trial.view().holding);
}

#[tokio::test]
async fn outside_sessions_one_points_freely_and_a_session_begins_at_the_centre() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    for by in [Role::Operator, Role::Surgeon] {
        trial.conductor.choose(by, touch(None, 256.0, 186.0)).await.unwrap();
    }
    let place = PatchPlace::nearest(0.0, 0.5);
    assert_eq!(aims(&mut trial), [aim(place, 1), aim(place, 2)]);
    assert!(trial.conductor.choose(Role::Researcher, touch(None, 256.0, 186.0)).await.is_err());

    trial.begin("paper").await;
    assert_eq!(aims(&mut trial), [aim(PatchPlace::CENTRE, 2)]);
}

#[tokio::test]
async fn the_focus_is_held_until_it_is_released_or_the_clock_stops() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = start(folder.path()).await;
    let session = trial.begin("pointing").await;
    inspect(&mut trial).await;
    let segment = trial.view().segment.unwrap();
    trial.commanded();
    let aimed = |held| Command::Aim(Aim { held, ..Aim::default() });

    let hold = Action::HoldFocus { segment };
    trial.surgeon(hold.clone()).await;
    trial.surgeon(hold.clone()).await;
    assert_eq!(trial.commanded(), [aimed(true)], "the policy stays in charge, so that it goes on at once");
    assert!(trial.view().focus_held && trial.operator_view().surgeon.focus_held);
    trial.wait(Duration::from_secs(2)).await;
    trial.conductor.act(Role::Operator, session, Action::ReleaseFocus { segment }).await.unwrap();
    assert_eq!(trial.commanded(), [aimed(false)]);

    // A pause ends it, before any policy can take a step.
    trial.surgeon(hold).await;
    trial.commanded();
    trial.surgeon(Action::Pause { reason: String::new() }).await;
    let paused = Command::Drive { drive: Drive::Hold { at: None }, segment: Some(segment) };
    assert_eq!(trial.commanded(), [paused, aimed(false)]);
    trial.surgeon(Action::ReleaseFocus { segment }).await;
    trial.surgeon(Action::Resume).await;
    assert!(!trial.view().focus_held);

    let names: Vec<_> = kinds(&trial, session).await.split_off(3).iter().map(EventKind::name).collect();
    assert_eq!(names, ["focus-held", "focus-released", "focus-held", "paused", "resumed"]);
    let timeline = trial.reports.timeline(Role::Researcher, session, 100).await.unwrap();
    let lasted: Vec<_> = timeline.holds.iter().map(|hold| hold.to.map(|to| to - hold.from)).collect();
    assert_eq!(lasted, [Some(2.0), Some(0.0)]);
}

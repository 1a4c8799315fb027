//! The surgeon's tablet goes away and comes back, and what is seen on it is recorded.

use std::time::Duration;

use parfocal_base::FocalPower;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::{Command, Drive};
use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::{Verdict, verify};
use parfocal_records::store::telemetry;
use parfocal_trial::action::{Action, Focus};
use parfocal_trial::event::EventKind;
use parfocal_trial::remark::Sight;
use parfocal_trial::role::Role;
use parfocal_trial::session::PauseCause;
use parfocal_trial::tablet::{PictureSize, Presence, TabletReport};

use crate::exports::{json, rows};
use crate::fixture::Trial;
use crate::storage::step;

const SMALL: PictureSize = PictureSize { width: 512, height: 272 };
const LARGE: PictureSize = PictureSize { width: 2048, height: 1088 };

/// Demands a picture of half the sensor's resolution, and lets the clock run on without a tablet.
const DEMANDING: &str = r#"
name = "demanding"
title = "Two settings"
researcher_title = "Two hill-climbers"
policies = ["mgm-hill-climber", "mlr-hill-climber"]
repeats = 1
order = "shuffled"
segment_seconds = 60
least_picture_width = 1024
"#;

/// Reports `presence` four times a second for `seconds`, with `pictures` of `size` each time.
async fn report(trial: &Trial, presence: Presence, size: Option<PictureSize>, seconds: u64) {
    for _ in 0..seconds * 4 {
        trial.clock.advance(Duration::from_millis(250));
        let pictures = if size.is_some() { 5 } else { 0 };
        trial.conductor.follow_tablets(TabletReport { presence, size, pictures }).await;
    }
}

async fn inspecting(trial: &mut Trial, protocol: &str) -> SessionId {
    let session = trial.begin(protocol).await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::Acknowledge { segment }).await;
    trial.commanded();
    session
}

async fn names(trial: &Trial, session: SessionId) -> Vec<&'static str> {
    let events = trial.store.reader().events(session).await.unwrap();
    events[3..].iter().map(|(_, event)| event.kind.name()).collect()
}

#[tokio::test]
async fn a_tablet_that_goes_away_pauses_the_setting_where_the_protocol_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial, "paper").await;
    let segment = trial.view().segment;
    report(&trial, Presence::Present, Some(LARGE), 10).await;
    report(&trial, Presence::Silent, None, 5).await;

    assert_eq!(trial.view().paused_by, Some(PauseCause::TabletAway));
    assert_eq!(trial.commanded(), [Command::Drive { drive: Drive::Hold { at: None }, segment }]);
    assert!(trial.operator_view().reason_wanted.is_none(), "the server says why");
    report(&trial, Presence::Present, None, 5).await;
    assert!(trial.view().paused && trial.view().may_resume, "the surgeon must not find the clock running");
    trial.surgeon(Action::Resume).await;
    assert_eq!(names(&trial, session).await, ["pictures-seen", "tablet-away", "paused", "tablet-back", "resumed"]);
    let left = trial.view().remaining_seconds.unwrap();
    assert!((left - 109.75).abs() < 0.01, "ten seconds were seen, and a quarter until it was noticed: {left}");

    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    let [absence] = &timeline.absences[..] else { panic!("{:?}", timeline.absences) };
    assert!((absence.to.unwrap() - absence.from - 5.0).abs() < 0.3, "{absence:?}");
    let [sight] = &timeline.sights[..] else { panic!("{:?}", timeline.sights) };
    assert_eq!(sight.size, LARGE);
    assert!((sight.per_second - 20.0).abs() < 1.0, "{sight:?}");
}

#[tokio::test]
async fn where_the_protocol_does_not_the_clock_runs_on_and_the_events_tell_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("demanding.toml"), DEMANDING).unwrap();
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 7).await;
    let session = inspecting(&mut trial, "demanding").await;
    report(&trial, Presence::Present, None, 1).await;
    report(&trial, Presence::Hidden, None, 5).await;
    assert!(!trial.view().paused);
    report(&trial, Presence::Present, None, 1).await;
    let events = trial.store.reader().events(session).await.unwrap();
    let kinds: Vec<EventKind> = events.into_iter().skip(3).map(|(_, event)| event.kind).collect();
    assert_eq!(kinds, [EventKind::TabletAway { hidden: true }, EventKind::TabletBack]);
}

#[tokio::test]
async fn a_session_in_which_no_tablet_was_ever_seen_knows_of_none() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial, "paper").await;
    report(&trial, Presence::NeverSeen, None, 10).await;
    assert!(names(&trial, session).await.is_empty());
    assert!(!trial.view().paused);
}

#[tokio::test]
async fn a_picture_that_stays_smaller_than_the_protocol_allows_pauses_the_setting() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("demanding.toml"), DEMANDING).unwrap();
    let mut trial = Trial::start_with(folder.path(), Some(folder.path()), 7).await;
    let session = inspecting(&mut trial, "demanding").await;
    // Each link begins with small pictures.
    report(&trial, Presence::Present, Some(SMALL), 2).await;
    report(&trial, Presence::Present, Some(LARGE), 10).await;
    assert!(!trial.view().paused);
    report(&trial, Presence::Present, Some(SMALL), 4).await;
    assert_eq!(trial.view().paused_by, Some(PauseCause::SmallPicture));
    assert!(trial.view().may_resume);

    let events = trial.store.reader().events(session).await.unwrap();
    let seen: Vec<(u32, u64)> =
        events.iter().filter_map(|(_, event)| event.kind.seen()).map(|seen| (seen.size.width, seen.pictures)).collect();
    assert_eq!(seen[..2], [(512, 40), (2048, 200)], "{seen:?}");
    assert_eq!(seen[2].0, 512);
    let paused = events.last().unwrap().1.kind.in_words(|_| 1);
    assert!(paused.contains("smaller than the protocol allows"), "{paused}");
}

#[tokio::test]
async fn what_was_seen_until_the_end_of_a_setting_is_recorded_before_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial, "paper").await;
    report(&trial, Presence::Present, Some(LARGE), 5).await;
    let segment = trial.view().segment.unwrap();
    trial.surgeon(Action::FinishSegment { segment }).await;
    assert_eq!(names(&trial, session).await, ["pictures-seen", "segment-finished"]);
}

#[tokio::test]
async fn what_was_seen_until_the_server_ends_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(folder.path()).await;
    let session = inspecting(&mut trial, "paper").await;
    report(&trial, Presence::Present, Some(LARGE), 5).await;
    trial.conductor.record_the_rest().await;
    drop(trial);

    let trial = Trial::start(folder.path()).await;
    assert_eq!(names(&trial, session).await, ["pictures-seen", "server-restarted"]);
}

/// "Blurred" may be said of the link: so the size and the rate stand beside each comment, setting and step.
#[tokio::test]
async fn an_export_tells_what_size_of_picture_the_surgeon_saw_and_how_many() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = Trial::start(&folder.path().join("data")).await;
    let session = inspecting(&mut trial, "paper").await;
    let segment = trial.view().segment.unwrap();
    let (sender, receiver) = tokio::sync::mpsc::channel(16);
    let writer = tokio::spawn(telemetry::run_writer(trial.store.clone(), receiver));

    report(&trial, Presence::Present, Some(LARGE), 3).await;
    let mut comment = trial.comment("blurred");
    comment.sight = Sight { picture_width: Some(512), pictures_per_second: Some(2.5) };
    trial.conductor.comment(comment).await.unwrap();
    let mut comment = trial.comment("lied");
    comment.sight = Sight { picture_width: Some(0), pictures_per_second: Some(-1.0) };
    trial.conductor.comment(comment).await.unwrap();
    report(&trial, Presence::Present, Some(SMALL), 1).await;
    // On a slow link some reports have no picture.
    report(&trial, Presence::Present, None, 1).await;
    sender.send(step(7, Some(segment))).await.unwrap();
    drop(sender);
    writer.await.unwrap();

    report(&trial, Presence::Silent, None, 4).await;
    trial.surgeon(Action::Resume).await;
    trial.conductor.act(Role::Operator, session, Action::Pause { reason: String::new() }).await.unwrap();
    let pause = trial.store.reader().events(session).await.unwrap().len();
    // No decimal of it must be lost on the way to the file.
    let power = FocalPower::new(0.1 + 0.2).unwrap();
    trial.conductor.focus(Role::Operator, &Focus::FocalPower(power.get())).await.unwrap();
    trial.wait(Duration::from_secs(2)).await;
    let about = u32::try_from(pause).unwrap();
    let why = Action::GiveReason { event: about, reason: "smoke".to_owned() };
    trial.conductor.act(Role::Operator, session, why).await.unwrap();

    let out = folder.path().join("out");
    export(&trial.access_log(), session, &out, false).await.unwrap();
    let checks = verify(&out, None);
    assert!(checks.iter().all(|check| !matches!(check.verdict, Verdict::Failed(_))), "{checks:#?}");

    let comments = rows(&out, "comments");
    let seen = |row: usize| (comments[row]["picture_width"].as_str(), comments[row]["pictures_per_second"].as_str());
    assert_eq!([seen(0), seen(1)], [("512", "2.5"), ("", "")]);
    assert_eq!(json(&out, "session.json")["comments"][0]["picture_width"], 512);

    let events = rows(&out, "events");
    let of = |kind: &str| events.iter().filter(|row| row["kind"] == kind).collect::<Vec<_>>();
    let [large, small] = of("pictures-seen")[..] else { panic!("{events:#?}") };
    assert_eq!((large["picture_width"].as_str(), large["picture_height"].as_str()), ("2048", "1088"));
    assert_eq!((large["pictures"].as_str(), large["over_ms"].as_str()), ("60", "3000"));
    assert_eq!(small["picture_width"], "512");
    assert_eq!(of("tablet-away")[0]["hidden"], "false");
    assert_eq!(of("focused-by-hand")[0]["focal_power"], "0.30000000000000004");
    assert_eq!(of("reason-given")[0]["about"], about.to_string());

    let setting = &rows(&out, "segments")[0];
    assert_eq!(setting["least_picture_width"], "512");
    // Three seconds of 2048, and of 512 the time until the tablet went away.
    let small_ms: f64 = small["over_ms"].parse().unwrap();
    let mean = (2048.0 * 3000.0 + 512.0 * small_ms) / (3000.0 + small_ms);
    assert!((setting["mean_picture_width"].parse::<f64>().unwrap() - mean).abs() < 1e-6);
    let rate = (60.0 + 20.0) * 1000.0 / (3000.0 + small_ms);
    assert!((setting["pictures_per_second"].parse::<f64>().unwrap() - rate).abs() < 1e-6);

    assert_eq!(rows(&out, "telemetry")[0]["picture_width"], "512");
    let timeline = trial.reports.timeline(Role::Researcher, session, 10).await.unwrap();
    assert_eq!(timeline.comments[0].picture_width, Some(512));
}

//! The figures that are computed from the telemetry of each setting, compared with values computed by hand.

use parfocal_records::store::LensMotion;
use parfocal_trial::action::Action;
use parfocal_trial::role::Role;
use sqlx::SqlitePool;

use crate::fixture::Trial;
use crate::storage::raw;

/// A telemetry row of a setting.
#[derive(Clone, Copy)]
struct Frame {
    run: i64,
    millis: i64,
    asked: f64,
    held: Option<&'static str>,
    optimal: Option<f64>,
}

/// Frames at intervals of 40 ms that request these focal powers.
fn frames(asked: &[f64]) -> Vec<Frame> {
    let frame =
        |(place, asked): (i64, &f64)| Frame { run: 1, millis: 40 * place, asked: *asked, held: None, optimal: None };
    (0..).zip(asked).map(frame).collect()
}

async fn insert(pool: &SqlitePool, segment: i64, frames: &[Frame]) {
    for (number, frame) in frames.iter().enumerate() {
        sqlx::query(
            "INSERT INTO telemetry (run, frame, exposed_ns, segment, asked, measured, policy_micros, latency_micros,
                 held, optimal, patch_x, patch_y)
             VALUES (?, ?, ?, ?, ?, ?, 0, 0, ?, ?, 240, 120)",
        )
        .bind(frame.run)
        .bind(i64::try_from(number).unwrap())
        .bind(frame.millis * 1_000_000)
        .bind(segment)
        .bind(frame.asked)
        .bind(frame.asked)
        .bind(frame.held)
        .bind(frame.optimal)
        .execute(pool)
        .await
        .unwrap();
    }
}

fn assert_is(found: &LensMotion, expected: LensMotion) {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(
        near(found.seconds, expected.seconds)
            && near(found.travel, expected.travel)
            && near(found.error, expected.error),
        "{found:?} instead of {expected:?}"
    );
    let counts = |motion: &LensMotion| (motion.setting, motion.frames, motion.turns, motion.known, motion.in_focus);
    assert_eq!(counts(found), counts(&expected));
}

#[tokio::test]
async fn figures_of_a_setting_are_those_by_hand_and_leave_out_pauses_and_restarts() {
    let folder = tempfile::tempdir().unwrap();
    let trial = Trial::start(folder.path()).await;
    let session = trial.begin("paper").await;
    trial.conductor.act(Role::Operator, session, Action::Abort { reason: "enough".to_owned() }).await.unwrap();
    assert_eq!(trial.store.reader().motions(session).await.unwrap(), []);

    // Up by 0.1 twice, no movement once, down by 0.1 twice, up by 0.3: two turns in 0.24 s.
    let mut first = frames(&[0.2, 0.3, 0.4, 0.4, 0.3, 0.2, 0.5]);
    // The optimum is known for three frames. The errors are 0.05, 0.25 and 0.
    for (place, optimal) in [(0, 0.25), (1, 0.55), (2, 0.4)] {
        first[place].optimal = Some(optimal);
    }

    // Up, then a pause of 0.4 s in which the lens is moved, then up again. After a restart, from another place, down
    // twice.
    let mut second = frames(&[0.2, 0.3, 0.9, 0.9, 0.4, 0.5, 0.8, 0.7, 0.6]);
    for frame in &mut second[2..4] {
        frame.held = Some("paused");
    }
    for frame in &mut second[4..] {
        frame.millis += 400;
    }
    for frame in &mut second[6..] {
        frame.run = 2;
    }
    // The last frame comes after two seconds without a frame.
    second[8].millis += 2000;

    let pool = raw(folder.path()).await;
    let sql = "SELECT number FROM segments WHERE session = ? ORDER BY setting LIMIT 2";
    let segments: Vec<i64> = sqlx::query_scalar(sql).bind(session.to_string()).fetch_all(&pool).await.unwrap();
    insert(&pool, segments[0], &first).await;
    // The telemetry of the second setting comes later, as after a disk that was too slow.
    assert_eq!(trial.store.reader().motions(session).await.unwrap().len(), 1);
    insert(&pool, segments[1], &second).await;
    pool.close().await;

    let found = trial.store.reader().motions(session).await.unwrap();
    assert_eq!(found.len(), 2);
    assert_eq!(trial.store.reader().motions(session).await.unwrap(), found, "the remembered figures");
    let expected =
        LensMotion { setting: 1, frames: 7, seconds: 0.24, travel: 0.7, turns: 2, known: 3, error: 0.3, in_focus: 2 };
    assert_is(&found[0], expected);
    // Movements of the policy: 0.2 to 0.3, 0.4 to 0.5, 0.8 to 0.7 to 0.6. That is one turn. Each takes 40 ms, except
    // the last, which is a gap.
    let expected =
        LensMotion { setting: 2, frames: 7, seconds: 0.12, travel: 0.4, turns: 1, known: 0, error: 0.0, in_focus: 0 };
    assert_is(&found[1], expected);
}

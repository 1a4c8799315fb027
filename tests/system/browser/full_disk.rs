//! A database that cannot be written: the pages say what is not saved or recorded yet, and when it is.

use std::sync::Arc;

use sqlx::Connection;

use super::driver::Driver;
use super::screenshots::shoot;
use super::theatre::Theatre;
use super::wait::until;
use crate::support::disk::SmallDisk;

#[tokio::test(flavor = "multi_thread")]
async fn what_a_full_disk_refuses_stays_on_the_tablet_and_is_saved_later() {
    let Some(disk) = SmallDisk::mount() else { return };
    let driver = Driver::start();
    let theatre = Theatre::on(&driver, Arc::clone(&disk.folder)).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-06", "limited").await;
    theatre.tap_notice(1).await;
    theatre.say("There is room", 1).await;
    surgeon.sees_panel("a few questions").await;
    disk.fill();
    // There may be space left within the files: send long comments until it is used up.
    let mut said = vec!["There is room".to_owned()];
    until("the disk to refuse", || {
        let text = format!("{} {}", said.len(), "long ".repeat(2000));
        said.push(text.trim().to_owned());
        async move {
            surgeon.paste("#comment", &text).await;
            surgeon.click("#send").await;
            until("an answer", || async { surgeon.text("#comment-state").await != "Saving…" }).await;
            surgeon.text("#comment-state").await.contains("Saved here")
        }
    })
    .await;

    surgeon.sees("#comment-state", "Saved here: 1 comment").await;
    surgeon.sees("#comment-state", "the disk is full").await;
    shoot(surgeon, "surgeon-13-full-disk").await;
    surgeon.reload().await;
    surgeon.sees("#comment-state", "Saved here").await;
    disk.empty();
    theatre.sees_saved(said.len()).await;

    let pool = theatre.server.database().await;
    let kept: Vec<String> =
        sqlx::query_scalar("SELECT text FROM comments ORDER BY number").fetch_all(&pool).await.unwrap();
    assert_eq!(kept, said, "each once, in the order said");
    pool.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_pause_that_cannot_be_recorded_yet_is_said_to_be_so() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    let operator = &theatre.operator;
    theatre.begin("S-07", "short").await;
    theatre.tap_notice(1).await;
    let other_program = theatre.server.lock_database().await;

    operator.sees("#session-actions", "Pause").await;
    operator.click_labelled("#session-actions", "Pause").await;
    operator.sees("#session-badges", "Paused").await;
    surgeon.sees("#panel h2", "Paused").await;
    surgeon.sees("#unrecorded", "not recorded yet").await;
    operator.sees("#unrecorded", "The lens is held, but this is not recorded yet").await;
    operator.sees("#unrecorded", "another program has locked the database").await;
    operator.sees("#log", "Paused (not recorded yet)").await;
    shoot(operator, "operator-11-not-recorded").await;
    shoot(surgeon, "surgeon-14-not-recorded").await;

    // Nor can the reason be saved. It stays in the box.
    theatre.say_why_paused("The phone").await;
    operator.sees("#session-trouble", "another program has locked the database").await;
    assert_eq!(operator.value("#pause-reason").await, "The phone");

    other_program.close().await.unwrap();
    operator.sees_no("#unrecorded").await;
    surgeon.sees_no("#unrecorded").await;
    assert!(!operator.text("#log").await.contains("not recorded"));
    operator.click("#reason-wanted [type=submit]").await;
    operator.sees_no("#reason-wanted").await;
    operator.sees("#log", ": The phone").await;
    let pool = theatre.server.database().await;
    let paused = "SELECT given.payload ->> 'reason' FROM events AS paused LEFT JOIN events AS given
        ON given.session = paused.session AND given.payload ->> 'about' = paused.number WHERE paused.kind = 'paused'";
    let reasons: Vec<String> = sqlx::query_scalar(paused).fetch_all(&pool).await.unwrap();
    assert_eq!(reasons, ["The phone"]);
    pool.close().await;
}

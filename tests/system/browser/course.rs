//! Sessions with unusual events: practice, a setting ended by its time limit, an emergency unblinding, an abort; and
//! what the surgeon sees of them.

use serde_json::{Value, json};
use sqlx::Row;

use super::blinding;
use super::driver::Driver;
use super::screenshots::shoot;
use super::theatre::Theatre;

/// A reason that a researcher might write. It names a policy, so only the researcher may see it.
const EMERGENCY: &str = "Bleeding: is it the mgm-hill-climber?";

#[tokio::test(flavor = "multi_thread")]
async fn practice_a_time_limit_an_emergency_and_an_abort() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;

    the_belief_of_a_policy_that_has_one(&theatre).await;
    practice(&theatre).await;
    beside_another_operator(&theatre).await;
    a_link_that_breaks_without_a_word(&theatre).await;
    time_limit(&theatre).await;
    let researcher = emergency_unblinding(&theatre).await;
    abort(&theatre).await;
    practice_stays_apart(&theatre, &researcher).await;
    database(&theatre).await;

    for browser in [&theatre.surgeon, &theatre.operator] {
        assert_eq!(browser.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    }

    let seen = blinding::check(&theatre.proxy.recorded());
    assert_eq!(seen.segments.len(), 6);
    assert!(seen.texts > 40 && seen.pictures > 40, "{} texts, {} pictures", seen.texts, seen.pictures);
}

async fn the_belief_of_a_policy_that_has_one(theatre: &Theatre) {
    let operator = &theatre.operator;
    operator.sees_no("#belief-choice").await;

    operator.select("#policy", "parfocal").await;
    operator.sees("#belief-choice", "Belief").await;
    operator.click("#belief-choice input").await;
    shoot(operator, "operator-6-belief").await;

    operator.select("#policy", "fixed").await;
    operator.sees_no("#belief-choice").await;

    operator.select("#policy", "parfocal").await;
    operator.sees("#belief-choice", "Belief").await;
}

async fn practice(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    let operator = &theatre.operator;

    theatre.begin("S-03", "practice").await;
    // A choice of belief would reveal the policy.
    operator.sees_no("#belief-choice").await;
    operator.sees("#session-badges", "Practice").await;

    surgeon.sees("#change-practice", "Practice").await;
    surgeon.sees("#change-what", "This is the first setting.").await;
    shoot(surgeon, "surgeon-11-practice").await;

    theatre.tap_notice(1).await;
    surgeon.sees("#practice", "Practice").await;
    theatre.say("Only trying", 1).await;
    theatre.finish_setting(4).await;

    surgeon.sees("#change-what", "The setting has changed.").await;
    theatre.tap_notice(2).await;
    theatre.finish_setting(5).await;

    surgeon.sees_panel("Final questions").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#panel h2", "Practice is over").await;

    operator.sees("#session-actions", "Close and prepare the next").await;
    operator.click("#session-actions .primary").await;
    surgeon.sees("#panel", "No trial is under way").await;
}

/// Another operator closes the session while this one is asked for a reason to abort it, and adds a participant. What
/// this one was about to write of a pause is gone with the session.
async fn beside_another_operator(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    let operator = &theatre.operator;

    theatre.begin("S-07", "practice").await;
    surgeon.sees("#change-what", "This is the first setting.").await;
    operator.sees("#session-actions button:first-child", "Pause").await;
    operator.click("#session-actions button:first-child").await;
    operator.sees("#session-badges", "Paused").await;
    operator.type_into("#pause-reason", "Half a reason").await;

    // The other gives the reason first. What this one was writing is not taken for the reason of the next pause.
    let server = &theatre.server;
    let shown = server.read("/api/operator/session").await;
    let session = shown["session"].clone();
    let event = &shown["reason_wanted"]["event"];
    let reason = json!({ "session": session, "action": "give-reason", "event": event, "reason": "The phone" });
    server.post("/api/operator/actions", reason).await;
    operator.sees_no("#reason-wanted").await;
    assert_eq!(operator.value("#pause-reason").await, "");

    for pressed in ["Resume", "Pause"] {
        operator.sees("#session-actions", pressed).await;
        operator.click_labelled("#session-actions", pressed).await;
    }
    operator.type_into("#pause-reason", "Half a reason").await;
    operator.click_labelled("#session-actions", "Abort").await;
    operator.sees("#reason-heading", "Abort the session").await;

    server.post("/api/operator/participants", json!({ "code": "S-08" })).await;
    let abort = json!({ "session": session, "action": "abort", "reason": "By the other" });
    server.post("/api/operator/actions", abort).await;
    server.post("/api/operator/dismissals", json!({ "session": session })).await;

    // This operator gives the reason to abort only now.
    operator.sees("#new-session", "Prepare session").await;
    theatre.give_reason("Too late").await;
    operator.sees("#reason-trouble", "This session was closed in the meantime").await;
    operator.click("#reason-dialog [data-close]").await;
    operator.sees("#participant", "S-08").await;
    assert_eq!(operator.value("#pause-reason").await, "");
    surgeon.sees("#panel", "No trial is under way").await;
}

/// The connection breaks silently. The page notices this itself, and catches up.
async fn a_link_that_breaks_without_a_word(theatre: &Theatre) {
    theatre.proxy.break_silently();
    theatre.begin("S-05", "practice").await;
    theatre.surgeon.sees("#change-what", "This is the first setting.").await;

    theatre.abort("Only to see").await;
    theatre.surgeon.sees("#panel h2", "The session was ended").await;

    theatre.operator.click("#session-actions .primary").await;
    theatre.surgeon.sees("#panel", "No trial is under way").await;
}

/// Nobody ends the setting; its limit of ten seconds does.
async fn time_limit(theatre: &Theatre) {
    theatre.begin("S-04", "limited").await;
    theatre.tap_notice(1).await;
    theatre.write("Cut off in the mid").await;

    theatre.surgeon.sees("#panel h2", "Setting 1: a few questions").await;
    theatre.operator.sees("#log", "Setting 1 finished after 10.0 s · system").await;

    // The half-written comment is still there and can be finished.
    assert_eq!(theatre.comment_box().await, "Cut off in the mid");
    theatre.say("dle", 1).await;
    theatre.answer_questions(3).await;
}

/// The researcher unblinds the session while it is under way. Returns the address of the list of sessions.
async fn emergency_unblinding(theatre: &Theatre) -> String {
    let surgeon = &theatre.surgeon;
    let page = &theatre.operator;
    surgeon.sees("#change-title", "Setting 2 of 2").await;
    let before = surgeon.everything().await;

    let researcher = theatre.server.link("researcher");
    let operator = page.new_tab(&researcher).await;
    page.click("td a.button").await;

    page.sees("#unblind", "Emergency unblinding").await;
    page.click("#unblind").await;
    page.sees("#reason-consequence", "under way").await;

    // Nothing happens without a reason.
    page.click("#reason-go").await;
    assert!(page.fails("#reason", "valueMissing").await);
    shoot(page, "researcher-6-emergency").await;

    theatre.give_reason(EMERGENCY).await;
    page.sees(".masthead", "Emergency unblinding").await;
    page.sees(".unblinded", "mgm-hill-climber").await;
    page.sees(".events", EMERGENCY).await;

    page.close_tab(&operator).await;
    page.sees("#log", "Unblinded by the researcher").await;
    assert!(!page.text("body").await.contains("Bleeding"), "the operator, beside the surgeon, is not told the reason");

    assert_eq!(surgeon.everything().await, before, "nothing on the surgeon's page has changed");

    surgeon.reload().await;
    surgeon.sees("#change-title", "Setting 2 of 2").await;
    assert_eq!(surgeon.everything().await, before, "nor has it after a reload");
    researcher
}

async fn abort(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    let operator = &theatre.operator;

    theatre.tap_notice(2).await;
    theatre.say("The last word", 2).await;

    operator.click_labelled("#session-actions", "Abort").await;
    operator.sees("#reason-consequence", "All comments and answers so far are kept").await;
    theatre.give_reason("The participant was called away").await;

    surgeon.sees("#panel h2", "The session was ended").await;
    surgeon.sees("#panel", "Everything you said is saved").await;
    shoot(surgeon, "surgeon-12-aborted").await;

    operator.sees("#phase", "Aborted").await;
    operator.sees("#log", "Session aborted: The participant was called away").await;
    shoot(operator, "operator-7-aborted").await;
}

/// The list of sessions shows practice sessions separately.
async fn practice_stays_apart(theatre: &Theatre, researcher: &str) {
    let page = &theatre.operator;
    page.open(researcher).await;
    page.sees("[aria-labelledby=sessions]", "S-04").await;
    page.sees("[aria-labelledby=practice]", "S-03").await;
    assert!(!page.text("[aria-labelledby=sessions]").await.contains("S-03"));
    assert!(!page.text("[aria-labelledby=practice]").await.contains("S-04"));
    page.sees("[aria-labelledby=sessions]", "emergency unblinding").await;
    shoot(page, "researcher-7-practice-apart").await;
}

async fn database(theatre: &Theatre) {
    let pool = theatre.server.database().await;
    let sql = "SELECT protocol, practice, (SELECT count(*) FROM comments AS c WHERE c.session = s.session) AS comments
               FROM sessions AS s ORDER BY rowid";
    let sessions = sqlx::query(sql).fetch_all(&pool).await.unwrap();
    let sessions: Vec<(String, bool, i64)> = sessions.iter().map(|row| (row.get(0), row.get(1), row.get(2))).collect();
    assert_eq!(
        sessions,
        [("practice", true, 1), ("practice", true, 0), ("practice", true, 0), ("limited", false, 2)]
            .map(|(protocol, practice, comments)| (protocol.to_owned(), practice, comments))
    );

    let sql =
        "SELECT kind, role, payload FROM events NATURAL JOIN (SELECT session FROM sessions WHERE protocol = 'limited')
               WHERE kind IN ('segment-finished', 'unblinded', 'aborted') ORDER BY number";
    let events = sqlx::query(sql).fetch_all(&pool).await.unwrap();
    let events: Vec<(String, String, Value)> = events
        .iter()
        .map(|row| (row.get(0), row.get(1), serde_json::from_str(row.get::<&str, _>(2)).unwrap()))
        .collect();

    let kinds: Vec<_> = events.iter().map(|(kind, role, _)| (kind.as_str(), role.as_str())).collect();
    assert_eq!(kinds, [("segment-finished", "system"), ("unblinded", "researcher"), ("aborted", "operator")]);
    assert_eq!(events[0].2["inspected_ms"], 10_000);
    assert_eq!((&events[1].2["reason"], &events[1].2["emergency"]), (&json!(EMERGENCY), &json!(true)));
    assert_eq!(events[2].2["reason"], "The participant was called away");
    let about =
        "SELECT text, setting FROM comments JOIN segments USING (segment) ORDER BY comments.number LIMIT 2 OFFSET 1";
    let about = sqlx::query(about).fetch_all(&pool).await.unwrap();
    let about: Vec<(String, i64)> = about.iter().map(|row| (row.get(0), row.get(1))).collect();
    assert_eq!(about, [("Cut off in the middle".to_owned(), 1), ("The last word".to_owned(), 2)]);
    pool.close().await;
}

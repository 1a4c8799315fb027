//! The whole trial: six settings with everything that happens in a theatre, then the researcher, the database, the
//! export, and what reached the surgeon's browser.

use std::process::Command;

use serde_json::json;
use sqlx::Row;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool};

use crate::blinding;
use crate::screenshots::shoot;
use crate::theatre::{Theatre, kill, start_again};
use crate::wait::until;
use crate::webdriver::{Browser, Driver};

#[tokio::test(flavor = "multi_thread")]
async fn a_surgeon_completes_a_blinded_trial() {
    let driver = Driver::start().await;
    let mut theatre = Theatre::open(&driver).await;
    prepare(&theatre).await;
    first_setting_typed_comments(&theatre).await;
    second_setting_quick_comments_and_double_taps(&theatre).await;
    third_setting_reload_and_second_tab(&theatre).await;
    fourth_setting_too_long_a_comment(&theatre).await;
    fifth_setting_killed_server(&mut theatre).await;
    sixth_setting_paused_and_ended_by_the_operator(&theatre).await;
    closing_questions(&theatre).await;
    let session = researcher(&theatre).await;
    assert_eq!(theatre.surgeon.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    assert_eq!(theatre.operator.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    database(&theatre, &session).await;
    export(&theatre, &session);
    let seen = blinding::check(&theatre.proxy.recorded());
    assert_eq!(seen.segments.len(), 6);
    assert!(seen.texts > 100 && seen.pictures > 100, "{} texts, {} pictures", seen.texts, seen.pictures);
    assert!(seen.files.contains("surgeon.js") && seen.files.contains("style.css"), "{:?}", seen.files);
}

/// The operator adds a participant and prepares and starts a session; the surgeon waits.
async fn prepare(theatre: &Theatre<'_>) {
    let (operator, surgeon) = (&theatre.operator, &theatre.surgeon);
    surgeon.sees("#panel", "No trial is under way").await;
    surgeon.sees("#simulated", "Simulated camera and lens").await;
    operator.sees("#warnings", "Simulated camera and lens").await;
    until("a picture", || async {
        surgeon.run("return document.querySelector('.viewer-stale').hidden", json!([])).await == true
    })
    .await;
    shoot(surgeon, "surgeon-1-no-session").await;
    shoot(operator, "operator-1-no-session").await;

    operator.click("#add-participant").await;
    operator.type_into("#code", "anna").await;
    operator.click("#participant-dialog [type=submit]").await;
    assert_eq!(operator.run("return document.getElementById('code').validity.patternMismatch", json!([])).await, true);
    operator.run("document.getElementById('code').value = ''", json!([])).await;
    operator.type_into("#code", "S-01").await;
    shoot(operator, "operator-2-participant").await;
    operator.click("#participant-dialog [type=submit]").await;
    operator.sees_no("#participant-dialog").await;

    let choose =
        "const s = document.getElementById('protocol'); s.value = 'short'; s.dispatchEvent(new Event('change'))";
    operator.run(choose, json!([])).await;
    operator.sees("#protocol-summary", "6 settings").await;
    operator.click("#new-session [type=submit]").await;
    operator.sees("#phase", "Ready to start").await;
    surgeon.sees("#panel", "6 settings to look at").await;
    shoot(surgeon, "surgeon-2-ready").await;
    operator.click("#session-actions .primary").await;
    surgeon.sees("#change-title", "Setting 1 of 6").await;
    shoot(surgeon, "surgeon-3-notice").await;
}

async fn first_setting_typed_comments(theatre: &Theatre<'_>) {
    let surgeon = &theatre.surgeon;
    surgeon.type_into("#change-tap", "\u{e00c}").await; // Escape: the notice stays
    theatre.tap_notice(1).await;
    theatre.say("Follows me well 🧠", 1).await;
    theatre.say("Loses the fissure", 2).await;
    surgeon.sees("#prompt", "How does the focus feel now?").await;
    shoot(surgeon, "surgeon-4-inspecting").await;
    theatre.operator.sees("#comments", "Follows me well 🧠").await;
    theatre.operator.sees("#phase", "Setting 1 of 6: inspecting").await;
    shoot(&theatre.operator, "operator-3-inspecting").await;
    surgeon.click("#finish").await;
    surgeon.sees("#panel h2", "a few questions").await;
    surgeon.click(".questions .done button").await;
    surgeon.sees("#missing", "One question is still open").await;
    theatre.choose("sharpness", 3).await;
    theatre.choose("sharpness", 5).await;
    surgeon.click("[data-question=remarks] textarea").await;
    surgeon.type_into("[data-question=remarks] textarea", "Good at rest").await;
    shoot(surgeon, "surgeon-5-questions").await;
    surgeon.click(".questions .done button").await;
}

async fn second_setting_quick_comments_and_double_taps(theatre: &Theatre<'_>) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(2).await;
    let twice = "const b = document.querySelector(arguments[0]); b.click(); b.click()";
    surgeon.run(twice, json!(["#quick button:nth-child(3)"])).await;
    surgeon.run(twice, json!(["#mark"])).await;
    theatre.sees_saved(4).await;
    surgeon.run(twice, json!(["#finish"])).await;
    theatre.answer_questions(2).await;
}

async fn third_setting_reload_and_second_tab(theatre: &Theatre<'_>) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(3).await;
    theatre.write("Half a thought").await;
    surgeon.reload().await;
    surgeon.sees("#setting", "Setting 3 of 6").await;
    until("the draft to be back", || async { theatre.comment_box().await == "Half a thought" }).await;
    let first = surgeon.new_tab(&format!("http://{}/surgeon", theatre.proxy.address)).await;
    surgeon.sees("#setting", "Setting 3 of 6").await;
    surgeon.click("#finish").await;
    surgeon.sees("#panel h2", "Setting 3: a few questions").await;
    surgeon.close_tab(&first).await;
    // The stale tab follows by itself, and its draft is still about setting 3.
    surgeon.sees("#panel h2", "Setting 3: a few questions").await;
    assert_eq!(theatre.comment_box().await, "Half a thought");
    theatre.say(", whole", 5).await;
    theatre.answer_questions(6).await;
}

async fn fourth_setting_too_long_a_comment(theatre: &Theatre<'_>) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(4).await;
    let paste = "const box = document.getElementById('comment'); box.value = 'x'.repeat(1_000_000);
                 box.dispatchEvent(new Event('input'));";
    surgeon.run(paste, json!([])).await;
    surgeon.click("#send").await;
    surgeon.sees("#comment-trouble", "it is back in the box").await;
    assert_eq!(theatre.comment_box().await.len(), 1_000_000);
    surgeon.reload().await;
    surgeon.sees("#setting", "Setting 4 of 6").await;
    until("the paste to be back", || async { theatre.comment_box().await.len() == 1_000_000 }).await;
    let shorten = paste.replace("'x'.repeat(1_000_000)", "'Shortened'");
    surgeon.run(&shorten, json!([])).await;
    surgeon.click("#send").await;
    theatre.sees_saved(6).await;
    theatre.finish_setting(4).await;
}

async fn fifth_setting_killed_server(theatre: &mut Theatre<'_>) {
    theatre.tap_notice(5).await;
    theatre.say("Saved before the crash", 7).await;
    kill(&mut theatre.server);
    theatre.write("Said while it was away").await;
    theatre.surgeon.click("#send").await;
    theatre.surgeon.sees("#comment-state", "kept on this device").await;
    shoot(&theatre.surgeon, "surgeon-6-no-connection").await;
    start_again(&mut theatre.server);
    theatre.surgeon.sees("#panel h2", "Paused").await;
    theatre.sees_saved(8).await;
    shoot(&theatre.surgeon, "surgeon-7-restarted").await;
    theatre.surgeon.click("#panel button").await;
    theatre.surgeon.sees_no("#panel").await;
    theatre.surgeon.sees("#setting", "Setting 5 of 6").await;
    theatre.finish_setting(7).await;
}

async fn sixth_setting_paused_and_ended_by_the_operator(theatre: &Theatre<'_>) {
    let (operator, surgeon) = (&theatre.operator, &theatre.surgeon);
    theatre.tap_notice(6).await;
    operator.sees("#phase", "Setting 6 of 6: inspecting").await;
    operator.click("#session-actions button:nth-child(2)").await;
    operator.type_into("#reason", "The lamp was moved").await;
    shoot(operator, "operator-4-reason").await;
    operator.click("#reason-go").await;
    surgeon.sees("#panel", "The operator has paused the session").await;
    shoot(surgeon, "surgeon-8-paused").await;
    operator.sees("#log", "Paused: The lamp was moved").await;
    operator.click("#session-actions .primary").await;
    surgeon.sees_no("#panel").await;
    operator.sees("#session-actions", "End setting 6 now").await;
    operator.click("#session-actions button:first-child").await;
    theatre.answer_questions(1).await;
}

async fn closing_questions(theatre: &Theatre<'_>) {
    let surgeon = &theatre.surgeon;
    surgeon.sees("#panel h2", "To finish").await;
    shoot(surgeon, "surgeon-9-closing").await;
    surgeon.click("[aria-label='Move setting 5 up']").await;
    surgeon.sees("[data-question=preference] > .state", "Saved").await;
    for (item, point) in [4, 2, 3, 1, 4, 3, 2, 2, 4, 2].into_iter().enumerate() {
        theatre.choose(&format!("usability-{item}"), point).await;
    }
    surgeon.sees("[data-question=usability] > .state", "Saved").await;
    surgeon.click("[data-question=closing-remarks] textarea").await;
    surgeon.type_into("[data-question=closing-remarks] textarea", "That it stays still").await;
    surgeon.click(".questions .done button").await;
    surgeon.sees("#panel h2", "Thank you").await;
    shoot(surgeon, "surgeon-10-completed").await;
    theatre.operator.sees("#phase", "Completed").await;
    shoot(&theatre.operator, "operator-5-completed").await;
}

/// The researcher looks at the session and unblinds it; gives its id.
async fn researcher(theatre: &Theatre<'_>) -> String {
    let page = &theatre.operator;
    page.open(&theatre.server.url(&format!("/enter?key={}", theatre.server.key("researcher")))).await;
    page.sees("tbody", "completed").await;
    shoot(page, "researcher-1-sessions").await;
    page.click("td a.button").await;
    page.sees("#comment-list", "Follows me well 🧠").await;
    page.sees(".closing", "SUS score 67.5").await;
    let session = page.run("return document.getElementById('session').dataset.session", json!([])).await;
    let session = session.as_str().unwrap().to_owned();
    assert_eq!(fetched(page, &format!("{session}/export.zip")).await, "200 PK");
    assert_eq!(fetched(page, &format!("{session}/export.zip?unblinded=true")).await, "409 {\"");
    page.click("#comment-list li:first-child button").await;
    page.sees("#timeline figcaption", "Follows me well 🧠").await;
    shoot(page, "researcher-2-blinded").await;
    page.click("#unblind").await;
    page.type_into("#reason", "Analysis begins").await;
    shoot(page, "researcher-3-unblinding").await;
    page.click("#reason-go").await;
    page.sees(".unblinded", "mlr-hill-climber").await;
    until("the focal path", || async {
        page.run("return document.querySelector('.timeline .path')?.getAttribute('d').length > 100", json!([])).await
            == true
    })
    .await;
    page.run("scrollTo(0, 0)", json!([])).await;
    shoot(page, "researcher-4-unblinded").await;
    assert_eq!(fetched(page, &format!("{session}/export.zip?unblinded=true")).await, "200 PK");
    page.open(&theatre.server.url("/researcher/dictionary")).await;
    page.sees("main", "comments.csv").await;
    shoot(page, "researcher-5-dictionary").await;
    session
}

/// Status and first two bytes of what the researcher's page gets at `path`.
async fn fetched(page: &Browser<'_>, path: &str) -> String {
    let script =
        "const answer = new XMLHttpRequest(); answer.open('GET', '/api/researcher/sessions/' + arguments[0], false);
                  answer.overrideMimeType('text/plain; charset=x-user-defined'); answer.send();
                  return answer.status + ' ' + answer.responseText.slice(0, 2)";
    page.run(script, json!([path])).await.as_str().unwrap().to_owned()
}

/// What is in the database, read by another program than the server.
async fn database(theatre: &Theatre<'_>, session: &str) {
    let file = theatre.server.data.path().join("parfocal.db");
    let pool = SqlitePool::connect_with(SqliteConnectOptions::new().filename(file).read_only(true)).await.unwrap();
    let rows = sqlx::query(
        "SELECT kind, text, setting, frame FROM comments LEFT JOIN segments USING (segment) WHERE comments.session = ? ORDER BY comments.number",
    );
    let rows = rows.bind(session).fetch_all(&pool).await.unwrap();
    let comments: Vec<(String, Option<String>, i64)> =
        rows.iter().map(|row| (row.get(0), row.get(1), row.get(2))).collect();
    let expected = [
        ("text", Some("Follows me well 🧠"), 1),
        ("text", Some("Loses the fissure"), 1),
        ("quick", Some("Too slow"), 2),
        ("mark", None, 2),
        ("text", Some("Half a thought, whole"), 3),
        ("text", Some("Shortened"), 4),
        ("text", Some("Saved before the crash"), 5),
        ("text", Some("Said while it was away"), 5),
    ];
    let expected = expected.map(|(kind, text, setting)| (kind.to_owned(), text.map(str::to_owned), setting));
    assert_eq!(comments, expected);
    assert!(rows.iter().all(|row| row.get::<Option<i64>, _>("frame").is_some()), "every comment names its frame");

    let latest = "SELECT value FROM answers LEFT JOIN segments USING (segment) WHERE answers.session = ? AND question = ? ORDER BY setting, answers.number";
    let values =
        |question: &'static str| sqlx::query_scalar::<_, String>(latest).bind(session).bind(question).fetch_all(&pool);
    // The first setting's answer was changed once; both stand.
    assert_eq!(values("sharpness").await.unwrap(), ["3", "5", "2", "6", "4", "7", "1"]);
    assert_eq!(values("remarks").await.unwrap(), ["\"Good at rest\""]);
    assert_eq!(values("preference").await.unwrap(), ["[1,2,3,5,4,6]"]);
    assert_eq!(values("usability").await.unwrap(), ["[4,2,3,1,4,3,2,2,4,2]"]);
    assert_eq!(values("closing-remarks").await.unwrap(), ["\"That it stays still\""]);

    let events = "SELECT kind FROM events WHERE session = ? AND kind NOT LIKE 'segment-%' AND kind != 'questions-finished' ORDER BY number";
    let events: Vec<String> = sqlx::query_scalar(events).bind(session).fetch_all(&pool).await.unwrap();
    assert_eq!(
        events,
        ["created", "started", "server-restarted", "resumed", "paused", "resumed", "completed", "unblinded"]
    );
    let steps = "SELECT count(DISTINCT segment) FROM telemetry WHERE segment IS NOT NULL";
    assert_eq!(sqlx::query_scalar::<_, i64>(steps).fetch_one(&pool).await.unwrap(), 6, "every setting has telemetry");
    pool.close().await;
}

/// The command's export is whole by the verifier's word.
fn export(theatre: &Theatre<'_>, session: &str) {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("export");
    let parfocal = || Command::new(env!("CARGO_BIN_EXE_parfocal"));
    let exported = parfocal()
        .args(["export", session, "--unblinded", "--out"])
        .arg(&folder)
        .arg("--data-dir")
        .arg(theatre.server.data.path())
        .output()
        .unwrap();
    assert!(exported.status.success(), "{}", String::from_utf8_lossy(&exported.stderr));
    let verified = parfocal().arg("verify").arg(&folder).output().unwrap();
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    let comments = std::fs::read_to_string(folder.join("comments.csv")).unwrap();
    assert!(comments.contains("Follows me well 🧠") && comments.contains("Said while it was away"), "{comments}");
}

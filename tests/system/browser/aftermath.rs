//! After the trial: what the researcher sees, what is in the database, and what is exported.

use serde_json::json;
use sqlx::Row;

use super::screenshots::shoot;
use super::theatre::Theatre;
use super::wait::until;
use crate::support::parfocal;

/// The researcher reads the session and unblinds it. Returns its id.
pub async fn researcher(theatre: &Theatre) -> String {
    let page = &theatre.operator;
    page.open(&theatre.server.link("researcher")).await;
    page.sees("tbody", "completed").await;
    shoot(page, "researcher-1-sessions").await;

    page.click("td a.button").await;
    page.sees("#comment-list", "Follows me well 🧠").await;
    page.sees(".closing", "SUS score 67.5").await;

    let session = page.attribute("#session", "data-session").await.unwrap();
    let export = format!("/api/researcher/sessions/{session}/export.zip");
    assert_eq!(page.start_of(&export).await, "200 PK");
    assert_eq!(page.start_of(&format!("{export}?unblinded=true")).await, "409 {\"");

    page.click("#comment-list li:first-child button").await;
    page.sees("#timeline figcaption", "Follows me well 🧠").await;
    shoot(page, "researcher-2-blinded").await;

    let held = page.properties(".timeline .pause title", "textContent").await;
    let restarted = held.iter().any(|reason| reason.contains("The server restarted"));
    assert!(restarted, "the timeline shows when the lens was held: {held:?}");

    page.click("#unblind").await;
    page.type_into("#reason", "Analysis begins").await;
    // A tablet might hold something that still counts. The dialog says so, and requires a confirmation.
    page.sees("#reason-confirm", "Unblind anyway").await;
    let consequence = page.text("#reason-consequence").await;
    assert!(consequence.contains("Comments and answers still on a tablet count until"), "{consequence}");
    assert!(
        !consequence.contains("not confirmed since the end"),
        "the tablet has said that it is empty: {consequence}"
    );

    shoot(page, "researcher-3-unblinding").await;

    // Nothing happens without the box ticked.
    page.click("#reason-go").await;
    assert!(page.is("#reason-dialog", "open").await);
    page.click("#reason-confirmed").await;
    page.click("#reason-go").await;

    page.sees(".unblinded", "mlr-hill-climber").await;
    until("the focal path", || async {
        page.attribute(".timeline .path", "d").await.is_some_and(|path| path.len() > 100)
    })
    .await;

    page.to_top().await;
    shoot(page, "researcher-4-unblinded").await;
    assert_eq!(page.start_of(&format!("{export}?unblinded=true")).await, "200 PK");

    page.open(&theatre.server.url("/researcher/dictionary")).await;
    page.sees("main", "comments.csv").await;
    shoot(page, "researcher-5-dictionary").await;
    session
}

/// Reads the database with another program than the server.
pub async fn database(theatre: &Theatre, session: &str) {
    let pool = theatre.server.database().await;
    let rows = sqlx::query(
        "SELECT kind, text, setting, frame FROM comments LEFT JOIN segments USING (segment)
         WHERE comments.session = ? ORDER BY comments.number",
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

    let latest = "SELECT value FROM answers LEFT JOIN segments USING (segment)
                  WHERE answers.session = ? AND question = ? ORDER BY setting, answers.number";
    let values =
        |question: &'static str| sqlx::query_scalar::<_, String>(latest).bind(session).bind(question).fetch_all(&pool);
    // The first setting's answer was changed once; both answers are stored.
    assert_eq!(values("sharpness").await.unwrap(), ["3", "5", "2", "6", "4", "7", "1"]);
    assert_eq!(values("remarks").await.unwrap(), ["\"Good at rest\""]);
    assert_eq!(values("preference").await.unwrap(), ["[1,2,3,5,4,6]"]);
    // Each item was stored by itself, as it was given.
    let items = [4, 2, 3, 1, 4, 3, 2, 2, 4, 2].iter().enumerate().map(|(place, point)| {
        let mut items = [0; 10];
        items[place] = *point;
        json!(items).to_string()
    });

    assert_eq!(values("usability").await.unwrap(), items.collect::<Vec<_>>());
    assert_eq!(values("closing-remarks").await.unwrap(), ["\"That it stays still\""]);

    // When a tablet was away, and what it saw, depends on how busy the machine is.
    let events = "SELECT kind FROM events
                  WHERE session = ? AND kind NOT LIKE 'segment-%' AND kind NOT LIKE 'tablet-%'
                  AND kind NOT IN ('questions-finished', 'pictures-seen') ORDER BY number";
    let events: Vec<String> = sqlx::query_scalar(events).bind(session).fetch_all(&pool).await.unwrap();
    assert_eq!(
        events,
        [
            "created",
            "started",
            "server-restarted",
            "resumed",
            "paused",
            "reason-given",
            "resumed",
            "completed",
            "unblinded"
        ]
    );

    let steps = "SELECT count(DISTINCT segment) FROM telemetry WHERE segment IS NOT NULL";
    assert_eq!(sqlx::query_scalar::<_, i64>(steps).fetch_one(&pool).await.unwrap(), 6, "every setting has telemetry");
    pool.close().await;
}

/// The verifier accepts the command's export.
pub fn export(theatre: &Theatre, session: &str) {
    let out = tempfile::tempdir().unwrap();
    let folder = out.path().join("export");
    let export = ["export", session, "--unblinded", "--out", folder.to_str().unwrap(), "--data-dir"];
    let (exported, said) = parfocal(&export, theatre.server.data.path());
    assert!(exported, "{said}");
    let (verified, said) = parfocal(&["verify"], &folder);
    assert!(verified, "{said}");
    let comments = std::fs::read_to_string(folder.join("comments.csv")).unwrap();
    assert!(comments.contains("Follows me well 🧠") && comments.contains("Said while it was away"), "{comments}");
}

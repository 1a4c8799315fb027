//! A study on the pages: planned, opened, used by the operator, closed, locked, unblinded by its statistician.

use std::io::Cursor;

use serde_json::json;
use sha2::{Digest, Sha256};

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::operator;
use super::wait::until;
use crate::http::studies::{act, definition, new_session, server};
use crate::support::{PASSPHRASE, Server};

async fn researcher(driver: &Driver, server: &Server) -> Browser {
    let browser = driver.browser().await;
    browser.open(&server.link("researcher")).await;
    browser
}

/// Enters a reason in the dialog and confirms.
async fn sign(page: &Browser, reason: &str) {
    page.type_into("#reason", reason).await;
    page.click("#reason-go").await;
}

/// The same, with the passphrase.
async fn confirm(page: &Browser, reason: &str, passphrase: &str) {
    page.type_into("#reason", reason).await;
    page.type_into("#passphrase", passphrase).await;
    page.click("#reason-go").await;
}

/// Fills in and sends the page's sign-in form.
async fn sign_in(page: &Browser, name: &str, passphrase: &str) {
    page.type_into("#name", name).await;
    page.type_into("#passphrase", passphrase).await;
    page.click("#sign-in-go").await;
}

/// The operator prepares a session in the study and ends it again.
async fn a_session(operator: &Browser) {
    operator.click("#add-participant").await;
    operator.type_into("#code", "S-01").await;
    operator.click("#participant-dialog [type=submit]").await;
    operator.sees_no("#participant-dialog").await;

    // While a study is open, nothing is selected in advance.
    operator.sees("#study-choice", "Study").await;
    assert_eq!(operator.value("#study").await, "");
    operator.select("#study", "scope-2026/leeds").await;
    operator.select("#protocol", "pair").await;
    assert_eq!(operator.count("#protocol option").await, 2, "“Choose…” and the study’s protocol alone");
    shoot(operator, "operator-11-study").await;

    // The operator's link is not enough: the page asks to sign in, in a dialog, and keeps the selection.
    operator.click("#new-session [type=submit]").await;
    operator.sees("#sign-in-dialog", "Sign in to continue").await;
    shoot(operator, "operator-12-sign-in").await;
    operator.type_into("#sign-in-name", "operator").await;
    operator.type_into("#sign-in-passphrase", PASSPHRASE).await;
    operator.click("#sign-in-dialog [type=submit]").await;
    operator.sees_no("#sign-in-dialog").await;
    operator.sees(".person", "Nurse Op").await;
    assert_eq!(operator.value("#study").await, "scope-2026/leeds");
    let shared = operator.value("#surgeon-link").await;

    operator.click("#new-session [type=submit]").await;
    operator.sees("#phase", "Ready to start").await;
    operator.sees("#link-session", "opens only this session").await;
    until("the link to this session", || async { operator.value("#surgeon-link").await != shared }).await;
    shoot(operator, "operator-13-link").await;
    operator.click_labelled("#session-actions", "Abort").await;
    operator.type_into("#reason", "The light failed").await;
    operator.click("#reason-go").await;
    operator.click_labelled("#session-actions", "Close and prepare").await;
    operator.sees("#new-session", "Prepare session").await;
}

/// Makes and aborts another session in the study, for S-02.
async fn another_session(server: &mut Server) {
    let token = server.sign_in("operator").await;
    server.use_key("operator", &token);
    server.post("/api/operator/participants", json!({"code": "S-02"})).await;
    let made = server.post("/api/operator/sessions", new_session("S-02")).await;
    let session = made["session"].clone();
    act(server, "operator", json!({"session": session, "action": "abort", "reason": "The light failed again"})).await;
    server.post("/api/operator/dismissals", json!({"session": session})).await;
}

/// Exports the unblinded study, whose page is open, with its policies.
async fn export_with_policies(page: &Browser, server: &mut Server) {
    page.click("#export-unblinded").await;
    page.sees("#export-state", "The export with policies is ready: 1 session").await;
    page.sees("#export-ready", "Download the package").await;
    page.sees_no("#export-progress").await;
    shoot(page, "study-5-exported").await;

    let link = page.attribute("#export-download", "href").await.unwrap();
    assert!(page.start_of(&link).await.starts_with("200 PK"));
    let token = server.sign_in("statistician").await;
    server.use_key("researcher", &token);
    let package = server.get_as("researcher", &link).send().await.unwrap().bytes().await.unwrap();
    let package = zip::ZipArchive::new(Cursor::new(package)).unwrap();
    assert!(package.file_names().any(|name| name.unwrap().ends_with("allocation.csv")), "which policy ran is in it");
}

/// Exports the study, whose page is open. The package is still there when the page is opened again.
async fn export(page: &Browser) {
    page.sees_no("#export-ready").await;
    page.click("#export-blinded").await;
    page.sees("#export-ready", "Download the package").await;
    page.reload().await;
    page.sees("#export-state", "The export without policies is ready: 1 session").await;
    page.sees("#export-ready", "Download the package").await;
    page.sees_no("#export-progress").await;
    shoot(page, "study-3-exported").await;
    assert!(page.start_of("/api/researcher/studies/scope-2026/export.zip").await.starts_with("200 PK"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_study_is_led_from_the_pages() {
    let driver = Driver::start();
    let (_protocols, mut server) = server();
    server.add_account("lead", "lead", "Dr Lead");
    server.add_account("operator", "operator", "Nurse Op");
    let operator = operator(&driver, &server).await;
    operator.sees("#new-session", "Prepare session").await;
    operator.sees_no("#study-choice").await;
    // Someone who wants only a single session never reads the word.
    assert!(!operator.text("body").await.to_lowercase().contains("study"));

    let page = researcher(&driver, &server).await;
    page.sees("nav", "Studies").await;
    page.open(&server.url("/researcher/studies")).await;
    page.sees("main", "No studies yet").await;
    page.sees("main", "Sign in to plan a study").await;
    page.click("#sign-in").await;
    sign_in(&page, "lead", "not the passphrase").await;
    page.sees("#sign-in-trouble", "do not match").await;
    shoot(&page, "sign-in-1-refused").await;
    page.clear("#passphrase").await;
    page.type_into("#passphrase", PASSPHRASE).await;
    page.click("#sign-in-go").await;
    page.sees(".person", "Dr Lead").await;
    page.sees("main", "No studies yet").await;
    page.paste("#definition", &definition().replace("spares = 1", "spares = 1000")).await;
    page.type_into("#plan-reason", "Ethics approved it").await;
    page.click("#plan-go").await;
    page.sees("#plan-trouble", "key 'spares': must be from 0 to 500 places, not 1000").await;
    shoot(&page, "study-1-malformed").await;
    // A file from Windows: its hash is that of its bytes, as every other site computes it.
    let text = format!("\u{feff}{}", definition().replace('\n', "\r\n"));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("study.toml");
    std::fs::write(&file, &text).unwrap();
    page.type_into("#file", file.to_str().unwrap()).await;
    until("the file to be shown", || async { page.value("#definition").await.contains("spares = 1\n") }).await;
    page.click("#plan-go").await;

    page.sees("#stage", "planned").await;
    page.sees("main", &hex::encode(Sha256::digest(&text))).await;
    page.sees("main", "Leeds General Infirmary").await;
    page.click("#open").await;
    page.sees("#concerns", "Nobody here could unblind the study").await;
    page.click("#reason-confirmed").await;
    shoot(&page, "study-2-opening").await;
    sign(&page, "The first surgeon comes").await;
    page.sees("#stage", "open").await;
    page.sees("#commitment", "parfocal study scope-2026 definition").await;

    operator.reload().await;
    a_session(&operator).await;

    page.reload().await;
    page.sees("main", "aborted").await;
    shoot(&page, "study-3-open").await;
    assert_eq!(page.count("#export-unblinded").await, 0, "not before the study is unblinded");
    export(&page).await;
    page.click_labelled("td", "Withdraw").await;
    sign(&page, "The surgeon asked for it").await;
    page.sees("td .badge.warn", "withdrawn").await;
    assert_eq!(page.count("#export").await, 0, "no session is left to export");

    // The prepared package still contains that session, so it can no longer be downloaded.
    another_session(&mut server).await;
    page.reload().await;
    page.sees("#export-trouble", "a surgeon has withdrawn").await;
    page.sees_no("#export-ready").await;

    page.click("#close").await;
    sign(&page, "The last surgeon was here").await;
    page.sees("#stage", "closed").await;
    page.click("#lock").await;
    // The tablet may still hold something, so the page requires a confirmation.
    page.sees("#reason-confirm", "Lock anyway").await;
    page.click("#reason-confirmed").await;
    confirm(&page, "The data are complete", "not the passphrase").await;
    page.sees("#reason-trouble", "This is not your passphrase").await;
    shoot(&page, "study-4-passphrase").await;
    page.clear("#passphrase").await;
    page.type_into("#passphrase", PASSPHRASE).await;
    page.click("#reason-go").await;
    page.sees("#stage", "locked").await;

    page.click("#unblind").await;
    confirm(&page, "The analysis begins", PASSPHRASE).await;
    page.sees("#reason-trouble", "'Dr Lead' is not among those who may unblind this study").await;
    shoot(&page, "study-4-refused").await;

    // Another person, whom the definition names, signs in.
    server.add_account("statistician", "lead", "Trial statistician");
    page.click("#reason-dialog [data-close]").await;
    page.click("#sign-out").await;
    page.sees("main", "Sign in").await;
    page.open(&server.url("/sign-in?next=/researcher/studies/scope-2026")).await;
    sign_in(&page, "statistician", PASSPHRASE).await;
    page.click("#unblind").await;
    confirm(&page, "The analysis begins", PASSPHRASE).await;
    page.sees("#stage", "unblinded").await;
    page.sees(".events", "Study unblinded: The analysis begins").await;
    shoot(&page, "study-5-unblinded").await;
    export_with_policies(&page, &mut server).await;

    page.open(&server.url("/researcher")).await;
    page.sees("tbody", "scope-2026").await;
    shoot(&page, "study-6-sessions").await;
    page.click("td a.button").await;
    page.sees(".unblinded", "hill-climber").await;
    page.open(&server.url("/researcher/studies")).await;
    page.sees("tbody", "unblinded").await;
    shoot(&page, "study-7-studies").await;

    for browser in [&page, &operator] {
        assert_eq!(browser.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    }
}

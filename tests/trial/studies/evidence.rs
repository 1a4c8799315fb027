//! Evidence of a study: another program recomputes its commitment, and every change of the drawn orders is found.

use std::path::Path;
use std::process::Command;

use parfocal_records::store::export::export;
use parfocal_records::store::export::verify::{Verdict, verify};
use parfocal_records::store::verify_database;
use serde_json::Value;

use super::*;
use crate::chain::{after, said};
use crate::exports::{failed, json, rows};
use crate::fixture::PARTICIPANT;

/// Runs a study of three sessions to its end, and returns one of the sessions.
async fn unblinded(folder: &Path) -> (Trial, SessionId) {
    let mut trial = opened(folder).await;
    let session = whole(&mut trial, PARTICIPANT, "leeds").await;
    whole(&mut trial, "S-02", "leeds").await;
    whole(&mut trial, "S-03", "london").await;
    to_the_end(&trial).await;
    (trial, session)
}

#[tokio::test]
async fn another_program_computes_the_same_orders_from_the_document_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = unblinded(folder.path()).await;
    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();
    let checks = verify(&out, None);
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert!(said(&checks, "study").unwrap().contains("all orders are those committed to"));

    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/trial/recompute_study.py");
    let output = Command::new("python3").arg(script).arg(&out).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let computed: Value = serde_json::from_slice(&output.stdout).unwrap();

    let events = rows(&out, "study_events");
    assert_eq!(computed["commitment"], events[1]["commitment"]);
    assert_eq!(computed["definition"], rows(&out, "studies")[0]["definition_sha256"]);
    assert_eq!(computed["statement"], json(&out, "allocation.json")["study_statement"]);
    let ran: Vec<String> = rows(&out, "allocation").into_iter().map(|mut row| row.remove("policy").unwrap()).collect();
    assert_eq!(computed["schedule"], ran.join(","));
}

#[tokio::test]
async fn a_list_holds_balanced_sets() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, _) = unblinded(folder.path()).await;
    let mut orders = Vec::new();
    for session in detail(&trial).await.study_sessions.iter().filter(|session| session.site == "leeds") {
        let stored = trial.store.reader().session(session.session).await.unwrap().unwrap();
        orders.push(stored.made.segments.into_iter().map(|(_, policy)| policy.to_string()).collect::<Vec<_>>());
    }
    // A set for two policies consists of one order and its reverse.
    assert_eq!(orders[0].iter().rev().collect::<Vec<_>>(), orders[1].iter().collect::<Vec<_>>());
}

#[tokio::test]
async fn two_databases_draw_different_orders_for_the_same_definition() {
    let one = tempfile::tempdir().unwrap();
    let other = tempfile::tempdir().unwrap();
    let mut lines = Vec::new();
    for (folder, seed) in [(&one, 5), (&other, 6)] {
        let trial = a_trial_from(folder.path(), seed).await;
        plan(&trial, definition()).await.unwrap();
        change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
        let study = detail(&trial).await;
        lines.push((study.definition_sha256, study.commitment_line.unwrap()));
    }
    assert_eq!(lines[0].0, lines[1].0, "the definition has the same hash at every site");
    assert_ne!(lines[0].1, lines[1].1);
}

/// SQL that tampers with a database, the check that must fail, and the text that it must report.
const TAMPERED: [(&str, &str, &str); 14] = [
    (
        "UPDATE studies SET definition = replace(definition, 'surgeons = 2', 'surgeons = 4')",
        "studies",
        "its definition was changed",
    ),
    ("UPDATE studies SET sites = '[\"leeds\"]'", "studies", "its orders, sites or seed were changed"),
    ("UPDATE studies SET sites = '[\"leeds\"]'", "chain", "studies: study scope-2026 was changed"),
    ("UPDATE study_seeds SET seed = printf('%064d', 7)", "studies", "its orders, sites or seed were changed"),
    ("DELETE FROM study_seeds", "studies", "the seed of its orders is missing"),
    (
        "UPDATE study_protocols SET protocol_toml = replace(protocol_toml, 'seconds = 60', 'seconds = 61')",
        "studies",
        "key 'sha256'",
    ),
    (
        "UPDATE study_events SET commitment = 'x' WHERE number = 2",
        "chain",
        "study_events: study-event scope-2026/2 was changed",
    ),
    (
        "UPDATE study_events SET person = 'somebody else' WHERE number = 4",
        "chain",
        "study-event scope-2026/4 was changed",
    ),
    ("UPDATE study_events SET reason = 'another' WHERE number = 5", "chain", "study-event scope-2026/5 was changed"),
    ("DELETE FROM study_events WHERE number = 3", "chain", "study-event scope-2026/3 is missing"),
    ("UPDATE study_sessions SET place = 3 WHERE place = 2", "chain", "study_sessions: study-session"),
    ("UPDATE study_sessions SET place = 3 WHERE place = 2", "studies", "its order is not that of place 3 in its list"),
    ("DELETE FROM study_sessions WHERE site = 'london'", "chain", "study_sessions: study-session"),
    (
        "DELETE FROM study_sessions WHERE site = 'leeds' AND place = 1",
        "studies",
        "has place 2 of the list of leeds, and place 1 was next",
    ),
];

#[tokio::test]
async fn whatever_is_changed_of_a_study_in_a_database_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, _) = unblinded(folder.path()).await;
    trial.store.close().await;
    drop(trial);

    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");
    assert!(
        said(&checks, "studies")
            .unwrap()
            .contains("studies as planned: 1; sessions with the next place and its order: 3")
    );

    let database = folder.path().join("parfocal.db");
    for (sql, check, expected) in TAMPERED {
        let checks = after(&database, sql, None).await;
        let found = said(&checks, check).expect_err(sql);
        assert!(found.contains(expected), "{sql}: {found}");
    }
}

#[tokio::test]
async fn a_place_that_was_given_by_no_rule_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let mut trial = opened(folder.path()).await;
    // Two surgeons are planned in Leeds. The aborted session opens a spare place.
    aborted(&trial, PARTICIPANT, "leeds").await;
    whole(&mut trial, "S-02", "leeds").await;
    let spare = whole(&mut trial, "S-03", "leeds").await;
    trial.store.close().await;
    drop(trial);

    let checks = verify_database(folder.path(), None).await.unwrap();
    assert_eq!(failed(&checks), [""; 0], "{checks:?}");

    let database = folder.path().join("parfocal.db");
    let checks = after(&database, "DELETE FROM events WHERE kind = 'aborted'", None).await;
    let found = said(&checks, "studies").unwrap_err();
    assert!(found.contains(&format!("session {spare} should have been refused")), "{found}");
}

/// File of an unblinded export, the text that is replaced in it, the replacement, and the text that the study's check
/// must report.
const TAMPERED_EXPORT: [(&str, &str, &str, &str); 6] = [
    ("study.toml", "surgeons = 3", "surgeons = 4", "study.toml is not the definition"),
    ("allocation.json", "place 2 ", "place 9 ", "the orders of the study are not those committed to"),
    ("study_sessions.csv", ",1\n", ",2\n", "the session's order is not that of place 2"),
    ("study_sessions.csv", "leeds", "paris", "study.toml has no site 'paris'"),
    ("studies.csv", "scope-2026", "scope-2027", "name different studies"),
    ("protocol.toml", "segment_seconds = 60", "segment_seconds = 61", "protocol.toml is not the version"),
];

#[tokio::test]
async fn whatever_is_changed_of_a_study_in_an_export_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let (trial, session) = unblinded(folder.path()).await;
    let out = folder.path().join("export");
    export(&trial.access_log(), session, &out, true).await.unwrap();

    for (file, from, to, expected) in TAMPERED_EXPORT {
        let path = out.join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file}: {text}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let checks = verify(&out, None);
        let found = checks.iter().find(|check| check.name == "study").unwrap().verdict.clone();
        assert!(matches!(&found, Verdict::Failed(problem) if problem.contains(expected)), "{file} {to}: {found:?}");
        std::fs::write(&path, text).unwrap();
    }
}

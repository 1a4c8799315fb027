//! Plans that cannot work as they are meant: told when planned, and confirmed when opened.

use parfocal_trial::account::AccountRole;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::study::definition::Definition;
use parfocal_trial::study::state::Change;

use super::{STATISTICIAN, a_trial, change, definition, detail, plan};
use crate::fixture::{Trial, known};

/// A server with a planned study.
async fn planned(folder: &std::path::Path, definition: String) -> Trial {
    let trial = a_trial(folder).await;
    plan(&trial, definition).await.unwrap();
    trial
}

#[tokio::test]
async fn a_plan_that_cannot_work_is_told_when_planned_and_confirmed_when_opened() {
    // Three surgeons at one of the sites, for sets of two; and nobody who may unblind has an account.
    let folder = tempfile::tempdir().unwrap();
    let trial = planned(folder.path(), definition()).await;
    let concerns = detail(&trial).await.concerns;
    assert_eq!(concerns.len(), 2, "{concerns:?}");
    assert!(concerns[0].contains("3 surgeons") && concerns[0].contains("Plan 2 or 4 surgeons"), "{concerns:?}");
    assert!(concerns[1].contains("Nobody here could unblind"), "{concerns:?}");

    let refused = change(&trial, Change::Open { despite_concerns: false }).await;
    let said = refused.unwrap_err().to_string();
    assert!(said.contains("3 surgeons") && said.contains("despite_concerns"), "{said}");
    change(&trial, Change::Open { despite_concerns: true }).await.unwrap();
    assert!(detail(&trial).await.concerns.is_empty(), "it is open now");
    change(&trial, Change::Close).await.unwrap();
    change(&trial, Change::Open { despite_concerns: false }).await.unwrap();
}

#[tokio::test]
async fn a_plan_for_whole_sets_with_a_lead_who_unblinds_opens_without_a_word() {
    let whole_sets = definition().replace("surgeons = 3", "surgeons = 4");
    let folder = tempfile::tempdir().unwrap();
    let trial = planned(folder.path(), whole_sets.clone()).await;
    trial.account("statistician", AccountRole::Researcher, STATISTICIAN).await;
    let concerns = detail(&trial).await.concerns;
    assert_eq!(concerns.len(), 1, "a researcher cannot unblind: {concerns:?}");

    let folder = tempfile::tempdir().unwrap();
    let trial = planned(folder.path(), whole_sets).await;
    trial.account("statistician", AccountRole::Lead, STATISTICIAN).await;
    change(&trial, Change::Open { despite_concerns: false }).await.unwrap();
}

#[test]
fn the_template_is_a_definition() {
    let protocol = super::protocol();
    let text = Definition::template(&protocol, "Dr \"Lead\"");
    let read = Definition::parse(&text, "template", &[protocol]).unwrap();
    assert_eq!(read.may_unblind, ["Dr \"Lead\""]);
    assert_eq!(read.sites[0].surgeons % 2, 0);
    assert!(text.contains("# A multiple of 2, so that every order comes equally often."), "{text}");
}

#[test]
fn the_template_for_shuffled_orders_promises_no_balance() {
    let paper = include_str!("../../../trial-protocols/paper.toml");
    let protocol = Protocol::parse(paper, "paper.toml", &known()).unwrap();
    let text = Definition::template(&protocol, "Dr Lead");
    assert!(!text.contains("A multiple of"), "{text}");
    assert!(Definition::parse(&text, "template", &[protocol]).is_ok());
}

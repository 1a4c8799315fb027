//! The leads' page on accounts, and the first sign-in to an account that a lead made.

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use crate::support::{PASSPHRASE, Server};

async fn sign_in(page: &Browser, server: &Server, name: &str, passphrase: &str) {
    page.open(&server.url("/sign-in?next=/researcher/studies")).await;
    page.type_into("#name", name).await;
    page.type_into("#passphrase", passphrase).await;
    page.click("#sign-in-go").await;
}

/// The lead enters their own passphrase in the dialog, and the change is made.
async fn confirm(page: &Browser, seen: &str) {
    page.type_into("#change-passphrase", PASSPHRASE).await;
    page.click("#change-go").await;
    page.sees("#people", seen).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lead_makes_an_account_and_its_person_chooses_a_passphrase() {
    let driver = Driver::start();
    let server = Server::start();
    server.add_account("lead", "lead", "Dr Lead");
    let lead = driver.browser().await;
    sign_in(&lead, &server, "lead", PASSPHRASE).await;
    lead.sees(".person", "Dr Lead").await;
    for page in ["/researcher", "/researcher/studies", "/researcher/dictionary"] {
        lead.open(&server.url(page)).await;
        lead.sees("nav", "People").await;
    }
    lead.open(&server.url("/researcher/accounts")).await;
    lead.sees("#people", "Dr Lead").await;

    lead.type_into("#display", "Dr Ada Lovelace").await;
    lead.type_into("#account", "a.lovelace").await;
    lead.select("#role", "researcher").await;
    lead.type_into("#first", "first day in theatre").await;
    lead.type_into("#make-passphrase", "not the passphrase").await;
    lead.click("#make-go").await;
    lead.sees("#make-trouble", "This is not your passphrase").await;
    shoot(&lead, "people-1-refused").await;
    lead.clear("#make-passphrase").await;
    lead.type_into("#make-passphrase", PASSPHRASE).await;
    lead.click("#make-go").await;
    lead.sees("#people", "chooses a passphrase next").await;

    let person = driver.browser().await;
    sign_in(&person, &server, "a.lovelace", "first day in theatre").await;
    person.sees("#sign-in-trouble", "Choose one that only you know").await;
    shoot(&person, "sign-in-2-choose").await;
    person.type_into("#new-passphrase", "analytical engine").await;
    person.type_into("#new-again", "analytical engines").await;
    person.click("#sign-in-go").await;
    person.sees("#sign-in-trouble", "The two new passphrases differ").await;
    person.clear("#new-again").await;
    person.type_into("#new-again", "analytical engine").await;
    person.click("#sign-in-go").await;
    person.sees(".person", "Dr Ada Lovelace").await;
    for page in ["/researcher", "/researcher/studies", "/researcher/dictionary"] {
        person.open(&server.url(page)).await;
        assert!(!person.text("nav").await.contains("People"), "the page is for leads");
    }

    lead.reload().await;
    lead.sees("#people", "in use").await;
    lead.click("[data-account='a.lovelace'] [data-change=role]").await;
    lead.sees("#change-heading", "Change the role of Dr Ada Lovelace").await;
    assert_eq!(lead.value("#change-role").await, "researcher");
    lead.select("#change-role", "monitor").await;
    shoot(&lead, "people-2-role").await;
    confirm(&lead, "monitor").await;
    lead.click("[data-account='a.lovelace'] [data-change=disable]").await;
    confirm(&lead, "disabled").await;
    shoot(&lead, "people-3-disabled").await;

    // The last lead cannot be disabled.
    lead.click("[data-account=lead] [data-change=disable]").await;
    lead.type_into("#change-passphrase", PASSPHRASE).await;
    lead.click("#change-go").await;
    lead.sees("#change-trouble", "the last lead who can sign in").await;
    lead.click("#change-dialog [data-close]").await;

    person.reload().await;
    person.sees("body", "Sign in").await;

    // A device must not be left behind that only seems to be signed out.
    drop(server);
    lead.click("#sign-out").await;
    lead.sees("#sign-out-trouble", "You are still signed in").await;
    shoot(&lead, "people-4-still-signed-in").await;

    for browser in [&lead, &person] {
        assert_eq!(browser.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    }
}

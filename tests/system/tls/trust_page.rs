//! The page about trusting the server, in browsers that trust it and in those that do not.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};
use x509_parser::parse_x509_certificate;

use super::client::certificate;
use super::trust::Trust;
use crate::browser::driver::{Browser, Driver};
use crate::browser::screenshots::shoot;
use crate::support::{BRAIN, Server};

/// The Chromium option that makes it trust the server's key. It replaces the steps on a device, which a test cannot
/// perform.
async fn trusting(server: &Server) -> String {
    let stream = Trust::of(server, &["h2"]).connect(server.address, "127.0.0.1").await.unwrap();
    let shown = certificate(&stream);
    let (_, read) = parse_x509_certificate(&shown).unwrap();
    format!("--ignore-certificate-errors-spki-list={}", STANDARD.encode(Sha256::digest(read.public_key().raw)))
}

async fn open_trust_page(browser: &Browser, server: &Server) {
    browser.open(&format!("http://{}/trust", server.address)).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_device_that_does_not_trust_the_server_gets_the_steps_and_one_that_does_continues() {
    let server = Server::encrypted();
    let driver = Driver::start();

    let stranger = driver.browser().await;
    open_trust_page(&stranger, &server).await;
    stranger.sees("#check", "Not yet.").await;
    stranger.sees("#steps-linux", "chrome://certificate-manager").await;
    stranger.sees_no("#go-on").await;
    shoot(&stranger, "trust-not-yet").await;

    let trusting = driver.browser_with(&[trusting(&server).await]).await;
    open_trust_page(&trusting, &server).await;
    trusting.sees("#check", "Yes, this device trusts the server.").await;
    shoot(&trusting, "trust-done").await;
    assert_eq!(trusting.complaints().await, Vec::<String>::new());

    // The link leads to the encrypted pages, with the operator's cookie.
    trusting.open(&server.link("operator")).await;
    trusting.sees("#trust-link", &format!("http://{}/trust", server.address)).await;
    trusting.sees("#fingerprint", ":").await;
    shoot(&trusting, "operator-encrypted").await;

    open_trust_page(&trusting, &server).await;
    trusting.click("#go-on").await;
    trusting.sees("h1", "Operator").await;
    assert_eq!(trusting.run("return isSecureContext && location.protocol", &[]).await, "https:");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_live_view_runs_encrypted() {
    let server = Server::with(&["--bind", "127.0.0.1:0", "--tls", "--camera", BRAIN]);
    let driver = Driver::start();
    let tablet = driver.browser_with(&[trusting(&server).await]).await;
    tablet.open(&server.link("surgeon")).await;
    crate::browser::wait::until("a picture", || async { tablet.brightness().await > 20.0 }).await;
    assert_eq!(tablet.complaints().await, Vec::<String>::new());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_has_gone_is_not_called_untrusted() {
    let mut server = Server::encrypted();
    let driver = Driver::start();
    let tablet = driver.browser().await;
    open_trust_page(&tablet, &server).await;
    tablet.sees("#check", "Not yet.").await;

    assert!(server.end(rustix::process::Signal::TERM));
    tablet.click("#check-again").await;
    tablet.sees("#check", "The server does not answer.").await;
}

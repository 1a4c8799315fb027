//! The operator reads whether everything is ready for a trial, and checks again after the tablet connects.

use super::driver::Driver;
use super::screenshots::shoot;
use super::theatre::operator;
use super::wait::until;
use crate::support::Server;

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_reads_whether_everything_is_ready() {
    let driver = Driver::start();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "5"]);
    let operator = operator(&driver, &server).await;
    operator.sees("#checks-open", "No surgeon's page is open.").await;
    operator.sees("#checks-open", "Scan the code").await;
    operator.sees("#checks-passed", "checks passed").await;
    shoot(&operator, "operator-11-checks").await;

    operator.click("#checks-details summary").await;
    operator.sees("#checks-well", "can be written, and is closed to other users").await;
    shoot(&operator, "operator-12-checks-open").await;

    let tablet = driver.browser().await;
    tablet.open(&server.link("surgeon")).await;
    until("the tablet is ready", || async {
        operator.try_click("#check-again").await;
        operator.text("#checks-well").await.contains("The surgeon's page is open in Chrome on Linux")
    })
    .await;
    assert_eq!(operator.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
}

//! The analysis of a study in a browser: reached from the study's page, read on the screen, printed.

use serde_json::json;

use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use crate::http::analysis::{STUDY, Study};
use crate::support::PASSPHRASE;

/// Number of paper pages when the open page is printed.
async fn printed_pages(page: &Browser) -> usize {
    use base64::Engine;
    let printed = page.tools("Page.printToPDF", json!({ "preferCSSPageSize": true })).await;
    let pdf = base64::prelude::BASE64_STANDARD.decode(printed["data"].as_str().unwrap()).unwrap();
    assert!(pdf.starts_with(b"%PDF-"));
    // The counts in the document: of all its pages, and of branches of its page tree.
    let text = String::from_utf8_lossy(&pdf);
    let number = |text: &str| text.chars().take_while(char::is_ascii_digit).collect::<String>().parse().ok();
    text.split("/Count ").skip(1).filter_map(number).max().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_analysis_is_reached_from_the_studys_page_and_prints() {
    let study = Study::run().await;
    study.change("unblind").await;

    let driver = Driver::start();
    let page = driver.browser().await;
    let path = format!("/researcher/studies/{STUDY}");
    page.open(&study.server.url(&format!("/sign-in?next={path}"))).await;
    page.type_into("#name", "statistician").await;
    page.type_into("#passphrase", PASSPHRASE).await;
    page.click("#sign-in-go").await;
    page.sees("#stage", "unblinded").await;
    page.click("a[href$='/analysis']").await;

    page.sees(".glance", "How sharp was the picture?").await;
    page.sees("#analysis", "from the records up to").await;
    let outcomes = page.count(".outcome").await;
    assert_eq!(page.count(".glance tbody tr").await, outcomes);
    assert_eq!(page.count(".figure svg").await, outcomes);
    page.sees(".words", "S-01 sees <FIXED> for the 2. time").await;
    shoot(&page, "study-8-analysis").await;

    let pages = printed_pages(&page).await;
    assert!(pages > outcomes && pages < 2 * outcomes + 4, "an outcome a page: {pages} pages of {outcomes} outcomes");
    assert_eq!(page.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
}

//! Every instrument on a tablet, behind a required consent; then a researcher corrects, notes, erases and records a
//! withdrawal.

use serde_json::json;

use super::blinding;
use super::driver::{Browser, Driver};
use super::screenshots::shoot;
use super::theatre::Theatre;
use super::wait::until;

/// Marks the line that `css` selects at `fraction` of its length, by a sliding touch.
async fn mark(page: &Browser, css: &str, fraction: f64) {
    page.show(css).await;
    let rail = page.area(&format!("{css} .rail")).await;
    let y = rail.top + rail.height / 2.0;
    let from = rail.left + rail.width * 0.5;
    let to = rail.left + rail.width * fraction;
    for (kind, x) in
        [("mousePressed", from), ("mouseMoved", f64::midpoint(from, to)), ("mouseMoved", to), ("mouseReleased", to)]
    {
        let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
        page.tools("Input.dispatchMouseEvent", event).await;
    }
}

/// Selects point `point` of the scale called `name`, after scrolling to it as a surgeon does: the row with the button
/// that goes on may lie over it, and the driver does not scroll to what is covered.
pub async fn choose_in_view(theatre: &Theatre, name: &str, point: u8) {
    theatre.surgeon.show(&format!("input[name='{name}'][value='{point}']")).await;
    theatre.choose(name, point).await;
}

fn state(question: &str) -> String {
    format!("[data-question={question}] > .state")
}

/// The operator prepares a session. It cannot start before the consent is recorded.
pub async fn prepare(theatre: &Theatre) {
    let operator = &theatre.operator;
    operator.click("#add-participant").await;
    operator.type_into("#code", "S-31").await;
    operator.click("#participant-dialog [type=submit]").await;
    operator.sees_no("#participant-dialog").await;
    operator.select("#protocol", "instruments").await;
    operator.click("#new-session [type=submit]").await;
    operator.sees("#consent", "requires the participant’s consent to version 2.1").await;
    assert!(!operator.text("#session-actions").await.contains("Start"));

    operator.click_labelled("#session-actions", "Record consent").await;
    operator.type_into("#consent-by", "KM").await;
    assert_eq!(operator.value("#consent-version").await, "2.1");
    shoot(operator, "operator-12-consent").await;
    operator.click("#consent-dialog [type=submit]").await;
    operator.sees("#consent", "Consent to version 2.1 of the text, on paper").await;
    operator.click_labelled("#session-actions", "Start").await;
}

/// Answers the questions after the first setting; half of them are answered before the page is reloaded.
async fn first_setting(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(1).await;
    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    assert_eq!(surgeon.count(".track.marked").await, 0, "no line has a mark of its own");

    mark(surgeon, "[data-question=effort]", 0.0).await;
    surgeon.sees(&state("effort"), "Saved").await;
    assert_eq!(surgeon.attribute("[data-question=effort] .track", "aria-valuenow").await.as_deref(), Some("0"));
    choose_in_view(theatre, "how-often", 3).await;
    surgeon.sees(&state("how-often"), "Saved").await;
    for (scale, fraction) in [(1, 0.3), (2, 0.15), (3, 0.6)] {
        mark(surgeon, &format!("[data-question=workload] fieldset:nth-child({scale})"), fraction).await;
    }
    surgeon.sees(&state("workload"), "3 of 6 answered · Saved").await;

    surgeon.reload().await;
    surgeon.sees(&state("workload"), "3 of 6 answered · Saved").await;
    assert_eq!(surgeon.count("[data-question=workload] .track.marked").await, 3);
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#missing", "One question is still open.").await;
    surgeon.sees("[data-question=workload] fieldset:nth-child(4) .gap", "Not answered yet").await;
    shoot(surgeon, "surgeon-17-workload").await;

    for (scale, fraction) in [(4, 0.4), (5, 0.3), (6, 0.35)] {
        mark(surgeon, &format!("[data-question=workload] fieldset:nth-child({scale})"), fraction).await;
    }
    surgeon.sees(&state("workload"), "Saved").await;
    // From 35 to 40 by the button beside the line.
    surgeon.click("[data-question=workload] fieldset:nth-child(6) .step:last-child").await;
    until("the button to move the mark", || async {
        surgeon.attribute("[data-question=workload] fieldset:nth-child(6) .track", "aria-valuetext").await.as_deref()
            == Some("40 of 100")
    })
    .await;
    surgeon.show("[data-question=effort]").await;
    shoot(surgeon, "surgeon-18-instruments").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees_no("[data-question=effort]").await;
}

async fn second_setting(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(2).await;
    theatre.say("Frau Mustermann bleeds", 1).await;
    theatre.say("The edge is sharp now", 2).await;
    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    mark(surgeon, "[data-question=effort]", 0.75).await;
    choose_in_view(theatre, "how-often", 5).await;
    for scale in 1..=6 {
        mark(surgeon, &format!("[data-question=workload] fieldset:nth-child({scale})"), 1.0).await;
    }
    surgeon.sees(&state("workload"), "Saved").await;
    choose_in_view(theatre, "seen-before", 3).await;
    surgeon.sees(&state("seen-before"), "Saved").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees_panel("Final questions").await;
}

async fn closing(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    for (scale, fraction) in [(1, 0.3), (2, 0.15), (3, 0.6), (4, 0.4), (5, 0.3), (6, 0.4)] {
        mark(surgeon, &format!("[data-question=surgical-workload] fieldset:nth-child({scale})"), fraction).await;
    }
    for pair in 6..21 {
        choose_in_view(theatre, &format!("surgical-workload-{pair}"), 1).await;
    }
    surgeon.sees(&state("surgical-workload"), "Saved").await;
    shoot(surgeon, "surgeon-19-pairs").await;
    for setting in 0..2 {
        choose_in_view(theatre, &format!("preference-{setting}"), 1).await;
    }
    surgeon.sees(&state("preference"), "Saved").await;
    shoot(surgeon, "surgeon-20-places").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#panel h2", "Thank you").await;
}

/// The researcher changes the records, in the operator's browser.
async fn researcher(theatre: &Theatre) {
    let page = &theatre.operator;
    page.open(&theatre.server.link("researcher")).await;
    page.click("td a.button").await;
    page.sees(".answers", "Raw TLX 35.8").await;
    page.sees(".closing", "Weighted SURG-TLX 33.3").await;
    page.sees(".consents", "obtained by KM").await;

    page.click("#correct-answer").await;
    page.sees("#correct-which", "Setting 1: How much did the focus distract you?").await;
    page.paste("#correct-new", "12").await;
    page.type_into("#correct-reason", "the hand slipped").await;
    shoot(page, "researcher-6-correcting").await;
    page.click("#correct-dialog [type=submit]").await;
    page.sees(".corrections", "the hand slipped").await;
    page.sees(".answers ins", "12").await;

    page.click_labelled("#comment-list", "Note").await;
    page.type_into("#correct-new", "Said of Frau Mustermann's bed").await;
    page.type_into("#correct-reason", "for the analysis").await;
    page.click("#correct-dialog [type=submit]").await;
    page.sees("#comment-list .note", "Said of Frau Mustermann's bed").await;
    page.to_top().await;
    shoot(page, "researcher-7-corrected").await;

    page.click_labelled("#comment-list", "Erase").await;
    page.type_into("#reason", "names a patient").await;
    shoot(page, "researcher-8-erasing").await;
    page.click("#reason-go").await;
    page.sees("#comment-list", "Erased on").await;
    assert!(!page.text("main").await.contains("Mustermann"));
    for file in std::fs::read_dir(theatre.server.data.path()).unwrap() {
        let bytes = std::fs::read(file.unwrap().path()).unwrap();
        assert!(!bytes.windows(10).any(|window| window == b"Mustermann"));
    }

    page.click("#withdraw").await;
    page.type_into("#reason", "wants no part in it").await;
    page.click("#reason-go").await;
    page.sees("main", "no longer shown, analysed or exported").await;
    page.sees("#words-left", "Texts that are still in the database: 1").await;
    for gone in ["#timeline", "#comment-list", ".answers", ".closing"] {
        assert_eq!(page.count(gone).await, 0, "{gone}");
    }
    assert!(!page.text(".corrections").await.contains("the hand slipped"), "nor what was put right in an answer");
    page.to_top().await;
    shoot(page, "researcher-9-withdrawn").await;

    page.click("#erase-all").await;
    page.type_into("#reason", "the participant asks for it").await;
    page.click("#reason-go").await;
    page.sees("#words-left", "No words of this session are left").await;

    page.click_labelled(".events", "Erase reason…").await;
    page.type_into("#reason", "it says why somebody left").await;
    page.click("#reason-go").await;
    page.sees(".events", "it says why somebody left").await;
    assert!(!page.text("main").await.contains("wants no part"));

    let session = page.attribute("#session", "data-session").await.unwrap();
    assert_eq!(page.start_of(&format!("/api/researcher/sessions/{session}/export.zip")).await, "409 {\"");
    page.open(&theatre.server.url("/researcher")).await;
    page.sees("tbody", "withdrawn").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_instrument_is_answered_on_a_tablet_and_its_records_are_put_right() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    prepare(&theatre).await;
    first_setting(&theatre).await;
    second_setting(&theatre).await;
    closing(&theatre).await;
    let latest = "SELECT json_group_array(value) FROM answers WHERE question = 'preference' OR question = 'effort'";
    theatre.keeps(latest, &[r#"["0","75","[1,0]","[0,1]"]"#]).await;
    researcher(&theatre).await;
    assert_eq!(theatre.surgeon.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    assert_eq!(theatre.operator.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
    let seen = blinding::check(&theatre.proxy.recorded());
    assert_eq!(seen.segments.len(), 2);
}

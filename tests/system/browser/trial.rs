//! The whole trial: six settings with everything that happens in a theatre, then the researcher, the database, the
//! export, and a check of what reached the surgeon's browser.

use super::aftermath::{database, export, researcher};
use super::blinding;
use super::driver::Driver;
use super::instruments::choose_in_view;
use super::screenshots::{resize, shoot};
use super::theatre::{Theatre, kill, start_again};
use super::wait::until;

/// Bytes of a comment that no request carries. Not much more: Chromium takes 10 s for each change of a box with a
/// million letters.
const TOO_LONG: usize = 300_000;

#[tokio::test(flavor = "multi_thread")]
async fn a_surgeon_completes_a_blinded_trial() {
    let driver = Driver::start();
    let mut theatre = Theatre::seeing(&driver).await;
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
    assert!(seen.files.contains("surgeon/page.js") && seen.files.contains("shared/style.css"), "{:?}", seen.files);
}

/// The operator adds a participant and prepares and starts a session; the surgeon waits.
async fn prepare(theatre: &Theatre) {
    let operator = &theatre.operator;
    let surgeon = &theatre.surgeon;
    surgeon.sees("#panel", "No trial is under way").await;
    surgeon.sees("#simulated", "Simulated camera and lens").await;
    operator.sees("#warnings", "Simulated camera and lens").await;
    until("a picture", || async { surgeon.is(".viewer-stale", "hidden").await }).await;
    shoot(surgeon, "surgeon-1-no-session").await;
    shoot(operator, "operator-1-no-session").await;

    operator.click("#add-participant").await;
    operator.type_into("#code", "anna").await;
    operator.click("#participant-dialog [type=submit]").await;
    assert!(operator.fails("#code", "patternMismatch").await);
    operator.clear("#code").await;
    operator.type_into("#code", "S-01").await;
    shoot(operator, "operator-2-participant").await;
    operator.click("#participant-dialog [type=submit]").await;
    operator.sees_no("#participant-dialog").await;

    operator.select("#protocol", "short").await;
    operator.sees("#protocol-summary", "6 settings").await;
    operator.prepare_session().await;
    surgeon.sees("#panel", "You will look at 6 settings").await;
    shoot(surgeon, "surgeon-2-ready").await;
    operator.click("#session-actions .primary").await;
    surgeon.sees("#change-title", "Setting 1 of 6").await;
    surgeon.sees("#change-what", "This is the first setting.").await;
    shoot(surgeon, "surgeon-3-notice").await;
}

async fn first_setting_typed_comments(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    surgeon.type_into("#change-tap", "\u{e00c}").await; // Escape: the notice stays
    theatre.tap_notice(1).await;

    theatre.say("Follows me well 🧠", 1).await;
    theatre.say("Loses the fissure", 2).await;
    surgeon.sees("#prompt", "How does the focus feel now?").await;

    shoot(surgeon, "surgeon-4-inspecting").await;

    // An upright tablet, and the same with its keyboard open.
    resize(surgeon, 820, 1180).await;
    let without = surgeon.area("#comment").await.width;
    resize(surgeon, 820, 780).await;
    let with = surgeon.area("#comment").await.width;
    assert!(without > 550.0 && with >= without, "above the keyboard there is as much room to write: {with}, {without}");
    resize(surgeon, 1180, 820).await;

    // The operator reads along, and sees nothing of policy or timing.
    theatre.operator.sees("#comments", "Follows me well 🧠").await;
    theatre.operator.sees("#phase", "Setting 1 of 6: inspecting").await;
    theatre.operator.sees("#traces-hidden", "hidden while a session runs").await;
    theatre.operator.sees("#devices", "timing hidden").await;
    let shown = theatre.operator.property("#policy option:checked", "text").await;
    assert_eq!(shown.as_deref(), Some("Hidden during a session"));
    shoot(&theatre.operator, "operator-3-inspecting").await;

    // Not every question is answered at the first try.
    theatre.finish().await;
    surgeon.sees_panel("a few questions").await;
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#missing", "One question is still open").await;
    surgeon.sees("[data-question=sharpness] > .state", "Not answered yet").await;

    theatre.choose("sharpness", 3).await;
    theatre.choose("sharpness", 5).await;
    surgeon.click("[data-question=remarks] textarea").await;
    surgeon.type_into("[data-question=remarks] textarea", "Good at rest").await;

    shoot(surgeon, "surgeon-5-questions").await;
    surgeon.tap_in_panel(".questions .done button").await;
}

async fn second_setting_quick_comments_and_double_taps(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(2).await;

    surgeon.double_click("#quick button:nth-child(3)").await;
    surgeon.double_click("#mark").await;
    theatre.sees_saved(4).await;

    surgeon.double_click("#finish").await;
    surgeon.sees("#finish", "Tap again to finish").await;
    surgeon.sees("#finish-heard", "Tap again to finish").await;
    shoot(surgeon, "surgeon-14-finish").await;

    surgeon.sees("#finish", "Done with this setting").await;
    surgeon.sees("#remaining", "left").await;
    theatre.finish_setting(2).await;
}

async fn third_setting_reload_and_second_tab(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(3).await;

    theatre.write("Half a thought").await;
    surgeon.reload().await;
    surgeon.sees("#setting", "Setting 3 of 6").await;
    until("the draft to be back", || async { theatre.comment_box().await == "Half a thought" }).await;

    let first = surgeon.new_tab(&format!("http://{}/surgeon", theatre.proxy.address)).await;
    surgeon.sees("#setting", "Setting 3 of 6").await;
    theatre.finish().await;
    surgeon.sees("#panel h2", "Setting 3: a few questions").await;

    surgeon.close_tab(&first).await;
    // The stale tab catches up by itself, and its draft is still about setting 3.
    surgeon.sees("#panel h2", "Setting 3: a few questions").await;
    assert_eq!(theatre.comment_box().await, "Half a thought");

    theatre.say(", whole", 5).await;
    theatre.answer_questions(6).await;
}

async fn fourth_setting_too_long_a_comment(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(4).await;

    let picture = theatre.picture().await;
    surgeon.paste("#comment", &"x".repeat(TOO_LONG)).await;
    surgeon.click("#send").await;
    surgeon.sees("#comment-trouble", "is back in the box: This text is too long").await;
    assert_eq!(theatre.comment_box().await.len(), TOO_LONG);
    assert_eq!(theatre.picture().await, picture, "neither a long comment nor a message moves the picture");

    let colours = surgeon.area(".viewer-colour").await;
    assert!(colours.height > 0.0 && colours.bottom() <= picture.top, "nothing about the colours lies on the tissue");

    shoot(surgeon, "surgeon-15-long-comment").await;
    surgeon.reload().await;
    surgeon.sees("#setting", "Setting 4 of 6").await;
    until("the paste to be back", || async { theatre.comment_box().await.len() == TOO_LONG }).await;

    surgeon.paste("#comment", "Shortened").await;
    surgeon.click("#send").await;
    theatre.sees_saved(6).await;
    theatre.finish_setting(4).await;
}

async fn fifth_setting_killed_server(theatre: &mut Theatre) {
    theatre.tap_notice(5).await;
    theatre.say("Saved before the crash", 7).await;
    let picture = theatre.picture().await;

    kill(&mut theatre.server);
    theatre.write("Said while it was away").await;
    theatre.surgeon.click("#send").await;
    theatre.surgeon.sees("#comment-state", "Saved here").await;

    theatre.surgeon.click("#finish").await;
    until("the server not to answer", || async {
        theatre.surgeon.try_click("#finish").await;
        theatre.surgeon.text("#trouble").await.contains("does not answer")
    })
    .await;

    theatre.surgeon.sees("#view .viewer-stale", "Not live").await;
    theatre.surgeon.sees("#now", "No server since").await;
    assert_eq!(theatre.picture().await, picture, "what the page says of the connection does not move the picture");

    let edge = theatre.surgeon.area("#quick").await;
    let cut = theatre.surgeon.areas("#quick button").await.into_iter();
    let cut = cut.filter(|each| each.right() > edge.right() + 1.0 || each.bottom() > edge.bottom() + 1.0);
    assert_eq!(cut.count(), 0, "every quick comment can be tapped without a connection");

    let prompt = theatre.surgeon.style("#prompt", "visibility").await;
    assert_eq!(prompt, "hidden", "the prompt gives way to the warning");

    shoot(&theatre.surgeon, "surgeon-6-no-connection").await;

    start_again(&mut theatre.server);
    theatre.surgeon.sees("#panel h2", "Paused").await;
    theatre.surgeon.sees_no("#trouble:not(:empty)").await;
    theatre.sees_saved(8).await;
    theatre.surgeon.sees("#panel", "Everything you said is saved.").await;
    shoot(&theatre.surgeon, "surgeon-7-restarted").await;

    theatre.surgeon.tap_in_panel("#panel button").await;
    theatre.surgeon.sees_no("#panel").await;
    theatre.surgeon.sees("#setting", "Setting 5 of 6").await;
    theatre.finish_setting(7).await;
}

async fn sixth_setting_paused_and_ended_by_the_operator(theatre: &Theatre) {
    let operator = &theatre.operator;
    let surgeon = &theatre.surgeon;
    theatre.tap_notice(6).await;
    operator.sees("#phase", "Setting 6 of 6: inspecting").await;

    // One tap pauses. Why can be told afterwards.
    operator.click_labelled("#session-actions", "Pause").await;
    surgeon.sees("#panel", "The operator has paused the session").await;
    shoot(surgeon, "surgeon-8-paused").await;
    operator.sees("#log", "Paused").await;

    operator.sees("#pause-reason-label", "Why you paused at").await;
    operator.type_into("#pause-reason", "The lamp was moved").await;
    shoot(operator, "operator-4-reason").await;
    operator.click("#reason-wanted [type=submit]").await;
    operator.sees("#log", ": The lamp was moved").await;
    operator.sees_no("#reason-wanted").await;

    operator.click("#session-actions .primary").await;
    surgeon.sees_no("#panel").await;

    operator.sees("#session-actions", "End setting 6 now").await;
    operator.click_labelled("#session-actions", "End setting").await;
    operator.sees("#reason-heading", "End setting 6 now").await;
    operator.sees_no("#reason").await;
    shoot(operator, "operator-11-end-setting").await;

    operator.click("#reason-go").await;
    theatre.answer_questions(1).await;
}

async fn closing_questions(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    surgeon.sees_panel("Final questions").await;
    shoot(surgeon, "surgeon-9-closing").await;

    // A ranking counts when it is confirmed; until then it is kept on the device, also over a reload.
    // It begins in an order drawn by lot. Each setting put first turns it into one that is known.
    for setting in [6, 4, 5, 3, 2, 1] {
        let top = format!("[aria-label='Put setting {setting} first']");
        until("the setting to be first", || async {
            surgeon.show(&top).await;
            surgeon.try_click(&top).await;
            surgeon.text(".ranking li:first-child").await.contains(&format!("Setting {setting}"))
        })
        .await;
    }
    for way in ["up", "down"] {
        let arrow = format!("[aria-label='Move setting 4 {way}']");
        surgeon.show(&arrow).await;
        surgeon.click(&arrow).await;
    }
    surgeon.sees("[data-question=preference] > .state", "Kept on this device until you tap").await;
    surgeon.reload().await;
    surgeon.sees(".ranking li:nth-child(4)", "Setting 5").await;
    surgeon.sees(".ranking li:first-child .said", "“").await;
    surgeon.show("[data-question=preference] .confirm").await;
    surgeon.tap_in_panel("[data-question=preference] .confirm").await;
    surgeon.sees("[data-question=preference] > .state", "Saved").await;

    half_a_questionnaire_on_a_second_tablet(theatre).await;

    surgeon.click("[data-question=closing-remarks] textarea").await;
    surgeon.type_into("[data-question=closing-remarks] textarea", "That it stays still").await;
    surgeon.tap_in_panel(".questions .done button").await;

    surgeon.sees("#panel h2", "Thank you").await;
    shoot(surgeon, "surgeon-10-completed").await;
    theatre.operator.sees("#phase", "Completed").await;
    shoot(&theatre.operator, "operator-5-completed").await;
}

/// Each item is stored when it is given: also over a reload, and together with those from another tab.
async fn half_a_questionnaire_on_a_second_tablet(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    let give = async |items: std::ops::Range<usize>| {
        for (item, point) in [4, 2, 3, 1, 4, 3, 2, 2, 4, 2].into_iter().enumerate().take(items.end).skip(items.start) {
            choose_in_view(theatre, &format!("usability-{item}"), point).await;
        }
    };

    let state = "[data-question=usability] > .state";

    give(0..4).await;
    surgeon.sees(state, "4 of 10 answered · Saved").await;
    surgeon.reload().await;
    surgeon.sees(state, "4 of 10 answered · Saved").await;

    // The page scrolls to the first item without an answer.
    surgeon.tap_in_panel(".questions .done button").await;
    surgeon.sees("#missing", "2 questions are still open").await;
    surgeon.sees(".sus fieldset:nth-child(5) .gap", "Not answered yet").await;
    assert_eq!(surgeon.text(".sus fieldset:nth-child(4) .gap").await, "");

    let item = surgeon.area(".sus fieldset:nth-child(5)").await;
    let panel = surgeon.area("#panel").await;
    let is_seen = item.top >= panel.top && item.bottom() <= panel.bottom();
    assert!(is_seen, "the first item without an answer is on screen");
    shoot(surgeon, "surgeon-16-missing").await;

    let first = surgeon.new_tab(&format!("http://{}/surgeon", theatre.proxy.address)).await;
    surgeon.sees(state, "4 of 10 answered").await;
    give(4..9).await;
    surgeon.sees(state, "9 of 10 answered · Saved").await;

    surgeon.close_tab(&first).await;
    surgeon.sees(state, "9 of 10 answered").await;
    give(9..10).await;
    surgeon.sees(state, "Saved").await;

    let chosen = surgeon.values(".sus input:checked").await;
    assert_eq!(chosen, ["4", "2", "3", "1", "4", "3", "2", "2", "4", "2"]);
}

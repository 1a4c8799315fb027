//! The surgeon's page in the surgeon's language: whole trials, upright and across and with text of twice the size; what
//! a tablet reads before and after, and without a network; and texts that are written from right to left.

use super::driver::{Browser, Driver};
use super::large_text::look;
use super::screenshots::{resize, shoot};
use super::theatre::{Theatre, kill};
use super::wait::until;

/// What the surgeon's page says in a language, at places of different origin: the page's template, its scripts, plural
/// forms, the server.
struct Spoken {
    protocol: &'static str,
    code: &'static str,
    picture: &'static str,
    ready: &'static str,
    notice: &'static str,
    left: &'static str,
    hold: &'static str,
    placeholder: &'static str,
    saved: &'static str,
    paused: &'static str,
    go_on: &'static str,
    questions: &'static str,
    closing: &'static str,
    ended: &'static str,
    idle: &'static str,
    refused: &'static str,
    closing_items: &'static [(&'static str, &'static str)],
}

const GERMAN: Spoken = Spoken {
    protocol: "german",
    code: "de",
    picture: "Livebild",
    ready: "Sie werden 2 Einstellungen nacheinander ansehen.",
    notice: "Einstellung 1 von 2",
    left: "noch ",
    hold: "Fokus halten",
    placeholder: "Schreiben Sie, was Sie sehen",
    saved: "1 Kommentar gespeichert",
    paused: "Sie haben die Sitzung pausiert.",
    go_on: "Weiter",
    questions: "Einstellung 1: einige Fragen",
    closing: "Letzte Fragen",
    ended: "Die Sitzung wurde beendet",
    idle: "Es läuft kein Versuch.",
    refused: "Dieser Link gilt nicht oder nicht mehr.",
    closing_items: &[
        ("[data-question=workload] legend", "Ihre Belastung"),
        ("[data-question=workload] fieldset:nth-child(2) legend", "Körperliche Anforderung"),
        ("[data-question=usability] fieldset:nth-child(2) legend", "2. Ich empfinde das System als unnötig komplex."),
        ("[data-question=preference] .confirm", "Diese Reihenfolge stimmt"),
        ("[data-question=seen-before] .points", "Unsicher"),
    ],
};

const FRENCH: Spoken = Spoken {
    protocol: "french",
    code: "fr",
    picture: "Image en direct",
    ready: "Vous regarderez 2 réglages, l’un après l’autre.",
    notice: "Réglage 1 sur 2",
    left: "reste ",
    hold: "Figer la netteté",
    placeholder: "Écrivez ce que vous voyez",
    saved: "1 commentaire enregistré",
    paused: "Vous avez mis la séance en pause.",
    go_on: "Continuer",
    questions: "Réglage 1 : quelques questions",
    closing: "Dernières questions",
    ended: "La séance a été arrêtée",
    idle: "Aucun essai n’est en cours.",
    refused: "Ce lien n’est pas valable, ou ne l’est plus.",
    closing_items: &[
        ("[data-question=usability] fieldset:nth-child(2) legend", "2. Ce système est inutilement complexe"),
        ("[data-question=preference] .place", "1er, le meilleur"),
    ],
};

const SPANISH: Spoken = Spoken {
    protocol: "spanish",
    code: "es",
    picture: "Imagen en directo",
    ready: "Verá 2 ajustes, uno tras otro.",
    notice: "Ajuste 1 de 2",
    left: "quedan ",
    hold: "Mantener enfoque",
    placeholder: "Escriba lo que ve",
    saved: "1 comentario guardado",
    paused: "Ha puesto la sesión en pausa.",
    go_on: "Continuar",
    questions: "Ajuste 1: unas preguntas",
    closing: "Preguntas finales",
    ended: "La sesión se ha interrumpido",
    idle: "No hay ningún ensayo en curso.",
    refused: "Este enlace no es válido o ya no lo es.",
    closing_items: &[("[data-question=preference] .about", "Dé un puesto a cada ajuste.")],
};

/// Taps `css`, and again, until `shown` appears: the page ignores taps right after something has come under the finger.
async fn tap_until(page: &Browser, css: &str, shown: &str) {
    until(&format!("{shown} after a tap on {css}"), || async {
        page.count(shown).await > 0 && page.is(shown, "isConnected").await && !page.text(shown).await.is_empty() || {
            page.try_click(css).await;
            false
        }
    })
    .await;
}

/// A setting is inspected: what is said of it is in the language, and a comment is kept.
async fn comments_while_inspecting(theatre: &Theatre, spoken: &Spoken) {
    let surgeon = &theatre.surgeon;
    surgeon.sees("#remaining", spoken.left.trim()).await;
    surgeon.sees("#hold", spoken.hold).await;
    assert_eq!(surgeon.attribute("#comment", "placeholder").await.as_deref(), Some(spoken.placeholder));
    theatre.write("µ").await;
    surgeon.click("#send").await;
    surgeon.sees("#comment-state", spoken.saved).await;
}

/// Finishes the setting, and waits for the questions with this heading.
async fn finish(theatre: &Theatre, heading: &str) {
    theatre.finish().await;
    theatre.surgeon.sees_panel(heading).await;
}

/// Answers both questions after a setting, and continues.
async fn answer(theatre: &Theatre) {
    let surgeon = &theatre.surgeon;
    theatre.choose("sharpness", 4).await;
    surgeon.show("[data-question=effort]").await;
    surgeon.click("[data-question=effort] .track").await;
    surgeon.show(".questions .done button").await;
    until("the questions to be done", || async {
        surgeon.try_click(".questions .done button").await;
        surgeon.count("[data-question=sharpness]").await == 0
    })
    .await;
}

/// A whole trial in a language, with text of twice the size or of the usual one.
async fn a_trial(spoken: &Spoken, large: bool) {
    let driver = Driver::start();
    let mut theatre = Theatre::open(&driver).await;
    if large {
        let link = theatre.server.link("surgeon");
        theatre.surgeon = driver.browser_with_large_text().await;
        theatre.surgeon.open(&link).await;
    }
    let surgeon = &theatre.surgeon;
    let size = if large { "large-text-" } else { "" };
    let named = |state: &str| format!("{size}language-{}-{state}", spoken.code);
    let link = surgeon.run("return location.origin", &[]).await.as_str().unwrap().to_owned();

    // The page was loaded in English, and changes when the session comes.
    surgeon.sees("#panel", "No trial is under way").await;
    theatre.prepare("S-50", spoken.protocol).await;
    surgeon.sees("#panel", spoken.ready).await;
    assert_eq!(surgeon.attribute("html", "lang").await.as_deref(), Some(spoken.code));
    assert_eq!(surgeon.attribute("html", "dir").await.as_deref(), Some("ltr"));
    look(surgeon, &named("1-ready")).await;

    theatre.operator.click("#session-actions .primary").await;
    surgeon.sees("#change-title", spoken.notice).await;
    look(surgeon, &named("2-notice")).await;
    let title = surgeon.text("#change-title").await;
    until("the notice to take the tap", || async {
        surgeon.try_click("#change-tap").await;
        surgeon.text("#change-title").await != title
    })
    .await;
    comments_while_inspecting(&theatre, spoken).await;
    look(surgeon, &named("3-inspecting")).await;
    surgeon.click("#overlays summary").await;
    look(surgeon, &named("4-display")).await;
    surgeon.click("#overlays summary").await;

    surgeon.focus("#view").await;
    surgeon.type_into("#view", "++").await;
    surgeon.sees(".viewer-unzoom", "×").await;
    surgeon.click("#pause").await;
    surgeon.sees("#panel", spoken.paused).await;
    surgeon.sees("#panel button", spoken.go_on).await;
    look(surgeon, &named("5-paused")).await;
    if !large {
        resize(surgeon, 1180, 820).await;
        let (card, unzoom) = (surgeon.area(".panel-card").await, surgeon.area(".viewer-unzoom").await);
        assert!(unzoom.bottom() <= card.top, "{unzoom:?} lies on {card:?}");
    }
    // What a reload brings is in the session's language from the first.
    surgeon.reload().await;
    surgeon.sees("#panel", spoken.paused).await;
    assert_eq!(surgeon.attribute(".viewer-picture", "aria-label").await.as_deref(), Some(spoken.picture));
    until("the session to go on", || async {
        surgeon.try_click("#panel button").await;
        surgeon.count("#panel button").await == 0
    })
    .await;

    finish(&theatre, spoken.questions).await;
    surgeon.sees(".questions .done button", spoken.go_on).await;
    look(surgeon, &named("6-questions")).await;
    answer(&theatre).await;
    surgeon.sees("#change-title", &spoken.notice.replace('1', "2")).await;
    tap_until(surgeon, "#change-tap", "#remaining").await;
    theatre.finish().await;
    surgeon.sees_panel(&spoken.questions.replace('1', "2")).await;
    answer(&theatre).await;

    surgeon.sees_panel(spoken.closing).await;
    for (css, text) in spoken.closing_items {
        surgeon.sees(css, text).await;
    }
    // The row with the button that goes on lies over what is scrolled beneath it.
    shoot(surgeon, &named("7-closing")).await;
    theatre.abort("the language was seen").await;
    surgeon.sees("#panel", spoken.ended).await;
    look(surgeon, &named("8-ended")).await;

    // The tablet stays in its language when the session is closed, also on pages that are no session's.
    theatre.operator.click_labelled("#session-actions", "Close").await;
    surgeon.sees("#panel", spoken.idle).await;
    surgeon.reload().await;
    surgeon.sees("#panel", spoken.idle).await;
    surgeon.open(&format!("{link}/tablet")).await;
    look(surgeon, &named("9-tablet")).await;
    surgeon.open(&format!("{link}/enter?key=wrong")).await;
    surgeon.sees("main", spoken.refused).await;
    assert_eq!(surgeon.attribute("html", "lang").await.as_deref(), Some(spoken.code));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trial_in_french() {
    a_trial(&FRENCH, false).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_trial_in_german_with_text_of_twice_the_size() {
    a_trial(&GERMAN, true).await;
}

/// The other trials differ from those above by their words alone.
#[tokio::test(flavor = "multi_thread")]
#[ignore = "takes minutes: for whoever changes words, and looks at the pictures"]
async fn every_trial_in_every_size() {
    for (spoken, large) in [(&GERMAN, false), (&SPANISH, false), (&FRENCH, true), (&SPANISH, true)] {
        a_trial(spoken, large).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_changes_from_the_language_of_one_session_to_that_of_the_next() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    for (participant, spoken) in [("S-52", &GERMAN), ("S-53", &SPANISH)] {
        theatre.prepare(participant, spoken.protocol).await;
        surgeon.sees("#panel", spoken.ready).await;
        assert_eq!(surgeon.attribute("html", "lang").await.as_deref(), Some(spoken.code));
        theatre.operator.click("#session-actions .primary").await;
        surgeon.sees("#change-title", spoken.notice).await;
        tap_until(surgeon, "#change-tap", "#remaining").await;
        comments_while_inspecting(&theatre, spoken).await;
        finish(&theatre, spoken.questions).await;
        theatre.abort("the language was seen").await;
        surgeon.sees("#panel", spoken.ended).await;
        theatre.operator.click_labelled("#session-actions", "Close").await;
        surgeon.sees("#panel", spoken.idle).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_page_that_was_loaded_before_a_german_session_is_german_without_a_network() {
    let driver = Driver::start();
    let mut theatre = Theatre::open(&driver).await;
    theatre.surgeon.keeps_page().await;
    theatre.begin("S-54", GERMAN.protocol).await;
    theatre.surgeon.sees("#change-title", GERMAN.notice).await;
    tap_until(&theatre.surgeon, "#change-tap", "#remaining").await;
    theatre.write("halb").await;
    let picture = theatre.picture().await;

    kill(&mut theatre.server);
    let surgeon = &theatre.surgeon;
    surgeon.reload().await;
    surgeon.sees("#setting", "Einstellung 1 von 2").await;
    surgeon.sees("#now", "Kein Server seit").await;
    surgeon.sees("#hold", GERMAN.hold).await;
    assert_eq!(surgeon.attribute("html", "lang").await.as_deref(), Some("de"));
    assert_eq!(theatre.picture().await, picture, "the longer words do not move the picture");
    surgeon.click("#send").await;
    surgeon.sees("#comment-state", "Hier gespeichert: 1 Kommentar.").await;
}

/// The page as it is, and as it would be in a language that is written from right to left.
async fn both_directions(surgeon: &Browser, name: &str) {
    look(surgeon, &format!("language-arabic-{name}")).await;
    surgeon.run("document.documentElement.dir = 'rtl'", &[]).await;
    look(surgeon, &format!("language-arabic-{name}-rtl")).await;
    surgeon.run("document.documentElement.dir = 'ltr'", &[]).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn arabic_texts_of_a_protocol_read_from_right_to_left_and_nothing_overlaps() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-51", "arabic").await;
    theatre.tap_notice(1).await;
    surgeon.sees("#prompt", "كيف تشعر بالتركيز الآن؟").await;
    for css in ["#prompt", "#quick button"] {
        assert_eq!(surgeon.style(css, "direction").await, "rtl", "{css}");
    }
    assert_eq!(surgeon.style("#now", "direction").await, "ltr", "the page itself is English");
    surgeon.click("#quick button").await;
    surgeon.sees("#comment-state", "1 comment saved").await;
    both_directions(surgeon, "1-inspecting").await;

    finish(&theatre, "a few questions").await;
    assert_eq!(surgeon.style("[data-question=sharpness] legend", "direction").await, "rtl");
    both_directions(surgeon, "2-questions").await;
    answer(&theatre).await;
    theatre.tap_notice(2).await;
    finish(&theatre, "a few questions").await;
    answer(&theatre).await;
    surgeon.sees_panel("Final questions").await;
    shoot(surgeon, "language-arabic-3-closing").await;
}

//! A whole session on the surgeon's page using only the keyboard.

use fantoccini::key::Key;

use super::driver::{Browser, Driver};
use super::theatre::Theatre;
use super::wait::until;

/// Gets the focused element, and whether its focus is visible.
const FOCUS: &str = "const at = document.activeElement;
    const marked = at.matches('.likert input') ? at.nextElementSibling : at.querySelector('.go') ?? at;
    const { outlineStyle, outlineWidth } = getComputedStyle(marked);
    return [at.id || at.name || at.textContent.trim(), outlineStyle !== 'none' && parseFloat(outlineWidth) >= 2];";

/// Longer than the pause between two keys of one text.
const A_WHILE: &str = "return new Promise((done) => setTimeout(done, 700))";

/// More presses of the Tab key than any page has stops.
const STOPS: usize = 60;

impl Browser {
    /// The id, name or label of the focused element. Panics if its focus is not visible.
    async fn focused(&self) -> String {
        let focus = self.run(FOCUS, &[]).await;
        let name = focus[0].as_str().unwrap().to_owned();
        let is_heading = self.run("return document.activeElement.matches('h2, body')", &[]).await == true;
        assert!(is_heading || focus[1] == true, "nobody sees that {name} has the focus");
        name
    }

    /// Presses the Tab key until `wanted` has the focus.
    async fn tab_to(&self, wanted: &str) {
        for _ in 0..STOPS {
            if self.focused().await == wanted {
                return;
            }
            self.press(Key::Tab.into()).await;
        }
        panic!("the Tab key does not lead to {wanted}");
    }

    async fn press_all(&self, text: &str) {
        for key in text.chars() {
            self.press(key).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_surgeon_goes_through_a_session_without_touching_the_screen() {
    let driver = Driver::start();
    let theatre = Theatre::open(&driver).await;
    let surgeon = &theatre.surgeon;
    theatre.begin("S-41", "practice").await;

    for setting in 1..=2 {
        surgeon.sees("#change-title", &format!("Setting {setting} of 2")).await;
        // A key that comes with the notice, or soon after another, was meant for what was there before.
        until("the notice to take the key", || async {
            surgeon.run(A_WHILE, &[]).await;
            surgeon.press(Key::Enter.into()).await;
            surgeon.text("#change-title").await.is_empty()
        })
        .await;

        surgeon.tab_to("comment").await;
        surgeon.press_all("by keys").await;
        surgeon.press(Key::Enter.into()).await;
        theatre.sees_saved(setting).await;

        surgeon.tab_to("finish").await;
        surgeon.press(Key::Enter.into()).await;
        surgeon.sees("#finish", "Tap again to finish").await;
        until("the setting to be finished", || async {
            surgeon.press(Key::Enter.into()).await;
            surgeon.text("#finish").await.is_empty()
        })
        .await;

        surgeon.sees_panel("a few questions").await;
        // A key right after the questions have appeared was meant for what was there before.
        surgeon.run(A_WHILE, &[]).await;
        surgeon.tab_to("sharpness").await;
        surgeon.press(' ').await;
        surgeon.press(Key::Right.into()).await;
        surgeon.sees("[data-question=sharpness] > .state", "Saved").await;
        assert!(surgeon.is("input[name=sharpness][value='2']", "checked").await);
        surgeon.tab_to("Continue").await;
        surgeon.press(Key::Enter.into()).await;
    }

    surgeon.sees_panel("Final questions").await;
    surgeon.run(A_WHILE, &[]).await;
    surgeon.tab_to("Finish").await;
    surgeon.press(Key::Enter.into()).await;
    surgeon.sees("#panel h2", "Practice is over").await;
    surgeon.sees("#now", "Keep the tablet: the trial comes next.").await;
}

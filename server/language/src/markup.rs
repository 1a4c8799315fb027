//! Puts messages into pages. An element names its message by the attribute `data-l10n-id`, as Fluent's own pages do.
//! The browser does the same when the language changes (`web/static/shared/language.js`).

use super::Language;

const NAMED: &str = " data-l10n-id=\"";

impl Language {
    /// `page` with the text and the attributes of every element that names a message. Our own templates alone come
    /// here: such an element is empty, and none of its attributes holds a `>`.
    pub fn fill(self, page: &str) -> String {
        let mut filled = String::with_capacity(page.len() + page.len() / 4);
        let mut rest = page;
        while let Some((before, after)) = rest.split_once(NAMED) {
            let Some((id, after)) = after.split_once('"') else { break };
            let Some((attributes, after)) = after.split_once('>') else { break };
            filled.push_str(before);
            filled.push_str(NAMED);
            filled.push_str(id);
            filled.push('"');
            for (name, value) in self.attributes(id) {
                filled.extend([" ", &name, "=\"", &escaped(&value), "\""]);
            }
            filled.push_str(attributes);
            filled.push('>');
            filled.push_str(&escaped(&self.value(id)));
            rest = after;
        }
        filled.push_str(rest);
        filled
    }

    /// The text of message `id`; empty if it has attributes only.
    fn value(self, id: &str) -> String {
        match self.bundle().get_message(id) {
            Some(message) if message.value().is_none() => String::new(),
            _ => self.say(id),
        }
    }

    fn attributes(self, id: &str) -> Vec<(String, String)> {
        let message = self.bundle().get_message(id);
        let attributes = message.into_iter().flat_map(|message| message.attributes().collect::<Vec<_>>());
        attributes.map(|one| (one.id().to_owned(), self.format(id, Some(one.id()), None))).collect()
    }
}

/// `text` as HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_get_the_text_and_the_attributes_of_their_messages() {
        let page = "<p>kept</p><button id=\"pause\" data-l10n-id=\"pause\" hidden></button>\
                    <textarea data-l10n-id=\"comment-box\"></textarea>";
        assert_eq!(
            Language::English.fill(page),
            "<p>kept</p><button id=\"pause\" data-l10n-id=\"pause\" hidden>Pause</button>\
             <textarea data-l10n-id=\"comment-box\" aria-label=\"Comment\" placeholder=\"Write what you see\"></textarea>"
        );
        assert!(Language::German.fill(page).contains(">Pause</button>"));
        assert_eq!(Language::English.fill("<p data-l10n-id=\"cut"), "<p data-l10n-id=\"cut");
    }

    #[test]
    fn nothing_of_a_message_is_markup() {
        assert_eq!(escaped("a <b> & \"c\""), "a &lt;b&gt; &amp; &quot;c&quot;");
    }
}

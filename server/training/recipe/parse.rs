//! From a recipe's text to a recipe whose numbers make sense.

use super::Recipe;
use super::check::check;

impl Recipe {
    /// The recipe that `text` (TOML) describes.
    ///
    /// # Errors
    /// With line and key, when a key is unknown, missing or of the wrong type, or a number makes no sense.
    pub fn parse(text: &str) -> Result<Self, String> {
        let recipe: Self = toml::from_str(text).map_err(|error| sentence(&error, text))?;
        check(&recipe)?;
        Ok(recipe)
    }
}

/// The error in `text` as one sentence; TOML's own is a small drawing.
fn sentence(error: &toml::de::Error, text: &str) -> String {
    let what = error.message().trim().replace('\n', ", ");
    let before = error.span().and_then(|span| text.get(..span.start));
    before.map_or(what.clone(), |before| format!("line {}: {what}", before.matches('\n').count() + 1))
}

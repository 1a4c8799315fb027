//! Parses a recipe and checks its numbers.

use super::Recipe;
use super::check::check;

impl Recipe {
    /// Parses the recipe in `text` (TOML).
    ///
    /// # Errors
    /// If a key is unknown, missing or of the wrong type (with its line), or a number is outside its range.
    pub fn parse(text: &str) -> Result<Self, String> {
        let recipe: Self = toml::from_str(text).map_err(|error| sentence(&error, text))?;
        check(&recipe)?;
        Ok(recipe)
    }
}

/// The error in `text` as one sentence with its line. TOML's own message has several lines.
fn sentence(error: &toml::de::Error, text: &str) -> String {
    let what = error.message().trim().replace('\n', ", ");
    let before = error.span().and_then(|span| text.get(..span.start));
    before.map_or(what.clone(), |before| format!("line {}: {what}", before.matches('\n').count() + 1))
}

//! Shared by all commands: how they fail, what they print, and the progress bar.

use std::io::Write;

use indicatif::{ProgressBar, ProgressStyle};

/// A command's failure: one clear sentence that says what to do.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Writes what a command was asked for on standard output.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|error| format!("cannot write to standard output: {error}").into())
}

/// A bar over `total` poses, `done` of which are done.
pub fn bar(total: usize, done: usize) -> ProgressBar {
    let bar = steps(total, "poses").with_position(done as u64);
    bar.reset_eta();
    bar
}

/// A bar over `total` of what `name` calls them.
pub fn steps(total: usize, name: &str) -> ProgressBar {
    let bar = ProgressBar::new(total as u64);
    let style = ProgressStyle::with_template(&format!("{{bar:30}} {{pos}}/{{len}} {name}, {{eta}} left {{msg}}"));
    style.map_or_else(|_| bar.clone(), |style| bar.clone().with_style(style))
}

/// `count` poses, in words.
pub fn poses(count: usize) -> String {
    format!("{count} {}", if count == 1 { "pose" } else { "poses" })
}

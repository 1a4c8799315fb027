//! Shared by all commands: how they fail, what they print, and the progress bar.

use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};

use crate::notices;

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

/// How far work of several parts has come, on standard error: a bar on a terminal, elsewhere a line for each tenth of
/// a part. May be told from several threads.
pub struct Steps {
    bar: Option<ProgressBar>,
    /// The part told last, and how many tenths of it.
    last: Mutex<(&'static str, usize)>,
}

impl Steps {
    /// Nothing told yet.
    pub fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(0);
            let style = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}, {eta} left");
            style.map_or_else(|_| bar.clone(), |style| bar.clone().with_style(style))
        });
        Self { bar, last: Mutex::new(("", 0)) }
    }

    /// Tells that `done` of `all` are done, of what `part` calls them.
    pub fn tell(&self, part: &'static str, done: usize, all: usize) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let tenths = done * 10 / all.max(1);
        let is_new = last.0 != part;

        if let Some(bar) = &self.bar {
            if is_new {
                bar.set_message(part);
                bar.reset_eta();
            }
            bar.set_length(all as u64);
            bar.set_position(done as u64);
        } else if done > 0 && (is_new || tenths > last.1) {
            notices::tell(format_args!("{done} of {all} {part}"));
        }
        *last = (part, tenths);
    }

    /// Takes the bar away.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// `count` poses, in words.
pub fn poses(count: usize) -> String {
    format!("{count} {}", if count == 1 { "pose" } else { "poses" })
}

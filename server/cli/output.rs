//! Shared by all commands: how they fail and wait, what they print, and the progress bar.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use parfocal_base::files::replace;
use parfocal_base::notices;

/// A command's failure: one clear sentence that says what to do.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Runs `work`, such as a database query, to its end on this thread.
///
/// # Errors
/// If the system refuses a resource that waiting needs, such as one more open file.
pub fn wait_for<T>(work: impl Future<Output = T>) -> std::io::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(work))
}

/// Writes a command's result to standard output.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .map_err(|error| format!("cannot write to standard output: {error}").into())
}

/// Writes a command's result to standard output, as a line of JSON.
pub fn print_json(result: &impl Serialize) -> Result<(), Failure> {
    print(&(serde_json::to_string(result)? + "\n"))
}

/// Writes a command's result to standard output: as JSON if that was asked for, otherwise as `text`.
pub fn print_result(json: bool, result: &impl Serialize, text: impl FnOnce() -> String) -> Result<(), Failure> {
    if json { print_json(result) } else { print(&text()) }
}

/// Writes a command's result to the file `path`, whole or not at all.
pub fn save(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    replace(path, bytes).map_err(|error| format!("cannot write {}: {error}", path.display()).into())
}

/// Writes a plot to the SVG file `path`, whole or not at all.
pub fn save_plot(path: &Path, svg: &str) -> Result<(), Failure> {
    replace(path, svg.as_bytes()).map_err(|error| format!("cannot save the plot to {}: {error}", path.display()).into())
}

/// `path` as one word of a command that somebody may copy into a shell.
pub fn word(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |letter: char| letter.is_alphanumeric() || "/._-+,:=@%".contains(letter);
    if !path.is_empty() && path.chars().all(is_plain) {
        return path;
    }
    format!("'{}'", path.replace('\'', r"'\''"))
}

/// A table of `rows` as CSV.
pub fn csv<R: Serialize>(rows: impl IntoIterator<Item = Result<R, Failure>>) -> Result<Vec<u8>, Failure> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table.serialize(row?)?;
    }
    table.into_inner().map_err(|error| error.to_string().into())
}

/// A progress bar over `total` items that looks as `template` says.
pub fn bar(total: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(total);
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// A progress bar over `total` poses.
pub fn bar_of_poses(total: usize) -> ProgressBar {
    bar(total as u64, "{bar:30} {pos}/{len} poses, {eta} left {msg}")
}

/// Progress of work that has several parts, on standard error: a bar on a terminal, otherwise one line per tenth of a
/// part. May be called from several threads.
pub struct Steps {
    bar: Option<ProgressBar>,
    /// The part reported last, and how many tenths of it are done.
    last: Mutex<(&'static str, usize)>,
}

impl Steps {
    /// Nothing reported yet.
    pub fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| bar(0, "{bar:30} {pos}/{len} {msg}, {eta} left"));
        Self { bar, last: Mutex::new(("", 0)) }
    }

    /// Reports that `done` of `all` items are done; `part` says what the items are.
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

    /// Removes the bar.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// `count` poses in words.
pub fn poses(count: usize) -> String {
    format!("{count} {}", if count == 1 { "pose" } else { "poses" })
}

/// Says that the scan in `out` holds what it was made for: `poses`, such as "6 poses".
pub fn stored(poses: &str, out: &Path) -> String {
    format!("{poses} in {}; check them with `parfocal scan info {}`\n", out.display(), word(out))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_in_a_command_is_one_word_of_it() {
        assert_eq!(word(Path::new("runs/first-try_2.0")), "runs/first-try_2.0");
        for path in ["runs/first try", "it's", "a;b $HOME *", "", "naïve \"x\""] {
            let command = format!("printf '%s|' {}", word(Path::new(path)));
            let run = std::process::Command::new("sh").args(["-c", &command]).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&run.stdout), format!("{path}|"));
        }
    }
}

//! `parfocal policies`: lists the registry.

use super::output::{Failure, print};
use parfocal_autofocus::{PolicyEntry, Registry};

/// Arguments of `parfocal policies`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Print a JSON array instead of a table.
    #[arg(long)]
    json: bool,
}

/// Prints every policy on standard output.
///
/// # Errors
/// If standard output cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let entries = Registry::standard().entries();
    let text = if arguments.json { serde_json::to_string_pretty(&entries)? + "\n" } else { table(&entries) };
    print(&text)
}

fn table(entries: &[PolicyEntry]) -> String {
    let width = entries.iter().map(|entry| entry.name.as_str().len()).max().unwrap_or(0);
    let line = |entry: &PolicyEntry| {
        let reason = entry.reason.as_ref().map_or(String::new(), |reason| format!(" (cannot run: {reason})"));
        format!("{:width$}  {}{reason}\n", entry.name.as_str(), entry.summary)
    };
    entries.iter().map(line).collect()
}

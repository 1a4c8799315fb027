//! `parfocal study analyse`: an unblinded study's analysis in words, as JSON or as a folder. Only reads the database.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use super::output::{Failure, print};
use parfocal_records::store::Reader;
use parfocal_results::analysis::{Analysis, Comparison, ProtocolAnalysis, analyse, decimals};

/// Arguments of `parfocal study analyse`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the study.
    study: String,
    /// Folder of the server's database.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Print it as JSON.
    #[arg(long)]
    json: bool,
    /// Also write tables, figures and JSON to a folder: new or empty.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Analyses the study.
///
/// # Errors
/// If there is no such study, it is not unblinded, or the folder cannot be written.
pub async fn run(arguments: &Arguments) -> Result<(), Failure> {
    let reader = Reader::open(&arguments.data_dir).await?;
    let analysis = analyse(&reader, &arguments.study).await?;
    let written = match &arguments.out {
        Some(out) => Some((out, analysis.into_folder(out).await?)),
        None => None,
    };

    if arguments.json {
        return print(&(serde_json::to_string(&analysis)? + "\n"));
    }
    let mut text = in_words(&analysis);
    if let Some((out, files)) = written {
        let _ = writeln!(text, "\n{} files in {}", files.len(), out.display());
    }
    print(&text)
}

fn in_words(analysis: &Analysis) -> String {
    let mut text = format!("{}: {}\nplanned analysis: {}\n", analysis.study, analysis.title, analysis.planned);
    for note in &analysis.notes {
        let _ = writeln!(text, "{note}");
    }
    for protocol in &analysis.protocols {
        write_protocol(&mut text, protocol);
    }
    text
}

fn write_protocol(text: &mut String, protocol: &ProtocolAnalysis) {
    let _ = writeln!(text, "\nprotocol {}: {}", protocol.protocol, protocol.researcher_title);
    for note in &protocol.notes {
        let _ = writeln!(text, "{note}");
    }
    for compared in &protocol.outcomes {
        write_outcome(text, compared);
    }
}

fn write_outcome(text: &mut String, compared: &Comparison) {
    let outcome = &compared.outcome;
    let better = outcome.better.map_or_else(String::new, |end| format!("; {end} is better"));
    let _ = writeln!(text, "\n{} ({}{better})", outcome.label, outcome.unit);

    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| decimals(value, 3));
    for line in &compared.policies {
        let summary = &line.summary;
        let _ = writeln!(
            text,
            "  {:24} n {:3}  missing {:3}  mean {:>8}  median {:>8}  sd {:>8}",
            line.policy,
            summary.n,
            line.missing,
            number(summary.mean),
            number(summary.median),
            number(summary.sd),
        );
    }

    if compared.left_out > 0 {
        let _ = writeln!(text, "  surgeons left out of the tests because a value is missing: {}", compared.left_out);
    }
    let pairs = compared.pairs.iter().map(|pair| &pair.said);
    let said = std::iter::once(&compared.difference.said).chain(pairs);
    for sentence in said.chain([&compared.repeats.said, &compared.position.said]) {
        let _ = writeln!(text, "  {sentence}");
    }
}

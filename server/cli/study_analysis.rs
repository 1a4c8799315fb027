//! `parfocal study analyse`: an unblinded study's analysis in words, as JSON or as a folder, from a database or from a
//! package. Only reads.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;

use super::output::{Failure, print, print_json};
use parfocal_base::notices;
use parfocal_records::store::Reader;
use parfocal_records::store::export::verify::Verdict;
use parfocal_results::analysis::{
    Analysis, Comparison, ProtocolAnalysis, SiteAnalysis, analyse, analyse_package, counted, decimals,
};
use parfocal_results::package;

/// Arguments of `parfocal study analyse`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of a study in the database, or a package: a folder that `parfocal export --study` or `parfocal study merge`
    /// wrote with the policies. A package is verified first.
    #[arg(value_name = "STUDY|PACKAGE")]
    study: String,
    /// Folder of the server's database; `data` by default.
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
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
/// If there is no such study or package, it is not unblinded, the package does not verify, or the folder cannot be
/// written.
pub async fn run(arguments: &Arguments) -> Result<(), Failure> {
    let analysis = if let Some(folder) = package_of(arguments).await? {
        if let Some(out) = &arguments.out {
            package::check_outside(out, folder)?;
        }
        verified(folder)?
    } else {
        let reader = Reader::open(folder_of(arguments)).await?;
        analyse(&reader, &arguments.study).await?
    };
    let written = match &arguments.out {
        Some(out) => Some((out, analysis.into_folder(out).await?)),
        None => None,
    };

    if arguments.json {
        return print_json(&analysis);
    }
    let mut text = in_words(&analysis);
    if let Some((out, files)) = written {
        let _ = writeln!(text, "\n{} files in {}", files.len(), out.display());
    }
    print(&text)
}

/// Folder of the database.
fn folder_of(arguments: &Arguments) -> &Path {
    arguments.data_dir.as_deref().unwrap_or(Path::new("data"))
}

/// The package that the arguments name; `None` if they name a study of the database.
async fn package_of(arguments: &Arguments) -> Result<Option<&Path>, Failure> {
    let name = &arguments.study;
    let folder = Path::new(name);
    let is_path = name.contains(std::path::MAIN_SEPARATOR);
    if arguments.data_dir.is_some() && !is_path {
        return Ok(None);
    }

    package::may_read(folder)?;
    if !package::is_package(folder) {
        if is_path || folder.exists() && !is_study(arguments).await {
            bail!(
                "{name} is not a package of a study; give a folder that `parfocal export --study` or `parfocal study \
                 merge` wrote (unpack a ZIP file first), or the name of a study"
            );
        }
        if arguments.data_dir.is_none() && !folder_of(arguments).exists() {
            bail!(
                "there is no package '{name}' here, and no server's data folder: give the folder of a package, or name \
                 the server's data folder with --data-dir"
            );
        }
        return Ok(None);
    }
    if !is_path && is_study(arguments).await {
        bail!(
            "'{name}' is a package here, and also a study of the database in data: write ./{name} for the package, or \
             add --data-dir data for the study"
        );
    }
    Ok(Some(folder))
}

/// Whether the database has a study with the name that was given.
async fn is_study(arguments: &Arguments) -> bool {
    let Ok(reader) = Reader::open(folder_of(arguments)).await else { return false };
    reader.study_names().await.is_ok_and(|names| names.contains(&arguments.study))
}

/// The analysis of the package in `folder`, if it verifies.
fn verified(folder: &Path) -> Result<Analysis, Failure> {
    for check in package::check(folder, None) {
        match check.verdict {
            Verdict::Failed(problem) => {
                let (folder, name) = (folder.display(), check.name);
                bail!(
                    "{folder} was not analysed, because it does not verify: {name}: {problem}; `parfocal verify \
                     {folder}` shows every check"
                );
            }
            Verdict::NotChecked(reason) => notices::tell(format_args!("{}: not checked: {reason}", check.name)),
            Verdict::Passed(_) => {}
        }
    }
    Ok(analyse_package(folder)?)
}

fn in_words(analysis: &Analysis) -> String {
    let mut text = format!("{}: {}\nplanned analysis: {}\n", analysis.study, analysis.title, analysis.planned);
    let _ = writeln!(text, "sites: {}", analysis.sites.join(", "));
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
    for session in &protocol.sessions {
        let Some(remark) = &session.remark else { continue };
        let of = session.surgeon.as_ref().map_or_else(String::new, |surgeon| format!("of {surgeon} "));
        let _ = writeln!(text, "Session {of}at {} ({}): {remark}.", session.site, session.session);
    }
    for (place, compared) in protocol.outcomes.iter().enumerate() {
        write_outcome(text, compared);
        for site in &protocol.by_site {
            write_site(text, site, &site.outcomes[place]);
        }
    }
}

/// The figures of one site, below those of all.
fn write_site(text: &mut String, site: &SiteAnalysis, compared: &Comparison) {
    let surgeons = counted(site.surgeons, "surgeon");
    let sessions = counted(site.sessions, "session");
    let _ = writeln!(text, "  at {}: {surgeons}, {sessions}", site.site);
    write_policies(text, "    ", compared);
    for sentence in sentences(compared) {
        let _ = writeln!(text, "    {sentence}");
    }
}

fn write_outcome(text: &mut String, compared: &Comparison) {
    let outcome = &compared.outcome;
    let better = outcome.better.map_or_else(String::new, |end| format!("; {end} is better"));
    let _ = writeln!(text, "\n{} ({}{better})", outcome.label, outcome.unit);

    write_policies(text, "  ", compared);
    if compared.left_out > 0 {
        let _ = writeln!(text, "  surgeons left out of the tests because a value is missing: {}", compared.left_out);
    }
    for sentence in sentences(compared).chain([&compared.repeats.said, &compared.position.said]) {
        let _ = writeln!(text, "  {sentence}");
    }
}

/// What was found of the policies.
fn sentences(compared: &Comparison) -> impl Iterator<Item = &String> {
    std::iter::once(&compared.difference.said).chain(compared.pairs.iter().map(|pair| &pair.said))
}

fn write_policies(text: &mut String, indent: &str, compared: &Comparison) {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| decimals(value, 3));
    for line in &compared.policies {
        let summary = &line.summary;
        let _ = writeln!(
            text,
            "{indent}{:24} n {:3}  missing {:3}  mean {:>8}  median {:>8}  sd {:>8}",
            line.policy,
            summary.n,
            line.missing,
            number(summary.mean),
            number(summary.median),
            number(summary.sd),
        );
    }
}

//! `parfocal study`: plans a study, opens, closes and locks it while no server runs, shows its state, analyses it, and
//! joins the exports of its sites.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{Args, Subcommand};
use getrandom::SysRng;
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

use super::export::join;
use super::input::without_systems_own;
use super::library::protocols;
use super::output::{Failure, print, print_result, wait_for};
use super::study_analysis;
use parfocal_autofocus::Registry;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_records::store::{Reader, StoreError, StoredStudy};
use parfocal_results::package::{self, PackageSource};
use parfocal_session::conductor::Studies;
use parfocal_session::reports::StudyDetail;
use parfocal_trial::study::signature::{Channel, Signature};
use parfocal_trial::study::state::Change;

/// What `parfocal study` does.
#[derive(Debug, Subcommand)]
pub enum Action {
    /// Plan a study from a definition; docs/study.md explains its keys.
    New(NewArguments),
    /// Allow new sessions. The first time, draw the orders and print the commitment to them.
    Open {
        /// Name of the study.
        study: String,
        /// Open it even if its plan cannot work as it is meant.
        #[arg(long)]
        despite_concerns: bool,
        #[command(flatten)]
        signed: Signed,
    },
    /// Allow no more new sessions.
    Close {
        /// Name of the study.
        study: String,
        #[command(flatten)]
        signed: Signed,
    },
    /// Lock a closed study, so that it cannot be changed any more.
    Lock {
        /// Name of the study.
        study: String,
        /// Lock it even if a surgeon's device may still hold unsent data, which would then not count.
        #[arg(long)]
        despite_outstanding: bool,
        #[command(flatten)]
        signed: Signed,
    },
    /// Print the state of a study, also while a server runs; without a name, of all studies.
    Show(Show),
    /// Join the exports of several sites into one package, after verifying each.
    Merge(Merge),
    /// Analyse an unblinded study, also while a server runs; changes nothing. docs/analysis.md explains the figures.
    Analyse(study_analysis::Arguments),
}

#[derive(Debug, Args)]
pub struct NewArguments {
    /// The definition: a TOML file.
    definition: PathBuf,
    /// A site that this database runs; may be repeated; all sites of the definition by default.
    #[arg(long = "site", value_name = "NAME")]
    sites: Vec<String>,
    /// Folder with more trial protocols; `trial-protocols` by default, if it exists.
    #[arg(long, value_name = "DIR")]
    protocols: Option<PathBuf>,
    #[command(flatten)]
    signed: Signed,
}

#[derive(Debug, Args)]
pub struct Signed {
    /// Person who makes the change; recorded with it.
    #[arg(long, value_name = "PERSON")]
    by: String,
    /// Reason for the change; recorded with it.
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// Folder of the server's database. No server may run on it.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
}

#[derive(Debug, Args)]
pub struct Show {
    /// Name of the study.
    study: Option<String>,
    /// Folder of the server's database.
    #[arg(long, value_name = "DIR", default_value = "data")]
    data_dir: PathBuf,
    /// Print it as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub struct Merge {
    /// The sites' exports: folders written by `parfocal export --study`, or exports of single sessions.
    #[arg(required = true, value_name = "DIR")]
    sites: Vec<PathBuf>,
    /// Folder to write: new or empty.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print a summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Does what the arguments say.
///
/// # Errors
/// If there is no database, a server has it open, or the study's rules refuse the change.
pub fn run(action: &Action) -> Result<(), Failure> {
    wait_for(async {
        match action {
            Action::New(new) => plan(new).await,
            Action::Open { study, despite_concerns, signed } => {
                let despite_concerns = *despite_concerns;
                change(study, Change::Open { despite_concerns }, signed).await
            }
            Action::Close { study, signed } => change(study, Change::Close, signed).await,
            Action::Lock { study, despite_outstanding, signed } => {
                let despite_outstanding = *despite_outstanding;
                change(study, Change::Lock { despite_outstanding }, signed).await
            }
            Action::Show(show) => self::show(show).await,
            Action::Merge(sites) => merge(sites),
            Action::Analyse(analyse) => study_analysis::run(analyse).await,
        }
    })?
}

async fn plan(new: &NewArguments) -> Result<(), Failure> {
    let file = new.definition.display().to_string();
    let definition =
        std::fs::read_to_string(&new.definition).map_err(|error| format!("cannot read {file}: {error}"))?;

    let studies = open(&new.signed.data_dir, new.protocols.as_deref()).await?;
    let signature = new.signed.signature()?;
    let planned = studies.plan(Channel::CommandLine, &definition, &file, &new.sites, signature).await?;
    tell(&studies, planned.as_str()).await
}

async fn change(study: &str, change: Change, signed: &Signed) -> Result<(), Failure> {
    let studies = open(&signed.data_dir, None).await?;
    let mut random = ChaCha12Rng::try_from_rng(&mut SysRng)?;
    studies.change(Channel::CommandLine, study, change, signed.signature()?, None, &mut random).await?;
    tell(&studies, study).await
}

async fn open(folder: &Path, protocol_folder: Option<&Path>) -> Result<Studies, Failure> {
    let library = protocols(protocol_folder, &Registry::standard())?;
    let opened = Studies::open(folder, &library, Arc::new(SystemClock)).await;
    opened.map_err(|error| match error {
        StoreError::InUse { folder, .. } => {
            let folder = folder.display();
            format!("a server runs on {folder}; use its page /researcher/studies, or stop it and try again").into()
        }
        error => error.into(),
    })
}

impl Signed {
    fn signature(&self) -> Result<Signature, Failure> {
        Ok(Signature::new(&self.by, &self.reason)?)
    }
}

/// Prints the state of `study` after a change, and the chain's head.
async fn tell(studies: &Studies, study: &str) -> Result<(), Failure> {
    let detail = StudyDetail::read(studies, study).await?;
    let head = studies.reader().head().await?;
    studies.close().await;
    print(&format!("{}chain {head}\n", in_short(&detail)))
}

async fn show(show: &Show) -> Result<(), Failure> {
    let reader = Reader::open(&show.data_dir).await?;
    let names = match &show.study {
        Some(name) => vec![name.clone()],
        None => reader.study_names().await?,
    };

    let mut details = Vec::new();
    for name in names {
        let study: Option<StoredStudy> = reader.study(&name).await?;
        let study = study.ok_or_else(|| format!("there is no study '{name}'; `parfocal study show` lists all"))?;
        details.push(StudyDetail::of(&study, &reader, |_| SystemClock.wall()).await?);
    }

    match (&show.study, details.as_slice()) {
        (Some(_), [detail]) => print_result(show.json, detail, || whole(detail)),
        (None, []) if !show.json => print("no studies yet\n"),
        (_, all) => print_result(show.json, &all, || all.iter().map(in_short).collect()),
    }
}

/// Joins the sites' exports.
fn merge(merge: &Merge) -> Result<(), Failure> {
    let mut sources = Vec::new();
    let mut left_out = Vec::new();
    for site in without_systems_own(&merge.sites) {
        package::check_outside(&merge.out, site)?;
        left_out.extend(package::left_out(site)?);
        for export in package::exports_of(site)? {
            sources.push(PackageSource::open(&export)?);
        }
    }
    left_out.sort();
    join(&sources, &left_out, &merge.out, merge.json)
}

/// A study in a few lines.
fn in_short(detail: &StudyDetail) -> String {
    let line = &detail.line;
    let mut text = format!(
        "{}: {}; sessions: {}; surgeons planned here: {}; {}\n",
        line.study,
        line.stage.name(),
        line.sessions,
        line.surgeons,
        line.title
    );
    if let Some(commitment) = &detail.commitment_line {
        let _ = writeln!(text, "{commitment}");
    }
    for concern in &detail.concerns {
        let _ = writeln!(text, "warning: {concern}");
    }
    if detail.outstanding > 0 {
        let sessions = detail.outstanding;
        let _ = writeln!(
            text,
            "warning: for {sessions} of its sessions, a surgeon's device may still hold comments or answers"
        );
    }
    text
}

/// Everything about a study except its orders.
fn whole(detail: &StudyDetail) -> String {
    let mut text = in_short(detail);
    let _ = writeln!(text, "definition {}", detail.definition_sha256);
    for protocol in &detail.protocols {
        let _ = writeln!(text, "protocol {} {}", protocol.name, protocol.sha256);
    }
    for each in &detail.sites {
        let site = &each.site;
        let here = if each.here { "" } else { ", not here" };
        let _ = writeln!(
            text,
            "site {}: surgeons {}, spare places {}, sessions {}{here}",
            site.name, site.surgeons, site.spares, each.sessions
        );
    }
    for session in &detail.study_sessions {
        let _ = writeln!(
            text,
            "session {} {} {} {} place {}",
            session.session,
            session.surgeon(),
            session.site,
            session.protocol,
            session.place
        );
    }
    for event in &detail.log {
        let _ = writeln!(text, "{:.0} {} ({}): {}", event.at, event.person, event.by, event.in_words());
    }
    text
}

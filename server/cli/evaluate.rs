//! `parfocal evaluate`: all policies on the same focal-time scans, and the paper's table with ours beside it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use indicatif::{ProgressBar, ProgressStyle};

use super::{Failure, scan};
use crate::autofocus::{PolicyName, Registry, scripted, shipped};
use crate::camera::phantom::Trajectory;
use crate::camera::recorded::ScanFolder;
use crate::training::evaluate::{Benchmark, COUNT, Conditions, FRAMES, Outcome, SEED, ScanSet, compare, evaluate};
use crate::training::footage;
use crate::training::recorded::{Between, FOCAL_POWERS, HASTE, POSES, Recorded, RecordedScan};
use crate::training::report::Report;
use crate::training::scan::ScanSettings;

/// What to evaluate, and on what.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Which scans: `simulated`, the reference benchmark; `phantom`, recorded over the phantom as an arm would; or the folder
    /// of a recorded scan.
    #[arg(long, value_name = "simulated|phantom|DIR", default_value = "simulated")]
    scans: String,
    /// What a recorded scan shows between two of its focal powers.
    #[arg(long, value_enum, default_value_t)]
    between: Between,
    /// A video, an image or a folder of images to scan in place of the reference pictures.
    #[arg(long, value_name = "PATH")]
    footage: Vec<PathBuf>,
    /// Policies by name, separated by commas, or `all` that can run; `file:PATH` for one from a `TorchScript` file.
    #[arg(long, default_value = "all")]
    policies: String,
    /// Folder with weights (`NAME.safetensors`) to take in the place of those that ship.
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Seed of the scans' courses; a recorded scan has its own.
    #[arg(long, value_name = "N", default_value_t = SEED)]
    seed: u64,
    /// Number of scans; 200 simulated ones or 1 over the phantom, if not said.
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Folder for the table (Markdown, CSV, JSON) and the figure.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// When scans, footage or policies cannot be had, or results cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    tch::set_num_threads(1);
    let mut registry = Registry::standard();
    if let Some(folder) = &arguments.weights {
        registry = shipped::with_folder(registry, folder)?;
    }
    let policies = policies(&arguments.policies, &registry);
    let registry = policies.iter().fold(registry, scripted::with_file);
    let scans = scans(arguments)?;
    let bar = progress(policies.len() * scans.set.count());
    let outcomes = evaluate(&registry, &policies, scans.set.as_ref(), &|name| {
        bar.set_message(name.to_owned());
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    let report = report(arguments, &scans, &outcomes);
    if let Some(folder) = &arguments.out {
        report
            .write(&outcomes, folder)
            .map_err(|error| format!("cannot write the results to {}: {error}", folder.display()))?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        print!("{}", report.markdown());
    }
    Ok(())
}

fn policies(asked: &str, registry: &Registry) -> Vec<PolicyName> {
    if asked == "all" {
        registry.entries().into_iter().filter(|entry| entry.available).map(|entry| entry.name).collect()
    } else {
        asked.split(',').map(|name| PolicyName::new(name.trim())).collect()
    }
}

/// What to evaluate on.
struct Scans {
    set: Box<dyn ScanSet>,
    seed: u64,
    between: Option<Between>,
}

fn scans(arguments: &Arguments) -> Result<Scans, Failure> {
    if arguments.count == Some(0) {
        return Err("--count must be at least 1".into());
    }
    if arguments.scans == "simulated" {
        return simulated(arguments);
    }
    if !arguments.footage.is_empty() {
        return Err("--footage makes simulated scans; leave out --scans".into());
    }
    let between = Some(arguments.between);
    let recorded = |scans| Box::new(Recorded { scans, between: arguments.between });
    if arguments.scans == "phantom" {
        let scans = (0..arguments.count.unwrap_or(1) as u64).map(|index| phantom(arguments.seed.wrapping_add(index)));
        return Ok(Scans { set: recorded(scans.collect()), seed: arguments.seed, between });
    }
    let folder = Path::new(&arguments.scans);
    if !folder.is_dir() {
        return Err(format!(
            "there are no scans '{0}'; use simulated, phantom or a recorded scan's folder",
            arguments.scans
        )
        .into());
    }
    if arguments.count.is_some_and(|count| count > 1) {
        return Err("a folder holds one scan; leave out --count".into());
    }
    let folder = ScanFolder::open(folder)?;
    let bar = scan::bar(folder.poses().len(), 0);
    let scan = RecordedScan::read(&folder, &|| bar.inc(1))?;
    bar.finish_and_clear();
    Ok(Scans { set: recorded(vec![Arc::new(scan)]), seed: folder.header().seed, between })
}

fn phantom(seed: u64) -> Arc<RecordedScan> {
    let bar = scan::bar(POSES, 0);
    let scan = RecordedScan::phantom(&Trajectory::new(seed, POSES, HASTE), seed, FOCAL_POWERS, &|| bar.inc(1));
    bar.finish_and_clear();
    Arc::new(scan)
}

fn simulated(arguments: &Arguments) -> Result<Scans, Failure> {
    let mut clips = Vec::new();
    for path in &arguments.footage {
        clips.extend(footage::clips(path)?);
    }
    let (seed, count) = (arguments.seed, arguments.count.unwrap_or(COUNT));
    let set = if clips.is_empty() {
        Benchmark { seed, ..Benchmark::reference(count)? }
    } else {
        Benchmark { clips, conditions: Conditions::Same(ScanSettings::default()), seed, count, frames: FRAMES }
    };
    Ok(Scans { set: Box::new(set), seed, between: None })
}

fn report(arguments: &Arguments, scans: &Scans, outcomes: &[Outcome]) -> Report {
    let rows: Vec<_> = outcomes.iter().map(Outcome::row).collect();
    let comparisons = compare(&rows);
    let footage = arguments.footage.iter().map(|path| path.display().to_string()).collect();
    let (name, count) = (arguments.scans.clone(), scans.set.count());
    Report { scans: name, seed: scans.seed, count, footage, between: scans.between, rows, comparisons }
}

fn progress(total: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} scans, {eta} left: {msg}");
    let bar = ProgressBar::new(total as u64);
    style.map_or_else(|_| bar.clone(), |style| bar.clone().with_style(style))
}

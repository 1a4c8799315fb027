//! `parfocal evaluate`: all policies on the same focal-time scans, and the paper's table with ours beside it.

use std::path::PathBuf;

use indicatif::{ProgressBar, ProgressStyle};

use super::Failure;
use crate::autofocus::{PolicyName, Registry, shipped};
use crate::training::evaluate::{Benchmark, COUNT, FRAMES, Outcome, SEED, compare, evaluate};
use crate::training::footage;
use crate::training::pictures::{Split, reference};
use crate::training::report::Report;
use crate::training::scan::ScanSettings;

/// What to evaluate, and on what.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Which scans: `simulated`, the reference benchmark.
    #[arg(long, default_value = "simulated")]
    scans: String,
    /// A video, an image or a folder of images to scan in place of the reference pictures.
    #[arg(long, value_name = "PATH")]
    footage: Vec<PathBuf>,
    /// Policies by name, separated by commas, or `all` that can run.
    #[arg(long, default_value = "all")]
    policies: String,
    /// Folder with weights (`NAME.safetensors`) to take in the place of those that ship.
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Seed of the scans' courses.
    #[arg(long, default_value_t = SEED)]
    seed: u64,
    /// Number of scans.
    #[arg(long, default_value_t = COUNT)]
    count: usize,
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
        registry = shipped::with_folder(registry, folder);
    }
    let policies = policies(&arguments.policies, &registry);
    let benchmark = benchmark(arguments)?;
    let bar = progress(policies.len() * benchmark.count);
    let outcomes = evaluate(&registry, &policies, &benchmark, &|name| {
        bar.set_message(name.to_owned());
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    let report = report(arguments, &outcomes);
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

fn benchmark(arguments: &Arguments) -> Result<Benchmark, Failure> {
    if arguments.count == 0 {
        return Err("--count must be at least 1".into());
    }
    let mut clips = Vec::new();
    for path in &arguments.footage {
        clips.extend(footage::clips(path)?);
    }
    if arguments.scans != "simulated" {
        return Err(format!("there are no scans '{}'; use --scans simulated", arguments.scans).into());
    }
    let mut settings = ScanSettings::default();
    if clips.is_empty() {
        clips = reference(Split::Test, arguments.count.min(COUNT) as u64)?;
        settings = ScanSettings::reference();
    }
    let (seed, count) = (arguments.seed, arguments.count);
    Ok(Benchmark { clips, settings, seed, count, frames: FRAMES })
}

fn report(arguments: &Arguments, outcomes: &[Outcome]) -> Report {
    let rows: Vec<_> = outcomes.iter().map(Outcome::row).collect();
    let comparisons = compare(&rows);
    let footage = arguments.footage.iter().map(|path| path.display().to_string()).collect();
    let scans = arguments.scans.clone();
    Report { scans, seed: arguments.seed, count: arguments.count, footage, rows, comparisons }
}

fn progress(total: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} scans, {eta} left: {msg}");
    let bar = ProgressBar::new(total as u64);
    style.map_or_else(|_| bar.clone(), |style| bar.clone().with_style(style))
}

//! `parfocal evaluate`: runs policies on the same focal-time scans, and shows the paper's table beside ours.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ArgGroup;
use clap::builder::RangedU64ValueParser;
use indicatif::ProgressBar;
use serde::Serialize;

use super::input::without_systems_own;
use super::library;
use super::output::{Failure, bar, bar_of_poses, print, print_result, word};
use super::policy_process;
use parfocal_autofocus::{FieldOfView, Registry, exec, scripted};
use parfocal_base::files::replace;
use parfocal_base::notices::tell;
use parfocal_base::{BlurRate, PolicyName};
use parfocal_devices::camera::recorded::ScanFolder;
use parfocal_devices::simulation::phantom::Trajectory;
use parfocal_imaging::PixelFormat;
use parfocal_learning::evaluation::evaluate;
use parfocal_learning::evaluation::report::EvaluatedScans;
use parfocal_learning::evaluation::shard::{Part, PartOf, Shard, merge, no_shard};
use parfocal_learning::evaluation::stacks::{Blur, FIRST_SEED, SEEDS, evaluate_stacks, with_baselines};
use parfocal_learning::scans::ScanSet;
use parfocal_learning::scans::benchmark::{Benchmark, COUNT, Conditions, FRAMES, SEED};
use parfocal_learning::scans::detail::{warning, without_detail};
use parfocal_learning::scans::footage;
use parfocal_learning::scans::recorded::{
    FOCAL_POWERS, HASTE, Interpolation, Kept, POSES, RecordedScan, RecordedScans,
};
use parfocal_learning::scans::simulated::Scene;
use parfocal_learning::scans::stack::source::StackSource;

/// What to evaluate, and on what.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("destination").multiple(true))]
pub struct Arguments {
    /// Scans: `simulated`, the reference benchmark; `relief`, the benchmark with relief; `phantom`,
    /// a scan over the phantom as a robotic arm would record it; or the folder of a recorded scan.
    #[arg(long, value_name = "simulated|relief|phantom|DIR", default_value = "simulated")]
    scans: String,
    /// What a recorded scan shows between two of its focal powers; `nearest` by default.
    #[arg(long, value_enum)]
    between: Option<Interpolation>,
    /// Evaluate on a photographed focal stack instead: a folder of pictures of one still scene in order of focus.
    /// `DIR:K` makes K of its planes the range 0 to 1, by default two fifths of them. Each stack runs at two scales and
    /// with three seeds, 31 to 33 unless --seed names the first. May be repeated.
    #[arg(
        long,
        value_name = "DIR",
        num_args = 1..,
        conflicts_with_all = ["scans", "footage", "between", "count", "shard", "merge"]
    )]
    stacks: Vec<String>,
    /// Format of .raw and .bin files in --stacks: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the one
    /// of their length.
    #[arg(long, value_name = "FORMAT", requires = "stacks")]
    raw: Option<PixelFormat>,
    /// Tell the policies how fast the optic blurs: pixels (standard deviation) for a change of focal power by 1, as
    /// `parfocal scan info` measures them; with --stacks also `measured`, each stack by its own pictures.
    #[arg(long, value_name = "PIXELS|measured")]
    blur: Option<Blur>,
    /// Videos (their first 1500 frames), images or folders of images to use instead of the reference pictures.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    footage: Vec<PathBuf>,
    /// Names of policies, separated by commas; `all` for all that can run; `file:PATH` for a
    /// TorchScript file and `exec:COMMAND` for a policy in another process, each of which ends with the argument and
    /// may hold commas. May be repeated.
    #[arg(long, alias = "policy", value_name = "NAMES", default_value = "all")]
    policies: Vec<String>,
    /// Folder with weights of your own (`NAME.safetensors`) that replace those that ship.
    #[arg(long, value_name = "DIR")]
    weights: Option<PathBuf>,
    /// Seed of the scans, 2023 by default; a recorded scan has its own.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Number of scans: 200 by default and 10000 at most; over the phantom 1 by default and 100 at most.
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<usize>::new().range(1..=10_000))]
    count: Option<usize>,
    /// Run only part I of N of the scans, for example 2/8, and give its paths as JSON for --merge: with --out as
    /// shard-I-of-N.json in that folder, with --json on standard output.
    #[arg(long, value_name = "I/N", requires = "destination")]
    shard: Option<Part>,
    /// Merge all shards of an evaluation; the result equals that of one run to the last digit.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = [
        "scans", "between", "footage", "policies", "weights", "blur", "seed", "count", "shard",
    ])]
    merge: Vec<PathBuf>,
    /// Print JSON.
    #[arg(long, group = "destination")]
    json: bool,
    /// Folder for the results: tables (Markdown, CSV, JSON) and a figure.
    #[arg(long, value_name = "DIR", group = "destination")]
    out: Option<PathBuf>,
}

/// Limit on scans over the phantom: each takes 25 MB, and half a minute to make.
const MOST_PHANTOM: usize = 100;

/// Runs the command.
///
/// # Errors
/// If scans, footage, policies or shards cannot be used, or results cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(folder) = &arguments.out {
        std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    }

    if !arguments.stacks.is_empty() {
        return stacks(arguments);
    }

    let shards = if arguments.merge.is_empty() {
        let shard = evaluated(arguments)?;
        if arguments.shard.is_some() {
            return give_shard(arguments, &shard);
        }
        vec![(String::new(), shard)]
    } else {
        without_systems_own(&arguments.merge).into_iter().map(|file| read_shard(file)).collect::<Result<_, _>>()?
    };

    let (report, outcomes) = merge(shards)?;
    give(arguments, &report, || report.markdown(), |folder| report.write(&outcomes, folder))
}

/// Writes and prints the results. Does both even if one fails, so that the other still has them.
fn give(
    arguments: &Arguments,
    report: &impl Serialize,
    markdown: impl FnOnce() -> String,
    write: impl FnOnce(&Path) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let written = match &arguments.out {
        Some(folder) => write(folder).map_err(|error| unwritable(folder, &error)),
        None => Ok(()),
    };
    print_result(arguments.json, report, markdown)?;
    Ok(written?)
}

fn unwritable(folder: &Path, error: &std::io::Error) -> String {
    format!("cannot write the results to {}: {error}", folder.display())
}

/// The requested policies, each of which can run, and the registry that builds them.
fn registry_and_policies(arguments: &Arguments) -> Result<(Registry, Vec<PolicyName>), Failure> {
    let registry = library::policies(arguments.weights.as_deref(), arguments.blur_rate())?;

    if matches!(arguments.blur, Some(Blur::Measured)) && arguments.stacks.is_empty() {
        bail!(
            "--blur measured works only with --stacks; for other scans give the pixels; `parfocal scan info` \
             shows them for a recorded scan"
        );
    }

    let policies = policies(&arguments.policies, &registry);
    let settings = policy_process::for_evaluation(None);
    let registry =
        policies.iter().fold(registry, |registry, name| policy_process::with_outside(registry, name, &settings));

    // Report a policy that cannot run before doing anything that takes time.
    policies.iter().try_for_each(|name| registry.build(name).map(drop))?;
    Ok((registry, policies))
}

/// What the policies look at of a recorded scan's pictures.
fn kept(registry: &Registry, policies: &[PolicyName]) -> Result<Kept, Failure> {
    for name in policies {
        if registry.build(name)?.field_of_view() == FieldOfView::Surroundings {
            return Ok(Kept::Surroundings);
        }
    }
    Ok(Kept::Patches)
}

/// Runs the policies on the requested scans, or on the requested shard of them.
fn evaluated(arguments: &Arguments) -> Result<Shard, Failure> {
    let (registry, policies) = registry_and_policies(arguments)?;

    let part = arguments.shard.unwrap_or(Part::WHOLE);
    let Scans { set, seed, count, between } = scans(arguments, part, kept(&registry, &policies)?)?;
    if set.count() == 0 {
        bail!("shard {part} has no scans: there are only {count}; make fewer shards");
    }

    let blank = without_detail(set.as_ref());
    match warning(blank, set.count()) {
        Ok(None) => {}
        Ok(Some(warning)) => tell(format_args!("note: {warning}")),
        // The other shards may have detail.
        Err(error) if part == Part::WHOLE => return Err(error.into()),
        Err(error) => tell(format_args!("note: shard {part}: {error}")),
    }

    let bar = progress(policies.len() * set.count());
    let outcomes = evaluate(&registry, &policies, set.as_ref(), &|name| {
        bar.set_message(name.to_owned());
        bar.inc(1);
    });
    bar.finish_and_clear();

    let mut weights = registry.weights();
    weights.retain(|name, _| policies.contains(name));
    let subject = EvaluatedScans {
        scans: arguments.scans.clone(),
        seed,
        count,
        footage: arguments.footage.iter().map(|path| path.display().to_string()).collect(),
        between,
        blur: arguments.blur_rate().map(BlurRate::get),
        weights_folder: arguments.weights.as_ref().map(|folder| folder.display().to_string()),
        weights,
    };

    Ok(Shard::new(part, subject, blank, outcomes?))
}

/// Writes and prints a shard, for `--merge`.
fn give_shard(arguments: &Arguments, shard: &Shard) -> Result<(), Failure> {
    let text = serde_json::to_string(shard)? + "\n";
    let mut message = String::new();

    if let Some(folder) = &arguments.out {
        let file = folder.join(shard.part.file_name());
        replace(&file, text.as_bytes()).map_err(|error| unwritable(folder, &error))?;
        let folder = word(folder);
        message = format!(
            "shard {} is in {}; when all shards are there: \
             parfocal evaluate --merge {folder}/shard-*.json --out {folder}\n",
            shard.part,
            file.display()
        );
    }

    print(if arguments.json { &text } else { &message })
}

fn read_shard(file: &Path) -> Result<(String, Shard), Failure> {
    let name = file.display().to_string();
    let text = std::fs::read(file).map_err(|error| format!("cannot read the shard {name}: {error}"))?;
    let shard = serde_json::from_slice(&text).map_err(|_| no_shard(&name))?;
    Ok((name, shard))
}

impl Arguments {
    fn seed(&self) -> u64 {
        self.seed.unwrap_or(SEED)
    }

    /// The blur rate that was given; none if each stack's is measured.
    const fn blur_rate(&self) -> Option<BlurRate> {
        match self.blur {
            Some(Blur::Rate(rate)) => Some(rate),
            Some(Blur::Measured) | None => None,
        }
    }
}

/// Evaluates on focal stacks.
fn stacks(arguments: &Arguments) -> Result<(), Failure> {
    let (registry, policies) = registry_and_policies(arguments)?;
    let named = without_systems_own(&arguments.stacks).into_iter();
    let sources: Vec<StackSource> = named.map(|text| StackSource::parse(text, arguments.raw)).collect();

    let seed = arguments.seed.unwrap_or(FIRST_SEED);

    let bar = progress(with_baselines(&policies).len() * sources.len() * 2 * SEEDS);
    let (report, outcomes) = evaluate_stacks(&registry, &policies, &sources, seed, arguments.blur, &|name| {
        bar.set_message(name.to_owned());
        bar.inc(1);
    })?;
    bar.finish_and_clear();

    give(arguments, &report, || report.markdown(), |folder| report.write(&outcomes, folder))
}

/// The requested policies, each once.
fn policies(asked: &[String], registry: &Registry) -> Vec<PolicyName> {
    let mut policies: Vec<PolicyName> = Vec::new();
    for name in asked.iter().flat_map(|argument| names(argument)) {
        let all = registry.entries().into_iter().filter(|entry| entry.available).map(|entry| entry.name);
        let named: Vec<_> = if name == "all" { all.collect() } else { vec![PolicyName::new(name)] };
        policies.extend(named.into_iter().filter(|name| !policies.contains(name)).collect::<Vec<_>>());
    }
    policies
}

/// The names in one argument. A file's path or a command extends to the end of the argument, commas included.
fn names(argument: &str) -> Vec<&str> {
    let argument = argument.trim_start();
    match argument.split_once(',') {
        Some((name, rest)) if ![scripted::PREFIX, exec::PREFIX].iter().any(|prefix| argument.starts_with(prefix)) => {
            std::iter::once(name.trim_end()).chain(names(rest)).collect()
        }
        _ => vec![argument.trim_end()],
    }
}

/// The scans to evaluate on.
struct Scans {
    /// The scans of one part.
    set: Box<dyn ScanSet>,
    seed: u64,
    /// Number of scans in all parts.
    count: usize,
    between: Option<Interpolation>,
}

fn scans(arguments: &Arguments, part: Part, kept: Kept) -> Result<Scans, Failure> {
    let are_drawn = ["simulated", "relief"].contains(&arguments.scans.as_str());
    if are_drawn && arguments.between.is_some() {
        bail!("--between is for recorded scans, which have pictures at some focal powers only");
    }

    if arguments.scans == "simulated" {
        return simulated(arguments, part);
    }

    if !arguments.footage.is_empty() {
        bail!("--footage needs simulated scans; leave out --scans");
    }

    if arguments.scans == "relief" {
        let seed = arguments.seed();
        let count = arguments.count.unwrap_or(COUNT);
        let set = Benchmark { seed, ..Benchmark::relief(count)? };
        return Ok(Scans { set: Box::new(PartOf::new(set, part)), seed, count, between: None });
    }

    let between = arguments.between.unwrap_or_default();
    let recorded = |scans| Box::new(RecordedScans { scans, between });
    let between = Some(between);

    if arguments.scans == "phantom" {
        if arguments.count.is_some_and(|count| count > MOST_PHANTOM) {
            bail!("--count is at most {MOST_PHANTOM} over the phantom");
        }
        let count = arguments.count.unwrap_or(1);
        let scans = part.scans(count).map(|index| phantom(arguments.seed().wrapping_add(index as u64), kept));
        return Ok(Scans { set: recorded(scans.collect()), seed: arguments.seed(), count, between });
    }

    let folder = Path::new(&arguments.scans);
    if !folder.is_dir() {
        bail!("unknown scans '{0}'; use simulated, relief, phantom or the folder of a recorded scan", arguments.scans);
    }

    if arguments.count.is_some_and(|count| count > 1) {
        bail!("a folder holds one scan; leave out --count");
    }
    if part != Part::WHOLE {
        bail!("a folder holds one scan, which cannot be split; leave out --shard");
    }
    if arguments.seed.is_some() {
        bail!("a recorded scan has its own seed; leave out --seed");
    }

    let folder = ScanFolder::open(folder)?;
    let bar = bar_of_poses(folder.poses().len());
    let scan = RecordedScan::read(&folder, kept, &|| bar.inc(1))?;
    bar.finish_and_clear();

    Ok(Scans { set: recorded(vec![Arc::new(scan)]), seed: folder.header().seed, count: 1, between })
}

fn phantom(seed: u64, kept: Kept) -> Arc<RecordedScan> {
    let bar = bar_of_poses(POSES);
    let trajectory = Trajectory::new(seed, POSES, HASTE);
    let scan = RecordedScan::phantom(&trajectory, seed, FOCAL_POWERS, kept, &|| bar.inc(1));
    bar.finish_and_clear();
    Arc::new(scan)
}

fn simulated(arguments: &Arguments, part: Part) -> Result<Scans, Failure> {
    let clips = footage::clips(&arguments.footage)?;
    let seed = arguments.seed();
    let count = arguments.count.unwrap_or(COUNT);

    let set = if clips.is_empty() {
        Benchmark { seed, ..Benchmark::reference(count)? }
    } else {
        Benchmark {
            scenes: clips.into_iter().map(Scene::Flat).collect(),
            conditions: Conditions::Fitting,
            seed,
            count,
            frames: FRAMES,
        }
    };

    Ok(Scans { set: Box::new(PartOf::new(set, part)), seed, count, between: None })
}

fn progress(total: usize) -> ProgressBar {
    bar(total as u64, "{bar:30} {pos}/{len} scans, {eta} left: {msg}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_at_commas_but_a_files_path_is_not() {
        let asked = ["fixed, mgm-learned", "parfocal,file:a,b.pt", "fixed"].map(str::to_owned);
        let names: Vec<_> = policies(&asked, &Registry::default()).iter().map(ToString::to_string).collect();
        assert_eq!(names, ["fixed", "mgm-learned", "parfocal", "file:a,b.pt"]);
    }

    #[test]
    fn all_may_stand_beside_others() {
        let registry = || Registry::standard().without("broken", "", "it is not here");
        let count = Registry::standard().entries().len();
        let names = policies(&["all".to_owned(), "parfocal,file:a.pt".to_owned()], &registry());
        assert_eq!((names.len(), names[count].as_str()), (count + 1, "file:a.pt"));
    }
}

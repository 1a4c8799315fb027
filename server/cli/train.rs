//! `parfocal train`: trains a learned policy on this machine, or compares trainings.

use std::path::PathBuf;

use clap::ValueEnum;

use super::input::without_systems_own;
use super::interrupt::Interrupt;
use super::output::{Failure, bar, print, print_result, word};
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_base::clock::SystemClock;
use parfocal_base::notices::tell;
use parfocal_imaging::PixelFormat;
use parfocal_learning::training::recipe::LEG;
use parfocal_learning::training::recipe::{MAX_UPDATES, Recipe, is_later_stage, names, shipped};
use parfocal_learning::training::run::comparison::{TrainedRun, markdown};
use parfocal_learning::training::run::resume::ResumeRequest;
use parfocal_learning::training::run::{Run, Sources, TrainingProgress};

/// Where to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Compute {
    /// The processor.
    Cpu,
    /// An NVIDIA GPU.
    Cuda,
}

/// What to train, and where to write it.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    training: Option<Training>,
    /// Compare the trainings in these run folders instead: recipe, seed, updates, best validation, benchmark.
    #[arg(long, value_name = "DIR", num_args = 1.., required_unless_present = "policy", conflicts_with = "Training")]
    compare: Vec<PathBuf>,
    /// With --compare, print JSON.
    #[arg(long, requires = "compare")]
    json: bool,
}

/// One training.
#[derive(Debug, clap::Args)]
#[group(id = "Training")]
struct Training {
    /// Recipe: `mgm-learned`, `mlr-learned`, `cnn-learned` or `parfocal`. Each of the first three also has a recipe
    /// that follows the paper, with `-paper` at the end. `cnn-learned-refined`, `parfocal-refined`, `parfocal-relief`,
    /// `cnn-learned-glass` and `parfocal-glass` (on focal stacks of several optics, with `--scans`) and
    /// `parfocal-adapted` (to a bench, with `--scans`) are later stages: give them the weights of the stage before with
    /// `--from`.
    policy: String,
    /// Run folder: recipe, weights, model card, curves, checkpoint.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A recipe of your own (TOML) instead of the one that ships; not needed with `--resume`.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Number of updates instead of the recipe's; not needed with `--resume`.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_UPDATES))]
    updates: Option<u64>,
    /// Videos (their first 1500 frames), images or folders of images to train on instead of drawn pictures or, by the
    /// recipe's `footage_share`, beside them; not needed with `--resume`.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    footage: Vec<PathBuf>,
    /// Recorded scans and focal stacks of your own bench to train on beside the pictures, half of the
    /// time: folders of `parfocal scan`, or of pictures of a still scene in order of focus. `DIR:K` makes
    /// K planes of a stack the range 0 to 1, by default two fifths. Of five folders or more every fifth
    /// is kept for validation. Not needed with `--resume`.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    scans: Vec<String>,
    /// Format of .raw and .bin files in --scans: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the one
    /// of their length. Not needed with `--resume`.
    #[arg(long, value_name = "FORMAT")]
    raw: Option<PixelFormat>,
    /// Where to compute.
    #[arg(long, value_enum, default_value = "cpu")]
    device: Compute,
    /// Continue from the checkpoint in the run folder, with the same recipe, seed, footage and scans.
    #[arg(long)]
    resume: bool,
    /// Weights (safetensors) of the same policy to start from instead of random ones.
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    from: Option<PathBuf>,
    /// Seed of everything random, 1 by default.
    #[arg(long)]
    seed: Option<u64>,
}

/// Runs the command.
///
/// # Errors
/// If the recipe, footage, folder or checkpoint is unusable.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.training {
        Some(training) => train(training),
        None => compare(&arguments.compare, arguments.json),
    }
}

fn compare(folders: &[PathBuf], json: bool) -> Result<(), Failure> {
    let mut runs = Vec::new();
    for folder in without_systems_own(folders) {
        match TrainedRun::read(folder)? {
            Some(run) => runs.push(run),
            None => tell(format_args!("note: {} is left out: it has saved nothing yet", folder.display())),
        }
    }
    print_result(json, &runs, || markdown(&runs))
}

fn train(arguments: &Training) -> Result<(), Failure> {
    let device = device(arguments.device)?;
    let mut run = if arguments.resume { resume(arguments, device)? } else { begin(arguments, device)? };
    let total = run.recipe().updates();

    if let Some(version) = run.other_version() {
        tell(format_args!("note: parfocal {version} made the checkpoint; the result may differ from that version's"));
    }

    let interrupt = Interrupt::listen(format!("saving after at most {LEG} more updates"))?;
    let bar = bar(total, "{bar:25} {pos}/{len} updates, {per_sec}, {eta} left: {msg}").with_position(run.updates());
    bar.reset_eta();
    let mut validation = run.best();

    let mut tell_progress = |progress: &TrainingProgress| {
        validation = progress.validation.unwrap_or(validation);
        let epsilon = progress.epsilon.map_or(String::new(), |epsilon| format!(", epsilon {epsilon:.2}"));
        let mae = if validation.is_finite() { format!(", validation MAE {validation:.4}") } else { String::new() };
        let message = format!("loss {:.4}{epsilon}{mae}", progress.loss);
        if bar.is_hidden() && progress.validation.is_some() {
            tell(format_args!("{} of {total} updates: {message}", progress.updates));
        }
        bar.set_position(progress.updates);
        bar.set_message(message);
    };

    // Run on one of the threads that share the work, so that it need not wait for another to wake up whenever there is
    // work to share.
    let threads = rayon::ThreadPoolBuilder::new().start_handler(|_| compute_on_this_thread()).build()?;
    let whole = threads.install(|| run.go(&SystemClock, &|| interrupt.asked(), &mut tell_progress))?;

    if !whole {
        bar.finish_and_clear();
        let device = if arguments.device == Compute::Cuda { " --device cuda" } else { "" };
        return print(&format!(
            "stopped after {} of {total} updates; continue with: parfocal train {} --out {} --resume{device}\n",
            run.updates(),
            arguments.policy,
            word(&arguments.out)
        ));
    }

    let saved = format!(
        "trained and saved in {}; --resume adds the benchmark's figures to the model card",
        arguments.out.display()
    );
    interrupt.all_is_saved(saved.clone());
    if interrupt.asked() {
        bar.finish_and_clear();
        return print(&(saved + "\n"));
    }

    let next = "running the best weights on the reference benchmark; Ctrl-C skips it";
    if bar.is_hidden() && run.recipe().benchmark > 0 {
        tell(format_args!("{next}"));
    }
    bar.set_message(next);
    run.report()?;
    bar.finish_and_clear();
    print(&format!("best validation MAE {:.4}; weights and model card in {}\n", run.best(), arguments.out.display()))
}

fn device(compute: Compute) -> Result<tch::Device, Failure> {
    match compute {
        Compute::Cpu => Ok(tch::Device::Cpu),
        Compute::Cuda if tch::Cuda::is_available() => Ok(tch::Device::Cuda(0)),
        Compute::Cuda => Err(
            "this libtorch has no CUDA, or finds no GPU; start parfocal with the libtorch of PyTorch 2.11 for CUDA \
            as in docs/training.md, or use --device cpu"
                .into(),
        ),
    }
}

fn begin(arguments: &Training, device: tch::Device) -> Result<Run, Failure> {
    let mut recipe = match own_recipe(arguments)? {
        Some(recipe) => recipe,
        None => shipped_recipe(arguments)?,
    };

    if let Some(updates) = arguments.updates {
        recipe = recipe.with_updates(updates);
    }

    let seed = arguments.seed.unwrap_or(1);
    let from = arguments.from.as_deref();
    Ok(Run::begin(recipe, seed, &sources(arguments), &arguments.out, from, device)?)
}

fn sources(arguments: &Training) -> Sources {
    let scans = without_systems_own(&arguments.scans).into_iter().cloned().collect();
    Sources { footage: arguments.footage.clone(), scans, raw: arguments.raw }
}

fn resume(arguments: &Training, device: tch::Device) -> Result<Run, Failure> {
    let request = ResumeRequest {
        name: arguments.policy.clone(),
        recipe: own_recipe(arguments)?,
        updates: arguments.updates,
        seed: arguments.seed,
        sources: sources(arguments),
    };
    Ok(Run::resume(&arguments.out, &request, device)?)
}

/// The recipe that ships under the given name. One that trains weights further needs some: its learning rate and its
/// length suit only weights that have learned something already.
fn shipped_recipe(arguments: &Training) -> Result<Recipe, Failure> {
    let name = &arguments.policy;
    let unknown = || format!("there is no recipe '{name}'; there are: {}", names().join(", "));
    let recipe = Recipe::parse(shipped(name).ok_or_else(unknown)?)?;

    if arguments.from.is_none() && is_later_stage(name) {
        let policy = &recipe.policy;
        bail!(
            "the recipe '{name}' trains weights of {policy} further: give them by --from, such as \
             --from policies/{policy}.safetensors"
        );
    }
    Ok(recipe)
}

/// The recipe in the file that `--config` names.
fn own_recipe(arguments: &Training) -> Result<Option<Recipe>, Failure> {
    let Some(file) = &arguments.config else { return Ok(None) };
    let text =
        std::fs::read_to_string(file).map_err(|error| format!("cannot read the recipe {}: {error}", file.display()))?;
    let recipe = Recipe::parse(&text).map_err(|error| format!("in the recipe {}: {error}", file.display()))?;

    if recipe.policy != arguments.policy {
        let file = file.display();
        let made = &recipe.policy;
        let asked = &arguments.policy;
        bail!("the recipe {file} makes '{made}', not '{asked}'; give that policy, or another recipe");
    }

    Ok(Some(recipe))
}

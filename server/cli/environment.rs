//! `parfocal environment`: simulated scans for a training in another program, over standard input and output.

use std::io::{BufReader, BufWriter};
use std::path::PathBuf;

use clap::builder::RangedU64ValueParser;

use super::input::number;
use super::output::Failure;
use parfocal_base::notices::tell;
use parfocal_imaging::PixelFormat;
use parfocal_learning::scans::bench::BenchScenes;
use parfocal_learning::scans::benchmark::FRAMES;
use parfocal_learning::scans::footage;
use parfocal_learning::scans::pictures::{Split, reference, varied};
use parfocal_learning::scans::relief;
use parfocal_learning::scans::scenery::Scenery;
use parfocal_learning::scans::simulated::Scene;
use parfocal_learning::scans::variety::Variety;
use parfocal_learning::training::served::{Fleet, Shows, serve};

/// Bytes that the pipes are read and written with at a time.
const BUFFER: usize = 1 << 16;

/// Arguments of `parfocal environment`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Scans: `simulated` over drawn pictures, `relief` over scenes with relief, or the folder of a recorded scan or of
    /// a focal stack (`DIR:K` makes K of its planes the range 0 to 1). Each gets the same share; all folders together
    /// count as one.
    #[arg(long, value_name = "simulated|relief|DIR", num_args = 1.., default_value = "simulated")]
    scans: Vec<String>,
    /// Format of .raw and .bin files in focal stacks: Mono8, Mono10, Mono10p, Mono12, Mono12p or Mono16; by default the
    /// one of their length.
    #[arg(long, value_name = "FORMAT")]
    raw: Option<PixelFormat>,
    /// Videos (their first 1500 frames), images or folders of images instead of drawn pictures.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    footage: Vec<PathBuf>,
    /// What the scenes are for: each purpose has drawn scenes of its own, and of five recordings or more every fifth is
    /// not for training. Footage is the same for all.
    #[arg(long, value_enum, default_value = "training")]
    split: Split,
    /// Scenes of each kind to draw.
    #[arg(
        long, value_name = "N", default_value = "32",
        value_parser = RangedU64ValueParser::<u64>::new().range(1..=10_000)
    )]
    scenes: u64,
    /// Share of the scans that vary in speed, blur, noise, exposure, lens and what else is in view, 0 to 1. At 0 they
    /// are those of the reference benchmark.
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = number(0.0..=1.0))]
    variety: f64,
    /// What is shown of a frame.
    #[arg(long, value_enum, default_value = "patch")]
    observation: Shows,
    /// Environments side by side.
    #[arg(
        long, value_name = "N", default_value = "1",
        value_parser = RangedU64ValueParser::<usize>::new().range(1..=4096)
    )]
    count: usize,
    /// Frames of a scan.
    #[arg(long, value_name = "N", default_value_t = FRAMES as u32, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

/// Serves environments until standard input is closed.
///
/// # Errors
/// If the scenes cannot be used, a pipe fails, or the other program sends something that is no request.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scenery = scenery(arguments)?;
    let variety = Variety { share: arguments.variety };
    let mut fleet =
        Fleet::new(scenery, variety, arguments.observation, arguments.count, arguments.frames, arguments.seed);
    let requests = BufReader::with_capacity(BUFFER, std::io::stdin().lock());
    let answers = BufWriter::with_capacity(BUFFER, std::io::stdout().lock());
    Ok(serve(&mut fleet, requests, answers)?)
}

fn scenery(arguments: &Arguments) -> Result<Scenery, Failure> {
    if !arguments.footage.is_empty() && !arguments.scans.iter().any(|scans| scans == "simulated") {
        bail!("--footage needs simulated scans; add simulated to --scans");
    }
    if !arguments.footage.is_empty() && arguments.split != Split::Training {
        tell(format_args!("note: footage is the same for training, validation and test"));
    }

    let mut groups: Vec<Vec<Scene>> = Vec::new();
    let mut folders = Vec::new();

    for scans in &arguments.scans {
        match scans.as_str() {
            "simulated" => groups.push(flat(arguments)?),
            "relief" => {
                let scenes = relief::scenes(arguments.split, arguments.scenes)?;
                groups.push(scenes.into_iter().map(Scene::Stack).collect());
            }
            folder => folders.push(folder.to_owned()),
        }
    }

    if !folders.is_empty() {
        let bench = BenchScenes::read(&folders, arguments.raw)?;
        groups.push(if arguments.split == Split::Training { bench.training } else { bench.validation });
    }

    Scenery::evenly(groups).ok_or_else(|| "there is nothing to scan; name scans with --scans".into())
}

/// Scenes with everything at one distance.
fn flat(arguments: &Arguments) -> Result<Vec<Scene>, Failure> {
    let clips = if arguments.footage.is_empty() {
        // Scans that are those of the reference benchmark are over its kind of pictures.
        let draw = if arguments.variety > 0.0 { varied } else { reference };
        draw(arguments.split, arguments.scenes)?
    } else {
        footage::clips(&arguments.footage)?
    };
    Ok(clips.into_iter().map(Scene::Flat).collect())
}

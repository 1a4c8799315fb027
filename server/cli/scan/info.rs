//! `parfocal scan info`: what a scan holds, and whether it is whole and unchanged.

use std::fmt::Write;
use std::path::PathBuf;

use rayon::prelude::*;
use serde::Serialize;

use crate::cli::output::{Failure, bar_of_poses, print_result, save_plot};
use parfocal_base::plot::{Axis, Plot};
use parfocal_devices::camera::recorded::{Damage, Image, ScanFolder, poses};
use parfocal_learning::scans::stack::optics::StackOptics;
use parfocal_learning::scans::stack::{FocalStack, Plane};

/// Most poses whose focus curves are used.
const SHOWN: usize = 3;

/// Arguments of `parfocal scan info`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder of the scan.
    folder: PathBuf,
    /// Print JSON.
    #[arg(long)]
    json: bool,
    /// Also save a plot of the optimum over the poses as this SVG file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What is printed.
#[derive(Debug, Serialize)]
struct Info {
    path: String,
    camera: String,
    lens: Option<String>,
    simulated: bool,
    calibration: Option<String>,
    seed: u64,
    poses: usize,
    recorded: usize,
    focal_powers: Vec<f64>,
    width: usize,
    height: usize,
    bytes: u64,
    optimum: Optimum,
    /// Figures of the optic; `None` if the poses have too few focal powers or pictures are damaged.
    optics: Option<StackOptics>,
    deviation: Option<Deviation>,
    missing: Vec<usize>,
    damaged: Vec<String>,
}

/// The optimum over the poses.
#[derive(Debug, Default, Serialize)]
struct Optimum {
    min: f64,
    max: f64,
    /// Mean absolute change from one pose to the next.
    step: f64,
}

/// Distance of the optimum found in the pictures from the one that a simulation knows.
#[derive(Debug, Serialize)]
struct Deviation {
    mean: f64,
    max: f64,
    /// The pose of `max`.
    worst_pose: usize,
    /// Fraction of poses within one step of the focal powers.
    within_step: f64,
}

/// Looks at the scan and checks every picture.
///
/// # Errors
/// If there is no scan. If poses are missing or pictures are damaged, after reporting them.
pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scan = ScanFolder::open(&arguments.folder)?;
    let progress = bar_of_poses(scan.poses().len());
    let poses: Vec<_> = scan.poses().values().collect();
    let checked: Vec<_> = poses.par_iter().map(|pose| scan.check(pose)).inspect(|_| progress.inc(1)).collect();
    progress.finish_and_clear();

    let bytes = checked.iter().map(|(bytes, _)| bytes).sum();
    let damages: Vec<Damage> = checked.into_iter().flat_map(|(_, damages)| damages).collect();
    let info = info(&scan, bytes, &damages);

    // A plot that cannot be saved costs nobody what was found.
    let saved = arguments.out.as_ref().map_or(Ok(()), |path| save_plot(path, &picture(&scan)));
    print_result(arguments.json, &info, || text(&info))?;
    saved?;

    if let Some(damage) = damages.first() {
        let more = if damages.len() > 1 { format!(" (and {} more)", damages.len() - 1) } else { String::new() };
        bail!(
            "{} is damaged: {}{more}; restore it from a copy, or record the scan again",
            scan.path().join(&damage.file).display(),
            damage.reason
        );
    }

    scan.whole()?;
    Ok(())
}

fn info(scan: &ScanFolder, bytes: u64, damages: &[Damage]) -> Info {
    let header = scan.header().clone();
    let first = scan.poses().values().next();
    Info {
        path: scan.path().display().to_string(),
        camera: header.camera,
        lens: header.lens,
        simulated: header.simulated,
        calibration: header.calibration,
        seed: header.seed,
        poses: header.poses,
        recorded: scan.poses().len(),
        focal_powers: header.focal_powers.iter().map(|power| power.get()).collect(),
        width: first.map_or(0, |pose| pose.width),
        height: first.map_or(0, |pose| pose.height),
        bytes,
        optimum: optimum(&path(scan)),
        optics: if damages.is_empty() { optics_of(scan) } else { None },
        deviation: deviation(scan),
        missing: scan.missing(),
        damaged: damages.iter().map(|damage| damage.file.clone()).collect(),
    }
}

/// The optimum of each stored pose.
fn path(scan: &ScanFolder) -> Vec<f64> {
    scan.poses().values().map(|pose| pose.optimum.get()).collect()
}

fn optimum(path: &[f64]) -> Optimum {
    let steps = path.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    Optimum {
        min: path.iter().copied().reduce(f64::min).unwrap_or_default(),
        max: path.iter().copied().reduce(f64::max).unwrap_or_default(),
        // Not with `sum`, which gives -0 for no values.
        step: steps.fold(0.0, |sum, step| sum + step) / (path.len().max(2) - 1) as f64,
    }
}

fn deviation(scan: &ScanFolder) -> Option<Deviation> {
    let poses = scan.poses().values();
    let known: Vec<_> = poses.filter_map(|pose| Some((pose.pose, pose.optimum.distance(pose.truth?)))).collect();

    let powers = &scan.header().focal_powers;
    let step = powers.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f64::max);
    let &(worst_pose, max) = known.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let count = known.len() as f64;

    Some(Deviation {
        mean: known.iter().map(|known| known.1).sum::<f64>() / count,
        max,
        worst_pose,
        within_step: known.iter().filter(|known| known.1 <= step).count() as f64 / count,
    })
}

fn text(info: &Info) -> String {
    let first = info.focal_powers.first().copied().unwrap_or_default();
    let last = info.focal_powers.last().copied().unwrap_or_default();
    let mut rows = vec![
        ("camera", info.camera.clone()),
        ("lens", info.lens.clone().unwrap_or_else(|| "unknown".to_owned())),
        ("calibration", info.calibration.clone().unwrap_or_else(|| "none".to_owned())),
        ("seed", info.seed.to_string()),
        ("poses", format!("{} of {}", info.recorded, info.poses)),
        ("focal powers", format!("{} from {first:.3} to {last:.3}", info.focal_powers.len())),
        ("pictures", format!("{}x{} pixels, {} bytes in all", info.width, info.height, info.bytes)),
        (
            "optimum",
            format!("{:.3} to {:.3}, changes by {:.4} per pose", info.optimum.min, info.optimum.max, info.optimum.step),
        ),
    ];

    if let Some(Deviation { mean, max, worst_pose, within_step }) = &info.deviation {
        let share = 100.0 * within_step;
        rows.push((
            "error",
            format!("{mean:.4} on average, {max:.3} at most (pose {worst_pose}); {share:.1} % within a step"),
        ));
    }

    if !info.missing.is_empty() {
        rows.push(("missing", poses(&info.missing)));
    }
    rows.push(("damaged", if info.damaged.is_empty() { "none".to_owned() } else { info.damaged.join(", ") }));

    let mut text = table(&rows);

    if let Some(found) = &info.optics {
        text.push_str(&optics(found, "focal power"));
    }
    text
}

fn table(rows: &[(&str, String)]) -> String {
    rows.iter().fold(String::new(), |mut text, (name, value)| {
        let _ = writeln!(text, "{name:<14}{value}");
        text
    })
}

/// An optic's figures, one per line; `unit` names the unit of the pictures' positions.
pub(super) fn optics(optics: &StackOptics, unit: &str) -> String {
    let mut rows = Vec::new();
    if let Some(blur) = optics.blur_per_unit {
        rows.push(("blur", format!("grows by {blur:.3} pixels per unit of {unit}")));
    }
    if let Some(softness) = optics.softness {
        rows.push(("softness", format!("the best picture is blurred by {softness:.1} pixels")));
    }
    if let Some(growth) = optics.magnification {
        rows.push(("magnification", format!("changes by {:+.2} % from the first {unit} to the last", 100.0 * growth)));
    }

    let mut text = table(&rows);
    for place in &optics.places {
        let name = format!("{},{}", place.x, place.y);
        let sees = if place.sharpness.iter().any(|value| *value > 0.0) {
            format!("sharpest at {unit} {:.3}", place.best)
        } else {
            "nothing to focus on".to_owned()
        };
        let _ = writeln!(text, "{name:<14}{} {sees}", bars(&place.sharpness));
    }
    text
}

/// A curve as a line of bars, from 0 to its maximum.
fn bars(curve: &[f64]) -> String {
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = curve.iter().copied().fold(1e-9, f64::max);
    curve.iter().map(|value| BARS[((7.99 * value / most) as usize).min(7)]).collect()
}

/// The optic's figures, measured on some of the poses.
fn optics_of(scan: &ScanFolder) -> Option<StackOptics> {
    let poses: Vec<_> = scan.poses().values().collect();
    let shown = poses.iter().step_by(poses.len().div_ceil(SHOWN).max(1));
    let stacks = shown.filter_map(|pose| {
        let plane = |image: &Image| {
            let picture = scan.picture(pose, image).ok()?;
            Some(Plane { name: image.file.clone(), position: image.focal_power.get(), picture })
        };

        FocalStack::new(pose.images.iter().map(plane).collect::<Option<_>>()?).ok()
    });

    let found: Vec<StackOptics> = stacks.map(|stack| StackOptics::of(&stack)).collect();
    (!found.is_empty()).then(|| StackOptics::together(found))
}

/// Plots the optimum over the poses in black, and the truth behind it if it is known.
fn picture(scan: &ScanFolder) -> String {
    let truth: Option<Vec<f64>> = scan.poses().values().map(|pose| Some(pose.truth?.get())).collect();
    let path = path(scan);
    let across = Axis { label: "pose", from: 1.0, to: path.len().max(1) as f64 };
    let up = Axis { label: "focal power", from: 0.0, to: 1.0 };

    let mut plot = Plot::default();
    let mut panel = plot.panel(across, up);
    if let Some(truth) = &truth {
        panel.values("truth", "#56b4e9", truth);
    }
    panel.values("optimum", "black", &path);
    plot.svg()
}

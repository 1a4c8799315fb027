//! Shows how the reference benchmark's scans were chosen. Several kinds of disturbance at several strengths are tried
//! on validation pictures. Only `fixed` and the hill-climbers are compared with the paper's simulated column. The
//! candidate whose largest deviation is the least wins. `cargo bench --bench calibrate`

use std::sync::Arc;

use parfocal_autofocus::Registry;
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_base::PolicyName;
use parfocal_devices::simulation::texture::vary_contrast;
use parfocal_imaging::GrayImage;
use parfocal_learning::evaluation::{Outcome, evaluate};
use parfocal_learning::scans::benchmark::{Benchmark, Conditions, FRAMES};
use parfocal_learning::scans::clip::Clip;
use parfocal_learning::scans::pictures::{Split, sharp_phantom};
use parfocal_learning::scans::simulated::{ScanSettings, Scene};

const COUNT: usize = 200;
/// The paper's simulated column: policy and mean absolute error.
const PAPER: [(&str, f64); 3] = [("fixed", 0.236), ("mgm-hill-climber", 0.102), ("mlr-hill-climber", 0.092)];

/// One candidate: its name, the scans' settings, and how much the pictures' contrast varies from place to place.
struct Candidate {
    name: String,
    settings: ScanSettings,
    uneven: f32,
}

fn candidates() -> Vec<Candidate> {
    let plain = ScanSettings::default();
    let mut all = Vec::new();
    let mut add = |name: String, settings: ScanSettings, uneven: f32| all.push(Candidate { name, settings, uneven });
    add("walks alone".to_owned(), plain, 0.0);
    for strength in [0.07, 0.08, 0.09, 0.10, 0.11] {
        add(format!("contrast a frame, sd {strength}"), ScanSettings { flicker: strength, ..plain }, 0.0);
    }
    for strength in [0.3, 0.4, 0.5, 0.6, 0.7] {
        add(format!("tremor, sd {strength} px"), ScanSettings { tremor: strength, ..plain }, 0.0);
    }
    for strength in [0.4f32, 0.8, 1.0, 1.2] {
        for speed in [1.0, 2.0, 4.0, 5.0, 6.0] {
            let mut settings = plain;
            settings.crop.speed = speed;
            add(format!("contrast from place to place, sd {strength}, crop {speed} px"), settings, strength);
        }
    }
    all
}

fn main() {
    compute_on_this_thread();
    let pictures: Vec<GrayImage> = (0..COUNT as u64).map(|index| sharp_phantom(Split::Validation, index)).collect();
    let registry = Registry::standard();
    let policies = PAPER.map(|(name, _)| PolicyName::new(name));
    println!("largest deviation; then MAE and share in focus of fixed, MGM and MLR hill-climber");
    for Candidate { name, settings, uneven } in candidates() {
        let scenes = pictures.iter().zip(0..).map(|(picture, seed)| {
            let mut picture = picture.clone();
            if uneven > 0.0 {
                vary_contrast(&mut picture, uneven, seed);
            }
            Scene::Flat(Arc::new(Clip::still(picture).unwrap()))
        });
        let conditions = Conditions::Same(settings);
        let benchmark = Benchmark { scenes: scenes.collect(), conditions, seed: 1, count: COUNT, frames: FRAMES };
        let outcomes = evaluate(&registry, &policies, &benchmark, &|_| ()).unwrap();
        let rows: Vec<_> = outcomes.iter().skip(1).map(Outcome::row).collect();
        let deviation = rows.iter().zip(PAPER).map(|(row, (_, mae))| (row.mae / mae - 1.0).abs()).fold(0.0, f64::max);
        let figures: Vec<_> = rows.iter().map(|row| format!("{:.3} {:.1} %", row.mae, 100.0 * row.in_focus)).collect();
        println!("{:5.1} %  {}  {name}", 100.0 * deviation, figures.join("  "));
    }
}

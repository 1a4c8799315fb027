//! Shows how the hand that moves over the recorded benchmark's phantom was chosen. Several speeds along the surface and
//! towards it are tried on brains that the benchmark does not use. Only `fixed` and the hill-climbers are compared with
//! the paper's robotic column. The candidate whose largest deviation is the least wins. The last line is the benchmark
//! itself. `cargo bench --bench calibrate_recorded`, with `-- frozen` for that line alone.

use std::sync::Arc;

use parfocal_autofocus::Registry;
use parfocal_base::PolicyName;
use parfocal_devices::simulation::phantom::{Haste, Trajectory};
use parfocal_learning::evaluation::{Outcome, evaluate};
use parfocal_learning::scans::benchmark::SEED;
use parfocal_learning::scans::recorded::{
    FOCAL_POWERS, HASTE, Interpolation, Kept, POSES, RecordedScan, RecordedScans,
};

/// The paper's robotic column: policy and mean absolute error.
const PAPER: [(&str, f64); 3] = [("fixed", 0.262), ("mgm-hill-climber", 0.146), ("mlr-hill-climber", 0.163)];
/// Number of brains tried at each speed, and of poses over each.
const TRIED: (u64, usize) = (3, 400);

fn main() {
    println!("largest deviation; then MAE and share in focus of oracle, fixed, MGM and MLR hill-climber");
    let tried: &[f64] = if std::env::args().any(|argument| argument == "frozen") { &[] } else { &[1.0, 2.0, 3.0] };
    for &focus in tried {
        for sideways in [8.0, 16.0, 24.0, 32.0, 40.0] {
            let haste = Haste { sideways, focus };
            report((1..=TRIED.0).map(|brain| scan(SEED + brain, haste, TRIED.1)).collect(), haste);
        }
    }
    report(vec![scan(SEED, HASTE, POSES)], HASTE);
}

fn scan(seed: u64, haste: Haste, poses: usize) -> Arc<RecordedScan> {
    let trajectory = Trajectory::new(seed, poses, haste);
    Arc::new(RecordedScan::phantom(&trajectory, seed, FOCAL_POWERS, Kept::Patches, &|| ()))
}

fn report(scans: Vec<Arc<RecordedScan>>, haste: Haste) {
    let set = RecordedScans { scans, between: Interpolation::Nearest };
    let policies = PAPER.map(|(name, _)| PolicyName::new(name));
    let outcomes = evaluate(&Registry::standard(), &policies, &set, &|_| ()).unwrap();
    let rows: Vec<_> = outcomes.iter().map(Outcome::row).collect();
    let deviation = rows[1..].iter().zip(PAPER).map(|(row, (_, mae))| (row.mae / mae - 1.0).abs()).fold(0.0, f64::max);
    let figures: Vec<_> = rows.iter().map(|row| format!("{:.3} {:.1} %", row.mae, 100.0 * row.in_focus)).collect();
    let Haste { sideways, focus } = haste;
    println!("{:5.1} %  {}  sideways {sideways}, focus {focus}", 100.0 * deviation, figures.join("  "));
}

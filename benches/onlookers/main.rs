//! Measures how often the depth map is right: a tracker of `parfocal`'s weights looks on at one place while a policy
//! moves the lens for another one. What it says of its place is compared with the truth, which scans know.
//! `cargo bench --bench onlookers -- STACK...`, each a focal stack's folder as `parfocal evaluate --stacks` takes it;
//! without stacks, on the benchmark and on scenes with relief.

use std::sync::Arc;

use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_autofocus::{Observation, Registry};
use parfocal_base::{FocalPower, IN_FOCUS, PolicyName};
use parfocal_learning::scans::benchmark::{Benchmark, COUNT};
use parfocal_learning::scans::stack::drift::{StackCourse, StackScans};
use parfocal_learning::scans::stack::source::StackSource;
use parfocal_learning::scans::{FocalTimeScan, ScanSet};
use parfocal_pipeline::live::Side;

/// Policies that move the lens.
const DRIVERS: [&str; 3] = ["mgm-hill-climber", "mgm-bisection", "parfocal"];
/// Frames at the beginning that are not counted.
const FIRST: usize = 25;
/// Scans of the benchmark, and of relief.
const SCANS: usize = 40;
/// First of the seeds of a stack's courses, and their number.
const SEEDS: std::ops::Range<u64> = 31..35;

/// How often something was told, and right.
#[derive(Default, Clone, Copy)]
struct Count {
    all: usize,
    told: usize,
    right: usize,
}

impl Count {
    /// `right`: `None` where nothing was told.
    fn add(&mut self, right: Option<bool>) {
        self.all += 1;
        self.told += usize::from(right.is_some());
        self.right += usize::from(right == Some(true));
    }

    fn words(self) -> String {
        let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
        format!("{:.0} %: {:.0} %", share(self.told, self.all), share(self.right, self.told))
    }
}

/// The sides that were told while `driver` followed the scan `seen` and the onlooker saw `other`.
fn look_on(
    driver: &PolicyName,
    mut seen: Box<dyn FocalTimeScan>,
    mut other: Box<dyn FocalTimeScan>,
    frames: usize,
    sides: &mut Count,
) {
    let registry = Registry::standard();
    let mut policy = registry.build(driver).expect("ships");
    let mut onlooker = registry.build(&PolicyName::new("parfocal")).expect("ships");
    let mut focal_power = FocalPower::MIDDLE;

    for frame in 0..frames {
        let target = policy.step(&Observation { view: &seen.observe(focal_power), focal_power }).target;
        let asked = FocalPower::nearest(target);
        let view = other.observe(focal_power);
        let belief = onlooker.look_on(&Observation { view: &view, focal_power }, asked).expect("has a belief");

        // A belief is about the next frame, but people see it beside this one.
        let distance = other.optimum().get() - focal_power.get();
        if frame >= FIRST {
            sides.add(match Side::of(&belief, focal_power) {
                Side::Unknown => None,
                Side::InFocus => Some(distance.abs() < IN_FOCUS),
                Side::Higher => Some(distance > 0.0),
                Side::Lower => Some(distance < 0.0),
            });
        }

        seen.advance();
        other.advance();
        focal_power = asked;
    }
}

/// Counts for each driver over the scans of `set`, each with the next one as the other place.
fn counts(set: &dyn ScanSet, count: usize) -> [Count; DRIVERS.len()] {
    DRIVERS.map(|driver| {
        let mut sides = Count::default();
        for index in 0..count {
            let (seen, frames) = set.scan(index);
            let (other, _) = set.scan((index + 1) % count);
            look_on(&PolicyName::new(driver), seen, other, frames, &mut sides);
        }
        sides
    })
}

fn print(name: &str, counts: [Count; DRIVERS.len()]) {
    println!("| {name} | {} |", counts.map(Count::words).join(" | "));
}

fn main() {
    compute_on_this_thread();
    let stacks: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    println!("| side told: right | {} |", DRIVERS.join(" | "));
    println!("|---|{}", "---|".repeat(DRIVERS.len()));

    if stacks.is_empty() {
        print("benchmark", counts(&Benchmark::reference(COUNT).expect("is drawn"), SCANS));
        print("relief", counts(&Benchmark::relief(COUNT).expect("is drawn"), SCANS));
        return;
    }

    let mut all = [Count::default(); DRIVERS.len()];
    for text in &stacks {
        let source = StackSource::parse(text, None);
        let (scaled, _) = source.at_scales().expect("a focal stack");
        for stack in scaled {
            let course = |seed| StackCourse::new(Arc::clone(&stack.pictures), stack.planes, seed).expect("is large");
            let scans = StackScans(SEEDS.map(|seed| Arc::new(course(seed))).collect());
            let found = counts(&scans, scans.count());
            print(&format!("{} {}", source.folder.display(), stack.scale), found);
            for (sum, found) in all.iter_mut().zip(found) {
                sum.all += found.all;
                sum.told += found.told;
                sum.right += found.right;
            }
        }
    }
    print("all", all);
}

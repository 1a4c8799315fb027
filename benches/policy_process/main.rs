//! Measures what a policy in another process costs beside the same policy built in: `fixed`, which computes nothing, in
//! Python by `parfocal.policy.serve`. `cargo bench --features aravis --bench policy_process`

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use parfocal_autofocus::exec::{ProcessSettings, Times, with_command};
use parfocal_autofocus::{Observation, Policy, Registry};
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_base::{FocalPower, PolicyName};
use parfocal_imaging::{PATCH_SIDE, Patch, View};
use parfocal_pipeline::control::LatencyFigures;

/// Frames without a pause in between, which keeps all caches warm.
const CLOSE: usize = 5000;
/// Frames as a camera delivers them.
const PACED: usize = 500;
const PERIOD: Duration = Duration::from_millis(20);

const MINE: &str = "import parfocal.policy\nparfocal.policy.serve(lambda picture, focal_power: 0.0)\n";

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("mine.py");
    std::fs::write(&file, MINE).expect("can be written");

    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let places = ["python/src", "target/python", "target/recordings"].map(|place| root.join(place));
    let places = std::env::join_paths(places).expect("no colons in them");
    let name = format!("exec:env 'PYTHONPATH={}' python3 -s {}", places.display(), file.display());
    let name = PolicyName::new(&name);

    let registry = with_command(Registry::standard(), &name, &settings());
    match registry.build(&name) {
        Ok(outside) => measure("in Python", outside),
        Err(error) => println!("skipped the process: {error}"),
    }
    measure("built in", registry.build(&PolicyName::new("fixed")).expect("ships"));
}

fn settings() -> ProcessSettings {
    ProcessSettings {
        launcher: env!("CARGO_BIN_EXE_parfocal").into(),
        clock: Arc::new(SystemClock),
        start: Duration::from_mins(1),
        answer: Duration::from_secs(1),
        build: Duration::from_secs(1),
        many: false,
        times: Times::Clock,
        say: |line| println!("policy: {line}"),
    }
}

fn measure(name: &str, mut policy: Box<dyn Policy>) {
    let view =
        View::from(Patch(std::array::from_fn::<_, { PATCH_SIDE * PATCH_SIDE }, _>(|index| (index % 256) as f32)));
    let mut step = || {
        let began = SystemClock.now();
        policy.step(&Observation { view: &view, focal_power: FocalPower::MIDDLE });
        SystemClock.now().since(began).as_micros() as u32
    };

    let mut close: Vec<u32> = (0..CLOSE).map(|_| step()).collect();
    let mut paced: Vec<u32> = (0..PACED)
        .map(|_| {
            std::thread::sleep(PERIOD);
            step()
        })
        .collect();
    for (how, took) in [("without a pause", &mut close), ("at 50 frames a second", &mut paced)] {
        let LatencyFigures { steps, p50, p99 } = LatencyFigures::of(took);
        println!("fixed, {name}, {steps} steps {how}: p50 {p50} µs, p99 {p99} µs");
    }
}

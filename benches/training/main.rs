//! Measures what training costs: environment steps, replay memory, and updates compared with the same loop in `PyTorch`
//! (`peer.py`). `cargo bench --bench training`; for the peer, set PYTHON to a Python that has `PyTorch` 2.11.

use std::hint::black_box;
use std::process::Command;
use std::sync::Arc;

use parfocal_autofocus::learned::Input;
use parfocal_autofocus::networks::compute_on_this_thread;
use parfocal_base::clock::{Clock, SystemClock};
use parfocal_imaging::{PATCH_SIDE, Patch};
use parfocal_learning::scans::clip::Clip;
use parfocal_learning::scans::pictures::{Split, varied};
use parfocal_learning::scans::scenery::Scenery;
use parfocal_learning::scans::variety::Variety;
use parfocal_learning::training::belief::BeliefTrainer;
use parfocal_learning::training::dqn::DqnTrainer;
use parfocal_learning::training::dqn::replay::{CompactView, Replay, Transition};
use parfocal_learning::training::environment::Environment;
use parfocal_learning::training::recipe::{Recipe, shipped};
use parfocal_learning::training::trainer::Trainer;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Transitions in a window.
const TRANSITIONS: usize = 16;

/// Runs `work` a few times to warm up, and then `times` times. Returns how often a second it ran.
fn rate(times: u32, mut work: impl FnMut()) -> f64 {
    (0..=times / 10).for_each(|_| work());
    let begin = SystemClock.now();
    (0..times).for_each(|_| work());
    f64::from(times) / SystemClock.now().since(begin).as_secs_f64()
}

fn environment(clips: &[Arc<Clip>]) {
    let scenery = Scenery::from(clips.to_vec());
    for (name, share) in [("reference scans", 0.0), ("varied scans", 1.0)] {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut environments: Vec<_> =
            (0..64).map(|_| Environment::draw(&scenery, Variety { share }, 0.0, &mut rng)).collect();
        let rounds = rate(200, || {
            for environment in &mut environments {
                black_box(environment.observe());
                let target = environment.focal_power().get() + 0.01;
                environment.advance(target);
            }
        });
        println!("environment, {name}: {:.0} steps a second", 64.0 * rounds);
    }
}

fn updates(clips: &[Arc<Clip>], name: &str, input: Input, batch: usize, times: u32) {
    let mut recipe = Recipe::parse(shipped(name).unwrap()).unwrap().dqn.unwrap();
    // A window's first seven frames have no full history, its last no successor.
    (recipe.windows, recipe.window) = (batch / TRANSITIONS, TRANSITIONS + 8);
    // As in `peer.py` the memory is filled once and no frame is played meanwhile.
    (recipe.frames_an_update, recipe.warm_up, recipe.replay) = (0, 20_000, 20_000);
    let mut trainer = DqnTrainer::new(input, recipe, clips.to_vec().into(), 1, tch::Device::Cpu);
    trainer.update();
    let rate = rate(times, || {
        black_box(trainer.update());
    });
    println!("ours {name}, {batch} transitions: {rate:.1} updates a second, {:.0} transitions", rate * batch as f64);
}

/// Updates a second of whole trainings, including the frames that they play: on one thread, and on one for each core.
fn trainings(clips: &[Arc<Clip>]) {
    for (name, times) in [("cnn-learned", 500), ("parfocal-glass", 40)] {
        for threads in [1, 0] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let (rate, threads) = pool.install(|| {
                compute_on_this_thread();
                let mut trainer = trainer(name, clips);
                let update = || {
                    black_box(trainer.update());
                };
                (rate(times, update), rayon::current_num_threads())
            });
            println!("training {name}, {threads} threads: {rate:.1} updates a second");
        }
    }
}

/// A training by the recipe `name`, over `clips` alone.
fn trainer(name: &str, clips: &[Arc<Clip>]) -> Box<dyn Trainer> {
    let recipe = Recipe::parse(shipped(name).unwrap()).unwrap();
    let scenery = Scenery::from(clips.to_vec());
    match (recipe.dqn, recipe.belief) {
        (Some(dqn), _) => Box::new(DqnTrainer::new(Input::Patch, dqn, scenery, 1, tch::Device::Cpu)),
        (None, belief) => Box::new(BeliefTrainer::new(belief.unwrap(), scenery, 1, tch::Device::Cpu)),
    }
}

fn memory() {
    const FRAMES: usize = 2_500_000;
    let mut replay = Replay::new(FRAMES, 8);
    let seen = CompactView::patch(&Patch([7.0; PATCH_SIDE * PATCH_SIDE]));
    for index in 0..FRAMES {
        replay.push(index % 8, &seen, Transition::default());
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let resident: f64 =
        status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok()).unwrap();
    println!("replay memory of {FRAMES} patches: the process holds {:.2} GB", resident * 1024.0 / 1e9);
    black_box(replay.len());
}

fn main() {
    let clips = varied(Split::Training, 12).unwrap();
    // One thread, as `peer.py` has.
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| {
        compute_on_this_thread();
        environment(&clips);
        // The batches of `peer.py`.
        for batch in [32, 256] {
            updates(&clips, "mgm-learned-paper", Input::Mgm, batch, 300);
            updates(&clips, "cnn-learned-paper", Input::Patch, batch, 60);
        }
    });
    trainings(&clips);
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    match Command::new(&python).arg("benches/training/peer.py").status() {
        Ok(status) if status.success() => {}
        _ => println!("no peer: '{python}' has no PyTorch; set PYTHON to one that has"),
    }
    memory();
}

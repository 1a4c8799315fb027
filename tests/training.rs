//! Training and evaluation from outside: a short training learns, stopping changes nothing, the same seed gives the same
//! figures.

use std::cell::Cell;
use std::path::Path;
use std::process::{Command, Output};

use parfocal::clock::SystemClock;
use parfocal::training::checkpoint::Checkpoint;
use parfocal::training::recipe::{Recipe, shipped};
use parfocal::training::run::{Beginning, LEG, Run};

/// The recipe that ships for `policy`, small.
fn small(policy: &str, updates: u64) -> Recipe {
    let mut recipe = Recipe::parse(shipped(policy).unwrap()).unwrap();
    (recipe.pictures, recipe.validate_every, recipe.benchmark) = (6, updates, 2);
    if let Some(dqn) = &mut recipe.dqn {
        (dqn.scans, dqn.frames_an_update, dqn.warm_up, dqn.replay) = (8, 16, 1000, 4000);
        (dqn.windows, dqn.window, dqn.updates) = (8, 16, updates);
        (dqn.epsilon_frames, dqn.variety) = (5000, 0.0);
    }
    if let Some(belief) = &mut recipe.belief {
        (belief.scans, belief.window, belief.updates, belief.variety) = (8, 16, updates, 0.0);
    }
    recipe
}

/// Trains for at most `legs` legs; returns whether the training is complete.
fn train(recipe: &Recipe, folder: &Path, legs: u64, beginning: &Beginning) -> bool {
    tch::set_num_threads(1);
    let mut run = Run::start(recipe.clone(), 7, Vec::new(), folder, beginning, tch::Device::Cpu).unwrap();
    let left = Cell::new(legs);
    run.go(&SystemClock, &|| left.replace(left.get().saturating_sub(1)) == 0, &mut |_| ()).unwrap()
}

#[test]
fn a_short_training_beats_a_lens_that_stays_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut recipe = small("parfocal", 500);
    if let Some(belief) = &mut recipe.belief {
        belief.scans = 32;
    }
    assert!(train(&recipe, folder.path(), u64::MAX, &Beginning::Nothing));
    let curves = std::fs::read_to_string(folder.path().join("curves.csv")).unwrap();
    let mae: f64 = curves.trim_end().rsplit(',').next().unwrap().parse().unwrap();
    // `fixed` has 0.25: the mean distance of a uniformly spread optimum from the middle.
    assert!(mae < 0.2, "{mae}");
}

#[test]
fn what_begins_with_weights_begins_with_what_they_know() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = small("mgm-learned", 1);
    let start = |file: &str| {
        let beginning = Beginning::Weights(file.into());
        Run::start(recipe.clone(), 7, Vec::new(), folder.path(), &beginning, tch::Device::Cpu)
    };
    // Another policy's weights are refused, and leave nothing behind.
    assert!(
        start("policies/parfocal.safetensors").err().unwrap().to_string().contains("cannot begin with the weights")
    );
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    let mut run = start("policies/mgm-learned.safetensors").unwrap();
    assert!(run.go(&SystemClock, &|| false, &mut |_| ()).unwrap());
    run.report().unwrap();
    run.report().unwrap();
    // After a single update: the shipped weights' error, where random ones stand at 0.25.
    assert!(run.best() < 0.15, "{}", run.best());
    let card = std::fs::read_to_string(folder.path().join("MODEL_CARD.md")).unwrap();
    assert!(card.contains("the weights policies/mgm"));
    assert_eq!(
        card.matches("scans of the reference benchmark (seed 2023): mean absolute focal power error 0.").count(),
        1
    );
}

#[test]
fn training_resumed_is_training_never_stopped() {
    for policy in ["mgm-learned", "cnn-learned", "parfocal"] {
        let recipe = small(policy, 2 * LEG);
        let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        assert!(train(&recipe, whole.path(), u64::MAX, &Beginning::Nothing));
        assert!(!train(&recipe, parts.path(), 1, &Beginning::Nothing));
        let start = || {
            Run::start(recipe.clone(), 7, Vec::new(), parts.path(), &Beginning::Checkpoint, tch::Device::Cpu).unwrap()
        };
        assert_eq!(start().other_version(), None);
        let file = parts.path().join("checkpoint.safetensors");
        let mut checkpoint = Checkpoint::read(&file).unwrap();
        checkpoint.notes.insert("version".to_owned(), "0.0.9".to_owned());
        checkpoint.write(&file).unwrap();
        assert_eq!(start().other_version(), Some("0.0.9"));
        assert!(train(&recipe, parts.path(), u64::MAX, &Beginning::Checkpoint));
        for file in ["curves.csv", &format!("{policy}.safetensors")] {
            let read = |folder: &tempfile::TempDir| std::fs::read(folder.path().join(file)).unwrap();
            assert!(read(&whole) == read(&parts), "{policy}: {file} differs");
        }
    }
}

fn parfocal(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_parfocal")).args(arguments).output().unwrap()
}

#[test]
fn the_same_seed_gives_the_same_figures_to_the_last_digit() {
    let evaluate =
        || parfocal(&["evaluate", "--count", "2", "--policies", "fixed,mgm-hill-climber,parfocal", "--json"]);
    let (first, second) = (evaluate(), evaluate());
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    assert_eq!(first.stdout, second.stdout);
    let report: serde_json::Value = serde_json::from_slice(&first.stdout).unwrap();
    let names: Vec<_> = report["rows"].as_array().unwrap().iter().map(|row| row["policy"].as_str().unwrap()).collect();
    assert_eq!(names, ["oracle", "fixed", "mgm-hill-climber", "parfocal"]);
    assert_eq!(report["comparisons"].as_array().unwrap().len(), 3);
    assert!(report["rows"][0]["in_focus"].as_f64().unwrap() > 0.9);
}

#[test]
fn parfocal_keeps_the_lens_still_while_there_is_nothing_to_see() {
    let folder = tempfile::tempdir().unwrap();
    let glove = folder.path().join("glove.png");
    image::GrayImage::from_pixel(128, 128, image::Luma([90])).save(&glove).unwrap();
    let output = parfocal(&[
        "evaluate",
        "--count",
        "2",
        "--policies",
        "mgm-hill-climber,parfocal",
        "--json",
        "--footage",
        glove.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let travels = [1, 2].map(|row: usize| report["rows"][row]["travel"].as_f64().unwrap());
    // A hill-climber steps at every frame.
    assert!((travels[0] - 0.05).abs() < 1e-9 && travels[1] == 0.0, "{travels:?}");
}

#[test]
fn bad_input_is_answered_with_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let out = out.to_str().unwrap();
    let recipe = folder.path().join("recipe.toml");
    std::fs::write(&recipe, shipped("mgm-learned").unwrap().replace("warm_up", "warmup")).unwrap();
    let recipe = recipe.to_str().unwrap();
    let few = folder.path().join("few.toml");
    std::fs::write(&few, shipped("mgm-learned").unwrap().replace("pictures = 960", "pictures = 3")).unwrap();
    let few = few.to_str().unwrap();
    let foreign = "policies/parfocal.safetensors";
    for (arguments, told) in [
        (vec!["evaluate", "--policies", "nonsense", "--count", "1"], "there is no policy 'nonsense'"),
        (vec!["evaluate", "--footage", "/no/such.mp4"], "there is no such file"),
        (vec!["train", "fixed", "--out", out], "nothing trains 'fixed'"),
        (vec!["train", "parfocal", "--out", out, "--device", "cuda"], "use --device cpu"),
        (vec!["train", "mgm-learned", "--out", out, "--config", recipe], "unknown field `warmup`"),
        (vec!["train", "parfocal", "--out", out, "--resume"], "cannot use the checkpoint"),
        (
            vec!["train", "mgm-learned", "--out", out, "--config", few, "--from", foreign],
            "the weights are of another network",
        ),
        (vec!["evaluate", "--weights", out, "--count", "1"], "there are no weights in"),
        (vec!["serve", "--weights", out], "there are no weights in"),
    ] {
        let output = parfocal(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {error}");
        assert!(error.contains(told), "{arguments:?}: {error}");
    }
}

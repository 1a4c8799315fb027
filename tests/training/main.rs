//! Training and evaluation from outside: a short training learns, stopping changes nothing, and the same seed gives the
//! same figures.

mod bench;
#[path = "../shared/program.rs"]
mod program;

use std::cell::Cell;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use parfocal_autofocus::Registry;
use parfocal_base::PolicyName;
use parfocal_base::clock::SystemClock;
use parfocal_imaging::GrayImage;
use parfocal_learning::evaluation::evaluate;
use parfocal_learning::scans::benchmark::{Benchmark, Conditions, FRAMES};
use parfocal_learning::scans::clip::Clip;
use parfocal_learning::scans::simulated::Scene;
use parfocal_learning::training::recipe::LEG;
use parfocal_learning::training::recipe::{Recipe, shipped};
use parfocal_learning::training::run::checkpoint::Checkpoint;
use parfocal_learning::training::run::resume::ResumeRequest;
use parfocal_learning::training::run::{Run, Sources};
use rustix::process::Signal;

use self::program::{command, parfocal};

/// The recipe that ships as `policy`, made small, with `updates` updates.
fn small(policy: &str, updates: u64) -> Recipe {
    let mut recipe = Recipe::parse(shipped(policy).unwrap()).unwrap();
    (recipe.pictures, recipe.validate_every, recipe.benchmark) = (6, updates, 2);
    if let Some(dqn) = &mut recipe.dqn {
        (dqn.scans, dqn.frames_an_update, dqn.warm_up, dqn.replay) = (8, 16, 1000, 4000);
        (dqn.windows, dqn.window, dqn.updates) = (8, 16, updates);
        (dqn.epsilon_frames, dqn.variety) = (5000, 0.0);
    }

    if let Some(belief) = &mut recipe.belief {
        (belief.scans, belief.window, belief.updates, belief.variety) = (8, 4, updates, 0.0);
    }
    recipe
}

fn begin(recipe: &Recipe, folder: &Path) -> Run {
    tch::set_num_threads(1);
    Run::begin(recipe.clone(), 7, &Sources::default(), folder, None, tch::Device::Cpu).unwrap()
}

fn resume(policy: &str, folder: &Path) -> Run {
    let asked = ResumeRequest { name: policy.to_owned(), ..ResumeRequest::default() };
    Run::resume(folder, &asked, tch::Device::Cpu).unwrap()
}

/// Trains for at most `legs` legs; returns whether the training is complete.
fn train(mut run: Run, legs: u64) -> bool {
    let left = Cell::new(legs);
    run.go(&SystemClock, &|| left.replace(left.get().saturating_sub(1)) == 0, &mut |_| ()).unwrap()
}

#[test]
fn a_short_training_beats_a_lens_that_stays_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut recipe = small("parfocal", 2 * LEG);
    if let Some(belief) = &mut recipe.belief {
        (belief.scans, belief.window) = (32, 8);
    }
    assert!(train(begin(&recipe, folder.path()), u64::MAX));
    let curves = std::fs::read_to_string(folder.path().join("curves.csv")).unwrap();
    let mae: f64 = curves.trim_end().rsplit(',').next().unwrap().parse().unwrap();
    // `fixed` has 0.25, the mean distance of a uniformly distributed optimum from the middle.
    assert!(mae < 0.2, "{mae}");
}

#[test]
fn the_number_of_cores_changes_no_digit() {
    let recipe = small("parfocal", LEG);
    let weights = [1, 3].map(|cores| {
        let folder = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(cores).build().unwrap();
        assert!(pool.install(|| train(begin(&recipe, folder.path()), u64::MAX)));
        std::fs::read(folder.path().join("parfocal.safetensors")).unwrap()
    });
    assert!(weights[0] == weights[1]);
}

#[test]
fn what_begins_with_weights_begins_with_what_they_know() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = small("mgm-learned", 1);
    let start = |file: &str| {
        let from = Some(Path::new(file));
        Run::begin(recipe.clone(), 7, &Sources::default(), folder.path(), from, tch::Device::Cpu)
    };

    // Another policy's weights are rejected, and no file stays behind.
    assert!(start("policies/parfocal.safetensors").err().unwrap().to_string().contains("cannot use the weights"));
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);

    let mut run = start("policies/mgm-learned.safetensors").unwrap();
    assert!(run.go(&SystemClock, &|| false, &mut |_| ()).unwrap());
    run.report().unwrap();
    // Figures that somebody removed are made again; those on the card stay as they are.
    let figures = folder.path().join("benchmark.json");
    let first = std::fs::read(&figures).unwrap();
    std::fs::remove_file(&figures).unwrap();
    run.report().unwrap();
    assert!(std::fs::read(&figures).unwrap() == first);

    // After one update the error is still that of the shipped weights. Random weights would have 0.25.
    assert!(run.best() < 0.15, "{}", run.best());

    let card = std::fs::read_to_string(folder.path().join("MODEL_CARD.md")).unwrap();
    assert!(card.contains("the weights policies/mgm"));
    assert_eq!(
        card.matches("scans of the reference benchmark (seed 2023): mean absolute focal power error 0.").count(),
        1
    );
}

fn resumed_is_never_stopped(recipe: &str) {
    let recipe = small(recipe, 2 * LEG);
    let policy = &recipe.policy;
    let whole = tempfile::tempdir().unwrap();
    let parts = tempfile::tempdir().unwrap();

    assert!(train(begin(&recipe, whole.path()), u64::MAX));
    assert!(!train(begin(&recipe, parts.path()), 1));
    assert_eq!(resume(policy, parts.path()).other_version(), None);

    let file = parts.path().join("checkpoint.safetensors");
    let mut checkpoint = Checkpoint::read(&file).unwrap();
    checkpoint.notes.insert("version".to_owned(), "0.0.9".to_owned());
    checkpoint.write(&file).unwrap();
    assert_eq!(resume(policy, parts.path()).other_version(), Some("0.0.9"));

    assert!(train(resume(policy, parts.path()), u64::MAX));

    for file in ["curves.csv", &format!("{policy}.safetensors")] {
        let read = |folder: &tempfile::TempDir| std::fs::read(folder.path().join(file)).unwrap();
        assert!(read(&whole) == read(&parts), "{policy}: {file} differs");
    }
}

#[test]
fn training_resumed_is_training_never_stopped() {
    // Side by side: a training computes on one core.
    std::thread::scope(|scope| {
        for recipe in ["mgm-learned", "mgm-learned-paper", "cnn-learned", "parfocal"] {
            scope.spawn(|| resumed_is_never_stopped(recipe));
        }
    });
}

/// A picture of noise, `side` pixels wide and high.
fn picture(folder: &Path, name: &str, side: u32) -> PathBuf {
    let path = folder.join(name);
    let gray = |x: u32, y: u32| image::Luma([u8::try_from((7919 * x + 104_729 * y) % 251).unwrap()]);
    image::GrayImage::from_fn(side, side, gray).save(&path).unwrap();
    path
}

#[test]
fn trainings_are_compared_by_what_their_folders_hold() {
    let folder = tempfile::tempdir().unwrap();
    let short = folder.path().join("short");
    let long = folder.path().join("long");
    let run = |updates: u64, path: &Path| begin(&small("mgm-learned", updates), path);
    let mut complete = run(LEG, &short);
    assert!(complete.go(&SystemClock, &|| false, &mut |_| ()).unwrap());
    complete.report().unwrap();
    assert!(!train(run(2 * LEG, &long), 1));

    let [first, second] = [&short, &long].map(|path| path.to_str().unwrap());
    let output = parfocal(&["train", "--compare", first, second]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(
        output.status.success() && table.starts_with("| run | policy | dqn.updates | validate_every | seed |"),
        "{table}"
    );
    let line = format!("| {second} | mgm-learned | 200 | 200 | 7 | 100 of 200 | – | – | – |");
    assert!(table.contains(&line), "{table}");

    let output = parfocal(&["train", "--compare", first, second, "--json"]);
    let runs: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&runs[0]["seed"], &runs[0]["updates"], &runs[1]["of"]), (&7.into(), &LEG.into(), &200.into()));
    let mae = runs[0]["benchmark"]["mae"].as_f64().unwrap();
    let card = std::fs::read_to_string(short.join("MODEL_CARD.md")).unwrap();
    assert!(card.contains(&format!("(seed 2023): mean absolute focal power error {mae:.4} ")), "{card}");

    let begun = folder.path().join("begun");
    drop(run(LEG, &begun));
    let output = parfocal(&["train", "--compare", first, begun.to_str().unwrap()]);
    assert_eq!(String::from_utf8(output.stdout).unwrap().lines().count(), 3);
    assert!(String::from_utf8_lossy(&output.stderr).contains("begun is left out: it has saved nothing yet"));

    // A training that still draws its pictures, or was stopped there, has a lock alone in its folder.
    let drawing = folder.path().join("drawing");
    let drawing = drawing.to_str().unwrap();
    assert!(!parfocal(&["train", "mgm-learned", "--out", drawing, "--footage", "/no/such.mp4"]).status.success());
    let output = parfocal(&["train", "--compare", first, drawing]);
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("drawing is left out: it has saved nothing yet"));

    let nothing = parfocal(&["train", "--compare", folder.path().to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("holds no saved training"));
    for wrong in [["train", "parfocal"].as_slice(), &["train"], &["train", "parfocal", "--compare", first]] {
        assert_eq!(parfocal(wrong).status.code(), Some(2), "{wrong:?}");
    }
}

#[test]
fn a_training_continues_on_the_footage_that_it_was_begun_with() {
    let folder = tempfile::tempdir().unwrap();
    let first = picture(folder.path(), "first.png", 80);
    let other = picture(folder.path(), "other.png", 90);

    let run = folder.path().join("run");
    let mut recipe = small("mgm-learned", 2 * LEG);
    recipe.pictures = 1;
    let sources = Sources { footage: vec![first.clone()], ..Sources::default() };
    let begun = Run::begin(recipe, 7, &sources, &run, None, tch::Device::Cpu).unwrap();

    assert!(!train(begun, 1));

    let again = |footage: &[&PathBuf], seed: Option<u64>| {
        let footage = footage.iter().copied().cloned().collect();
        let sources = Sources { footage, ..Sources::default() };
        let asked = ResumeRequest { name: "mgm-learned".to_owned(), sources, seed, ..ResumeRequest::default() };
        Run::resume(&run, &asked, tch::Device::Cpu).map(|run| run.updates()).map_err(|error| error.to_string())
    };

    assert_eq!(again(&[], Some(7)), Ok(LEG));
    assert_eq!(again(&[&first], None), Ok(LEG));
    assert!(again(&[], Some(8)).unwrap_err().contains("begun with seed 7, not 8"));
    assert!(again(&[&other], None).unwrap_err().contains("begun on other footage: "));

    // The name of a file need not be text.
    let moved = folder.path().join(OsStr::from_bytes(b"moved \xff.png"));
    std::fs::rename(&first, &moved).unwrap();
    assert!(again(&[], None).unwrap_err().contains("is gone: cannot read"));
    assert_eq!(again(&[&moved], None), Ok(LEG));

    std::fs::rename(&other, &first).unwrap();
    assert!(again(&[], None).unwrap_err().contains("has changed;"));

    // The model card names the footage too.
    std::fs::rename(&moved, &first).unwrap();
    assert!(train(resume("mgm-learned", &run), u64::MAX));
    assert!(std::fs::read_to_string(run.join("MODEL_CARD.md")).unwrap().contains("on 1 clips of footage"));
}

#[test]
fn a_signal_saves_then_resume_needs_the_folder_alone_and_a_second_one_ends_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("recipe.toml");
    let out = folder.path().join("run");

    let mut recipe = small("mgm-learned", 1_000_000);
    (recipe.pictures, recipe.validate_every) = (1, LEG);
    if let Some(dqn) = &mut recipe.dqn {
        dqn.windows = 64;
    }

    std::fs::write(&config, toml::to_string(&recipe).unwrap()).unwrap();
    let out = out.to_str().unwrap();

    let start = |arguments: &[&str]| {
        let mut process = command(&["train", "mgm-learned", "--out", out]);
        process.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    };

    let send = |signal, process: &std::process::Child| {
        rustix::process::kill_process(rustix::process::Pid::from_child(process), signal).unwrap();
    };

    let mut process = start(&["--config", config.to_str().unwrap()]);

    // Without a terminal, it reports its progress at each validation.
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.starts_with("100 of 1000000 updates: loss ") && line.contains("validation MAE 0.")));

    // Meanwhile no other training may use the folder.
    let second = start(&["--resume"]).wait_with_output().unwrap();
    assert!(String::from_utf8_lossy(&second.stderr).contains("another training is running in"));

    // As a cluster's scheduler and a service manager do.
    send(Signal::TERM, &process);
    let output = process.wait_with_output().unwrap();
    assert!(output.status.success());

    let told = String::from_utf8(output.stdout).unwrap();
    assert!(told.contains(&format!("continue with: parfocal train mgm-learned --out {out} --resume")), "{told}");

    let mut process = start(&["--resume"]);
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains(" of 1000000 updates: loss ")));
    send(Signal::INT, &process);
    assert!(lines.any(|line| line.contains("Ctrl-C again to stop at once")));
    send(Signal::INT, &process);
    assert_eq!(process.wait().unwrap().signal(), Some(2));
}

#[test]
fn a_training_outlives_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("recipe.toml");
    let out = folder.path().join("run");

    let mut recipe = small("mgm-learned", 200);
    (recipe.pictures, recipe.validate_every) = (1, LEG);
    std::fs::write(&config, toml::to_string(&recipe).unwrap()).unwrap();

    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut process = command(&["train", "mgm-learned", "--config"]);
    process.arg(&config).arg("--out").arg(&out);

    let output = process.stderr(full).output().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    assert!(out.join("mgm-learned.safetensors").exists());
}

#[test]
fn footage_is_read_as_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let evaluate = |name: &str| {
        let mut process = command(&["evaluate", "--policies", "fixed", "--count", "1", "--footage", name]);
        process.current_dir(folder.path()).output().unwrap()
    };

    let whole = std::fs::read(picture(folder.path(), "cut.jpg", 200)).unwrap();
    std::fs::write(folder.path().join("cut.jpg"), &whole[..whole.len() / 2]).unwrap();
    let output = evaluate("cut.jpg");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("damaged or cut short"));

    // Recorders name files by the time, so names may contain colons.
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-f", "lavfi", "-i", "testsrc=s=128x128:r=10", "-frames:v", "10", "-c:v", "ffv1"])
        .arg(folder.path().join("10:30.mkv"))
        .status();

    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: no ffmpeg to make a video with");
        return;
    }

    let output = evaluate("10:30.mkv");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_same_seed_gives_the_same_figures_to_the_last_digit() {
    let evaluate =
        || parfocal(&["evaluate", "--count", "2", "--policies", "fixed,mgm-hill-climber,parfocal", "--json"]);
    let first = evaluate();
    let second = evaluate();
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
    // Not with `evaluate --footage`, which rejects footage without detail.
    let glove = GrayImage { width: 128, height: 128, data: vec![90.0; 128 * 128] };
    let scenes = vec![Scene::Flat(Arc::new(Clip::still(glove).unwrap()))];
    let conditions = Conditions::Fitting;
    let scans = Benchmark { scenes, conditions, seed: 2023, count: 2, frames: FRAMES };
    let policies = ["mgm-hill-climber", "parfocal"].map(PolicyName::new);
    let outcomes = evaluate(&Registry::standard(), &policies, &scans, &|_| ()).unwrap();
    let travels = [1, 2].map(|row: usize| outcomes[row].row().travel);
    // A hill-climber moves by a step at every frame.
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
    let occupied = folder.path().to_str().unwrap();
    for (arguments, told) in [
        (vec!["evaluate", "--policies", "nonsense", "--count", "1"], "there is no policy 'nonsense'"),
        (vec!["evaluate", "--footage", "/no/such.mp4"], "there is no such file"),
        (vec!["train", "fixed", "--out", out], "there is no recipe 'fixed'"),
        (vec!["train", "parfocal", "--out", out, "--device", "cuda"], "use --device cpu"),
        (vec!["train", "mgm-learned", "--out", out, "--config", recipe], "unknown field `warmup`"),
        (vec!["train", "parfocal", "--out", "/proc/x"], "cannot write to /proc/x"),
        (vec!["train", "parfocal", "--out", occupied], "choose a new or empty folder"),
        (vec!["train", "parfocal", "--out", out, "--resume"], "has no checkpoint to continue from"),
        (vec!["train", "parfocal-adapted", "--out", out], "give them by --from, such as --from policies/parfocal.saf"),
        (
            vec!["train", "mgm-learned", "--out", out, "--config", few, "--from", foreign],
            "the weights belong to another network",
        ),
        (vec!["evaluate", "--weights", out, "--count", "1"], "there are no weights in"),
        (vec!["serve", "--weights", out, "--bind", "127.0.0.1:0", "--data-dir", out], "there are no weights in"),
    ] {
        let output = parfocal(&arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {error}");
        assert!(error.contains(told), "{arguments:?}: {error}");
    }
}

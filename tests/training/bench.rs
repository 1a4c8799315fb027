//! Training on the recordings of a bench: which are accepted, kept for validation, or rejected.

use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::texture::texture;

use super::*;

/// Stores a focal stack of 9 pictures in `folder`, over a texture drawn from `seed`. The fifth picture is the sharpest.
fn stack(folder: &Path, seed: u64) {
    std::fs::create_dir_all(folder).unwrap();
    let sharp = texture(seed, 144);
    for plane in 0..9u8 {
        let blurred = gaussian_blur(&sharp, 0.6 * (f64::from(plane) - 4.0).abs());
        let levels = blurred.data.iter().map(|level| level.round() as u8).collect();
        let picture = image::GrayImage::from_raw(144, 144, levels).unwrap();
        picture.save(folder.join(format!("{plane}.png"))).unwrap();
    }
}

/// Makes five stacks and returns their names for the command line.
fn five_stacks(folder: &Path) -> Vec<String> {
    let names = ["first", "second", "third", "fourth", "fifth"];
    let made = names.iter().zip(1..).map(|(name, seed)| {
        stack(&folder.join(name), seed);
        folder.join(name).to_str().unwrap().to_owned()
    });
    made.collect()
}

fn on(scans: &[String]) -> Sources {
    Sources { scans: scans.to_vec(), ..Sources::default() }
}

/// Resumes the `mgm-learned` in `run` with `scans`. Returns the number of updates done, or the error.
fn again(run: &Path, scans: &[String]) -> Result<u64, String> {
    let asked = ResumeRequest { name: "mgm-learned".to_owned(), sources: on(scans), ..ResumeRequest::default() };
    Run::resume(run, &asked, tch::Device::Cpu).map(|run| run.updates()).map_err(|error| error.to_string())
}

#[test]
fn a_training_continues_on_the_recordings_that_it_was_begun_on() {
    let folder = tempfile::tempdir().unwrap();
    let stacks = five_stacks(folder.path());
    let run = folder.path().join("run");

    let begun = Run::begin(small("mgm-learned", 2 * LEG), 7, &on(&stacks), &run, None, tch::Device::Cpu).unwrap();
    assert!(!train(begun, 1));
    assert_eq!(again(&run, &[]), Ok(LEG));
    assert_eq!(again(&run, &stacks), Ok(LEG));
    assert!(again(&run, &stacks[..4]).unwrap_err().contains("begun on other scans: "));

    let moved = folder.path().join("moved").to_str().unwrap().to_owned();
    std::fs::rename(&stacks[1], &moved).unwrap();
    let error = again(&run, &[]).unwrap_err();
    assert!(error.contains("are gone: there is no folder") && error.contains("with --scans"), "{error}");

    let mut found = stacks.clone();
    found[1].clone_from(&moved);
    assert_eq!(again(&run, &found), Ok(LEG));

    let mut of_other_planes = found.clone();
    of_other_planes[1].push_str(":4");
    assert!(again(&run, &of_other_planes).unwrap_err().contains("give each folder the same :PLANES"));

    stack(Path::new(&stacks[1]), 99);
    assert!(again(&run, &[]).unwrap_err().contains("have changed;"));

    std::fs::remove_dir_all(&stacks[1]).unwrap();
    std::fs::rename(&moved, &stacks[1]).unwrap();
    assert!(train(resume("mgm-learned", &run), u64::MAX));
    let card = std::fs::read_to_string(run.join("MODEL_CARD.md")).unwrap();
    assert!(card.contains("and on 5 recordings of a bench, 1 of them kept for validation"), "{card}");
    // Six drawn pictures as they are, the same varied, and as many over the recordings.
    assert!(card.contains("On 18 validation scans, 12 of them varied: "), "{card}");

    let without = folder.path().join("without");
    assert!(!train(begin(&small("mgm-learned", 2 * LEG), &without), 1));
    assert!(again(&without, &stacks).unwrap_err().contains("begun without recordings; leave out --scans"));
}

#[test]
fn recordings_are_taken_as_scans_or_stacks_and_every_fifth_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let stacks = five_stacks(folder.path());
    let scan = folder.path().join("scan").to_str().unwrap().to_owned();
    let made =
        parfocal(&["scan", "from-stack", &stacks[0], "--out", &scan, "--size", "96", "--poses", "20", "--planes", "5"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));

    let recipe = folder.path().join("recipe.toml");
    let text = toml::to_string(&small("mgm-learned", LEG)).unwrap();
    std::fs::write(&recipe, text).unwrap();
    let train = |scans: &[&str], out: &str| {
        let out = folder.path().join(out);
        let begin = ["train", "mgm-learned", "--config", recipe.to_str().unwrap(), "--out", out.to_str().unwrap()];
        parfocal(&[&begin, ["--scans"].as_slice(), scans].concat())
    };

    let with_planes = format!("{}:5", stacks[1]);
    let four = [scan.as_str(), &with_planes, &stacks[2], &stacks[3]];
    let trained = train(&[four.as_slice(), &[&stacks[4]]].concat(), "whole");
    let told = String::from_utf8_lossy(&trained.stderr).into_owned();
    assert!(trained.status.success(), "{told}");
    assert!(told.contains(&format!("kept for validation, not trained on: {}\n", stacks[4])), "{told}");

    let told = String::from_utf8_lossy(&train(&[&scan], "one").stderr).into_owned();
    assert!(told.contains("validation uses the recordings that are trained on"), "{told}");

    let empty = folder.path().join("empty").to_str().unwrap().to_owned();
    std::fs::create_dir(&empty).unwrap();
    let many = format!("{}:20", stacks[2]);
    for (wrong, expected) in [
        ("/no/such/bench", "there is no folder /no/such/bench; name folders of recorded scans"),
        (empty.as_str(), "empty"),
        (&many, "cannot be scanned: a range of 20 planes needs"),
    ] {
        let refused = train(&[wrong], "refused");
        let told = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(1) && told.contains(expected), "{wrong}: {told}");
    }
}

#[test]
fn a_stack_of_raw_mosaics_is_trained_on_in_the_format_that_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let stack = folder.path().join("stack");
    std::fs::create_dir_all(&stack).unwrap();
    let sharp = texture(3, 512);
    for plane in 0..7_u8 {
        let picture = gaussian_blur(&sharp, 0.8 * (f64::from(plane) - 3.0).abs());
        // A cell of 4x4 samples for each pixel, as counts of 12 bit in two bytes.
        let count = |index: usize| (picture.data[index / 2048 / 4 * 512 + index % 2048 / 4].round() as u16) << 4;
        let bytes: Vec<u8> = (0..2048 * 1088).flat_map(|index| count(index).to_le_bytes()).collect();
        std::fs::write(stack.join(format!("{plane}.raw")), bytes).unwrap();
    }

    let run = folder.path().join("run");
    let scans = [stack.to_str().unwrap().to_owned()];
    let raw = |format: &str| Sources { raw: Some(format.parse().unwrap()), ..on(&scans) };
    let begin = |sources: &Sources, out: &Path| {
        Run::begin(small("mgm-learned", 2 * LEG), 7, sources, out, None, tch::Device::Cpu)
    };

    let guessed = begin(&on(&scans), &folder.path().join("guessed")).err().unwrap().to_string();
    assert!(guessed.contains("but Mono10 ends at 1023; give --raw Mono12 or Mono16"), "{guessed}");

    assert!(!train(begin(&raw("Mono12"), &run).unwrap(), 1));
    assert_eq!(again(&run, &[]), Ok(LEG), "the checkpoint knows the format");
    let other = ResumeRequest { name: "mgm-learned".to_owned(), sources: raw("Mono16"), ..ResumeRequest::default() };
    let error = Run::resume(&run, &other, tch::Device::Cpu).err().unwrap().to_string();
    assert!(error.contains("begun on other scans"), "{error}");
}

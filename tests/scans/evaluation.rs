//! What an evaluation does with its arguments, and where its results go.

use super::*;

/// Evaluates on one simulated scan with more arguments.
fn evaluate(more: &[&str]) -> Command {
    command(&[&["evaluate", "--count", "1"], more].concat())
}

#[test]
fn results_that_cannot_be_written_are_still_printed() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("results");
    // A folder has the name of the last file.
    fs::create_dir_all(out.join("figure.svg")).unwrap();
    let output = evaluate(&["--policies", "fixed", "--out", text(&out)]).output().unwrap();
    assert!(complaint(&output).contains("cannot write the results to"), "{}", complaint(&output));
    assert!(said(&output).contains("| fixed |"), "{}", said(&output));
    // An impossible folder is reported before anything is played, so before the missing footage.
    let file = out.join("results.json");
    let output = evaluate(&["--out", text(&file), "--footage", "/no/such.mp4"]).output().unwrap();
    assert!(complaint(&output).contains("cannot write the results to"), "{}", complaint(&output));
}

#[test]
fn a_full_disk_leaves_no_half_of_a_result() {
    let folder = TempDir::new().unwrap();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    // Four pages: the tables fit, the figure does not. The disk ends with the namespace in which it is mounted.
    let script = format!(
        "mount -t tmpfs -o size=16k tmpfs {0} || exit 77
         {1} evaluate --count 1 --policies fixed --out {0}/out >/dev/null; echo code $?; ls -A {0}/out",
        disk.display(),
        env!("CARGO_BIN_EXE_parfocal"),
    );

    let output = Command::new("unshare").args(["-rm", "sh", "-c", &script]).stdin(Stdio::null()).output();
    let output = match output {
        Ok(output) if output.status.code() != Some(77) && !said(&output).is_empty() => output,
        other => return println!("skipped: a small disk cannot be mounted here: {other:?}"),
    };

    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(said(&output), "code 1\nresults.csv\nresults.json\nresults.md\n", "{error}");
    assert!(error.contains("cannot write the results to"), "{error}");
}

#[test]
fn a_full_standard_output_is_reported() {
    for arguments in [["--policies", "fixed"].as_slice(), &["--policies", "fixed", "--json"]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = evaluate(arguments).stdout(full).output().unwrap();
        assert!(
            complaint(&output).contains("cannot write to standard output: No space left"),
            "{}",
            complaint(&output)
        );
    }
}

#[test]
fn impossible_numbers_of_scans_are_wrong_usage() {
    for count in ["0", "10001", "100000000000000000", "18446744073709551615"] {
        let output = parfocal(&["evaluate", "--policies", "fixed", "--count", count]);
        assert_eq!(output.status.code(), Some(2), "{count}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("1..=10000"), "{count}");
    }
    let many = parfocal(&["evaluate", "--scans", "phantom", "--policies", "fixed", "--count", "101"]);
    assert!(complaint(&many).contains("at most 100 over the phantom"));
}

#[test]
fn a_policy_that_cannot_run_is_reported_before_anything_is_played() {
    // The missing footage would be the next error.
    for (policies, told) in [
        ("fixed,nonsense", "there is no policy 'nonsense'"),
        ("file:no,such.pt", "cannot read no,such.pt"),
        ("file:tests/vectors/flat-only.pt", "it returned no numbers"),
    ] {
        let output = evaluate(&["--policies", policies, "--footage", "/no/such.mp4"]).output().unwrap();
        assert!(complaint(&output).contains(told), "{}", complaint(&output));
    }
}

#[test]
fn results_say_what_was_evaluated() {
    let folder = TempDir::new().unwrap();
    let (out, still, script) =
        (folder.path().join("out"), folder.path().join("still.png"), folder.path().join("a,b&c.pt"));
    fs::copy("tests/vectors/first-frame.pt", &script).unwrap();
    let noise = |x: u32, y: u32| u8::try_from((x * 7919 + y * 104_729 + x * y * 31) % 200).unwrap();
    image::GrayImage::from_fn(160, 120, |x, y| image::Luma([noise(x, y)])).save(&still).unwrap();
    let policy = format!("file:{}", text(&script));
    let arguments = ["--policies", "fixed,mgm-learned", "--policies", &policy, "--weights", "policies"];
    let output = evaluate(&arguments).args(["--footage", text(&still), "--out", text(&out)]).output().unwrap();
    assert!(output.status.success(), "{}", complaint(&output));
    let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
    let report: Value = serde_json::from_str(&read("results.json")).unwrap();
    let sum = report["weights"]["mgm-learned"].as_str().unwrap();
    assert_eq!((sum.len(), report["weights"].as_object().unwrap().len()), (64, 2));
    assert_eq!((&report["weights_folder"], &report["rows"][3]["policy"]), (&"policies".into(), &policy.clone().into()));
    let table = read("results.md");
    assert_eq!(table, said(&output));
    for told in [&format!("over {}, 1 of them", text(&still)), &format!("mgm-learned {}", &sum[..12]), "in policies"] {
        assert!(table.contains(told), "{table}");
    }
    let csv = read("results.csv");
    assert!(csv.lines().nth(3).unwrap().contains(&format!(",simulated,2023,{},{sum},", text(&still))), "{csv}");
    assert!(read("figure.svg").contains("a,b&amp;c.pt</title>"));
}

/// A picture of overlapping squares of many sizes and gray levels.
fn gravel(path: &Path, side: u32) {
    let mut picture = image::GrayImage::new(side, side);
    let mut state = 1u32;
    let mut draw = |below: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % below
    };

    for _ in 0..side * 8 {
        let left = draw(side);
        let top = draw(side);
        let length = 4 + draw(20);
        let level = draw(256);
        for (x, y) in (top..top + length).flat_map(|y| (left..left + length).map(move |x| (x, y))) {
            if x < side && y < side {
                picture.put_pixel(x, y, image::Luma([u8::try_from(level).unwrap()]));
            }
        }
    }

    picture.save(path).unwrap();
}

#[test]
fn a_large_still_picture_is_focused_on_as_well_as_a_small_one() {
    let folder = TempDir::new().unwrap();
    let still = folder.path().join("still.png");
    let in_focus = |side: u32| {
        gravel(&still, side);
        let arguments = ["evaluate", "--count", "8", "--json", "--policies", "parfocal", "--footage", text(&still)];
        let output = parfocal(&arguments);
        assert!(output.status.success(), "{}", complaint(&output));
        let report: Value = serde_json::from_str(&said(&output)).unwrap();
        report["rows"][1]["in_focus"].as_f64().unwrap()
    };

    let small = in_focus(480);
    let large = in_focus(512);
    assert!(small > 0.9 && large > 0.9, "{small} {large}");
}

#[test]
fn footage_without_detail_is_refused_and_a_part_without_detail_is_reported() {
    let folder = TempDir::new().unwrap();
    let wall = folder.path().join("1-wall.png");
    let gravel_picture = folder.path().join("2-gravel.png");
    image::GrayImage::from_pixel(160, 160, image::Luma([200])).save(&wall).unwrap();
    let told = complaint(&evaluate(&["--policies", "fixed", "--footage", text(&wall)]).output().unwrap());
    assert!(told.contains("nothing to focus on: even the sharpest patch shows no detail in any of 1 scans"), "{told}");
    let run = folder.path().join("run");
    let train = ["train", "mgm-learned", "--out", text(&run), "--footage", text(&wall)];
    assert!(complaint(&parfocal(&train)).contains("no detail in any of 60 scans"));

    // Scans take turns between the pictures of a folder.
    fs::remove_dir_all(&run).unwrap();
    gravel(&gravel_picture, 160);
    let arguments = ["evaluate", "--count", "4", "--policies", "fixed", "--footage", text(folder.path())];
    let output = parfocal(&arguments);
    assert!(output.status.success(), "{}", complaint(&output));
    let share = "in 50.0 % of the scans (2 of 4) even the sharpest patch shows no detail";
    assert!(said(&output).contains(share), "{}", said(&output));
    assert!(String::from_utf8_lossy(&output.stderr).contains(share));
}

#[test]
fn shards_put_together_are_one_run_to_the_last_digit() {
    let folder = TempDir::new().unwrap();
    let whole = folder.path().join("whole");
    let parts = folder.path().join("parts");
    let arguments = ["evaluate", "--count", "5", "--seed", "11", "--policies", "mgm-hill-climber,mlr-learned,parfocal"];
    let run = |more: &[&str]| {
        let output = parfocal(&[&arguments, more].concat());
        assert!(output.status.success(), "{}", complaint(&output));
        said(&output)
    };

    let told = run(&["--out", text(&whole)]);
    assert!(run(&["--shard", "2/3", "--out", text(&parts)]).contains("shard-2-of-3.json; when all shards are there: "));
    run(&["--shard", "3/3", "--out", text(&parts)]);
    fs::write(parts.join("shard-1-of-3.json"), run(&["--shard", "1/3", "--json"])).unwrap();

    let files = ["shard-3-of-3.json", "shard-1-of-3.json", "shard-2-of-3.json"].map(|file| parts.join(file));
    let files: Vec<&str> = files.iter().map(|file| text(file)).collect();
    let merged = parfocal(&[&["evaluate", "--merge"], &files[..], &["--out", text(&parts)]].concat());
    assert!(merged.status.success(), "{}", complaint(&merged));
    assert_eq!(said(&merged), told);
    for file in ["results.json", "results.md", "results.csv", "figure.svg"] {
        let read = |folder: &Path| fs::read_to_string(folder.join(file)).unwrap();
        assert_eq!(read(&parts), read(&whole), "{file}");
    }

    let incomplete = complaint(&parfocal(&[&["evaluate", "--merge"], &files[..2]].concat()));
    assert!(incomplete.contains("shards are missing: 2/3; run"), "{incomplete}");
    let none = complaint(&parfocal(&["evaluate", "--merge", text(&parts.join("results.json"))]));
    assert!(none.contains("results.json is not a shard"), "{none}");
    let many = complaint(&parfocal(&["evaluate", "--count", "2", "--policies", "fixed", "--shard", "3/3", "--json"]));
    assert!(many.contains("shard 3/3 has no scans: there are only 2"), "{many}");
    // Wrong usage: a shard needs an output, and a merge already has its scans.
    for wrong in [["--shard", "1/2"].as_slice(), &["--shard", "3/2", "--json"], &["--merge", "a", "--seed", "1"]] {
        assert_eq!(parfocal(&[&["evaluate"], wrong].concat()).status.code(), Some(2), "{wrong:?}");
    }
}

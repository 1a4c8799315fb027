//! A focal stack is made into a scan. Pictures that are not a stack are refused. Policies can be evaluated on the scan.

use parfocal_devices::simulation::blur::gaussian_blur;
use parfocal_devices::simulation::texture::texture;
use parfocal_imaging::GrayImage;

use super::*;

/// Saves 13 pictures of a texture, without those in `gaps`. The seventh is the sharpest. Blur grows by 5 pixels per
/// whole range.
fn stack(folder: &Path, gaps: &[usize]) {
    fs::create_dir_all(folder).unwrap();
    let sharp = texture(8, 200);
    for index in (0..13).filter(|index| !gaps.contains(index)) {
        let blur = 5.0 / 12.0 * (f64::from(u8::try_from(index).unwrap()) - 6.0).abs();
        save(&gaussian_blur(&sharp, blur), &folder.join(format!("plane {index}.png")));
    }
}

fn save(picture: &GrayImage, path: &Path) {
    let levels = picture.data.iter().map(|level| level.round() as u8).collect();
    let width = picture.width.try_into().unwrap();
    let height = picture.height.try_into().unwrap();
    image::GrayImage::from_raw(width, height, levels).unwrap().save(path).unwrap();
}

#[test]
fn a_focal_stack_becomes_a_scan_that_policies_can_be_evaluated_on() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    let out = folder.path().join("scan");
    stack(&pictures, &[3]);
    let arguments = ["scan", "from-stack", text(&pictures), "--out", text(&out), "--size", "96", "--poses", "60"];
    let output = parfocal(&arguments);
    assert!(output.status.success(), "{}", complaint(&output));
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(told.contains("note: 1 of 13 planes are missing and are mixed from their neighbours"), "{told}");
    assert!(said(&output).contains("sharpest at position 6.000"), "{}", said(&output));
    let stored = contents(&out);
    assert!(parfocal(&arguments).status.success());
    assert!(contents(&out) == stored, "the same command goes on, here with nothing");

    let output = parfocal(&["scan", "info", text(&out), "--json"]);
    let info: Value = serde_json::from_str(&said(&output)).unwrap();
    assert_eq!((&info["poses"], &info["width"], &info["simulated"]), (&60.into(), &96.into(), &false.into()));
    assert_eq!(info["focal_powers"].as_array().unwrap().len(), 7);
    // 7 of 13 planes are half of the range, so half of the blur.
    let blur = info["optics"]["blur_per_unit"].as_f64().unwrap();
    assert!((blur / 2.5 - 1.0).abs() < 0.2, "{blur}");
    assert!(info["optimum"]["max"].as_f64().unwrap() > info["optimum"]["min"].as_f64().unwrap());

    let output = parfocal(&["evaluate", "--scans", text(&out), "--policies", "mgm-hill-climber", "--json"]);
    let report: Value = serde_json::from_str(&said(&output)).unwrap();
    let mae = |row: usize| report["rows"][row]["mae"].as_f64().unwrap();
    assert!(mae(0) < 0.1 && mae(1) < 0.2, "{report}");
}

#[test]
fn policies_are_evaluated_on_a_stack_and_get_its_blur_rate() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    stack(&pictures, &[]);

    let seven = format!("{}:7", text(&pictures));
    let evaluate = |more: &[&str]| parfocal(&[&["evaluate", "--policies", "fixed", "--json"], more].concat());
    let results = |more: &[&str]| -> Value {
        let output = evaluate(&[&["--stacks", &seven, text(&pictures)], more].concat());
        serde_json::from_str(&said(&output)).unwrap_or_else(|error| panic!("{error}: {}", complaint(&output)))
    };

    let untold = results(&[]);
    // Two stacks at two scales each, three policies: the oracle and the baseline are always there.
    let stacks = untold["stacks"].as_array().unwrap();
    assert_eq!((stacks.len(), stacks[0]["rows"].as_array().unwrap().len()), (4, 3));
    assert_eq!((&stacks[0]["planes"], &stacks[2]["planes"], &stacks[0]["blur"]), (&7.into(), &6.into(), &Value::Null));

    // 7 of 13 planes are half of the range, so half of the blur.
    let told = results(&["--blur", "measured"]);
    let blur = told["stacks"][0]["blur"].as_f64().unwrap();
    assert!((blur / 2.5 - 1.0).abs() < 0.2, "{blur}");
    assert_eq!(told["stacks"][0]["rows"], stacks[0]["rows"], "fixed has no use for it");

    for (wrong, expected) in [
        (["--blur", "measured"].as_slice(), "--blur measured works only with --stacks"),
        (&["--blur", "0"], "must be from 0.1 to 200 pixels"),
        (&["--blur", "much"], "'much' is not a number of pixels"),
    ] {
        let output = evaluate(wrong);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && told.contains(expected), "{told}");
    }
}

#[test]
fn pictures_that_are_not_a_focal_stack_are_refused_before_anything_is_written() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    let out = folder.path().join("scan");
    stack(&pictures, &[]);
    let told = |more: &[&str]| {
        let output = parfocal(&[&["scan", "from-stack", text(&pictures), "--out", text(&out)], more].concat());
        assert!(!out.exists(), "{}", said(&output));
        complaint(&output)
    };

    assert!(told(&["--planes", "13"]).contains("give --planes at most 12"));
    assert!(told(&["--size", "256"]).contains("does not fit into pictures of 200x200"));
    assert!(told(&["--scale", "2"]).contains("does not fit into pictures of 100x100"));

    let list = folder.path().join("list.csv");
    fs::write(&list, "name,position\nplane 0.png,0\nplane 1.png,1\n").unwrap();
    assert!(told(&["--list", text(&list)]).contains("at least 5 pictures at different positions, but has 2"));
    fs::write(&list, "plane 0.png,0\nplane 1.png\n").unwrap();
    assert!(told(&["--list", text(&list)]).contains("line 2 must be a file's name, a comma and a position"));
    let shuffled = [6, 0, 7, 1, 8, 2, 9, 3, 10, 4, 11, 5, 12];
    let lines = (0..).zip(shuffled).map(|(position, index)| format!("plane {index}.png,{position}\n"));
    fs::write(&list, lines.collect::<String>()).unwrap();
    assert!(told(&["--list", text(&list)]).contains("not in order of focus"));

    save(&texture(8, 100), &pictures.join("plane 13.png"));
    assert!(told(&[]).contains("all pictures of a stack must have one size"));
}

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
    // Two stacks at two scales each, four policies: the oracle and both baselines are always there.
    let stacks = untold["stacks"].as_array().unwrap();
    assert_eq!((stacks.len(), stacks[0]["rows"].as_array().unwrap().len()), (4, 4));
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

/// The pictures of [`stack`], each as gray levels row by row.
fn levels() -> Vec<Vec<u8>> {
    let sharp = texture(8, 200);
    let blurred = |index: i32| gaussian_blur(&sharp, 5.0 / 12.0 * (f64::from(index) - 6.0).abs());
    (0..13).map(|index| blurred(index).data.iter().map(|level| level.round() as u8).collect()).collect()
}

#[test]
fn a_stack_in_one_file_is_one_in_a_folder() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    stack(&pictures, &[]);
    let cut = ["--size", "96", "--poses", "20"];
    let make = |stack: &Path, out: &str| {
        let out = folder.path().join(out);
        let output = parfocal(&[&["scan", "from-stack", text(stack), "--out", text(&out)], &cut[..]].concat());
        assert!(output.status.success(), "{}", complaint(&output));
        let images: Vec<_> =
            contents(&out).into_iter().filter(|(path, _)| path.extension().is_some_and(|end| end == "png")).collect();
        (images, said(&output), notes(&output))
    };
    let (expected, _, _) = make(&pictures, "of a folder");

    let ome = r#"<?xml version="1.0" encoding="UTF-8"?><OME><Image ID="Image:0"><Pixels ID="Pixels:0" SizeX="200"
        SizeY="200" SizeZ="13" SizeC="1" SizeT="1" PhysicalSizeZ="2.5" PhysicalSizeZUnit="&#181;m"/></Image></OME>"#;
    let image_j = "ImageJ=1.54f\nimages=13\nslices=13\nspacing=0.5\nunit=mm\n";
    for (name, description, told, peak) in [
        ("plain.tif", "", "13 pages: taken in their order", "6.000"),
        ("stack.ome.tif", ome, "13 pages: 2.5 µm apart, as its OME metadata say", "15.000"),
        ("image-j.tif", image_j, "13 pages: 0.5 mm apart, as ImageJ wrote", "3.000"),
    ] {
        let file = folder.path().join(name);
        fs::write(&file, tiff::pages(&levels(), 200, description)).unwrap();
        let (found, printed, note) = make(&file, &format!("of {name}"));
        assert!(found == expected, "{name}");
        assert!(note.contains(told), "{note}");
        assert!(printed.contains(&format!("sharpest at position {peak}")), "{printed}");
    }

    let hyperstack = "ImageJ=1.54f\nimages=13\nchannels=13\nslices=13\n";
    let file = folder.path().join("hyper.tif");
    fs::write(&file, tiff::pages(&levels(), 200, hyperstack)).unwrap();
    let told = complaint(&parfocal(&["scan", "from-stack", text(&file), "--out", text(&folder.path().join("no"))]));
    assert!(told.contains("it has 13 positions, 13 channels and 1 times"), "{told}");
}

#[test]
fn policies_are_evaluated_on_a_stack_in_one_file() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    stack(&pictures, &[]);
    let file = folder.path().join("pictures.tif");
    fs::write(&file, tiff::pages(&levels(), 200, "")).unwrap();

    let rows = |stack: &Path| {
        let output = parfocal(&["evaluate", "--policies", "fixed", "--json", "--stacks", text(stack)]);
        assert!(output.status.success(), "{}", complaint(&output));
        serde_json::from_str::<Value>(&said(&output)).unwrap()["stacks"][0]["rows"].clone()
    };
    assert_eq!(rows(&file), rows(&pictures));
}

#[test]
fn uneven_positions_are_interpolated_and_said() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    stack(&pictures, &[]);
    fs::rename(pictures.join("plane 12.png"), pictures.join("plane 12.5.png")).unwrap();

    let out = folder.path().join("scan");
    let more = ["--size", "96", "--poses", "5"];
    let output = parfocal(&[&["scan", "from-stack", text(&pictures), "--out", text(&out)], &more[..]].concat());
    assert!(output.status.success(), "{}", complaint(&output));
    let told = notes(&output);
    let expected = "the planes stand 1 apart: 12 are pictures as they were taken, 1 are mixed";
    assert!(told.contains(expected), "{told}");
}

#[test]
fn the_bits_of_a_stack_may_be_said() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    fs::create_dir_all(&pictures).unwrap();
    // Dark throughout: a sixteenth of what 16 bit can hold.
    for (index, levels) in levels().into_iter().enumerate() {
        let samples: Vec<u16> = levels.into_iter().map(|level| 16 * u16::from(level)).collect();
        let picture = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(200, 200, samples).unwrap();
        picture.save(pictures.join(format!("{index}.png"))).unwrap();
    }

    let brightest = |out: &Path| {
        let scan = ScanFolder::open(out).unwrap();
        let pose = scan.poses().values().next().unwrap();
        let levels = pose.images.iter().map(|image| scan.picture(pose, image).unwrap().data);
        levels.flatten().fold(0.0, f32::max)
    };
    let make = |name: &str, bits: &[&str]| {
        let out = folder.path().join(name);
        let arguments = ["scan", "from-stack", text(&pictures), "--out", text(&out), "--size", "96", "--poses", "1"];
        (parfocal(&[&arguments[..], bits].concat()), out)
    };

    let (output, guessed) = make("guessed", &[]);
    assert!(notes(&output).contains("so they are read as 12 bit: 4095 is white"), "{}", notes(&output));
    let (output, told) = make("told", &["--bits", "16"]);
    assert!(!notes(&output).contains("is white"), "{}", notes(&output));
    assert!(brightest(&guessed) > 10.0 * brightest(&told), "{} {}", brightest(&guessed), brightest(&told));

    let refused = complaint(&make("too few", &["--bits", "10"]).0);
    assert!(refused.contains("give --bits 12 or more"), "{refused}");
}

//! `parfocal inspect` as people and scripts use it.

mod formats;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn inspect(arguments: &[&str], paths: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_parfocal")).arg("inspect").args(arguments).args(paths).output().unwrap()
}

/// The objects that `--json` printed.
fn objects(output: &Output) -> Vec<Value> {
    let text = std::str::from_utf8(&output.stdout).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn complaint(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn write(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// A disc on black: 400x300 pixels, centre (210, 140), radius 120, with a step of 100 gray levels at column 210.
fn disc() -> image::GrayImage {
    image::GrayImage::from_fn(400, 300, |x, y| {
        let inside = (f64::from(x) - 210.0).hypot(f64::from(y) - 140.0) < 120.0;
        image::Luma([if !inside {
            0
        } else if x < 210 {
            90
        } else {
            190
        }])
    })
}

#[test]
fn a_gray_picture_has_the_values_worked_out_by_hand() {
    let folder = TempDir::new().unwrap();
    for name in ["disc.png", "disc.tif"] {
        let path = folder.path().join(name);
        disc().save(&path).unwrap();
        let output = inspect(&["--json"], &[&path]);
        assert!(output.status.success(), "{}", complaint(&output));
        let object = &objects(&output)[0];
        assert_eq!(object["path"], path.to_str().unwrap());
        assert_eq!((&object["width"], &object["height"]), (&400.into(), &300.into()));
        assert_eq!(object["kind"], "gray");
        let area = &object["content_area"];
        for (key, expected) in [("x", 210.0), ("y", 140.0), ("radius", 120.0)] {
            assert!((area[key].as_f64().unwrap() - expected).abs() < 2.0, "{area}");
        }
        assert_eq!((&object["patch"]["width"], &object["patch"]["height"]), (&32.into(), &32.into()));
        let x = object["patch"]["x"].as_u64().unwrap();
        assert!(x.abs_diff(194) <= 2 && object["patch"]["y"].as_u64().unwrap().abs_diff(124) <= 2);
        // A vertical step of 100: |Ix| = 400 in the two columns beside it, 0 elsewhere: 2 * 400 / 32.
        assert!((object["mgm"].as_f64().unwrap() - 25.0).abs() < 1e-3, "{object}");
        assert!((1.0..1.3).contains(&object["mlr"].as_f64().unwrap()));
    }
}

#[test]
fn without_a_content_area_the_patch_stands_in_the_middle() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flat.jpg");
    image::RgbImage::from_pixel(101, 64, image::Rgb([90, 90, 90])).save(&path).unwrap();
    let object = &objects(&inspect(&["--json"], &[&path]))[0];
    assert_eq!(object["kind"], "rgb");
    assert!(object["content_area"].is_null());
    assert_eq!((&object["patch"]["x"], &object["patch"]["y"]), (&34.into(), &16.into()));
    assert!(object["mgm"].as_f64().unwrap().abs() < 1e-6 && (object["mlr"].as_f64().unwrap() - 1.0).abs() < 1e-6);
}

#[test]
fn mosaics_are_measured_in_pixels_of_a_band() {
    let folder = TempDir::new().unwrap();
    let samples = vec![512_u16; 2048 * 1088];
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
    let raw = write(&folder, "frame.RAW", &bytes);
    let png = folder.path().join("frame.png");
    image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2048, 1088, samples).unwrap().save(&png).unwrap();
    let small = folder.path().join("small.tif");
    image::ImageBuffer::from_pixel(256, 128, image::Luma([512_u16])).save(&small).unwrap();
    let output = inspect(&["--json", "--mosaic"], &[&raw, &png, &small]);
    assert!(output.status.success(), "{}", complaint(&output));
    let found: Vec<_> =
        objects(&output).iter().map(|o| (o["kind"].clone(), o["width"].clone(), o["height"].clone())).collect();
    let expected = |width: u32, height: u32| ("mosaic".into(), width.into(), height.into());
    assert_eq!(found, [expected(512, 272), expected(512, 272), expected(64, 32)]);
}

#[test]
fn a_calibration_sets_the_scale_of_a_mosaic() {
    let folder = TempDir::new().unwrap();
    // Left half at a quarter of full scale, right half at a half.
    let mosaic = image::ImageBuffer::from_fn(256, 128, |x, _| image::Luma([if x < 128 { 256_u16 } else { 512 }]));
    let path = folder.path().join("mosaic.png");
    mosaic.save(&path).unwrap();
    let calibration = write(&folder, "unit.toml", b"white = 512\n");
    let mgm = |more: &[&str]| {
        let output = inspect(&[&["--json", "--mosaic"], more].concat(), &[&path]);
        assert!(output.status.success(), "{}", complaint(&output));
        objects(&output)[0]["mgm"].as_f64().unwrap()
    };

    // A step of s gray levels has an MGM of 8 s / 32.
    assert!((mgm(&[]) - 255.0 * 256.0 / 1023.0 / 4.0).abs() < 1e-3);
    assert!((mgm(&["--calibration", calibration.to_str().unwrap()]) - 255.0 / 2.0 / 4.0).abs() < 1e-3);
}

#[test]
fn a_calibration_is_named_only_if_a_mosaic_was_developed_with_it() {
    let folder = TempDir::new().unwrap();
    let mosaic = folder.path().join("mosaic.png");
    image::ImageBuffer::from_pixel(2048, 1088, image::Luma([256_u16])).save(&mosaic).unwrap();
    let colour = folder.path().join("colour.png");
    image::RgbImage::from_pixel(64, 64, image::Rgb([90, 60, 30])).save(&colour).unwrap();
    let calibration = write(&folder, "unit.toml", b"name = 'theatre 2'\n");

    for (paths, named) in [(vec![&*colour], false), (vec![&*colour, &*mosaic], true)] {
        let output = inspect(&["--calibration", calibration.to_str().unwrap()], &paths);
        assert!(output.status.success(), "{}", complaint(&output));
        let told = String::from_utf8(output.stdout).unwrap();
        assert_eq!(told.contains("mosaics developed with the calibration theatre 2"), named, "{told}");
    }
}

#[test]
fn overlays_are_pictures_of_the_same_size_and_none_overwrites_another() {
    let folder = TempDir::new().unwrap();
    let one = folder.path().join("disc.png");
    let other = folder.path().join("sub/disc.png");
    fs::create_dir(folder.path().join("sub")).unwrap();
    disc().save(&one).unwrap();
    disc().save(&other).unwrap();
    let out = folder.path().join("new/overlays");
    let output = inspect(&["--out", out.to_str().unwrap()], &[&one, &other]);
    assert!(output.status.success(), "{}", complaint(&output));
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(table.lines().count(), 3, "a heading and a line a file");
    for name in ["disc.png.overlay.png", "disc.png.overlay-2.png"] {
        let overlay = image::open(out.join(name)).unwrap().to_rgb8();
        assert_eq!(overlay.dimensions(), (400, 300));
        let coloured = overlay.pixels().filter(|pixel| pixel[0] != pixel[2]).count();
        assert!(coloured > 500, "circle, square and values are drawn: {coloured}");
        assert_eq!(overlay.get_pixel(200, 140), &image::Rgb([90, 90, 90]), "the patch itself is left as it is");
    }
}

/// Colours in which an overlay's circle and patch are drawn.
const DRAWN: [[u8; 3]; 2] = [[0, 220, 255], [255, 220, 0]];

/// A mosaic of 512x256 samples with a bright disc, saved as PNG: fine stripes in every band on it.
fn striped_mosaic(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("mosaic.png");
    let mosaic = image::ImageBuffer::from_fn(512, 256, |x, y| {
        let inside = (f64::from(x) - 256.0).hypot(f64::from(y) - 128.0) < 110.0;
        let stripe = if x % 6 < 3 { 650_u16 } else { 350 };
        image::Luma([if inside { stripe } else { 8 }])
    });
    mosaic.save(&path).unwrap();
    path
}

#[test]
fn a_mosaic_is_developed_at_the_size_that_is_asked_for() {
    let folder = TempDir::new().unwrap();
    let path = striped_mosaic(&folder);

    let mut reports = Vec::new();
    let mut contrasts = Vec::new();
    for (size, width, height) in [("cell", 128, 64), ("half", 256, 128), ("full", 512, 256)] {
        let out = folder.path().join(size);
        let output =
            inspect(&["--json", "--mosaic", "--size", size, "--out", out.to_str().unwrap()], &[path.as_path()]);
        assert!(output.status.success(), "{}", complaint(&output));
        reports.push(objects(&output));

        let picture = image::open(out.join(format!("mosaic.png.{size}.png"))).unwrap().to_rgb8();
        assert_eq!(picture.dimensions(), (width, height));
        // The overlay lies beside it. In the picture itself no pixel has the colours of circle and patch.
        let overlay = image::open(out.join("mosaic.png.overlay.png")).unwrap().to_rgb8();
        assert_eq!(overlay.dimensions(), (width, height));
        let drawn = |picture: &image::RgbImage| picture.pixels().filter(|pixel| DRAWN.contains(&pixel.0)).count();
        assert_eq!(drawn(&picture), 0, "{size}");
        assert!(drawn(&overlay) > 50, "{size}");
        assert_eq!(fs::read_dir(&out).unwrap().count(), 2);

        // Within the patch, where nothing is drawn.
        let row = |x: u32| f64::from(picture.get_pixel(x, height / 2)[1]);
        let middle: Vec<f64> = (width / 2 - width / 12..width / 2 + width / 12).map(row).collect();
        let brightest = middle.iter().copied().fold(0.0, f64::max);
        contrasts.push(brightest - middle.iter().copied().fold(255.0, f64::min));
    }

    assert!(reports.iter().all(|report| *report == reports[0]), "values are those of the cells: {reports:?}");
    // sRGB encodes 350 and 650 of 1023 as 158 and 207.
    assert!(contrasts[0] < 42.0 && contrasts[2] > 46.0, "{contrasts:?}");

    // Without --size it is the size of the cells.
    let out = folder.path().join("default");
    assert!(inspect(&["--mosaic", "--out", out.to_str().unwrap()], &[path.as_path()]).status.success());
    for name in ["mosaic.png.cell.png", "mosaic.png.overlay.png"] {
        assert_eq!(fs::read(out.join(name)).unwrap(), fs::read(folder.path().join("cell").join(name)).unwrap());
    }
}

#[test]
fn only_mosaics_have_sizes() {
    let folder = TempDir::new().unwrap();
    let mosaic = striped_mosaic(&folder);
    let picture = folder.path().join("disc.png");
    disc().save(&picture).unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();

    let output = inspect(&["--size", "full", "--out", out], &[&picture]);
    assert_eq!(output.status.code(), Some(1));
    assert!(complaint(&output).contains("disc.png: --size is for mosaics"), "{}", complaint(&output));

    let coloured = folder.path().join("coloured.png");
    image::RgbImage::new(64, 64).save(&coloured).unwrap();
    let output = inspect(&["--json", "--mosaic", "--size", "full", "--out", out], &[&coloured, &mosaic]);
    assert_eq!(output.status.code(), Some(1));
    assert!(complaint(&output).contains("coloured.png: a mosaic is a gray picture, not"), "{}", complaint(&output));
    assert_eq!(objects(&output).len(), 1, "the mosaic is still developed");

    let unknown = inspect(&["--size", "double", "--out", out], &[&mosaic]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(complaint(&unknown).contains("cell, half, full"), "{}", complaint(&unknown));
    assert_eq!(inspect(&["--size", "half"], &[&mosaic]).status.code(), Some(2), "nothing would be written");
}

#[test]
fn a_systems_own_files_beside_pictures_are_passed_over_by_name() {
    let folder = TempDir::new().unwrap();
    let good = folder.path().join("disc.png");
    disc().save(&good).unwrap();
    let own = ["Thumbs.db", "desktop.ini", "._disc.png"].map(|name| write(&folder, name, b"no picture"));

    let all: Vec<&Path> = own.iter().map(PathBuf::as_path).chain([good.as_path()]).collect();
    let output = inspect(&["--json"], &all);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), objects(&output).len()), (Some(0), 1), "{told}");
    assert_eq!(told.lines().count(), 3, "{told}");
    for path in &own {
        let line = format!("passed over: {}, a file of the operating system", path.display());
        assert!(told.lines().any(|found| found == line), "{told}");
    }

    // Alone it is somebody's question.
    let output = inspect(&[], &[&own[0]]);
    assert_eq!(output.status.code(), Some(1));
    assert!(complaint(&output).contains("Thumbs.db: not a PNG, JPEG or TIFF picture"), "{}", complaint(&output));
}

#[test]
fn bad_files_are_named_and_the_others_still_inspected() {
    let folder = TempDir::new().unwrap();
    let good = folder.path().join("disc.png");
    disc().save(&good).unwrap();
    let whole = fs::read(&good).unwrap();
    let bad = [
        (write(&folder, "cut.png", &whole[..whole.len() / 2]), "damaged or cut short"),
        (write(&folder, "text.png", b"hello"), "not a PNG, JPEG or TIFF picture"),
        (write(&folder, "short.raw", &[0; 1000]), "a raw mosaic is 2048x1088 samples"),
        (write(&folder, "empty.jpg", b""), "the file is empty"),
        (folder.path().join("absent.png"), "cannot be read"),
        (folder.path().to_owned(), "this is a folder"),
    ];

    let tiny = folder.path().join("tiny.png");
    image::GrayImage::new(20, 40).save(&tiny).unwrap();
    let mut paths: Vec<&Path> = bad.iter().map(|(path, _)| path.as_path()).collect();
    paths.extend([tiny.as_path(), good.as_path()]);
    let output = inspect(&["--json"], &paths);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(objects(&output).len(), 1, "the good one");
    let complaint = complaint(&output);
    assert_eq!(complaint.lines().count(), 8, "a sentence a bad file, and a sum: {complaint}");
    for (path, words) in bad.iter().map(|(path, words)| (path, *words)).chain([(&tiny, "smaller than the 32x32 patch")])
    {
        let start = format!("parfocal: {}: ", path.display());
        assert!(complaint.lines().any(|line| line.starts_with(&start) && line.contains(words)), "{words}: {complaint}");
    }
}

#[test]
fn a_bad_calibration_is_named_with_its_line_and_key() {
    let folder = TempDir::new().unwrap();
    let good = folder.path().join("disc.png");
    disc().save(&good).unwrap();
    let calibration = write(&folder, "unit.toml", b"name = 'a'\nfwhm_nm = 3\n");
    let output = inspect(&["--calibration", calibration.to_str().unwrap()], &[&good]);
    assert_eq!(output.status.code(), Some(1));
    let complaint = complaint(&output);
    assert!(complaint.contains("unit.toml, line 2, key 'fwhm_nm'"), "{complaint}");
    assert_eq!(inspect(&[], &[]).status.code(), Some(2), "no path is wrong usage");
}

#[test]
fn the_content_area_of_real_footage_is_where_others_find_it() {
    let Some(footage) = std::env::var_os("PARFOCAL_CLIP").map(PathBuf::from) else {
        println!("skipped: PARFOCAL_CLIP names no clip");
        return;
    };

    let folder = TempDir::new().unwrap();
    let select = r"select=eq(n\,0)+eq(n\,80)+eq(n\,160)+eq(n\,240)";
    let status = Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&footage)
        .args(["-vf", select, "-fps_mode", "passthrough"])
        .arg(folder.path().join("%d.png"))
        .status();

    if !status.is_ok_and(|status| status.success()) {
        println!("skipped: ffmpeg is absent or cannot read the footage");
        return;
    }

    let paths: Vec<_> = (1..=4).map(|number| folder.path().join(format!("{number}.png"))).collect();
    let output = inspect(&["--json"], &paths.iter().map(PathBuf::as_path).collect::<Vec<_>>());
    assert!(output.status.success(), "{}", complaint(&output));
    // Values by torch-content-area's classical method.
    let expected = [[627.6, 399.2, 567.6], [615.2, 386.0, 567.4], [615.6, 395.5, 567.2], [614.5, 399.5, 567.2]];
    for (object, expected) in objects(&output).iter().zip(expected) {
        let area = &object["content_area"];
        for (key, expected) in ["x", "y", "radius"].into_iter().zip(expected) {
            assert!((area[key].as_f64().unwrap() - expected).abs() < 10.0, "{key} {expected}: {area}");
        }
    }
}

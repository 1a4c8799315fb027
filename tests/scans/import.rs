//! A folder of pictures is imported: checked before anything is written, and kept as it is.

use super::*;

/// Saves stripes of this contrast as a square picture.
fn stripes(path: &Path, contrast: u8, size: u32) {
    let stripes = image::GrayImage::from_fn(size, size, |x, _| image::Luma([100 + u8::from(x % 4 < 2) * contrast]));
    stripes.save_with_format(path, image::ImageFormat::Png).unwrap();
}

/// A folder of pictures of pose 1: a file's name and the contrast of its stripes.
fn pictures(folder: &TempDir, name: &str, files: &[(&str, u8)]) -> PathBuf {
    let path = folder.path().join(name);
    fs::create_dir_all(&path).unwrap();
    for (file, contrast) in files {
        stripes(&path.join(file), *contrast, 80);
    }
    path
}

#[test]
fn another_folder_is_not_taken_for_one_that_was_imported() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("scan");
    let import =
        |pictures: &Path| parfocal(&["scan", "import", text(pictures), "--out", text(&out), "--camera", "arm 3"]);
    let names = ["pose1_f0.0.png", "pose1_f1.0.png", "pose2_f0.0.png", "pose2_f1.0.png"];
    let first = pictures(&folder, "first", &[(names[0], 20), (names[1], 80), (names[2], 80), (names[3], 20)]);
    let second = pictures(&folder, "second", &[(names[0], 20), (names[1], 80), (names[2], 80), (names[3], 21)]);
    assert!(import(&first).status.success());
    let stored = contents(&out);
    let told = complaint(&import(&second));
    assert!(told.contains("holds another scan (with other pictures of pose 2)"), "{told}");
    // As if the first import had been cut short after its first pose.
    let journal = fs::read_to_string(out.join(POSES)).unwrap();
    fs::write(out.join(POSES), journal.lines().next().unwrap().to_owned() + "\n").unwrap();
    assert!(import(&first).status.success());
    assert!(contents(&out) == stored);
}

#[test]
#[allow(clippy::float_cmp, reason = "whole gray levels")]
fn focal_powers_that_agree_to_three_decimals_are_kept_apart() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("scan");
    let close =
        pictures(&folder, "close", &[("pose1_f0.1231.png", 20), ("pose1_f0.1234.png", 80), ("pose1_f1.png", 9)]);
    assert!(parfocal(&["scan", "import", text(&close), "--out", text(&out)]).status.success());
    assert!(parfocal(&["scan", "info", text(&out)]).status.success());
    let scan = ScanFolder::open(&out).unwrap();
    let pose = &scan.poses()[&1];
    let brightest = |power: f64| {
        let image = pose.images.iter().find(|image| image.focal_power == FocalPower::nearest(power)).unwrap();
        scan.picture(pose, image).unwrap().data.into_iter().reduce(f32::max).unwrap()
    };

    assert_eq!([0.1231, 0.1234, 1.0].map(brightest), [120.0, 180.0, 109.0]);
}

#[test]
fn a_picture_is_what_its_content_is_whatever_its_name() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("scan");
    let named = pictures(&folder, "named", &[("pose1_f0.jpg", 20), ("pose1_f1.tif", 80)]);
    let output = parfocal(&["scan", "import", text(&named), "--out", text(&out)]);
    assert!(output.status.success(), "{}", complaint(&output));
}

#[test]
fn a_folder_of_pictures_is_imported() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    let out = folder.path().join("scan");
    fs::create_dir(&pictures).unwrap();
    // Stripes of more contrast, the nearer the focal power is to 0.5 at pose 8 and to 0 at pose 9.
    let save = |pose: u32, power: f64, contrast: u8, size: u32| {
        let stripes = image::GrayImage::from_fn(size, size, |x, _| image::Luma([100 + u8::from(x % 4 < 2) * contrast]));
        stripes.save(pictures.join(format!("pose{pose:04}_f{power:.3}.png"))).unwrap();
    };

    for (pose, contrasts) in [(8, [20, 80, 30]), (9, [70, 40, 10])] {
        for (power, contrast) in [0.0, 0.5, 1.0].into_iter().zip(contrasts) {
            save(pose, power, contrast, 80);
        }
    }

    fs::write(pictures.join("notes.txt"), "not a picture").unwrap();
    let import = || parfocal(&["scan", "import", text(&pictures), "--out", text(&out), "--camera", "arm 3"]);

    fs::rename(pictures.join("pose0009_f0.500.png"), folder.path().join("aside.png")).unwrap();
    assert!(complaint(&import()).contains("pose 9 has no picture at focal power 0.500"));
    fs::rename(folder.path().join("aside.png"), pictures.join("pose0009_f0.500.png")).unwrap();
    save(11, 0.5, 10, 80);
    assert!(complaint(&import()).contains("there is no picture of pose 10 in"));
    fs::rename(pictures.join("pose0011_f0.500.png"), pictures.join("pose0009_f1.200.png")).unwrap();
    assert!(complaint(&import()).contains("focal power must be a number from 0 to 1"));
    fs::remove_file(pictures.join("pose0009_f1.200.png")).unwrap();
    save(9, 0.5, 40, 96);
    assert!(complaint(&import()).contains("is 96x96 pixels, but"));
    save(9, 0.5, 40, 63);
    assert!(complaint(&import()).contains("must be at least 64x64"));
    save(9, 0.5, 40, 80);
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let told = complaint(&parfocal(&["scan", "import", text(&empty), "--out", text(&out)]));
    assert!(told.contains("no picture named like pose0001_f0.350.png"), "{told}");
    assert!(!out.exists(), "nothing is written before all is checked");

    assert!(import().status.success());
    let scan = ScanFolder::open(&out).unwrap().whole().unwrap();
    assert_eq!(scan.header().camera, "arm 3");
    let optima: Vec<f64> = scan.poses().values().map(|pose| pose.optimum.get()).collect();
    assert_eq!(optima, [0.5, 0.0]);
    assert_eq!(scan.poses()[&1].patch, (24, 24), "in the middle of 80x80");
}

/// Saves a scan of two focal powers whose samples, 0 to `most`, stand in files of 16 bit.
fn deep(folder: &Path, most: u16) {
    fs::create_dir_all(folder).unwrap();
    for name in ["pose1_f0.png", "pose1_f1.png"] {
        let level = |x: u32, y: u32| image::Luma([((x + 96 * y) * u32::from(most) / (96 * 96 - 1)) as u16]);
        image::ImageBuffer::from_fn(96, 96, level).save(folder.join(name)).unwrap();
    }
}

#[test]
fn samples_of_twelve_bit_in_files_of_sixteen_keep_their_levels() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    deep(&pictures, 4095);
    let import = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let output = parfocal(&[&["scan", "import", text(&pictures), "--out", text(&out)], more].concat());
        (output, out)
    };
    let levels = |out: &Path| {
        let scan = ScanFolder::open(out).unwrap();
        let pose = &scan.poses()[&1];
        let mut levels: Vec<u8> =
            scan.picture(pose, &pose.images[0]).unwrap().data.into_iter().map(|level| level as u8).collect();
        levels.sort_unstable();
        levels.dedup();
        levels
    };

    let (output, out) = import("guessed", &[]);
    let told = notes(&output);
    assert!(told.contains("reach 4095, so they are read as 12 bit: 4095 is white"), "{told}");
    assert_eq!(levels(&out), (0..=255).collect::<Vec<u8>>());

    let (output, out) = import("given", &["--bits", "13"]);
    assert!(!notes(&output).contains("bit"), "{}", notes(&output));
    assert_eq!(levels(&out), (0..=127).collect::<Vec<u8>>());

    let told = complaint(&import("too few", &["--bits", "10"]).0);
    assert!(told.contains("holds a sample of 4095, which is more than 10 bit; give --bits 12 or more"), "{told}");

    deep(&pictures, 65_535);
    let (output, out) = import("whole", &[]);
    assert!(!notes(&output).contains("bit"), "{}", notes(&output));
    assert_eq!(levels(&out).len(), 256);
}

#[test]
fn a_colour_picture_of_the_sensors_size_keeps_its_levels_too() {
    let folder = TempDir::new().unwrap();
    let pictures = folder.path().join("pictures");
    let out = folder.path().join("scan");
    fs::create_dir_all(&pictures).unwrap();
    for name in ["pose1_f0.png", "pose1_f1.png"] {
        let level = |x: u32, y: u32| image::Rgb([(x + y) as u16; 3]);
        image::ImageBuffer::from_fn(2048, 1088, level).save(pictures.join(name)).unwrap();
    }

    let told = notes(&parfocal(&["scan", "import", text(&pictures), "--out", text(&out)]));
    assert!(told.contains("reach 3134, so they are read as 12 bit: 4095 is white"), "{told}");

    let scan = ScanFolder::open(&out).unwrap();
    let pose = &scan.poses()[&1];
    let picture = scan.picture(pose, &pose.images[0]).unwrap();
    // 255 * 3134 / 4095 is 195.2.
    assert_eq!((picture.data[0] as u8, picture.data[2048 * 1088 - 1] as u8), (0, 195));
}

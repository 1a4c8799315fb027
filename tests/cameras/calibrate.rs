//! `parfocal calibrate`: references taken with the phantom, what is refused, and how the rest of the program uses them.

use std::fs;
use std::path::Path;

use super::program::{done, refused};

fn capture<'a>(which: &'a str, camera: &'a str, out: &'a Path) -> [&'a str; 8] {
    ["calibrate", which, "--camera", camera, "--frames", "4", "--out", out.to_str().unwrap()]
}

#[test]
fn dark_and_white_make_a_calibration_that_names_itself_and_flattens_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("unit");
    let calibration = out.to_str().unwrap();
    assert!(refused(&capture("white", "phantom:white", &out)).contains("run `parfocal calibrate dark` first"));
    done(&[&capture("dark", "phantom:dark", &out)[..], &["--unit", "7", "--name", "theatre 2"]].concat());
    // Each reference is refused if it is mistaken for the other.
    let said = refused(&capture("white", "phantom:dark", &out));
    assert!(said.contains("nothing was saved: nothing is seen") && said.contains("`calibrate dark`"), "{said}");
    assert!(refused(&capture("dark", "phantom:white", &out)).contains("`calibrate white`"));
    let said = done(&capture("white", "phantom:white", &out));
    assert!(said.starts_with("theatre 2, unit 7, version 2 of 20"), "{said}");

    let toml = fs::read_to_string(out.join("calibration.toml")).unwrap();
    assert!(toml.contains("dark = \"dark-1.tiff\"") && toml.contains("white = \"white-2.tiff\""), "{toml}");
    assert!(out.join("calibration-1.toml").exists(), "the version before is kept");

    // The white reference itself, developed with its calibration, is even: its focus metric is almost 0.
    let white = out.join("white-2.tiff");
    let inspect = |extra: &[&str]| -> serde_json::Value {
        let line = done(&[&["inspect", "--json", white.to_str().unwrap()][..], extra].concat());
        serde_json::from_str(&line).unwrap()
    };

    let plain = inspect(&[]);
    let flat = inspect(&["--calibration", calibration]);
    assert!(flat["mgm"].as_f64().unwrap() < 0.01, "{flat}");
    assert!(plain["mgm"].as_f64().unwrap() > 0.5, "{plain}");
    assert!(flat["calibration"].as_str().unwrap().starts_with("theatre 2, unit 7, version 2"));
    assert!(plain.get("calibration").is_none());
}

#[test]
fn a_calibration_that_cannot_be_kept_leaves_the_one_before_and_its_history() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("unit");
    let current = out.join("calibration.toml");
    done(&capture("dark", "phantom:dark", &out));
    let before = fs::read(&current).unwrap();
    // The file's temporary copy cannot be written, as on a full disk.
    let aside = out.join(".calibration.toml.partial");
    fs::create_dir(&aside).unwrap();
    assert!(refused(&capture("white", "phantom:white", &out)).contains("cannot write to"));
    assert_eq!(fs::read(&current).unwrap(), before);
    fs::remove_dir(&aside).unwrap();
    assert!(done(&capture("white", "phantom:white", &out)).contains("version 2 of 20"));

    // What an imported file leaves out stays as it is: the measured references too.
    let part = folder.path().join("part.toml");
    fs::write(&part, "unit = \"77\"\n").unwrap();
    done(&["calibrate", "import", part.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let kept: toml::Table = toml::from_str(&fs::read_to_string(&current).unwrap()).unwrap();
    assert_eq!((kept["unit"].as_str(), kept["version"].as_str()), (Some("77"), Some("3")));
    assert_eq!((kept["dark"].as_str(), kept["white"].as_str()), (Some("dark-1.tiff"), Some("white-2.tiff")));

    // A folder with earlier versions but no current one is not used: their names are taken.
    fs::remove_file(&current).unwrap();
    let dark = fs::read(out.join("dark-1.tiff")).unwrap();
    let said = refused(&capture("dark", "phantom:dark", &out));
    assert!(said.contains("copy calibration-2.toml to that name"), "{said}");
    assert_eq!(fs::read(out.join("dark-1.tiff")).unwrap(), dark);
}

#[test]
fn references_of_another_size_are_refused_when_the_camera_opens() {
    let folder = tempfile::tempdir().unwrap();
    let reference = image::ImageBuffer::from_pixel(8, 8, image::Luma([40_u16]));
    reference.save(folder.path().join("dark.tiff")).unwrap();
    let file = folder.path().join("small.toml");
    fs::write(&file, "name = 'small'\ndark = 'dark.tiff'\n").unwrap();
    let data = folder.path().join("data");
    let file = file.to_str().unwrap();
    let serve = ["serve", "--bind", "127.0.0.1:0", "--data-dir", data.to_str().unwrap(), "--calibration", file];
    let said = refused(&serve);
    assert!(said.contains("small, version default was taken at 8x8, but the camera's picture is 2048x1088"), "{said}");
    fs::write(file, "name = 'wide'\nbit_depth = 12").unwrap();
    assert!(refused(&serve).contains("is for samples of 12 bit"), "a picture four times too dark");
    let out = folder.path().join("unit");
    fs::create_dir(&out).unwrap();
    fs::copy(file, out.join("calibration.toml")).unwrap();
    assert!(refused(&capture("dark", "phantom:dark", &out)).contains("`bit_depth = 10`"));
    fs::write(file, "dark = 'missing.tiff'").unwrap();
    assert!(refused(&serve).contains("key 'dark': cannot read the picture"), "the file and the key are named");
    fs::write(file, "white = 'dark.tiff'\ndark = 90").unwrap();
    assert!(refused(&serve).contains("key 'white': every count must be above"));
}

#[test]
fn a_makers_tables_are_imported() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    // Band b: a triangle of half width 10 nm about 460 + 8 b.
    let line = |nm: u32| {
        let of = |band: u32| (1.0 - (f64::from(nm) - f64::from(460 + 8 * band)).abs() / 10.0).max(0.0).to_string();
        format!("{nm},{}\n", (0..16).map(of).collect::<Vec<_>>().join(","))
    };

    let heading = format!("nm,{}\n", ["band"; 16].join(","));
    fs::write(path("responses.csv"), heading + &(440..=600).map(line).collect::<String>()).unwrap();
    let row = |row: usize| (0..16).map(|at| if at == row { "0.5" } else { "0" }).collect::<Vec<_>>().join(", ") + "\n";
    fs::write(path("correction.csv"), (0..16).map(row).collect::<String>()).unwrap();
    let out = path("unit");
    done(&[
        "calibrate",
        "import",
        "--responses",
        &path("responses.csv"),
        "--correction",
        &path("correction.csv"),
        "--unit",
        "9",
        "--out",
        &out,
    ]);

    let toml: toml::Table = toml::from_str(&fs::read_to_string(path("unit/calibration.toml")).unwrap()).unwrap();
    assert_eq!(toml["unit"].as_str(), Some("9"));
    let number = |key: &str, at: usize| toml[key][at].as_float().unwrap();
    assert!((number("centre_nm", 3) - 484.0).abs() < 1e-9 && (number("fwhm_nm", 3) - 10.0).abs() < 1e-9);
    assert_eq!(toml["spectral_correction"][4][4].as_float(), Some(0.5));

    // A lobe outside the sensor's range is higher, and still no band.
    let lobe = |nm: u32| {
        let nm = f64::from(nm);
        let height = |centre: f64, height: f64| (height - (nm - centre).abs() * height / 10.0).max(0.0);
        let response = |band: u32| (height(430.0, 2.0) + height(465.0 + 8.0 * f64::from(band), 1.0)).to_string();
        format!("{nm},{}\n", (0..16).map(response).collect::<Vec<_>>().join(","))
    };
    fs::write(path("lobes.csv"), (400..=640).map(lobe).collect::<String>()).unwrap();
    let lobes = ["calibrate", "import", "--responses", &path("lobes.csv"), "--out", &out];
    done(&lobes);
    let toml: toml::Table = toml::from_str(&fs::read_to_string(path("unit/calibration.toml")).unwrap()).unwrap();
    assert!((toml["centre_nm"][0].as_float().unwrap() - 465.0).abs() < 1e-9, "{toml}");
    let said = refused(&[&lobes[..], &["--range", "480-600"]].concat());
    assert!(said.contains("lobes.csv: band 0 has no peak between 480 and 600 nm"), "{said}");

    // A calibration that nothing could read again is not saved.
    let before = fs::read(path("unit/calibration.toml")).unwrap();
    let infrared = |nm: u32| line(nm - 340).replacen(&(nm - 340).to_string(), &nm.to_string(), 1);
    fs::write(path("infrared.csv"), (780..=940).map(infrared).collect::<String>()).unwrap();
    let import = ["calibrate", "import", "--responses", &path("infrared.csv"), "--range", "790-940", "--out", &out];
    let said = refused(&import);
    assert!(said.contains("nothing was saved") && said.contains("between 380 and 780 nm"), "{said}");
    assert_eq!(fs::read(path("unit/calibration.toml")).unwrap(), before);

    fs::write(path("correction.csv"), "1,2,3\n").unwrap();
    let said = refused(&["calibrate", "import", "--correction", &path("correction.csv"), "--out", &out]);
    assert!(said.contains("line 1 must have 16 numbers"), "{said}");
}

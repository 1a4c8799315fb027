//! The spectrum at a place, beside what Spectral Python and `NumPy` make of the cube at the same place.

use std::path::Path;
use std::process::Command;

use parfocal_imaging::{BANDS, Calibration, Reference};
use serde_json::Value;
use tempfile::TempDir;

use super::{SIZE, complaint, done, made_up, made_up_by, parfocal, said, text};

const DARK: f32 = 20.0;
const WHITE: f32 = 900.0;

/// The columns of a printed table, by their names. Empty cells are left out.
fn columns(table: &str) -> Value {
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let names = rows.headers().unwrap().clone();
    let rows: Vec<_> = rows.records().map(Result::unwrap).collect();
    let column = |at: usize| rows.iter().filter_map(|row| row[at].parse::<f64>().ok()).collect::<Vec<_>>();
    names
        .iter()
        .enumerate()
        .map(|(at, name)| (name.to_owned(), column(at).into()))
        .collect::<serde_json::Map<_, _>>()
        .into()
}

fn by_python(cube: &Path, at: [&str; 3]) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut python = Command::new("python3");
    python.arg("-s").arg(root.join("tests/recordings/spectrum.py")).arg(cube).args(at);
    python.args([DARK.to_string(), WHITE.to_string()]).env("PYTHONPATH", root.join("target/recordings"));
    let output = python.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn assert_same(ours: &Value, theirs: &Value) {
    let numbers = |list: &Value| list.as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect::<Vec<_>>();
    let (ours, theirs) = (numbers(ours), numbers(theirs));
    assert_eq!(ours.len(), BANDS);
    // Dark and span are kept in 32 bits.
    let near = ours.iter().zip(&theirs).all(|(ours, theirs)| (ours - theirs).abs() < 1e-6 * theirs.abs().max(1.0));
    assert!(near, "{ours:?}\n{theirs:?}");
}

#[test]
fn a_spectrum_is_what_spectral_python_finds_in_the_cube() {
    let folder = TempDir::new().unwrap();
    let calibration = Calibration {
        dark: Reference::PerBand([DARK; BANDS]),
        white: Reference::PerBand([WHITE; BANDS]),
        ..Calibration::default()
    };
    let recording = made_up_by(&folder, 30, SIZE, &calibration);
    let cube = folder.path().join("cube.hdr");
    done(&["recording", "cube", text(&recording), "--frame", "27", "--out", text(&cube)]);

    for (at, radius, cells) in [("31,17", "9", 15), ("1,1", "6.5", 3), ("30,14", "0", 1)] {
        let spectrum = ["recording", "spectrum", text(&recording), "--frames", "27", "--at", at, "--radius", radius];
        let ours = columns(&done(&spectrum));
        let (x, y) = at.split_once(',').unwrap();
        let theirs = by_python(&cube, [x, y, radius]);
        assert_eq!(ours["wavelength_nm"], theirs["wavelengths"]);
        assert_eq!(theirs["cells"], cells, "at {at}");
        for column in ["counts", "counts_spread", "reflectance", "reflectance_spread"] {
            assert_same(&ours[column], &theirs[column]);
        }
    }
}

#[test]
fn frames_are_pooled_and_without_a_white_reference_there_are_counts_alone() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 12);
    let out = folder.path().join("spectrum.csv");
    let told =
        done(&["recording", "spectrum", text(&recording), "--at", "8.5,4.5", "--frames", "2..4", "--out", text(&out)]);
    assert!(told.starts_with("1 cell in 3 frames; counts alone, since"), "{told}");
    let found = columns(&std::fs::read_to_string(&out).unwrap());
    assert_eq!(found["reflectance"], serde_json::json!([]));

    // The shortest wavelength, 460.1 nm, is band 12: row 3 and column 0 of the cell.
    let counts: Vec<f64> = (2..5).map(|frame| f64::from(super::sample(frame, 8, 7))).collect();
    let mean = counts.iter().sum::<f64>() / 3.0;
    let spread = (counts.iter().map(|count| (count - mean).powi(2)).sum::<f64>() / 3.0).sqrt();
    assert!((found["counts"][0].as_f64().unwrap() - mean).abs() < 1e-9, "{found}");
    assert!((found["counts_spread"][0].as_f64().unwrap() - spread).abs() < 1e-9, "{found}");
}

#[test]
fn places_and_frames_that_are_none_are_refused_in_a_sentence() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 12);
    let spectrum = |rest: &[&str]| parfocal(&[&["recording", "spectrum", text(&recording)], rest].concat());

    let told = complaint(&spectrum(&["--at", "64,3"]));
    assert!(told.contains("the place 64,3 is outside the picture of 64x32 samples"), "{told}");
    let told = complaint(&spectrum(&["--at", "3,3", "--radius", "-1"]));
    assert!(told.contains("a radius must be 0 or more samples, not -1"), "{told}");
    let told = complaint(&spectrum(&["--at", "3,3", "--frames", "10..12"]));
    assert!(told.contains("has 12 frames, counted from 0; there is no frame 12"), "{told}");

    for wrong in [["--at", "3"], ["--at", "nan,2"], ["--frames", "4..2"]] {
        let output = spectrum(&[&["--at", "3,3"], &wrong[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{wrong:?}: {}", said(&output));
    }
}

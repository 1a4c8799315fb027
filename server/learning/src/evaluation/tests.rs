//! An evaluation's figures, compared with values worked out by hand, and how an evaluation ends.

use crate::scans::benchmark::{Benchmark, Conditions};
use crate::scans::simulated::{ScanSettings, Scene};
use std::sync::Arc;

use super::*;
use crate::scans::clip::Clip;
use crate::scans::recorded::PARTS;
use parfocal_autofocus::{Decision, FieldOfView, Observation, Policy};
use parfocal_base::FocalPower;
use parfocal_devices::simulation::texture::texture;

fn row(focal_power: Vec<f64>, optimum: Vec<f64>) -> Row {
    Outcome { policy: "a".to_owned(), paths: vec![Path { focal_power, optimum, ..Path::default() }], parts: PARTS }
        .row()
}

#[test]
fn figures_of_fewer_poses_than_parts_are_those_of_the_whole_path() {
    // Forwards and backwards by one step, at every frame: 11 moves, 10 turns in 12 frames of 1/25 s.
    let to_and_fro = (0..12).map(|index| 0.5 + 0.05 * f64::from(index % 2)).collect();
    let row = row(to_and_fro, vec![0.5; 12]);
    assert_eq!((row.frames, row.scan_mae.len()), (12, 12));
    for (found, expected) in [
        (row.mae, 0.025),
        (row.sd, 0.025),
        (row.in_focus, 1.0),
        (row.travel, 0.05),
        (row.reversals, 10.0 * 25.0 / 12.0),
    ] {
        assert!((found - expected).abs() < 1e-12, "{row:?}");
    }
}

#[test]
fn figures_of_a_number_of_poses_that_parts_do_not_divide_are_those_of_the_whole_path() {
    // Up nine steps of 0.05, a pause, down nine: 18 moves in 19 intervals, one turn, in 20 frames.
    // Parts are of one or two.
    let place = |index: i32| 0.05 * f64::from(index.min(19 - index));
    let path: Vec<f64> = (0..20).map(place).collect();
    // Off by 0.2 at the first four frames, which fill three parts and half of a fourth.
    let optimum = path.iter().enumerate().map(|(i, f)| if i < 4 { f + 0.2 } else { *f }).collect();
    let row = row(path, optimum);
    assert_eq!((row.frames, row.scan_mae.len()), (20, PARTS));
    for (found, expected) in
        [(row.mae, 0.04), (row.sd, 0.08), (row.in_focus, 0.8), (row.travel, 18.0 * 0.05 / 19.0), (row.reversals, 1.25)]
    {
        assert!((found - expected).abs() < 1e-12, "{row:?}");
    }
}

/// A policy that returns NaN from its third frame on.
struct GivesUp(usize);

impl Policy for GivesUp {
    fn field_of_view(&self) -> FieldOfView {
        FieldOfView::Patch
    }

    fn step(&mut self, seen: &Observation<'_>) -> Decision {
        self.0 += 1;
        let target = if self.0 < 3 { seen.focal_power.get() } else { f64::NAN };
        Decision { target, ..Decision::default() }
    }
}

#[test]
fn a_policy_that_gives_up_has_no_figures() {
    let registry = Registry::default().with("lazy", "", || Box::new(GivesUp(0)));
    let scenes = vec![Scene::Flat(Arc::new(Clip::still(texture(1, 64)).unwrap()))];
    let conditions = Conditions::Same(ScanSettings::default());
    let scans = Benchmark { scenes, conditions, seed: 1, count: 1, frames: 9 };
    let told = evaluate(&registry, &[PolicyName::new("lazy")], &scans, &|_| ()).unwrap_err().to_string();
    assert!(told.starts_with("policy 'lazy' failed on scan 1: at frame 3 it returned NaN"), "{told}");
}

#[test]
fn the_first_scans_of_a_partly_varied_set_are_the_references() {
    let same = Benchmark::reference(4).unwrap();
    let varied = Benchmark { conditions: Conditions::VariedFrom(2), ..same.clone() };
    let seen = |set: &Benchmark, index| set.scan(index).0.observe(FocalPower::MIDDLE);
    let alike: Vec<bool> = (0..4).map(|index| seen(&same, index) == seen(&varied, index)).collect();
    assert_eq!(alike, [true, true, false, false]);
}

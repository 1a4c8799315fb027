//! A policy stepped over a recording.

use std::collections::BTreeMap;

use super::*;

/// The rows that `parfocal recording step` writes for `policy` over `recording`.
fn stepped(folder: &TempDir, recording: &Path, policy: &str) -> Vec<BTreeMap<String, String>> {
    let out = folder.path().join(format!("{policy}.csv"));
    let printed = done(&["recording", "step", text(recording), "--policy", policy, "--out", text(&out)]);
    assert!(printed.contains(&format!("steps of {policy} in")), "{printed}");
    csv::Reader::from_path(out).unwrap().deserialize().map(Result::unwrap).collect()
}

fn value(row: &BTreeMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} of {row:?}"))
}

#[test]
fn a_policy_steps_over_a_recording_and_says_what_it_saw_and_asked() {
    let folder = TempDir::new().unwrap();
    let recording = folder.path().join("phantom");
    let printed =
        done(&["recording", "record", "--out", text(&recording), "--seconds", "2", "--policy", "mgm-hill-climber"]);
    assert!(printed.contains("frames in"), "{printed}");
    let frames = Recording::open(&recording).unwrap();

    let rows = stepped(&folder, &recording, "mgm-hill-climber");
    assert_eq!(rows.len(), frames.rows().len());
    let mut last_metric = f64::NEG_INFINITY;
    let mut direction = 1.0;
    for (row, known) in rows.iter().zip(frames.rows()) {
        assert_eq!(row["frame_number"], known.number.to_string());
        let exposed_at = value(row, "focal_power");
        assert!((exposed_at - known.measured).abs() < 1e-12, "as the lens said: {row:?}");
        assert!((value(row, "recorded_asked") - known.asked).abs() < 1e-12, "{row:?}");

        // The paper's rule: a step of 0.05 in the last direction if the metric rose and 0 < f < 1, else in the other.
        let metric = value(row, "metric");
        let goes_on = metric > last_metric && exposed_at > 0.0 && exposed_at < 1.0;
        direction = if goes_on { direction } else { -direction };
        let expected = (exposed_at + 0.05 * direction).clamp(0.0, 1.0);
        assert!((value(row, "target") - expected).abs() < 1e-9, "{expected}: {row:?}");
        last_metric = metric;
    }

    // The metric is that of the patch in the developed picture, worked out by another command.
    let pictures = folder.path().join("pictures");
    done(&["recording", "video", text(&recording), "--out", text(&pictures), "--pictures", "tiff", "--to", "0"]);
    let seen = done(&["inspect", text(&pictures.join("frame000000.tiff")), "--json"]);
    let seen: Value = serde_json::from_str(seen.trim()).unwrap();
    assert_eq!(seen["patch"]["x"].to_string(), rows[0]["patch_x"], "{seen}");
    assert!((seen["mgm"].as_f64().unwrap() - value(&rows[0], "metric")).abs() < 1e-3, "{seen} {:?}", rows[0]);

    let fixed = stepped(&folder, &recording, "fixed");
    let start = value(&fixed[0], "focal_power");
    assert!(fixed.iter().all(|row| (value(row, "target") - start).abs() < 1e-12), "it stays where it began");
    assert!(fixed.iter().all(|row| row["metric"].is_empty()));
}

#[test]
fn a_table_is_written_whole_or_not_at_all() {
    let folder = TempDir::new().unwrap();
    let recording = made_up(&folder, 30);
    let out = folder.path().join("steps.csv");
    let step = |policy: &str| {
        complaint(&parfocal(&["recording", "step", text(&recording), "--policy", policy, "--out", text(&out)]))
    };
    assert!(step("guess").contains("there is no policy 'guess'"));
    // The made-up mosaics are smaller than a patch.
    assert!(step("fixed").contains("frame 0 holds nothing to focus on"), "{}", step("fixed"));
    assert!(!out.exists());
}

//! The model card, as Markdown: what users of trained weights should know about them.

use crate::evaluation::Row;
use crate::scans::benchmark::{Benchmark, SEED};
use parfocal_autofocus::shipped::{Design, design};

/// How weights were made.
pub(super) struct Provenance<'a> {
    pub policy: &'a str,
    pub seed: u64,
    /// Updates of the training.
    pub updates: u64,
    /// File of the weights that the training began with; `None` for random ones.
    pub origin: Option<&'a str>,
    /// What the training used, in words.
    pub data: &'a str,
}

/// The card of weights, with their figures `row` on the scans `validation`.
pub(super) fn validated(made: &Provenance<'_>, row: &Row, validation: &Benchmark) -> String {
    let origin = made.origin.map_or("random weights".to_owned(), |file| format!("the weights {file}"));

    let input = match design(made.policy) {
        Some(Design::Belief) => {
            "32x32 gray patches (0..255), two wider patches around each (32x32 means of 2x2 and of 4x4 pixels), the \
             128x128 pixels around each, and focal powers (0..1)"
        }
        Some(Design::Values(_)) | None => "32x32 gray patches (0..255) and focal powers (0..1)",
    };

    format!(
        "# {}\n\nTrained by `parfocal train` {}, seed {}, {} updates, recipe in `recipe.toml`, \
         beginning with {origin}, on {}.\n\n\
         Input: {input}. Weights: safetensors, float32, PyTorch's names and layouts. Not a medical device.\n\n\
         On {} validation scans, {} of them varied: {}.\n",
        made.policy,
        env!("CARGO_PKG_VERSION"),
        made.seed,
        made.updates,
        made.data,
        validation.count,
        validation.varied(),
        figures(row),
    )
}

const BENCHMARK: &str = "of the reference benchmark";

/// Whether `card` already has figures on the reference benchmark.
pub(super) fn is_benchmarked(card: &str) -> bool {
    card.contains(BENCHMARK)
}

/// Adds to `card` the figures `row` on `count` scans of the reference benchmark.
pub(super) fn benchmarked(card: &str, row: &Row, count: usize) -> String {
    format!("{card}\nOn {count} scans {BENCHMARK} (seed {SEED}): {}.\n", figures(row))
}

fn figures(row: &Row) -> String {
    format!(
        "mean absolute focal power error {:.4} ± {:.4}, in focus {:.1} %, travel {:.4} a frame, \
         {:.2} reversals a second",
        row.mae,
        row.sd,
        100.0 * row.in_focus,
        row.travel,
        row.reversals
    )
}

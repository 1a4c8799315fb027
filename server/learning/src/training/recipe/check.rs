//! Parses a recipe and checks its numbers before a training begins. An invalid one is rejected with its key and range.

use std::fmt::Display;
use std::ops::RangeInclusive;

use super::belief::BeliefRecipe;
use super::dqn::{Bellman, DqnRecipe, Lookahead, Target};
use super::{LEG, Recipe};
use crate::training::optimiser::Rule;
use parfocal_autofocus::networks::HISTORY;

/// Largest number of updates of a training.
pub const MAX_UPDATES: u64 = 1_000_000_000;

impl Recipe {
    /// Parses the recipe in `text` (TOML).
    ///
    /// # Errors
    /// If a key is unknown, missing or of the wrong type (with its line), or a number is outside its range.
    pub fn parse(text: &str) -> Result<Self, String> {
        let recipe: Self = toml::from_str(text).map_err(|error| sentence(&error, text))?;
        check(&recipe)?;
        Ok(recipe)
    }
}

/// The error in `text` as one sentence with its line. TOML's own message has several lines.
fn sentence(error: &toml::de::Error, text: &str) -> String {
    let what = error.message().trim().replace('\n', ", ");
    let before = error.span().and_then(|span| text.get(..span.start));
    before.map_or(what.clone(), |before| format!("line {}: {what}", before.matches('\n').count() + 1))
}

/// Checks all numbers of `recipe`: names the key, range and value of the first one outside its range.
fn check(recipe: &Recipe) -> Result<(), String> {
    within("pictures", recipe.pictures, 1..=100_000)?;
    within("validate_every", recipe.validate_every, LEG..=MAX_UPDATES)?;
    if !recipe.validate_every.is_multiple_of(LEG) {
        return Err(format!("'validate_every' must be a multiple of {LEG}, and is {}", recipe.validate_every));
    }

    within("footage_share", recipe.footage_share, 0.0..=1.0)?;
    within("reliefs", recipe.reliefs, 0..=10_000)?;
    within("relief_share", recipe.relief_share, 0.0..=1.0)?;
    within("bench_share", recipe.bench_share, 0.0..=1.0)?;
    within("benchmark", recipe.benchmark, 0..=10_000)?;

    match (&recipe.dqn, &recipe.belief) {
        (Some(dqn), None) => check_dqn(dqn),
        (None, Some(belief)) => check_belief(belief),
        _ => Err("a recipe needs exactly one of [dqn] and [belief]".to_owned()),
    }
}

fn check_dqn(dqn: &DqnRecipe) -> Result<(), String> {
    within("dqn.scans", dqn.scans, 1..=10_000)?;
    within("dqn.frames_a_scan", dqn.frames_a_scan, 1..=u16::MAX)?;
    within("dqn.frames_an_update", dqn.frames_an_update, 1..=1_000_000)?;
    // A state is the latest eight frames.
    within("dqn.window", dqn.window, HISTORY..=4096)?;
    within("dqn.windows", dqn.windows, 1..=4096)?;
    // After the warm-up, the replay memory of each scan must hold a whole window.
    let least = dqn.window * dqn.scans;
    within("dqn.warm_up", dqn.warm_up, least as u64..=1_000_000_000)?;
    within("dqn.replay", dqn.replay, least..=100_000_000)?;

    within("dqn.updates", dqn.updates, 1..=MAX_UPDATES)?;
    check_target(dqn)?;
    check_rule("dqn", dqn.optimiser)?;
    descent("dqn", dqn.clip, dqn.final_rate)?;

    within("dqn.first_epsilon", dqn.first_epsilon, 0.0..=1.0)?;
    within("dqn.last_epsilon", dqn.last_epsilon, 0.0..=1.0)?;
    within("dqn.epsilon_frames", dqn.epsilon_frames, 0..=1_000_000_000_000)?;
    within("dqn.target_share", dqn.target_share, 1e-9..=1.0)?;
    shares("dqn", dqn.variety, dqn.wandering)
}

fn check_target(dqn: &DqnRecipe) -> Result<(), String> {
    match dqn.target {
        Target::Bellman(Bellman { discount, steps, .. }) => {
            // With a discount of 1, or almost 1, the values are not bounded by the rewards.
            within("dqn.target.discount", discount, 0.0..=0.9999)?;

            // A state and the one `steps` later must lie in one window of one scan, both with their whole history.
            let most = (dqn.window - HISTORY).min(usize::from(dqn.frames_a_scan) - 1);
            if most == 0 {
                let least = HISTORY + 1;
                return Err(format!(
                    "'dqn.window' must be at least {least}, and 'dqn.frames_a_scan' at least 2, \
                     for targets of kind 'bellman'"
                ));
            }
            within("dqn.target.steps", steps, 1..=most)
        }
        Target::Lookahead(Lookahead { restless, turning }) => {
            within("dqn.target.restless", restless, 0.0..=1000.0)?;
            within("dqn.target.turning", turning, 0.0..=1.0)
        }
    }
}

fn check_belief(belief: &BeliefRecipe) -> Result<(), String> {
    within("belief.scans", belief.scans, 1..=10_000)?;
    within("belief.window", belief.window, 1..=4096)?;
    within("belief.windows_a_scan", belief.windows_a_scan, 1..=1_000_000)?;
    within("belief.updates", belief.updates, 1..=MAX_UPDATES)?;
    check_rule("belief", belief.optimiser)?;
    descent("belief", belief.clip, belief.final_rate)?;
    shares("belief", belief.variety, belief.wandering)
}

fn check_rule(section: &str, rule: Rule) -> Result<(), String> {
    let (Rule::RmsProp { learning_rate, .. } | Rule::Adam { learning_rate }) = rule;
    within(&format!("{section}.optimiser.learning_rate"), learning_rate, 1e-12..=1.0)?;
    match rule {
        Rule::RmsProp { momentum, .. } => within(&format!("{section}.optimiser.momentum"), momentum, 0.0..=0.9999),
        Rule::Adam { .. } => Ok(()),
    }
}

fn descent(section: &str, clip: f64, final_rate: f64) -> Result<(), String> {
    within(&format!("{section}.clip"), clip, 1e-9..=1e12)?;
    within(&format!("{section}.final_rate"), final_rate, 0.0..=1.0)
}

fn shares(section: &str, variety: f64, wandering: f64) -> Result<(), String> {
    within(&format!("{section}.variety"), variety, 0.0..=1.0)?;
    within(&format!("{section}.wandering"), wandering, 0.0..=1.0)
}

/// Rejects `value` outside `range`, including NaN.
fn within<N: Copy + PartialOrd + Display>(key: &str, value: N, range: RangeInclusive<N>) -> Result<(), String> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(format!("'{key}' must be from {} to {}, and is {value}", range.start(), range.end()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::training::recipe::{Recipe, shipped};

    /// Parses the recipe that ships as `name`, with `key` set to `value`.
    fn with(name: &str, key: &str, value: &str) -> Result<Recipe, String> {
        let text = shipped(name).unwrap();
        let line = |line: &str| match line.split_once(" = ") {
            Some((found, _)) if found == key => format!("{key} = {value}"),
            _ => line.to_owned(),
        };
        let changed = text.lines().map(line).collect::<Vec<_>>().join("\n");
        assert!(changed != text, "{key}");
        Recipe::parse(&changed)
    }

    #[test]
    fn numbers_that_make_no_sense_are_refused_with_key_range_and_value() {
        for (name, key, value, told) in [
            ("mgm-learned", "first_epsilon", "2.0", "'dqn.first_epsilon' must be from 0 to 1, and is 2"),
            ("mgm-learned", "first_epsilon", "nan", "'dqn.first_epsilon' must be from 0 to 1, and is NaN"),
            ("mgm-learned", "last_epsilon", "-1.0", "'dqn.last_epsilon' must be from 0 to 1, and is -1"),
            ("parfocal", "variety", "1.5", "'belief.variety' must be from 0 to 1, and is 1.5"),
            ("mgm-learned", "wandering", "2.0", "'dqn.wandering' must be from 0 to 1, and is 2"),
            ("mgm-learned", "window", "7", "'dqn.window' must be from 8 to 4096, and is 7"),
            ("mgm-learned", "scans", "4611686018427387904", "'dqn.scans' must be from 1 to 10000, and is 46"),
            ("mgm-learned", "replay", "9000000000000000000", "'dqn.replay' must be from 1024 to 100000000, and is 9"),
            ("mgm-learned", "replay", "1000", "'dqn.replay' must be from 1024 to"),
            ("mgm-learned", "warm_up", "1000", "'dqn.warm_up' must be from 1024 to"),
            ("mgm-learned", "updates", "0", "'dqn.updates' must be from 1 to"),
            ("parfocal", "updates", "0", "'belief.updates' must be from 1 to"),
            ("parfocal", "clip", "0.0", "'belief.clip' must be from 0.000000001 to"),
            ("mgm-learned", "clip", "nan", "and is NaN"),
            ("parfocal", "optimiser", "{ name = \"adam\", learning_rate = -0.1 }", "'belief.optimiser.learning_rate'"),
            ("parfocal", "validate_every", "150", "'validate_every' must be a multiple of 100, and is 150"),
            (
                "mgm-learned-paper",
                "target",
                "{ kind = \"bellman\", discount = 0.99, steps = 40, double = false }",
                "'dqn.target.steps' must be from 1 to 32, and is 40",
            ),
            (
                "mgm-learned-paper",
                "target",
                "{ kind = \"bellman\", discount = 0.99, steps = 0, double = false }",
                "'dqn.target.steps' must be from 1 to 32, and is 0",
            ),
            ("mgm-learned-paper", "window", "8", "'dqn.window' must be at least 9"),
        ] {
            let error = with(name, key, value).unwrap_err();
            assert!(error.contains(told) && !error.contains('\n'), "{key} = {value}: {error}");
        }
    }

    #[test]
    fn a_policy_may_be_trained_greedily() {
        let recipe = with("mgm-learned", "first_epsilon", "0.0").unwrap().dqn.unwrap();
        assert!(recipe.epsilon(0).abs() < 1e-12 && recipe.epsilon(u64::MAX) > 0.0);
    }

    /// Numbers of all sizes, in TOML's notation.
    fn number() -> impl Strategy<Value = String> {
        prop_oneof![
            any::<i64>().prop_map(|value| value.to_string()),
            (0..5000i64).prop_map(|value| value.to_string()),
            any::<f64>().prop_map(|value| if value.is_finite() { format!("{value:?}") } else { "nan".to_owned() }),
            (-1.0..2.0f64).prop_map(|value| format!("{value:?}")),
            Just("inf".to_owned()),
        ]
    }

    proptest! {
        #[test]
        fn a_recipe_of_any_numbers_is_refused_or_can_be_trained_by(
            name in prop::sample::select(vec!["mgm-learned", "mgm-learned-paper", "parfocal"]),
            numbers in prop::collection::vec((any::<prop::sample::Index>(), number()), 1..4),
            frames in any::<u64>(),
        ) {
            let mut lines: Vec<String> = shipped(name).unwrap().lines().map(str::to_owned).collect();
            let places: Vec<(usize, usize)> = lines
                .iter()
                .enumerate()
                .filter(|(_, line)| !line.starts_with('#') && !line.starts_with("policy"))
                .flat_map(|(row, line)| line.match_indices("= ").map(move |(at, _)| (row, at + 2)).collect::<Vec<_>>())
                .filter(|&(row, at)| lines[row][at..].starts_with(|c: char| c.is_ascii_digit()))
                .collect();

            for (index, value) in numbers {
                let (row, at) = places[index.index(places.len())];
                let Some(line) = lines[row].get(at..) else { continue };
                let end = line.find([' ', ',']).unwrap_or(line.len());
                lines[row].replace_range(at..at + end, &value);
            }

            let Ok(recipe) = Recipe::parse(&lines.join("\n")) else { return Ok(()) };
            prop_assert!(recipe.updates() > 0 && recipe.validate_every % 100 == 0 && recipe.pictures > 0);

            let share = |value: f64| (0.0..=1.0).contains(&value);
            if let Some(dqn) = recipe.dqn {
                prop_assert!([0, frames, u64::MAX].iter().all(|&frames| share(dqn.epsilon(frames))));
                prop_assert!(share(dqn.variety) && share(dqn.wandering) && dqn.clip > 0.0 && dqn.window >= 8);
                let window_of_each = dqn.window.checked_mul(dqn.scans).unwrap();
                prop_assert!(dqn.replay / dqn.scans >= dqn.window && dqn.warm_up >= window_of_each as u64);
                prop_assert!(dqn.replay.checked_mul(1024).is_some_and(|bytes| bytes < 1 << 37));
            }
            if let Some(belief) = recipe.belief {
                prop_assert!(share(belief.variety) && share(belief.wandering) && belief.clip > 0.0);
                prop_assert!(belief.scans * belief.window * belief.windows_a_scan > 0);
            }
        }
    }
}

//! One outcome compared between policies: summaries, tests, agreement of repeats, effect of position. If a figure
//! cannot be computed, a sentence says why.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use utoipa::ToSchema;

use super::outcomes::{Outcome, Value};
use super::statistics::{
    Agreement, Friedman, Interval, PermutationMethod, Summary, Trend, agreement, concordance, friedman, median,
    summary, trend,
};
use super::words::{counted, decimals, interval_words, method_words, p_words};
use parfocal_base::ids::SessionId;
use parfocal_base::statistics::{Method, bootstrap_statistic, holm, mean, rank_biserial, wilcoxon};

/// Significance level: a p below it counts as shown.
pub const LEVEL: f64 = 0.05;

/// Fewest surgeons for bootstrap intervals: with fewer, hardly any resamples differ.
const FEWEST_RESAMPLED: usize = 5;

/// An outcome compared between policies.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Comparison {
    /// The outcome that is compared.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Each policy's values over all settings.
    pub policies: Vec<PolicySummary>,
    /// Each surgeon's mean of each policy.
    pub surgeons: Vec<SurgeonMeans>,
    /// Number of surgeons without a missing value; the tests use these.
    pub complete: usize,
    /// Number of surgeons left out of the tests because a value is missing.
    pub left_out: usize,
    /// Whether the policies differ.
    pub difference: Difference,
    /// Every pair of policies.
    pub pairs: Vec<Pair>,
    /// How far repeats of a policy agree.
    pub repeats: Repeats,
    /// Whether values rise or fall with the position in the session.
    pub position: Position,
}

/// Summary of a policy's values.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct PolicySummary {
    /// The policy.
    pub policy: String,
    /// Number of settings without a value.
    pub missing: usize,
    /// Summary of its values over all settings.
    #[serde(flatten)]
    pub summary: Summary,
}

/// A surgeon's mean of each policy.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct SurgeonMeans {
    /// The surgeon's code.
    pub surgeon: String,
    /// The mean over the settings of each policy, in the order of `policies`; none if a value is missing.
    pub means: Vec<Option<f64>>,
}

/// Whether the policies differ.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Difference {
    /// The finding in a sentence, or why there is none.
    pub said: String,
    /// Friedman's test over the surgeons' means.
    pub friedman: Option<Friedman>,
    /// The 95 % bootstrap interval of Kendall's W over surgeons.
    pub w_interval: Option<Interval>,
}

/// Two policies compared by the surgeons' means.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = PolicyPair)]
pub struct Pair {
    /// The first policy.
    pub a: String,
    /// The second policy.
    pub b: String,
    /// Number of surgeons compared.
    pub n: usize,
    /// Number of surgeons whose means differ; a signed-rank test ignores the others.
    pub differing: usize,
    /// Sum of the ranks where `a` is higher.
    pub positive: f64,
    /// Sum of the ranks where `b` is higher.
    pub negative: f64,
    /// Two-sided p of Wilcoxon's signed-rank test.
    pub p: f64,
    /// How `p` was computed.
    pub method: Method,
    /// `p` corrected by Holm's method for the pairs of this outcome.
    pub p_holm: f64,
    /// Rank-biserial correlation, -1..=1: above 0 if `a` is higher; none if no surgeon's means differ.
    pub rank_biserial: Option<f64>,
    /// Its 95 % bootstrap interval over surgeons.
    pub rank_biserial_interval: Option<Interval>,
    /// Mean of `a` minus mean of `b`.
    pub mean_difference: f64,
    /// Its 95 % bootstrap interval over surgeons.
    pub mean_difference_interval: Option<Interval>,
    /// Median of the surgeons' differences.
    pub median_difference: f64,
    /// The finding in a sentence.
    pub said: String,
}

/// How far repeats of a policy agree within a session.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Repeats {
    /// The finding in a sentence, or why there is none.
    pub said: String,
    /// Number of subjects; a subject is a policy in a session without missing values.
    pub subjects: usize,
    /// The agreement; none if it cannot be computed.
    pub agreement: Option<Agreement>,
}

/// Whether values rise or fall with the position in the session.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Position {
    /// The finding in a sentence, or why there is none.
    pub said: String,
    /// Number of sessions without a missing value.
    pub sessions: usize,
    /// The mean over these sessions at each position.
    pub means: Vec<f64>,
    /// Page's test for a trend; none if it cannot be computed.
    pub trend: Option<Trend>,
}

/// Compares `outcome` between `policies`. Resamples and permutations are drawn from `seed`.
pub fn compare(outcome: Outcome, policies: &[String], observations: &[Value], seed: u64) -> Comparison {
    let surgeons = surgeon_means(policies, observations);
    let blocks: Vec<Vec<f64>> = surgeons.iter().filter_map(|line| line.means.iter().copied().collect()).collect();
    let sessions = complete_sessions(observations);

    Comparison {
        policies: policies.iter().map(|policy| policy_summary(policy, observations)).collect(),
        complete: blocks.len(),
        left_out: surgeons.len() - blocks.len(),
        difference: difference(policies, &blocks, seed),
        pairs: pairs(policies, &blocks, seed),
        repeats: repeats(policies, &sessions),
        position: position(&sessions),
        surgeons,
        outcome,
    }
}

fn policy_summary(policy: &str, observations: &[Value]) -> PolicySummary {
    let own: Vec<&Value> = observations.iter().filter(|one| one.policy == policy).collect();
    let values: Vec<f64> = own.iter().filter_map(|one| one.value).collect();
    PolicySummary { policy: policy.to_owned(), missing: own.len() - values.len(), summary: summary(&values) }
}

/// Each surgeon's mean of each policy over all its settings, or `None` if a value is missing.
fn surgeon_means(policies: &[String], observations: &[Value]) -> Vec<SurgeonMeans> {
    let names: BTreeSet<&str> = observations.iter().map(|one| one.surgeon.as_str()).collect();
    let mean_of = |surgeon: &str, policy: &String| {
        let own = observations.iter().filter(|one| one.surgeon == surgeon && one.policy == *policy);
        let values: Vec<f64> = own.map(|one| one.value).collect::<Option<_>>()?;
        (!values.is_empty()).then(|| mean(&values))
    };
    let line = |surgeon: &str| SurgeonMeans {
        surgeon: surgeon.to_owned(),
        means: policies.iter().map(|policy| mean_of(surgeon, policy)).collect(),
    };
    names.into_iter().map(line).collect()
}

/// The observations of each session without a missing value, ordered by position.
fn complete_sessions(observations: &[Value]) -> Vec<Vec<&Value>> {
    let mut sessions: BTreeMap<SessionId, Vec<&Value>> = BTreeMap::new();
    for one in observations {
        sessions.entry(one.session).or_default().push(one);
    }
    let mut complete: Vec<_> =
        sessions.into_values().filter(|session| session.iter().all(|one| one.value.is_some())).collect();
    for session in &mut complete {
        session.sort_by_key(|one| one.setting);
    }
    complete
}

fn difference(policies: &[String], blocks: &[Vec<f64>], seed: u64) -> Difference {
    let unknown = |said: String| Difference { said, friedman: None, w_interval: None };
    if policies.len() < 2 {
        return unknown("There is one policy: nothing to compare.".to_owned());
    }
    if blocks.len() < 2 {
        return unknown(too_few(blocks.len()));
    }
    if policies.len() == 2 {
        return unknown("There are two policies: the paired test below compares them.".to_owned());
    }
    let Some(found) = friedman(blocks, seed) else {
        return unknown("Each surgeon's means are the same for all policies: nothing to test.".to_owned());
    };

    let resampled = |drawn: &[usize]| concordance(drawn.iter().map(|&place| &blocks[place]));
    let w_interval = interval(blocks.len(), seed, resampled);
    let permutations = match found.permutation {
        PermutationMethod::Exact => "over all permutations",
        PermutationMethod::MonteCarlo => "over 9999 permutations drawn",
    };
    let finding = if found.p_permutation < LEVEL {
        "The policies differ"
    } else {
        "No difference between the policies was shown, which does not show that there is none"
    };
    let said = format!(
        "{finding}: Friedman χ²({}) = {}, {} {permutations}, {} by chi-square; Kendall's W = {}{}; {}.",
        found.df,
        decimals(found.chi_square, 2),
        p_words(found.p_permutation),
        p_words(found.p_chi_square),
        decimals(found.kendalls_w, 2),
        interval_words(w_interval.as_ref(), 2),
        counted(blocks.len(), "surgeon"),
    );
    Difference { said, friedman: Some(found), w_interval }
}

fn pairs(policies: &[String], blocks: &[Vec<f64>], seed: u64) -> Vec<Pair> {
    if blocks.len() < 2 {
        return Vec::new();
    }
    let places = (0..policies.len()).flat_map(|a| (a + 1..policies.len()).map(move |b| (a, b)));
    let mut pairs: Vec<Pair> = places
        .map(|(a, b)| {
            let values = |place: usize| blocks.iter().map(|block| block[place]).collect::<Vec<f64>>();
            pair([&policies[a], &policies[b]], &values(a), &values(b), seed)
        })
        .collect();

    let corrected = holm(&pairs.iter().map(|pair| pair.p).collect::<Vec<_>>());
    for (pair, p_holm) in pairs.iter_mut().zip(corrected) {
        pair.p_holm = p_holm;
        pair.said = pair_words(pair);
    }
    pairs
}

fn pair([a, b]: [&String; 2], of_a: &[f64], of_b: &[f64], seed: u64) -> Pair {
    // Means of the same ratings in another order differ only by rounding; treat them as equal.
    let difference = |(a, b): (&f64, &f64)| {
        let difference = a - b;
        if difference.abs() <= 1e-12 * a.abs().max(b.abs()) { 0.0 } else { difference }
    };
    let differences: Vec<f64> = of_a.iter().zip(of_b).map(difference).collect();
    let zeros = vec![0.0; differences.len()];
    let test = wilcoxon(&differences, &zeros);

    let drawn = |places: &[usize]| places.iter().map(|&place| differences[place]).collect::<Vec<f64>>();
    let biserial_of = |places: &[usize]| rank_biserial(&drawn(places));
    Pair {
        a: a.clone(),
        b: b.clone(),
        n: differences.len(),
        differing: test.differing,
        positive: test.positive,
        negative: test.negative,
        p: test.p,
        method: test.method,
        p_holm: test.p,
        rank_biserial: rank_biserial(&differences),
        rank_biserial_interval: interval(differences.len(), seed, biserial_of),
        mean_difference: mean(&differences),
        mean_difference_interval: interval(differences.len(), seed, |places| Some(mean(&drawn(places)))),
        median_difference: median(&differences).unwrap_or(0.0),
        said: String::new(),
    }
}

fn pair_words(pair: &Pair) -> String {
    let Some(r) = pair.rank_biserial else {
        return format!("{} and {}: no surgeon's means differ.", pair.a, pair.b);
    };
    let finding = if pair.p_holm >= LEVEL {
        format!("No difference between {} and {} was shown", pair.a, pair.b)
    } else if r > 0.0 {
        format!("{} is higher than {}", pair.a, pair.b)
    } else {
        format!("{} is lower than {}", pair.a, pair.b)
    };
    format!(
        "{finding}: Wilcoxon signed-rank, {} ({}), {} by Holm; rank-biserial r = {}{}; mean difference {}{}; {}; \
         the means of {} of them differ.",
        p_words(pair.p),
        method_words(pair.method),
        p_words(pair.p_holm),
        decimals(r, 2),
        interval_words(pair.rank_biserial_interval.as_ref(), 2),
        decimals(pair.mean_difference, 3),
        interval_words(pair.mean_difference_interval.as_ref(), 3),
        counted(pair.n, "surgeon"),
        pair.differing,
    )
}

fn repeats(policies: &[String], sessions: &[Vec<&Value>]) -> Repeats {
    let subject = |session: &Vec<&Value>, policy: &String| -> Vec<f64> {
        let own = session.iter().filter(|one| one.policy == *policy);
        own.filter_map(|one| one.value).collect()
    };
    let subjects: Vec<Vec<f64>> = sessions
        .iter()
        .flat_map(|session| policies.iter().map(move |policy| subject(session, policy)))
        .filter(|values| !values.is_empty())
        .collect();

    let count = subjects.len();
    let unknown = |said: &str| Repeats { said: said.to_owned(), subjects: count, agreement: None };
    if subjects.first().is_some_and(|values| values.len() < 2) {
        return unknown("Each policy ran once in a session: there are no repeats to compare.");
    }
    if count < 2 {
        return unknown("There are fewer than two pairs of repeats: nothing to compare.");
    }
    let Some(found) = agreement(&subjects) else {
        let mut values = subjects.iter().flatten();
        let first = values.next();
        return unknown(if values.all(|value| Some(value) == first) {
            "All values are the same: their agreement has no measure."
        } else {
            "Each policy in a session and each repeat has the same mean: their agreement has no measure."
        });
    };

    let ends = found.low.zip(found.high).map(|(low, high)| Interval { low, high });
    let said = format!(
        "Agreement of repeats: ICC(A,1) = {}{}; a policy in a session is a subject, {} of them.",
        decimals(found.icc, 2),
        interval_words(ends.as_ref(), 2),
        count,
    );
    Repeats { said, subjects: count, agreement: Some(found) }
}

/// Tests for a trend over positions. As in every test a surgeon is one unit, with the mean over its `sessions`.
fn position(sessions: &[Vec<&Value>]) -> Position {
    let values = |session: &Vec<&Value>| session.iter().filter_map(|one| one.value).collect::<Vec<f64>>();
    let all: Vec<Vec<f64>> = sessions.iter().map(values).collect();
    let means = mean_at_each_position(&all);
    let positions = means.len();

    let mut surgeons: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
    for (session, values) in sessions.iter().zip(&all) {
        let surgeon = session.first().map_or("", |one| one.surgeon.as_str());
        surgeons.entry(surgeon).or_default().push(values.clone());
    }
    let blocks: Vec<Vec<f64>> = surgeons.values().map(|sessions| mean_at_each_position(sessions)).collect();

    let unknown = |said: String, means| Position { said, sessions: sessions.len(), means, trend: None };
    if blocks.len() < 2 {
        let said = "Fewer than two surgeons have a session with all values: no trend can be tested.";
        return unknown(said.to_owned(), means);
    }
    if positions < 3 {
        return unknown("A session has fewer than three settings: no trend can be tested.".to_owned(), means);
    }
    let Some(found) = trend(&blocks) else {
        return unknown("For each surgeon all positions are the same: there is no trend.".to_owned(), means);
    };

    let finding = match (found.p < LEVEL, found.l > found.expected) {
        (false, _) => "No trend over positions was shown",
        (true, true) => "Values rise with the position in the session",
        (true, false) => "Values fall with the position in the session",
    };
    let said = format!(
        "{finding}: Page's L = {} ({} without a trend), {} ({}); {}.",
        decimals(found.l, 1),
        decimals(found.expected, 1),
        p_words(found.p),
        method_words(found.method),
        counted(blocks.len(), "surgeon"),
    );
    Position { said, sessions: sessions.len(), means, trend: Some(found) }
}

/// The mean of `sessions` at each position.
fn mean_at_each_position(sessions: &[Vec<f64>]) -> Vec<f64> {
    let positions = sessions.first().map_or(0, Vec::len);
    let mean_at =
        |place: usize| mean(&sessions.iter().filter_map(|values| values.get(place).copied()).collect::<Vec<f64>>());
    (0..positions).map(mean_at).collect()
}

/// The 95 % bootstrap interval of `statistic` over `count` surgeons; `None` if there are too few.
fn interval(count: usize, seed: u64, statistic: impl Fn(&[usize]) -> Option<f64>) -> Option<Interval> {
    if count < FEWEST_RESAMPLED {
        return None;
    }
    let (low, high) = bootstrap_statistic(count, seed, statistic)?;
    Some(Interval { low, high })
}

fn too_few(complete: usize) -> String {
    match complete {
        0 => "No surgeon has all values: nothing can be tested.".to_owned(),
        _ => "One surgeon has all values: a test needs two.".to_owned(),
    }
}

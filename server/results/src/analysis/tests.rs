//! Compares the analysis of simulated studies with known effects with SciPy's: `tests/vectors/analysis.py`.

use serde::Deserialize;
use uuid::Uuid;

use super::*;
use parfocal_base::ids::SessionId;

#[derive(Deserialize)]
struct Study {
    name: String,
    policies: Vec<String>,
    sessions: Vec<Session>,
    expected: Expected,
}

#[derive(Deserialize)]
struct Session {
    surgeon: String,
    settings: Vec<Setting>,
}

#[derive(Deserialize)]
struct Setting {
    policy: String,
    value: Option<f64>,
}

#[derive(Deserialize)]
struct Expected {
    policies: Vec<ExpectedPolicy>,
    complete: usize,
    friedman: ExpectedFriedman,
    pairs: Vec<ExpectedPair>,
    agreement: ExpectedAgreement,
    trend: ExpectedTrend,
}

#[derive(Deserialize)]
struct ExpectedPolicy {
    policy: String,
    missing: usize,
    n: usize,
    mean: f64,
    median: f64,
    sd: f64,
}

#[derive(Deserialize)]
struct ExpectedFriedman {
    chi_square: f64,
    p_chi_square: f64,
    w: f64,
}

#[derive(Deserialize)]
struct ExpectedPair {
    a: String,
    b: String,
    p: f64,
    p_holm: f64,
    differing: usize,
    positive: f64,
    negative: f64,
    rank_biserial: f64,
    mean_difference: f64,
}

#[derive(Deserialize)]
struct ExpectedAgreement {
    icc: f64,
    low: f64,
    high: f64,
}

#[derive(Deserialize)]
struct ExpectedTrend {
    l: f64,
    p_near: f64,
}

#[derive(Deserialize)]
struct Vectors {
    studies: Vec<Study>,
}

fn studies() -> Vec<Study> {
    let vectors: Vectors = serde_json::from_str(include_str!("../../../../tests/vectors/analysis.json")).unwrap();
    vectors.studies
}

fn session(number: usize) -> SessionId {
    SessionId(Uuid::from_u128(number as u128))
}

fn observations(sessions: &[Session]) -> Vec<Value> {
    let of_session = |(number, own): (usize, &Session)| {
        let observation = |(place, setting): (usize, &Setting)| Value {
            session: session(number),
            surgeon: own.surgeon.clone(),
            setting: place + 1,
            policy: setting.policy.clone(),
            repeat: 1 + own.settings[..place].iter().filter(|before| before.policy == setting.policy).count(),
            outcome: rating().outcome,
            value: setting.value,
        };
        own.settings.iter().enumerate().map(observation).collect::<Vec<_>>()
    };
    sessions.iter().enumerate().flat_map(of_session).collect()
}

fn rating() -> Outcome {
    let outcome = "sharp/point".to_owned();
    let label = "How sharp?".to_owned();
    let unit = "points, 1 to 7".to_owned();
    Outcome { outcome, label, unit, better: None, lowest: Some(1.0), highest: Some(7.0) }
}

fn assert_near(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs().max(1e-3), "{what}: {found} instead of {expected}");
}

#[test]
fn simulated_studies_have_the_figures_that_scipy_has() {
    for study in studies() {
        let name = study.name.as_str();
        let found = compare(rating(), &study.policies, &observations(&study.sessions), 7);
        let expected = &study.expected;
        assert_eq!((found.complete, found.left_out), (expected.complete, 1), "{name}");

        for (found, expected) in found.policies.iter().zip(&expected.policies) {
            assert_eq!(
                (&found.policy, found.missing, found.summary.n),
                (&expected.policy, expected.missing, expected.n)
            );
            assert_near(found.summary.mean.unwrap(), expected.mean, name);
            assert_near(found.summary.median.unwrap(), expected.median, name);
            assert_near(found.summary.sd.unwrap(), expected.sd, name);
        }

        let friedman = found.difference.friedman.unwrap();
        assert_near(friedman.chi_square, expected.friedman.chi_square, name);
        assert_near(friedman.p_chi_square, expected.friedman.p_chi_square, name);
        assert_near(friedman.kendalls_w, expected.friedman.w, name);

        assert_eq!(found.pairs.len(), expected.pairs.len());
        for (found, expected) in found.pairs.iter().zip(&expected.pairs) {
            assert_eq!((&found.a, &found.b, found.differing), (&expected.a, &expected.b, expected.differing));
            assert_near(found.p, expected.p, name);
            assert_near(found.p_holm, expected.p_holm, name);
            assert_near(found.positive, expected.positive, name);
            assert_near(found.negative, expected.negative, name);
            assert_near(found.rank_biserial.unwrap(), expected.rank_biserial, name);
            assert_near(found.mean_difference, expected.mean_difference, name);
            let interval = found.mean_difference_interval.unwrap();
            assert!(interval.low <= found.mean_difference && found.mean_difference <= interval.high, "{found:?}");
        }

        let agreement = found.repeats.agreement.unwrap();
        assert_near(agreement.icc, expected.agreement.icc, name);
        assert_near(agreement.low.unwrap(), expected.agreement.low, name);
        assert_near(agreement.high.unwrap(), expected.agreement.high, name);

        let trend = found.position.trend.unwrap();
        assert_near(trend.l, expected.trend.l, name);
        assert!((trend.p - expected.trend.p_near).abs() < 0.02, "{name}: {trend:?}");
    }
}

#[test]
fn an_effect_is_found_if_there_is_one_and_not_otherwise() {
    let [none, large] = studies().try_into().ok().unwrap();
    let found = compare(rating(), &none.policies, &observations(&none.sessions), 7);
    assert!(found.difference.said.starts_with("No difference between the policies was shown"), "{found:?}");
    assert!(found.pairs.iter().all(|pair| pair.said.starts_with("No difference")), "{found:?}");
    assert!(found.position.said.starts_with("No trend"), "{found:?}");

    let found = compare(rating(), &large.policies, &observations(&large.sessions), 7);
    assert!(found.difference.said.starts_with("The policies differ: Friedman χ²(2) = 15.85"), "{found:?}");
    let said: Vec<&str> = found.pairs.iter().map(|pair| pair.said.split(':').next().unwrap()).collect();
    assert_eq!(
        said,
        [
            "No difference between fixed and mgm-hill-climber was shown",
            "fixed is lower than parfocal",
            "mgm-hill-climber is lower than parfocal"
        ]
    );
}

/// A surgeon's values.
type Row<'a> = &'a [Option<f64>];

/// Values of one outcome, a row per surgeon. Each surgeon has one session, in which each policy runs once.
fn simple(rows: &[&[Option<f64>]]) -> (Vec<String>, Vec<Value>) {
    let policies: Vec<String> = (0..rows[0].len()).map(|place| format!("policy-{place}")).collect();
    let observation = |number: usize, place: usize, value: &Option<f64>| Value {
        session: session(number),
        surgeon: format!("S-{number}"),
        setting: place + 1,
        policy: policies[place].clone(),
        repeat: 1,
        outcome: rating().outcome,
        value: *value,
    };
    let all = rows.iter().enumerate().flat_map(|(number, row)| {
        row.iter().enumerate().map(|(place, value)| observation(number, place, value)).collect::<Vec<_>>()
    });
    let all = all.collect();
    (policies, all)
}

fn compare_simple(rows: &[&[Option<f64>]]) -> Comparison {
    let (policies, observations) = simple(rows);
    compare(rating(), &policies, &observations, 1)
}

#[test]
fn where_there_is_nothing_to_compute_a_sentence_says_so_and_json_has_no_odd_number() {
    let cases: [(&str, Vec<Row<'_>>, &str); 6] = [
        ("one policy", vec![&[Some(1.0)], &[Some(2.0)]], "There is one policy"),
        ("one surgeon", vec![&[Some(1.0), Some(2.0), Some(3.0)]], "One surgeon has all values"),
        ("nothing", vec![&[None, None, None], &[None, None, None]], "No surgeon has all values"),
        ("all ties", vec![&[Some(2.0); 3]; 4], "Each surgeon's means are the same for all policies"),
        ("two policies", vec![&[Some(2.0), Some(3.0)]; 6], "There are two policies"),
        ("a difference", vec![&[Some(1.0), Some(2.0), Some(3.0)]; 4], "The policies differ"),
    ];
    for (name, rows, said) in cases {
        let found = compare_simple(&rows);
        assert!(found.difference.said.starts_with(said), "{name}: {found:?}");
        assert!(!found.repeats.said.is_empty() && !found.position.said.is_empty(), "{name}: {found:?}");
        assert!(found.pairs.iter().all(|pair| !pair.said.is_empty()), "{name}: {found:?}");

        // NaN would become null in fields that must not be null.
        let json = serde_json::to_value(&found).unwrap();
        for pair in json["pairs"].as_array().unwrap() {
            for field in ["p", "p_holm", "positive", "negative", "mean_difference", "median_difference"] {
                assert!(pair[field].is_number(), "{name}: {pair}");
            }
        }
        assert!(json["position"]["means"].as_array().unwrap().iter().all(serde_json::Value::is_number), "{name}");
    }
    assert!(compare_simple(&[&[Some(1.0)]]).pairs.is_empty());
}

#[test]
fn repeats_without_a_measure_of_agreement_are_described_as_they_are() {
    let said_of = |values: [f64; 4]| {
        let setting = |(policy, value): (&str, f64)| Setting { policy: policy.to_owned(), value: Some(value) };
        let settings = ["a", "a", "b", "b"].into_iter().zip(values).map(setting).collect();
        let sessions = vec![Session { surgeon: "S-1".to_owned(), settings }];
        let values = observations(&sessions);
        compare(rating(), &["a".to_owned(), "b".to_owned()], &values, 1).repeats.said
    };
    assert!(said_of([3.0; 4]).starts_with("All values are the same"));
    let opposed = said_of([3.0, 4.0, 4.0, 3.0]);
    assert!(opposed.starts_with("Each policy in a session and each repeat has the same mean"), "{opposed}");
}

#[test]
fn a_surgeon_with_a_missing_value_is_left_out_of_tests_and_counted_and_is_described() {
    let rows: Vec<&[Option<f64>]> =
        vec![&[Some(1.0), Some(2.0), Some(3.0)], &[Some(2.0), Some(3.0), Some(5.0)], &[Some(7.0), None, Some(6.0)]];
    let found = compare_simple(&rows);
    assert_eq!((found.complete, found.left_out), (2, 1));
    assert!(found.pairs.iter().all(|pair| pair.n == 2));
    let described: Vec<_> = found.policies.iter().map(|line| (line.summary.n, line.missing)).collect();
    assert_eq!(described, [(3, 0), (2, 1), (3, 0)]);
    assert_eq!(found.surgeons[2].means, [Some(7.0), None, Some(6.0)]);
    assert_eq!(found.position.sessions, 2);
}

#[test]
fn there_are_no_bootstrap_intervals_of_fewer_than_five_surgeons() {
    let row: &[Option<f64>] = &[Some(1.0), Some(2.0), Some(4.0)];
    let other: &[Option<f64>] = &[Some(2.0), Some(1.0), Some(4.5)];
    let four = compare_simple(&[row, row, row, other]);
    let five = compare_simple(&[row, row, row, other, other]);
    assert!(four.difference.w_interval.is_none() && four.pairs[0].mean_difference_interval.is_none());
    assert!(five.difference.w_interval.is_some() && five.pairs[0].mean_difference_interval.is_some());
    assert_eq!(five, compare_simple(&[row, row, row, other, other]), "the same seed gives the same figures");
}

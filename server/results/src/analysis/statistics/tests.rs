//! Compares the statistics with SciPy's for the same values: `tests/vectors/analysis.py`.

use serde::Deserialize;

use super::*;
use parfocal_base::statistics::doubled_ranks;

#[derive(Deserialize)]
struct FriedmanCase {
    name: String,
    blocks: Vec<Vec<f64>>,
    chi_square: f64,
    p_chi_square: f64,
    p_exact: Option<f64>,
    w: f64,
    mean_ranks: Vec<f64>,
}

#[derive(Deserialize)]
struct TrendCase {
    name: String,
    blocks: Vec<Vec<f64>>,
    l: f64,
    p: f64,
    method: String,
}

#[derive(Deserialize)]
struct AgreementCase {
    name: String,
    subjects: Vec<Vec<f64>>,
    icc: f64,
    low: f64,
    high: f64,
}

#[derive(Deserialize)]
struct SummaryCase {
    values: Vec<f64>,
    mean: f64,
    median: f64,
    sd: Option<f64>,
}

#[derive(Deserialize)]
struct Vectors {
    friedman: Vec<FriedmanCase>,
    trend: Vec<TrendCase>,
    agreement: Vec<AgreementCase>,
    summary: Vec<SummaryCase>,
}

fn vectors() -> Vectors {
    serde_json::from_str(include_str!("../../../../../tests/vectors/analysis.json")).unwrap()
}

fn assert_near(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() <= 1e-9 * expected.abs().max(1e-3), "{what}: {found} instead of {expected}");
}

#[test]
fn friedmans_test_agrees_with_scipy_and_with_counting() {
    for case in vectors().friedman {
        let name = case.name.as_str();
        let found = friedman(&case.blocks, 1).unwrap();
        assert_near(found.chi_square, case.chi_square, name);
        assert_near(found.p_chi_square, case.p_chi_square, name);
        assert_near(found.kendalls_w, case.w, name);
        assert_near(concordance(&case.blocks).unwrap(), case.w, name);
        for (found, expected) in found.mean_ranks.iter().zip(&case.mean_ranks) {
            assert_near(*found, *expected, name);
        }

        if let Some(p) = case.p_exact {
            assert_eq!(found.permutation, PermutationMethod::Exact, "{name}");
            assert_near(found.p_permutation, p, name);
        } else {
            // Allows five standard errors of a drawn p, and the error of chi-square at this size.
            assert_eq!(found.permutation, PermutationMethod::MonteCarlo, "{name}");
            assert!((found.p_permutation - case.p_chi_square).abs() < 0.04, "{name}: {found:?}");
        }
    }
}

#[test]
fn a_p_that_was_drawn_is_near_the_exact_one() {
    for case in vectors().friedman.into_iter().filter(|case| case.p_exact.is_some()) {
        let ranks: Vec<Vec<i64>> = case.blocks.iter().map(|block| doubled_ranks(block)).collect();
        let p = case.p_exact.unwrap();
        let error = (p * (1.0 - p) / 9999.0).sqrt();
        let drawn = super::friedman::drawn_p(&ranks, 5);
        assert!((drawn - p).abs() < 5.0 * error + 2e-4, "{}: {drawn} for {p}", case.name);
    }
}

#[test]
fn pages_test_agrees_with_scipy_and_with_counting() {
    for case in vectors().trend {
        let found = trend(&case.blocks).unwrap();
        assert_near(found.l, case.l, &case.name);
        assert_near(found.p, case.p, &case.name);
        assert_eq!(serde_json::to_value(found.method).unwrap(), case.method, "{}", case.name);

        let reversed: Vec<Vec<f64>> = case.blocks.iter().map(|row| row.iter().rev().copied().collect()).collect();
        assert_near(trend(&reversed).unwrap().p, found.p, &case.name);
    }
}

#[test]
fn the_intraclass_correlation_agrees_with_published_figures_and_scipys_f() {
    for case in vectors().agreement {
        let found = agreement(&case.subjects).unwrap();
        assert_near(found.icc, case.icc, &case.name);
        assert_near(found.low.unwrap(), case.low, &case.name);
        assert_near(found.high.unwrap(), case.high, &case.name);
    }
}

#[test]
fn summaries_agree_with_numpy() {
    for case in vectors().summary {
        let found = summary(&case.values);
        assert_near(found.mean.unwrap(), case.mean, "mean");
        assert_near(found.median.unwrap(), case.median, "median");
        assert_eq!(found.sd.is_some(), case.sd.is_some());
        assert_near(found.sd.unwrap_or(0.0), case.sd.unwrap_or(0.0), "sd");
    }
    assert_eq!(summary(&[]), Summary { n: 0, mean: None, median: None, sd: None });
}

#[test]
fn what_has_no_answer_has_none() {
    let alike = vec![vec![3.0; 3]; 5];
    assert_eq!((friedman(&alike, 1), trend(&alike), agreement(&alike), concordance(&alike)), (None, None, None, None));
    let one = vec![vec![1.0, 2.0, 3.0]];
    assert_eq!((friedman(&one, 1), trend(&one), agreement(&one)), (None, None, None));
    let two_treatments = vec![vec![1.0, 2.0]; 4];
    assert_eq!((friedman(&two_treatments, 1), trend(&two_treatments)), (None, None));
    assert_eq!((friedman(&[], 1), trend(&[]), agreement(&[])), (None, None, None));

    let opposed = [3.0, 4.0].map(|first| vec![0.1 * first, 0.7 - 0.1 * first]);
    assert_eq!(agreement(&opposed), None, "nothing but rounding in its divisor");
    let cancelling = agreement(&[vec![1.0, 3.0, 1.0], vec![3.0, 0.0, 1.0]]).unwrap();
    assert_eq!((cancelling.low, cancelling.high), (None, None), "no half of an interval");

    let perfect = vec![vec![1.0, 1.0], vec![2.0, 2.0], vec![5.0, 5.0]];
    assert_eq!(agreement(&perfect), Some(Agreement { icc: 1.0, low: None, high: None }));
}

#[test]
fn values_that_differ_by_rounding_share_their_rank() {
    let mean = (0.1 + 0.2 + 0.3) / 3.0;
    let other = (0.3 + 0.2 + 0.1) / 3.0;
    assert_eq!(doubled_ranks(&[mean, 1.0, other]), [3, 6, 3]);
    assert_eq!(doubled_ranks(&[f64::NAN, 1.0, f64::NAN]), [4, 2, 6]);
}

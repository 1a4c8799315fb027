//! The analysis as tables, each with its data dictionary.

use super::report::{Analysis, ProtocolAnalysis};
use parfocal_base::ids::SessionId;
use parfocal_records::store::export::{Meaning, Row, Table, means, table};

const WITH_VALUE: Meaning = means("Number of settings with a value");
const WITHOUT_VALUE: Meaning = means("Number of settings without a value");
const MEAN: Meaning = means("Mean over the settings, in the outcome's unit; empty without a value");
const MEDIAN: Meaning = means("Median, in the outcome's unit; empty without a value");
const DEVIATION: Meaning = means(
    "Standard deviation of the sample (divided by n - 1), in the outcome's unit; empty with fewer than two values",
);

table! {
    name: "analysis_sessions",
    description: "The study's sessions, and whether each counts",
    key: [session],
    row:
    /// A session.
    #[derive(Debug, Clone)]
    SessionRow {
        session: SessionId = means("Random id of the session"),
        protocol: String = means("Name of the protocol"),
        site: String = means("Name of the site"),
        surgeon: Option<String> =
            means("Code of the participant, with corrections applied; empty if the session was withdrawn"),
        counts: bool = means("Whether the session counts in the analysis"),
        remark: Option<String> =
            means("Reason why the session does not count, or a remark on it; empty if there is none"),
    }
}

table! {
    name: "analysis_values",
    description: "Every compared value: one for each outcome and setting of the sessions that count",
    key: [session, setting, outcome],
    row:
    /// A value of an outcome in a setting.
    #[derive(Debug, Clone)]
    ValueRow {
        session: SessionId = means("Random id of the session"),
        protocol: String = means("Name of the protocol"),
        surgeon: String = means("Code of the participant, with corrections applied"),
        setting: usize = means("Number of the setting in the session, from 1"),
        policy: String = means("Name of the policy that ran"),
        repeat: usize = means("Number of the setting among those of the policy in the session, from 1"),
        outcome: String = means("Name of the outcome, as in analysis_policies"),
        value: Option<f64> =
            means("Value of the outcome, in the unit that analysis_policies names; empty if it is missing"),
    }
}

table! {
    name: "analysis_policies",
    description: "Each outcome by policy, over all settings",
    key: [protocol, outcome, policy],
    row:
    /// Summary of a policy's values.
    #[derive(Debug, Clone)]
    PolicyRow {
        protocol: String = means("Name of the protocol"),
        outcome: String = means("Name of the outcome: question and measure, or a quantity of the focal power"),
        label: String = means("Name of the outcome in words"),
        unit: String = means("Unit or scale of the outcome"),
        better: Option<&'static str> =
            means("Better end of the scale: higher or lower; empty if neither is known to be better"),
        policy: String = means("Name of the policy"),
        n: usize = WITH_VALUE,
        missing: usize = WITHOUT_VALUE,
        mean: Option<f64> = MEAN,
        median: Option<f64> = MEDIAN,
        sd: Option<f64> = DEVIATION,
    }
}

table! {
    name: "analysis_sites",
    description: "Each outcome by policy at each site; no rows if only one site has sessions that count",
    key: [protocol, outcome, site, policy],
    row:
    /// Summary of a policy's values at a site.
    #[derive(Debug, Clone)]
    SiteRow {
        protocol: String = means("Name of the protocol"),
        outcome: String = means("Name of the outcome, as in analysis_policies"),
        site: String = means("Name of the site"),
        surgeons: usize = means("Number of surgeons of the site whose sessions count"),
        sessions: usize = means("Number of sessions of the site that count"),
        policy: String = means("Name of the policy"),
        n: usize = WITH_VALUE,
        missing: usize = WITHOUT_VALUE,
        mean: Option<f64> = MEAN,
        median: Option<f64> = MEDIAN,
        sd: Option<f64> = DEVIATION,
    }
}

table! {
    name: "analysis_tests",
    description: "The tests of each outcome over all policies; surgeons with a missing value are left out",
    key: [protocol, outcome],
    row:
    /// The tests of an outcome.
    #[derive(Debug, Clone)]
    TestRow {
        protocol: String = means("Name of the protocol"),
        outcome: String = means("Name of the outcome, as in analysis_policies"),
        surgeons: usize = means("Number of surgeons tested: those without a missing value"),
        left_out: usize = means("Number of surgeons left out because a value is missing"),
        friedman_chi_square: Option<f64> = means("Friedman's chi-square, corrected for ties; empty if not tested"),
        friedman_df: Option<usize> = means("Degrees of freedom of Friedman's test; empty if not tested"),
        friedman_p_chi_square: Option<f64> =
            means("p of Friedman's test from the chi-square distribution; empty if not tested"),
        friedman_p_permutation: Option<f64> =
            means("p of Friedman's test over permutations of each surgeon's ranks; empty if not tested"),
        permutations: Option<String> =
            means("Permutations used: exact (all of them) or monte-carlo (9999 random ones); empty if not tested"),
        kendalls_w: Option<f64> =
            means("Kendall's W, 0 to 1: how far the surgeons agree on an order of policies; empty if not tested"),
        kendalls_w_low: Option<f64> =
            means("Lower end of the 95 % bootstrap interval of Kendall's W over surgeons; empty if not computed"),
        kendalls_w_high: Option<f64> =
            means("Upper end of the 95 % bootstrap interval of Kendall's W over surgeons; empty if not computed"),
        icc: Option<f64> = means("ICC(A,1) of the repeats of a policy in a session; empty without repeats"),
        icc_low: Option<f64> = means("Lower end of the 95 % interval of the ICC; empty if not computed"),
        icc_high: Option<f64> = means("Upper end of the 95 % interval of the ICC; empty if not computed"),
        icc_subjects: usize = means("Number of pairs of session and policy that the ICC compares"),
        page_l: Option<f64> = means("Page's L over the positions in the session; empty if not tested"),
        page_l_expected: Option<f64> = means("Expected value of L without a trend; empty if not tested"),
        page_p: Option<f64> = means("Two-sided p of Page's test; empty if not tested"),
        page_sessions: usize = means("Number of sessions that Page's test uses: those without a missing value"),
        difference: String = means("Whether policies differ, in a sentence"),
        agreement: String = means("How far repeats agree, in a sentence"),
        position: String = means("Whether values rise or fall with the position, in a sentence"),
    }
}

table! {
    name: "analysis_pairs",
    description: "Comparison of each two policies in each outcome, by the surgeons' means",
    key: [protocol, outcome, a, b],
    row:
    /// Two policies compared.
    #[derive(Debug, Clone)]
    PairRow {
        protocol: String = means("Name of the protocol"),
        outcome: String = means("Name of the outcome, as in analysis_policies"),
        a: String = means("Name of the first policy"),
        b: String = means("Name of the second policy"),
        surgeons: usize = means("Number of surgeons compared"),
        differing: usize =
            means("Number of surgeons whose means differ; the signed-rank test leaves out the others"),
        w_positive: f64 = means("Sum of the ranks where a is higher"),
        w_negative: f64 = means("Sum of the ranks where b is higher"),
        p: f64 = means("Two-sided p of Wilcoxon's signed-rank test"),
        method: String = means("Method that computed p: exact or normal-approximation"),
        p_holm: f64 = means("p corrected by Holm's method for the pairs of the outcome"),
        rank_biserial: Option<f64> =
            means("Rank-biserial correlation, -1 to 1, above 0 if a is higher; empty if no surgeon's means differ"),
        rank_biserial_low: Option<f64> = means(
            "Lower end of the 95 % bootstrap interval of the rank-biserial correlation over surgeons; empty if not \
             computed",
        ),
        rank_biserial_high: Option<f64> = means(
            "Upper end of the 95 % bootstrap interval of the rank-biserial correlation over surgeons; empty if not \
             computed",
        ),
        mean_difference: f64 = means("Mean of a minus mean of b, in the outcome's unit"),
        mean_difference_low: Option<f64> = means(
            "Lower end of the 95 % bootstrap interval of mean_difference over surgeons; empty if not computed",
        ),
        mean_difference_high: Option<f64> = means(
            "Upper end of the 95 % bootstrap interval of mean_difference over surgeons; empty if not computed",
        ),
        median_difference: f64 = means("Median of the surgeons' differences, in the outcome's unit"),
    }
}

table! {
    name: "analysis_whole_sessions",
    description: "Closing questions, which are about whole sessions and not about a policy",
    key: [protocol, outcome],
    row:
    /// Summary of the answers to a closing question.
    #[derive(Debug, Clone)]
    WholeRow {
        protocol: String = means("Name of the protocol"),
        outcome: String = means("Name of the outcome: question and measure"),
        label: String = means("Name of the outcome in words"),
        unit: String = means("Unit or scale of the outcome"),
        n: usize = means("Number of sessions with an answer"),
        missing: usize = means("Number of sessions without an answer"),
        mean: Option<f64> = means("Mean over the sessions, in the outcome's unit; empty without a value"),
        median: Option<f64> = MEDIAN,
        sd: Option<f64> = DEVIATION,
    }
}

table! {
    name: "analysis_words",
    description: "Comments and answers in words, with the policy that ran",
    key: [session, number],
    row:
    /// A comment or an answer in words.
    #[derive(Debug, Clone)]
    WordsRow {
        session: SessionId = means("Random id of the session"),
        number: usize = means("Number in the session, from 1: by setting, then in the order of recording"),
        protocol: String = means("Name of the protocol"),
        surgeon: String = means("Code of the participant, with corrections applied"),
        setting: Option<usize> = means("Number of the setting, from 1; empty outside the settings"),
        policy: Option<String> = means("Name of the policy that ran; empty outside the settings"),
        question: Option<String> = means("Text of the question; empty for a comment"),
        text: String = means("Words of the comment or answer; empty if they were erased"),
        late: bool = means("Whether the comment or answer arrived too late to count"),
        erased: bool = means("Whether the words were erased"),
    }
}

/// Every table of an analysis.
pub const TABLES: [Table; 8] = [
    SessionRow::TABLE,
    PolicyRow::TABLE,
    SiteRow::TABLE,
    TestRow::TABLE,
    PairRow::TABLE,
    WholeRow::TABLE,
    WordsRow::TABLE,
    ValueRow::TABLE,
];

/// The rows that `row` makes for each protocol of `analysis`.
pub fn rows<R>(analysis: &Analysis, row: impl Fn(&ProtocolAnalysis) -> Vec<R>) -> Vec<R> {
    analysis.protocols.iter().flat_map(row).collect()
}

impl ProtocolAnalysis {
    pub(super) fn session_rows(&self) -> Vec<SessionRow> {
        let row = |line: &super::report::AnalysedSession| SessionRow {
            session: line.session,
            protocol: self.protocol.clone(),
            site: line.site.clone(),
            surgeon: line.surgeon.clone(),
            counts: line.counts,
            remark: line.remark.clone(),
        };
        self.sessions.iter().map(row).collect()
    }

    pub(super) fn value_rows(&self) -> Vec<ValueRow> {
        let row = |value: &super::Value| ValueRow {
            session: value.session,
            protocol: self.protocol.clone(),
            surgeon: value.surgeon.clone(),
            setting: value.setting,
            policy: value.policy.clone(),
            repeat: value.repeat,
            outcome: value.outcome.clone(),
            value: value.value,
        };
        self.values.iter().map(row).collect()
    }

    pub(super) fn policy_rows(&self) -> Vec<PolicyRow> {
        let of_outcome = |compared: &super::Comparison| {
            let row = |line: &super::PolicySummary| PolicyRow {
                protocol: self.protocol.clone(),
                outcome: compared.outcome.outcome.clone(),
                label: compared.outcome.label.clone(),
                unit: compared.outcome.unit.clone(),
                better: compared.outcome.better,
                policy: line.policy.clone(),
                n: line.summary.n,
                missing: line.missing,
                mean: line.summary.mean,
                median: line.summary.median,
                sd: line.summary.sd,
            };
            compared.policies.iter().map(row).collect::<Vec<_>>()
        };
        self.outcomes.iter().flat_map(of_outcome).collect()
    }

    pub(super) fn site_rows(&self) -> Vec<SiteRow> {
        let mut rows = Vec::new();
        for site in &self.by_site {
            for compared in &site.outcomes {
                rows.extend(compared.policies.iter().map(|line| SiteRow {
                    protocol: self.protocol.clone(),
                    outcome: compared.outcome.outcome.clone(),
                    site: site.site.clone(),
                    surgeons: site.surgeons,
                    sessions: site.sessions,
                    policy: line.policy.clone(),
                    n: line.summary.n,
                    missing: line.missing,
                    mean: line.summary.mean,
                    median: line.summary.median,
                    sd: line.summary.sd,
                }));
            }
        }
        rows
    }

    pub(super) fn test_rows(&self) -> Vec<TestRow> {
        let row = |compared: &super::Comparison| {
            let friedman = compared.difference.friedman.as_ref();
            let agreement = compared.repeats.agreement;
            let trend = compared.position.trend;
            let permutations = friedman.map(|found| kebab(&found.permutation));
            TestRow {
                protocol: self.protocol.clone(),
                outcome: compared.outcome.outcome.clone(),
                surgeons: compared.complete,
                left_out: compared.left_out,
                friedman_chi_square: friedman.map(|found| found.chi_square),
                friedman_df: friedman.map(|found| found.df),
                friedman_p_chi_square: friedman.map(|found| found.p_chi_square),
                friedman_p_permutation: friedman.map(|found| found.p_permutation),
                permutations,
                kendalls_w: friedman.map(|found| found.kendalls_w),
                kendalls_w_low: compared.difference.w_interval.map(|interval| interval.low),
                kendalls_w_high: compared.difference.w_interval.map(|interval| interval.high),
                icc: agreement.map(|found| found.icc),
                icc_low: agreement.and_then(|found| found.low),
                icc_high: agreement.and_then(|found| found.high),
                icc_subjects: compared.repeats.subjects,
                page_l: trend.map(|found| found.l),
                page_l_expected: trend.map(|found| found.expected),
                page_p: trend.map(|found| found.p),
                page_sessions: compared.position.sessions,
                difference: compared.difference.said.clone(),
                agreement: compared.repeats.said.clone(),
                position: compared.position.said.clone(),
            }
        };
        self.outcomes.iter().map(row).collect()
    }

    pub(super) fn pair_rows(&self) -> Vec<PairRow> {
        let of_outcome = |compared: &super::Comparison| {
            let row = |pair: &super::Pair| PairRow {
                protocol: self.protocol.clone(),
                outcome: compared.outcome.outcome.clone(),
                a: pair.a.clone(),
                b: pair.b.clone(),
                surgeons: pair.n,
                differing: pair.differing,
                w_positive: pair.positive,
                w_negative: pair.negative,
                p: pair.p,
                method: kebab(&pair.method),
                p_holm: pair.p_holm,
                rank_biserial: pair.rank_biserial,
                rank_biserial_low: pair.rank_biserial_interval.map(|interval| interval.low),
                rank_biserial_high: pair.rank_biserial_interval.map(|interval| interval.high),
                mean_difference: pair.mean_difference,
                mean_difference_low: pair.mean_difference_interval.map(|interval| interval.low),
                mean_difference_high: pair.mean_difference_interval.map(|interval| interval.high),
                median_difference: pair.median_difference,
            };
            compared.pairs.iter().map(row).collect::<Vec<_>>()
        };
        self.outcomes.iter().flat_map(of_outcome).collect()
    }

    pub(super) fn whole_rows(&self) -> Vec<WholeRow> {
        let row = |whole: &super::report::WholeSessions| WholeRow {
            protocol: self.protocol.clone(),
            outcome: whole.outcome.outcome.clone(),
            label: whole.outcome.label.clone(),
            unit: whole.outcome.unit.clone(),
            n: whole.summary.n,
            missing: whole.missing,
            mean: whole.summary.mean,
            median: whole.summary.median,
            sd: whole.summary.sd,
        };
        self.whole_sessions.iter().map(row).collect()
    }

    pub(super) fn words_rows(&self) -> Vec<WordsRow> {
        let mut numbers = std::collections::BTreeMap::new();
        let mut rows = Vec::new();
        for surgeon in &self.words {
            for setting in &surgeon.settings {
                for words in &setting.words {
                    let number = numbers.entry(setting.session).or_insert(0);
                    *number += 1;
                    rows.push(WordsRow {
                        session: setting.session,
                        number: *number,
                        protocol: self.protocol.clone(),
                        surgeon: surgeon.surgeon.clone(),
                        setting: setting.setting,
                        policy: setting.policy.clone(),
                        question: words.question.clone(),
                        text: words.text.clone(),
                        late: words.late,
                        erased: words.erased,
                    });
                }
            }
        }
        rows
    }
}

/// A name as it is written in JSON.
fn kebab(name: &impl serde::Serialize) -> String {
    serde_json::to_value(name).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_that_may_be_empty_says_when() {
        for table in TABLES {
            for column in table.columns.iter().filter(|column| column.may_be_empty) {
                assert!(column.description.contains("empty"), "{}.{}", table.name, column.name);
            }
        }
    }
}

//! The analysis as tables, each with its data dictionary.

use super::report::{Analysis, ProtocolAnalysis};
use parfocal_base::ids::SessionId;
use parfocal_records::store::export::{Row, Table, means, table};

table! {
    name: "analysis_sessions",
    description: "The study's sessions, and whether each counts",
    key: [session],
    row:
    /// A session.
    #[derive(Debug, Clone)]
    SessionRow {
        session: SessionId = means("Session's random id"),
        protocol: String = means("Protocol's name"),
        site: String = means("Site"),
        surgeon: Option<String> = means("Participant's code, as it was corrected; empty of a withdrawn session"),
        counts: bool = means("Whether the session counts in the analysis"),
        remark: Option<String> = means("Why it does not count, or what is to be known of it"),
    }
}

table! {
    name: "analysis_values",
    description: "Every value that was compared: one for each outcome and setting of the sessions that count",
    key: [session, setting, outcome],
    row:
    /// A value of an outcome in a setting.
    #[derive(Debug, Clone)]
    ValueRow {
        session: SessionId = means("Session's random id"),
        protocol: String = means("Protocol's name"),
        surgeon: String = means("Participant's code, as it was corrected"),
        setting: usize = means("Number of the setting in the session, from 1"),
        policy: String = means("Policy that ran"),
        repeat: usize = means("Which of the policy's settings in the session, from 1"),
        outcome: String = means("Outcome; see analysis_policies"),
        value: Option<f64> = means("The value; empty where it is missing"),
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
        protocol: String = means("Protocol's name"),
        outcome: String = means("Outcome: question and measure, or a quantity of the focal power"),
        label: String = means("The outcome in words"),
        unit: String = means("Its unit or scale"),
        better: Option<&'static str> = means("Which end is better, higher or lower, where that is known"),
        policy: String = means("Policy"),
        n: usize = means("Settings with a value"),
        missing: usize = means("Settings without a value"),
        mean: Option<f64> = means("Mean over the settings"),
        median: Option<f64> = means("Median"),
        sd: Option<f64> = means("Standard deviation of the sample (divided by n - 1)"),
    }
}

table! {
    name: "analysis_sites",
    description: "Each outcome by policy at each site, where sessions of several sites count",
    key: [protocol, outcome, site, policy],
    row:
    /// Summary of a policy's values at a site.
    #[derive(Debug, Clone)]
    SiteRow {
        protocol: String = means("Protocol's name"),
        outcome: String = means("Outcome; see analysis_policies"),
        site: String = means("Site"),
        surgeons: usize = means("Surgeons of the site whose sessions count"),
        sessions: usize = means("Sessions of the site that count"),
        policy: String = means("Policy"),
        n: usize = means("Settings with a value"),
        missing: usize = means("Settings without a value"),
        mean: Option<f64> = means("Mean over the settings"),
        median: Option<f64> = means("Median"),
        sd: Option<f64> = means("Standard deviation of the sample (divided by n - 1)"),
    }
}

table! {
    name: "analysis_tests",
    description: "What is tested of each outcome over all policies; surgeons with a missing value are left out",
    key: [protocol, outcome],
    row:
    /// The tests of an outcome.
    #[derive(Debug, Clone)]
    TestRow {
        protocol: String = means("Protocol's name"),
        outcome: String = means("Outcome; see analysis_policies"),
        surgeons: usize = means("Surgeons without a missing value: those that are tested"),
        left_out: usize = means("Surgeons who are left out because a value is missing"),
        friedman_chi_square: Option<f64> = means("Friedman's statistic, corrected for ties; empty where not tested"),
        friedman_df: Option<usize> = means("Its degrees of freedom"),
        friedman_p_chi_square: Option<f64> = means("Its p from the chi-square distribution"),
        friedman_p_permutation: Option<f64> = means("Its p over permutations of each surgeon's ranks"),
        permutations: Option<String> = means("exact: over all of them; monte-carlo: over 9999 that were drawn"),
        kendalls_w: Option<f64> = means("Kendall's W, 0 to 1: how far the surgeons agree on an order of policies"),
        kendalls_w_low: Option<f64> = means("Lower end of its 95 % bootstrap interval over surgeons"),
        kendalls_w_high: Option<f64> = means("Upper end of that interval"),
        icc: Option<f64> = means("ICC(A,1) of the repeats of a policy in a session; empty without repeats"),
        icc_low: Option<f64> = means("Lower end of its 95 % interval"),
        icc_high: Option<f64> = means("Upper end of that interval"),
        icc_subjects: usize = means("Policies of sessions that it compares"),
        page_l: Option<f64> = means("Page's L over the positions in the session; empty where not tested"),
        page_l_expected: Option<f64> = means("What L is on average without a trend"),
        page_p: Option<f64> = means("Its two-sided p"),
        page_sessions: usize = means("Sessions without a missing value"),
        difference: String = means("Whether policies differ, in a sentence"),
        agreement: String = means("How far repeats agree, in a sentence"),
        position: String = means("Whether values rise or fall with the position, in a sentence"),
    }
}

table! {
    name: "analysis_pairs",
    description: "Each outcome between each two policies, by the surgeons' means",
    key: [protocol, outcome, a, b],
    row:
    /// Two policies compared.
    #[derive(Debug, Clone)]
    PairRow {
        protocol: String = means("Protocol's name"),
        outcome: String = means("Outcome; see analysis_policies"),
        a: String = means("One policy"),
        b: String = means("The other"),
        surgeons: usize = means("Surgeons compared"),
        differing: usize = means("Surgeons whose means differ; the signed-rank test leaves out the others"),
        w_positive: f64 = means("Sum of the ranks where a is higher"),
        w_negative: f64 = means("Sum of the ranks where b is higher"),
        p: f64 = means("Two-sided p of Wilcoxon's signed-rank test"),
        method: String = means("How p was computed: exact or normal-approximation"),
        p_holm: f64 = means("p corrected by Holm's method for the pairs of the outcome"),
        rank_biserial: Option<f64> = means("Rank-biserial correlation, -1 to 1: above 0 where a is higher"),
        rank_biserial_low: Option<f64> = means("Lower end of its 95 % bootstrap interval over surgeons"),
        rank_biserial_high: Option<f64> = means("Upper end of that interval"),
        mean_difference: f64 = means("Mean of a less mean of b, in the outcome's unit"),
        mean_difference_low: Option<f64> = means("Lower end of its 95 % bootstrap interval over surgeons"),
        mean_difference_high: Option<f64> = means("Upper end of that interval"),
        median_difference: f64 = means("Median of the surgeons' differences, in the outcome's unit"),
    }
}

table! {
    name: "analysis_whole_sessions",
    description: "Closing questions about whole sessions, which no policy can be given",
    key: [protocol, outcome],
    row:
    /// Summary of the answers to a closing question.
    #[derive(Debug, Clone)]
    WholeRow {
        protocol: String = means("Protocol's name"),
        outcome: String = means("Question and measure"),
        label: String = means("The outcome in words"),
        unit: String = means("Its unit or scale"),
        n: usize = means("Sessions with an answer"),
        missing: usize = means("Sessions without one"),
        mean: Option<f64> = means("Mean over the sessions"),
        median: Option<f64> = means("Median"),
        sd: Option<f64> = means("Standard deviation of the sample (divided by n - 1)"),
    }
}

table! {
    name: "analysis_words",
    description: "What surgeons said, with the policy that ran",
    key: [session, number],
    row:
    /// A comment or an answer in words.
    #[derive(Debug, Clone)]
    WordsRow {
        session: SessionId = means("Session's random id"),
        number: usize = means("Order in the session: by setting, then as it was kept"),
        protocol: String = means("Protocol's name"),
        surgeon: String = means("Participant's code, as it was corrected"),
        setting: Option<usize> = means("Number of the setting, from 1; empty outside the settings"),
        policy: Option<String> = means("Policy that ran; empty outside the settings"),
        question: Option<String> = means("The question that it answers; empty of a comment"),
        text: String = means("The words; empty where they were erased"),
        late: bool = means("Whether it arrived after the time in which what a surgeon's device held counted"),
        erased: bool = means("Whether its words were erased"),
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
        let row = |value: &super::report::Value| ValueRow {
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

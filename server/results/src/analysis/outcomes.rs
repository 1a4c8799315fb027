//! Outcomes: the numbers of each setting that are compared between the policies of a protocol.

use serde::Serialize;
use utoipa::ToSchema;

use parfocal_base::ids::SessionId;
use parfocal_records::store::LensMotion;
use parfocal_trial::instruments::{Measure, measures};
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::{AnswerValue, Question, QuestionKind};

/// Name of the outcome: changes of direction per second.
pub const TURNS: &str = "turns";
/// Name of the outcome: distance that the focal power travels per second.
pub const TRAVEL: &str = "travel";
/// Name of the outcome: mean distance from the optimum.
pub const FOCAL_ERROR: &str = "focal-error";
/// Name of the outcome: share of frames near the optimum.
pub const IN_FOCUS: &str = "in-focus";

/// A quantity that has a number in each setting.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Outcome {
    /// Name: question and measure, or a quantity of the focal power.
    pub outcome: String,
    /// Label for people.
    pub label: String,
    /// Unit or scale.
    pub unit: String,
    /// Which end is better, if known: `higher` or `lower`.
    pub better: Option<&'static str>,
    /// Lowest possible value; none if there is no limit.
    pub lowest: Option<f64>,
    /// Highest possible value; none if there is no limit.
    pub highest: Option<f64>,
}

/// A value that was compared.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[schema(as = AnalysedValue)]
pub struct Value {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, corrected if it was.
    pub surgeon: String,
    /// The setting, from 1.
    pub setting: usize,
    /// The policy that ran.
    pub policy: String,
    /// Number of this setting among the policy's settings in the session, from 1.
    pub repeat: usize,
    /// Name of the outcome.
    pub outcome: String,
    /// The value; none if it is missing.
    pub value: Option<f64>,
}

/// The outcomes from the questions of `protocol`: each single answer, each score of a questionnaire after a setting,
/// and the rank of each setting.
pub fn asked(protocol: &Protocol) -> Vec<Outcome> {
    let after_setting = protocol.after_segment.iter().flat_map(of_question);
    let settings = protocol.policies.len() * protocol.repeats;
    let rankings = protocol.closing.iter().filter(|question| is_ranking(question));
    let rankings = rankings.map(|question| of_ranking(question, settings));
    after_setting.chain(rankings).collect()
}

/// The outcomes of closing questions about the session as a whole.
pub fn asked_of_session(protocol: &Protocol) -> Vec<Outcome> {
    protocol.closing.iter().filter(|question| !is_ranking(question)).flat_map(of_question).collect()
}

/// The outcomes from telemetry.
pub fn driven() -> Vec<Outcome> {
    let outcome = |outcome: &str, label: &str, unit: &str, better, highest| Outcome {
        outcome: outcome.to_owned(),
        label: label.to_owned(),
        unit: unit.to_owned(),
        better,
        lowest: Some(0.0),
        highest,
    };
    let error = "True focal error, as the simulation knows it";
    vec![
        outcome(FOCAL_ERROR, error, "focal power, 0 to 1", Some("lower"), Some(1.0)),
        outcome(IN_FOCUS, "Frames in focus: true focal error below 0.1", "share, 0 to 1", Some("higher"), Some(1.0)),
        outcome(TURNS, "Turns: changes of direction of the focal power", "a second", None, None),
        outcome(TRAVEL, "Travel of the focal power, up and down", "focal power a second", None, None),
    ]
}

/// The values of the outcomes of [`driven`] in `motion`. Those that need the optimum are left out unless it is known
/// for at least half of the frames.
pub fn of_motion(motion: &LensMotion) -> Vec<(&'static str, f64)> {
    let mut values = Vec::new();
    if motion.seconds > 0.0 {
        values.push((TURNS, motion.turns as f64 / motion.seconds));
        values.push((TRAVEL, motion.travel / motion.seconds));
    }
    if motion.known > 0 && 2 * motion.known >= motion.frames {
        values.push((FOCAL_ERROR, motion.error / motion.known as f64));
        values.push((IN_FOCUS, motion.in_focus as f64 / motion.known as f64));
    }
    values
}

/// The values of the outcomes of `question` in an answer to it.
pub fn of_answer(question: &Question, value: &AnswerValue) -> Vec<(String, f64)> {
    let counted = measures(&question.kind, value).into_iter().filter(|measure| is_outcome(&question.kind, measure));
    counted.filter_map(|measure| Some((name(question, &measure), measure.value?))).collect()
}

/// The rank that a ranking gives each setting, in the order of the settings; `None` for a setting without a rank.
pub fn of_ranks(question: &Question, value: &AnswerValue) -> Vec<Option<f64>> {
    measures(&question.kind, value).into_iter().map(|measure| measure.value).collect()
}

/// Whether `question` asks to rank all settings.
pub const fn is_ranking(question: &Question) -> bool {
    matches!(question.kind, QuestionKind::Ranking { .. })
}

/// The name of the outcome of a ranking.
pub fn rank_name(question: &Question) -> String {
    format!("{}/rank", question.id)
}

fn of_ranking(question: &Question, settings: usize) -> Outcome {
    Outcome {
        outcome: rank_name(question),
        label: question.text.clone(),
        unit: format!("rank, 1 for the best to {settings}"),
        better: Some("lower"),
        lowest: Some(1.0),
        highest: Some(settings as f64),
    }
}

fn of_question(question: &Question) -> Vec<Outcome> {
    // `measures` names all measures even for an answer without any item.
    let nothing = match &question.kind {
        QuestionKind::Sus { .. } => AnswerValue::Points(vec![0; parfocal_trial::instruments::sus::ITEMS]),
        QuestionKind::NasaTlx { scales } => AnswerValue::Points(vec![0; scales.len()]),
        QuestionKind::SurgTlx { scales, pairs } => AnswerValue::Points(vec![0; scales.len() + pairs.len()]),
        QuestionKind::Text => AnswerValue::Text(String::new()),
        _ => AnswerValue::Point(0),
    };
    let counted = measures(&question.kind, &nothing).into_iter().filter(|measure| is_outcome(&question.kind, measure));
    counted.map(|measure| outcome(question, &measure)).collect()
}

/// Whether a measure is an outcome. Of a questionnaire only the scores are, not the items.
fn is_outcome(kind: &QuestionKind, measure: &Measure) -> bool {
    match kind {
        QuestionKind::Sus { .. } | QuestionKind::NasaTlx { .. } | QuestionKind::SurgTlx { .. } => {
            measure.score && !measure.name.starts_with("weight-of-")
        }
        QuestionKind::Ranking { .. } => false,
        _ => true,
    }
}

fn outcome(question: &Question, measure: &Measure) -> Outcome {
    let (unit, better, ends) = match &question.kind {
        QuestionKind::Likert { points, low, high, .. } => {
            (scale("points, 1", *points, low, high), None, Some((1.0, f64::from(*points))))
        }
        QuestionKind::VisualAnalogue { low, high } => {
            (scale("hundredths of the line, 0", 100, low, high), None, Some((0.0, 100.0)))
        }
        QuestionKind::Sus { .. } => ("0 to 100".to_owned(), Some("higher"), Some((0.0, 100.0))),
        QuestionKind::NasaTlx { .. } | QuestionKind::SurgTlx { .. } => {
            ("0 to 100".to_owned(), Some("lower"), Some((0.0, 100.0)))
        }
        QuestionKind::Recognition => ("1 no, 2 not sure, 3 yes".to_owned(), None, Some((1.0, 3.0))),
        QuestionKind::Ranking { .. } | QuestionKind::Text => (String::new(), None, None),
    };
    let label = if measure.score { format!("{}: {}", question.text, measure.label) } else { question.text.clone() };
    let (lowest, highest) = ends.unzip();
    Outcome { outcome: name(question, measure), label, unit, better, lowest, highest }
}

fn scale(from: &str, to: u8, low: &str, high: &str) -> String {
    if low.is_empty() && high.is_empty() {
        format!("{from} to {to}")
    } else {
        format!("{from} ({low}) to {to} ({high})")
    }
}

fn name(question: &Question, measure: &Measure) -> String {
    format!("{}/{}", question.id, measure.name)
}

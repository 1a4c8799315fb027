//! The protocol's file: its TOML shape, and the rules that a shape cannot express.

use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use serde::Deserialize;
use toml::Spanned;

use super::fault::{Fault, ProtocolError};
use super::{Prompt, Protocol, Record};
use crate::autofocus::PolicyName;
use crate::lens::FocalPower;
use crate::trial::allocation::Order;
use crate::trial::grace::DEFAULT_GRACE;
use crate::trial::question::{Question, QuestionKind};

/// Most segments in a session: what a surgeon can still compare, and the ranking's limit.
const MOST_SETTINGS: usize = 24;
/// Most segments in a balanced session: its base order is drawn by rejection, which is slow for long ones.
const MOST_BALANCED_SETTINGS: usize = 12;
/// Longest text that surgeons read, in characters.
const LONGEST_TEXT: usize = 400;

impl Protocol {
    /// Reads a protocol. `file` is named in errors; `known` are the policies that there are.
    ///
    /// # Errors
    /// At the first thing wrong, with its line and key.
    pub fn parse(source: &str, file: &str, known: &[PolicyName]) -> Result<Self, ProtocolError> {
        parse(source, known).map_err(|fault| fault.in_file(file, source))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Spanned<String>,
    title: Spanned<String>,
    researcher_title: Spanned<String>,
    #[serde(default)]
    practice: bool,
    policies: Spanned<Vec<Spanned<PolicyName>>>,
    repeats: Spanned<usize>,
    order: Spanned<Order>,
    segment_seconds: Spanned<u32>,
    #[serde(default)]
    start_focal_power: Option<Spanned<f64>>,
    #[serde(default)]
    prompt_seconds: Option<Spanned<u32>>,
    #[serde(default)]
    grace_minutes: Option<Spanned<u32>>,
    #[serde(default)]
    record: Record,
    #[serde(default)]
    quick_comments: Vec<Spanned<String>>,
    #[serde(default)]
    prompts: Vec<FilePrompt>,
    #[serde(default)]
    after_segment: Vec<FileQuestion>,
    #[serde(default)]
    closing: Vec<FileQuestion>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FilePrompt {
    at_seconds: Spanned<u32>,
    text: Spanned<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileQuestion {
    id: Spanned<String>,
    text: Spanned<String>,
    kind: Spanned<Kind>,
    points: Option<Spanned<u8>>,
    low: Option<Spanned<String>>,
    high: Option<Spanned<String>>,
    #[serde(default)]
    optional: bool,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Text,
    Likert,
    Ranking,
    Sus,
}

/// Reads and checks `source`.
fn parse(source: &str, known: &[PolicyName]) -> Result<Protocol, Fault> {
    let file: File = toml::from_str(source)?;
    let reader = Reader { known };
    identifier(&file.name, "name")?;

    let policies = reader.policies(&file.policies)?;
    let repeats = between(&file.repeats, "repeats", 1..=10, "")?;
    check_order(&file, policies.len() * repeats)?;

    let segment_seconds = between(&file.segment_seconds, "segment_seconds", 5..=3600, " seconds")?;
    let stay =
        file.prompt_seconds.as_ref().map_or(Ok(15), |stay| between(stay, "prompt_seconds", 1..=600, " seconds"))?;
    let grace = file.grace_minutes.as_ref().map_or(Ok(DEFAULT_GRACE), |minutes| {
        between(minutes, "grace_minutes", 0..=24 * 60, " minutes").map(|minutes| Duration::from_mins(minutes.into()))
    })?;

    let mut ids = BTreeSet::new();
    Ok(Protocol {
        title: reader.shown(&file.title, "title")?,
        researcher_title: file.researcher_title.get_ref().clone(),
        practice: file.practice,
        repeats,
        order: *file.order.get_ref(),
        segment_limit: Duration::from_secs(segment_seconds.into()),
        start: start(file.start_focal_power.as_ref())?,
        prompts: reader.prompts(&file.prompts, segment_seconds)?,
        prompt_stay: Duration::from_secs(stay.into()),
        quick_comments: reader.all_shown(&file.quick_comments, "quick_comments")?,
        grace,
        record: file.record,
        after_segment: reader.questions(&file.after_segment, &mut ids, false)?,
        closing: reader.questions(&file.closing, &mut ids, true)?,
        policies,
        name: file.name.into_inner(),
        source: source.into(),
    })
}

fn check_order(file: &File, settings: usize) -> Result<(), Fault> {
    if settings > MOST_SETTINGS {
        let message = format!("{settings} segments are too many; the limit is {MOST_SETTINGS}");
        return Err(Fault::new(file.repeats.span(), "repeats", message));
    }

    if *file.order.get_ref() != Order::Balanced {
        return Ok(());
    }
    let policies = file.policies.get_ref().len();
    if !(2..=4).contains(&policies) || settings > MOST_BALANCED_SETTINGS {
        let message = format!(
            "'balanced' takes 2 to 4 policies and at most {MOST_BALANCED_SETTINGS} segments, \
             not {policies} and {settings}"
        );

        return Err(Fault::new(file.order.span(), "order", message));
    }

    Ok(())
}

fn start(given: Option<&Spanned<f64>>) -> Result<FocalPower, Fault> {
    given.map_or(Ok(FocalPower::MIDDLE), |power| {
        FocalPower::new(*power.get_ref())
            .map_err(|error| Fault::new(power.span(), "start_focal_power", error.to_string()))
    })
}

fn between<T>(value: &Spanned<T>, key: &str, range: std::ops::RangeInclusive<T>, unit: &str) -> Result<T, Fault>
where
    T: PartialOrd + Copy + std::fmt::Display,
{
    let number = *value.get_ref();
    if range.contains(&number) {
        return Ok(number);
    }
    let message = format!("must be from {} to {}{unit}, not {number}", range.start(), range.end());
    Err(Fault::new(value.span(), key, message))
}

fn identifier(value: &Spanned<String>, key: &str) -> Result<(), Fault> {
    let text = value.get_ref();
    let fits = (1..=40).contains(&text.len())
        && text.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-');
    if fits {
        return Ok(());
    }
    let message = format!("'{text}' must be 1 to 40 lower case letters, digits and dashes");
    Err(Fault::new(value.span(), key, message))
}

struct Reader<'a> {
    known: &'a [PolicyName],
}

impl Reader<'_> {
    fn policies(&self, policies: &Spanned<Vec<Spanned<PolicyName>>>) -> Result<Vec<PolicyName>, Fault> {
        let mut names: Vec<PolicyName> = Vec::new();
        for policy in policies.get_ref() {
            let name = policy.get_ref();
            if !self.known.contains(name) {
                let known: Vec<&str> = self.known.iter().map(PolicyName::as_str).collect();
                let message = format!("there is no policy '{name}'; there are: {}", known.join(", "));
                return Err(Fault::new(policy.span(), "policies", message));
            }

            if names.contains(name) {
                return Err(Fault::new(policy.span(), "policies", format!("'{name}' is listed twice; use 'repeats'")));
            }
            names.push(name.clone());
        }

        if names.is_empty() {
            return Err(Fault::new(policies.span(), "policies", "name at least one policy"));
        }
        Ok(names)
    }

    /// A text for surgeons: not empty, not endless, and without a policy's name.
    fn shown(&self, value: &Spanned<String>, key: &str) -> Result<String, Fault> {
        let text = value.get_ref().trim();
        let length = text.chars().count();
        if !(1..=LONGEST_TEXT).contains(&length) {
            let message = format!("must be 1 to {LONGEST_TEXT} characters, not {length}");
            return Err(Fault::new(value.span(), key, message));
        }

        let lower = text.to_lowercase();
        // A name without a dash ("fixed") is a plain word too, and may be used as one.
        let named = self.known.iter().map(PolicyName::as_str).find(|name| name.contains('-') && lower.contains(name));
        named.map_or_else(
            || Ok(text.to_owned()),
            |name| {
                Err(Fault::new(value.span(), key, format!("names the policy '{name}', but surgeons are blind to it")))
            },
        )
    }

    fn all_shown(&self, values: &[Spanned<String>], key: &str) -> Result<Vec<String>, Fault> {
        values.iter().map(|value| self.shown(value, key)).collect()
    }

    fn prompts(&self, prompts: &[FilePrompt], segment_seconds: u32) -> Result<Vec<Prompt>, Fault> {
        let mut read = prompts
            .iter()
            .map(|prompt| {
                let at = between(&prompt.at_seconds, "at_seconds", 0..=segment_seconds - 1, " seconds")?;
                Ok(Prompt { at: Duration::from_secs(at.into()), text: self.shown(&prompt.text, "text")? })
            })
            .collect::<Result<Vec<_>, Fault>>()?;

        read.sort_by_key(|prompt| prompt.at);
        Ok(read)
    }

    fn questions(
        &self,
        questions: &[FileQuestion],
        ids: &mut BTreeSet<String>,
        closing: bool,
    ) -> Result<Vec<Question>, Fault> {
        questions
            .iter()
            .map(|question| {
                identifier(&question.id, "id")?;
                let id = question.id.get_ref().clone();
                if !ids.insert(id.clone()) {
                    return Err(Fault::new(question.id.span(), "id", format!("'{id}' is used twice")));
                }
                let kind = self.kind(question, closing)?;
                Ok(Question { id, text: self.shown(&question.text, "text")?, kind, optional: question.optional })
            })
            .collect()
    }

    fn kind(&self, question: &FileQuestion, closing: bool) -> Result<QuestionKind, Fault> {
        match question.kind.get_ref() {
            Kind::Likert => return self.likert(question),
            Kind::Ranking if !closing => {
                let message = "a ranking of all settings can be asked in [[closing]] only";
                return Err(Fault::new(question.kind.span(), "kind", message));
            }
            _ => {}
        }

        only_for_likert(question.points.as_ref().map(Spanned::span), "points")?;
        only_for_likert(question.low.as_ref().map(Spanned::span), "low")?;
        only_for_likert(question.high.as_ref().map(Spanned::span), "high")?;
        Ok(match question.kind.get_ref() {
            Kind::Ranking => QuestionKind::Ranking,
            Kind::Sus => QuestionKind::Sus,
            Kind::Text | Kind::Likert => QuestionKind::Text,
        })
    }

    fn likert(&self, question: &FileQuestion) -> Result<QuestionKind, Fault> {
        let missing = |key: &str| Fault::new(question.kind.span(), key, "a 'likert' question needs it");
        let points = question.points.as_ref().ok_or_else(|| missing("points"))?;
        if !matches!(points.get_ref(), 5 | 7) {
            let message = format!("must be 5 or 7, not {}", points.get_ref());
            return Err(Fault::new(points.span(), "points", message));
        }

        let low = self.shown(question.low.as_ref().ok_or_else(|| missing("low"))?, "low")?;
        let high = self.shown(question.high.as_ref().ok_or_else(|| missing("high"))?, "high")?;
        Ok(QuestionKind::Likert { points: *points.get_ref(), low, high })
    }
}

fn only_for_likert(span: Option<Range<usize>>, key: &str) -> Result<(), Fault> {
    span.map_or(Ok(()), |span| Err(Fault::new(span, key, "only a 'likert' question has it")))
}

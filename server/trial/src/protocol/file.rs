//! The protocol's file: its TOML structure, and the rules that the structure cannot express.

use std::collections::BTreeSet;
use std::ops::Range;
use std::time::Duration;

use serde::Deserialize;
use toml::Spanned;

use super::fault::{Fault, ProtocolError};
use super::{Prompt, Protocol, Record, named_policy};
use crate::allocation::Order;
use crate::consent;
use crate::grace::DEFAULT_GRACE;
use crate::instruments::{nasa_tlx, recognition, surg_tlx, sus};
use crate::pointing::PatchRule;
use crate::question::{Question, QuestionKind};
use crate::tablet::WhenAway;
use parfocal_base::FocalPower;
use parfocal_base::PolicyName;
use parfocal_language::Language;

/// Maximum number of segments in a session: more can no longer be compared or ranked by a surgeon.
const MOST_SETTINGS: usize = 24;
/// Maximum number of segments in a balanced session. Its base order is drawn by rejection, which is slow for more.
const MOST_BALANCED_SETTINGS: usize = 12;
/// Allowed number of labelled points on a scale. More cannot be distinguished, or tapped with gloves.
const LABELS: std::ops::RangeInclusive<u8> = 2..=9;
/// Longest time for which a protocol may keep voice: thirty years, as for the records of some trials.
const LONGEST_VOICE_DAYS: u32 = 30 * 366;
/// Width of the largest picture that a surgeon's page gets, in pixels.
const WIDEST_PICTURE: u32 = 2048;
/// Maximum length of a text that surgeons read, in characters.
const LONGEST_TEXT: usize = 400;

impl Protocol {
    /// Reads a protocol. Errors name `file`. `known` are the available policies.
    ///
    /// # Errors
    /// If the text is not a valid protocol. The error describes the first fault, with its line and key.
    pub fn parse(source: &str, file: &str, known: &[PolicyName]) -> Result<Self, ProtocolError> {
        parse(source, known, known).map_err(|fault| fault.in_file(file, source))
    }

    /// Reads a protocol that was stored with a session or a study. It may name policies that this version lacks, and
    /// its texts are those that surgeons have read, whatever this version refuses in a new one.
    ///
    /// # Errors
    /// If this version cannot read the protocol for another reason.
    pub fn parse_kept(source: &str, file: &str) -> Result<Self, ProtocolError> {
        #[derive(Deserialize)]
        struct Policies {
            policies: Vec<PolicyName>,
        }

        let kept: Result<Policies, Fault> = toml::from_str(source).map_err(Fault::from);
        let Policies { policies } = kept.map_err(|fault| fault.in_file(file, source))?;
        parse(source, &policies, &[]).map_err(|fault| fault.in_file(file, source))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Spanned<String>,
    language: Option<Spanned<String>>,
    title: Spanned<String>,
    researcher_title: Spanned<String>,
    #[serde(default)]
    practice: bool,
    policies: Spanned<Vec<Spanned<PolicyName>>>,
    repeats: Spanned<usize>,
    order: Spanned<Order>,
    segment_seconds: Spanned<u32>,
    start_focal_power: Option<Spanned<f64>>,
    prompt_seconds: Option<Spanned<u32>>,
    grace_minutes: Option<Spanned<u32>>,
    #[serde(default)]
    record: Record,
    #[serde(default)]
    voice: bool,
    voice_days: Option<Spanned<u32>>,
    #[serde(default)]
    when_tablet_away: WhenAway,
    patch: Option<Spanned<String>>,
    patch_stays: Option<Spanned<bool>>,
    patch_follows: Option<Spanned<String>>,
    #[serde(default)]
    hold: bool,
    least_picture_width: Option<Spanned<u32>>,
    consent_version: Option<Spanned<String>>,
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
    labels: Option<Spanned<Vec<Spanned<String>>>>,
    ties: Option<Spanned<bool>>,
    weighted: Option<Spanned<bool>>,
    #[serde(default)]
    optional: bool,
}

#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Text,
    Likert,
    VisualAnalogue,
    Ranking,
    Sus,
    NasaTlx,
    SurgTlx,
    Recognition,
}

impl Kind {
    /// The keys that questions of this kind have, beyond those of all questions.
    const fn own_keys(self) -> &'static [&'static str] {
        match self {
            Self::Likert => &["points", "low", "high", "labels"],
            Self::VisualAnalogue => &["low", "high"],
            Self::Ranking => &["ties"],
            Self::SurgTlx => &["weighted"],
            Self::Text | Self::Sus | Self::NasaTlx | Self::Recognition => &[],
        }
    }
}

impl FileQuestion {
    /// The given keys that not every kind of question has, each with its place in the text.
    fn own_keys(&self) -> impl Iterator<Item = (&'static str, Range<usize>)> {
        let given = [
            ("points", self.points.as_ref().map(Spanned::span)),
            ("low", self.low.as_ref().map(Spanned::span)),
            ("high", self.high.as_ref().map(Spanned::span)),
            ("labels", self.labels.as_ref().map(Spanned::span)),
            ("ties", self.ties.as_ref().map(Spanned::span)),
            ("weighted", self.weighted.as_ref().map(Spanned::span)),
        ];
        given.into_iter().filter_map(|(key, span)| Some((key, span?)))
    }
}

/// Reads and checks `source`. `known` are the available policies, `secret` those that no text for surgeons may name.
fn parse(source: &str, known: &[PolicyName], secret: &[PolicyName]) -> Result<Protocol, Fault> {
    let file: File = toml::from_str(source)?;
    let language = language(file.language.as_ref())?;
    let reader = Reader { known, secret, language };
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

    let width = file.least_picture_width.as_ref();
    let least_picture_width = width.map(|width| between(width, "least_picture_width", 1..=WIDEST_PICTURE, " pixels"));
    let consent = file.consent_version.as_ref().map(|version| text(version, "consent_version", consent::LONGEST));

    let mut ids = BTreeSet::new();
    Ok(Protocol {
        language,
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
        voice: file.voice,
        voice_days: voice_days(&file)?,
        when_tablet_away: file.when_tablet_away,
        patch: patch_rule(&file)?,
        hold: file.hold,
        least_picture_width: least_picture_width.transpose()?,
        consent: consent.transpose()?,
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

/// Reads the number of days for which voice is kept; none if it is kept until somebody erases it.
fn voice_days(file: &File) -> Result<Option<u32>, Fault> {
    let Some(days) = &file.voice_days else { return Ok(None) };
    if !file.voice {
        return Err(Fault::new(days.span(), "voice_days", "needs 'voice = true'"));
    }
    between(days, "voice_days", 1..=LONGEST_VOICE_DAYS, " days").map(Some)
}

/// Reads the language of all that surgeons read.
fn language(given: Option<&Spanned<String>>) -> Result<Language, Fault> {
    let Some(given) = given else { return Ok(Language::default()) };
    let code = given.get_ref();
    Language::from_code(code).ok_or_else(|| {
        let message = format!("there is no language \"{code}\" here; there are: {}", Language::codes());
        Fault::new(given.span(), "language", message)
    })
}

/// Reads who chooses the patch's place.
fn patch_rule(file: &File) -> Result<PatchRule, Fault> {
    let free = match &file.patch {
        None => false,
        Some(rule) => match rule.get_ref().as_str() {
            "centre" => false,
            "surgeon" => true,
            other => {
                let message = format!("must be \"centre\" or \"surgeon\", not \"{other}\"");
                return Err(Fault::new(rule.span(), "patch", message));
            }
        },
    };

    if let Some(follows) = &file.patch_follows {
        let message = match follows.get_ref().as_str() {
            "screen" => None,
            "tissue" => Some(
                "cannot be \"tissue\": sessions are blinded, and when the tissue is lost depends on how sharp the \
                 picture is, which would tell the policies apart; outside sessions the operator may choose it"
                    .to_owned(),
            ),
            other => Some(format!("must be \"screen\", not \"{other}\"")),
        };
        if let Some(message) = message {
            return Err(Fault::new(follows.span(), "patch_follows", message));
        }
    }

    match &file.patch_stays {
        Some(stays) if !free => Err(Fault::new(stays.span(), "patch_stays", "needs 'patch = \"surgeon\"'")),
        stays if free => Ok(PatchRule::Surgeon { stays: stays.as_ref().is_some_and(|stays| *stays.get_ref()) }),
        _ => Ok(PatchRule::Centre),
    }
}

fn start(given: Option<&Spanned<f64>>) -> Result<FocalPower, Fault> {
    given.map_or(Ok(FocalPower::MIDDLE), |power| {
        FocalPower::new(*power.get_ref())
            .map_err(|error| Fault::new(power.span(), "start_focal_power", error.to_string()))
    })
}

/// Checks that a text is neither empty nor longer than `longest` characters, and returns it without surrounding blanks.
pub(crate) fn text(value: &Spanned<String>, key: &str, longest: usize) -> Result<String, Fault> {
    let text = value.get_ref().trim();
    let length = text.chars().count();
    if (1..=longest).contains(&length) {
        return Ok(text.to_owned());
    }
    Err(Fault::new(value.span(), key, format!("must be 1 to {longest} characters, not {length}")))
}

pub(crate) fn between<T>(
    value: &Spanned<T>,
    key: &str,
    range: std::ops::RangeInclusive<T>,
    unit: &str,
) -> Result<T, Fault>
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

pub(crate) fn identifier(value: &Spanned<String>, key: &str) -> Result<(), Fault> {
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
    secret: &'a [PolicyName],
    language: Language,
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

    /// Checks a text for surgeons: it must be neither empty nor too long, and must not name a policy.
    fn shown(&self, value: &Spanned<String>, key: &str) -> Result<String, Fault> {
        let text = text(value, key, LONGEST_TEXT)?;
        match named_policy(&text, self.secret) {
            None => Ok(text),
            Some(name) => {
                Err(Fault::new(value.span(), key, format!("names the policy '{name}', which surgeons must not know")))
            }
        }
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
        let mut read = Vec::new();
        for question in questions {
            identifier(&question.id, "id")?;
            let id = question.id.get_ref().clone();
            let mut take = |id: &str| {
                let twice = || Fault::new(question.id.span(), "id", format!("'{id}' is used twice"));
                ids.insert(id.to_owned()).then_some(()).ok_or_else(twice)
            };
            take(&id)?;

            let kind = self.kind(question, closing)?;
            let follow_up =
                (kind == QuestionKind::Recognition).then(|| recognition::follow_up(&id, closing, self.language));
            if let Some(follow_up) = &follow_up {
                take(&follow_up.id)?;
            }
            let text = self.shown(&question.text, "text")?;
            read.push(Question { id, text, kind, optional: question.optional, only_if_yes: None });
            read.extend(follow_up);
        }
        Ok(read)
    }

    fn kind(&self, question: &FileQuestion, closing: bool) -> Result<QuestionKind, Fault> {
        let kind = *question.kind.get_ref();
        if let Some((key, span)) = question.own_keys().find(|(key, _)| !kind.own_keys().contains(key)) {
            return Err(Fault::new(span, key, "this kind of question does not have this key"));
        }

        match kind {
            Kind::Text => Ok(QuestionKind::Text),
            Kind::Likert => match &question.labels {
                Some(labels) => self.labelled(question, labels),
                None => self.likert(question),
            },
            Kind::VisualAnalogue => {
                let low = self.end(question, question.low.as_ref(), "low")?;
                let high = self.end(question, question.high.as_ref(), "high")?;
                Ok(QuestionKind::VisualAnalogue { low, high })
            }
            Kind::Ranking if !closing => {
                let message = "a ranking of all settings can be asked in [[closing]] only";
                Err(Fault::new(question.kind.span(), "kind", message))
            }
            Kind::Ranking => Ok(QuestionKind::Ranking { ties: is_set(question.ties.as_ref()) }),
            Kind::Sus => self.translated(question, "System Usability Scale", sus::question(self.language)),
            Kind::NasaTlx => self.translated(question, "NASA-TLX", nasa_tlx::question(self.language)),
            Kind::SurgTlx => {
                let asked = surg_tlx::question(is_set(question.weighted.as_ref()), self.language);
                self.translated(question, "SURG-TLX", asked)
            }
            Kind::Recognition => Ok(QuestionKind::Recognition),
        }
    }

    /// The instrument in the protocol's language. A translation of our own would not be the instrument.
    fn translated(
        &self,
        question: &FileQuestion,
        name: &str,
        asked: Option<QuestionKind>,
    ) -> Result<QuestionKind, Fault> {
        asked.ok_or_else(|| {
            let language = self.language.name();
            let message = format!(
                "there is no published {language} translation of the {name} here; \
                 ask it in another language, or leave it out"
            );
            Fault::new(question.kind.span(), "kind", message)
        })
    }

    fn likert(&self, question: &FileQuestion) -> Result<QuestionKind, Fault> {
        let missing = || Fault::new(question.kind.span(), "points", "a 'likert' question needs it, or 'labels'");
        let points = question.points.as_ref().ok_or_else(missing)?;
        if !matches!(points.get_ref(), 5 | 7) {
            let message = format!("must be 5 or 7, not {}", points.get_ref());
            return Err(Fault::new(points.span(), "points", message));
        }

        let low = self.end(question, question.low.as_ref(), "low")?;
        let high = self.end(question, question.high.as_ref(), "high")?;
        Ok(QuestionKind::Likert { points: *points.get_ref(), low, high, labels: Vec::new() })
    }

    /// Reads a Likert scale with a label on every point.
    fn labelled(&self, question: &FileQuestion, labels: &Spanned<Vec<Spanned<String>>>) -> Result<QuestionKind, Fault> {
        if let Some((key, span)) = question.own_keys().find(|(key, _)| *key != "labels") {
            return Err(Fault::new(span, key, "not allowed together with 'labels'"));
        }

        let shown = self.all_shown(labels.get_ref(), "labels")?;
        let points = u8::try_from(shown.len()).ok().filter(|points| LABELS.contains(points));
        let (Some(points), [low, .., high]) = (points, shown.as_slice()) else {
            let message = format!("must be {} to {} labels, not {}", LABELS.start(), LABELS.end(), shown.len());
            return Err(Fault::new(labels.span(), "labels", message));
        };
        Ok(QuestionKind::Likert { points, low: low.clone(), high: high.clone(), labels: shown.clone() })
    }

    /// Reads the meaning of an end of a scale.
    fn end(&self, question: &FileQuestion, end: Option<&Spanned<String>>, key: &str) -> Result<String, Fault> {
        let kind = if *question.kind.get_ref() == Kind::Likert { "likert" } else { "visual-analogue" };
        let missing = || Fault::new(question.kind.span(), key, format!("a '{kind}' question needs it"));
        self.shown(end.ok_or_else(missing)?, key)
    }
}

fn is_set(value: Option<&Spanned<bool>>) -> bool {
    value.is_some_and(|value| *value.get_ref())
}

//! What a session contributes to the analysis: numbers by setting, and words.

use std::collections::BTreeMap;

use super::outcomes::{is_ranking, of_answer, of_motion, of_ranks, rank_name};
use super::records::{AnswerRecord, SessionRecords};
use super::report::{SettingWords, Words};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::LensMotion;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::{AnswerValue, Question, QuestionKind};

/// A session that counts, with its contribution to the analysis.
pub struct GatheredSession {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, corrected if it was.
    pub surgeon: String,
    /// Name of the site.
    pub site: String,
    /// The session's settings, in order.
    pub settings: Vec<GatheredSetting>,
    /// Numbers about the whole session, by outcome.
    pub whole: BTreeMap<String, f64>,
    /// Comments and answers in words.
    pub words: Vec<SettingWords>,
}

/// A setting of a session.
pub struct GatheredSetting {
    /// The policy that ran.
    pub policy: String,
    /// Number of this setting among the policy's settings in the session, from 1.
    pub repeat: usize,
    /// Numbers of the setting, by outcome.
    pub values: BTreeMap<String, f64>,
}

/// The contribution of a session with `protocol`.
pub fn gather(protocol: &Protocol, records: SessionRecords) -> GatheredSession {
    let mut gathering = Gathering::new(protocol, &records);
    for motion in &records.motions {
        gathering.take_motion(motion);
    }
    for comment in records.comments {
        gathering.take_words(comment.segment, comment.words);
    }
    for answer in records.answers {
        gathering.take_answer(answer);
    }

    gathering.gathered.words.retain(|setting| !setting.words.is_empty());
    gathering.gathered
}

/// A session whose contribution is being gathered.
struct Gathering<'a> {
    protocol: &'a Protocol,
    segments: Vec<SegmentId>,
    gathered: GatheredSession,
}

impl<'a> Gathering<'a> {
    fn new(protocol: &'a Protocol, records: &SessionRecords) -> Self {
        let session = records.session;
        let mut ran: BTreeMap<&str, usize> = BTreeMap::new();
        let mut settings = Vec::new();
        let mut words = Vec::new();

        for ((_, policy), setting) in records.settings.iter().zip(1..) {
            let repeat = ran.entry(policy).or_default();
            *repeat += 1;
            words.push(SettingWords {
                session,
                setting: Some(setting),
                policy: Some(policy.clone()),
                words: Vec::new(),
            });
            settings.push(GatheredSetting { policy: policy.clone(), repeat: *repeat, values: BTreeMap::new() });
        }
        words.push(SettingWords { session, setting: None, policy: None, words: Vec::new() });

        Self {
            protocol,
            segments: records.settings.iter().map(|(segment, _)| *segment).collect(),
            gathered: GatheredSession {
                session,
                surgeon: records.surgeon.clone(),
                site: records.site.clone(),
                settings,
                whole: BTreeMap::new(),
                words,
            },
        }
    }

    /// Index of `segment` among the settings, from 0.
    fn place(&self, segment: Option<SegmentId>) -> Option<usize> {
        self.segments.iter().position(|known| Some(*known) == segment)
    }

    fn take_motion(&mut self, motion: &LensMotion) {
        let setting = motion.setting.checked_sub(1).and_then(|place| self.gathered.settings.get_mut(place));
        let Some(setting) = setting else { return };
        let values = of_motion(motion).into_iter().map(|(outcome, value)| (outcome.to_owned(), value));
        setting.values.extend(values);
    }

    fn take_words(&mut self, segment: Option<SegmentId>, words: Words) {
        // Words that belong to no setting come last.
        let place = self.place(segment).unwrap_or(self.segments.len());
        self.gathered.words[place].words.push(words);
    }

    fn take_answer(&mut self, answer: AnswerRecord) {
        let AnswerRecord { segment, value, erased, .. } = answer;
        let Some(question) = self.protocol.question(&answer.question, segment.is_some()) else { return };
        if let (QuestionKind::Text, AnswerValue::Text(text)) = (&question.kind, &value) {
            let words = Words { question: Some(question.text.clone()), text: text.clone(), late: false, erased };
            self.take_words(segment, words);
            return;
        }
        self.take_numbers(question, segment, &value);
    }

    fn take_numbers(&mut self, question: &Question, segment: Option<SegmentId>, value: &AnswerValue) {
        if is_ranking(question) {
            let ranks = of_ranks(question, value);
            for (setting, rank) in self.gathered.settings.iter_mut().zip(ranks) {
                setting.values.extend(rank.map(|rank| (rank_name(question), rank)));
            }
            return;
        }

        let values = of_answer(question, value);
        match self.place(segment) {
            Some(place) => self.gathered.settings[place].values.extend(values),
            None => self.gathered.whole.extend(values),
        }
    }
}

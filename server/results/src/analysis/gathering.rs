//! Reads from the database what is analysed of a study's sessions: numbers by setting, and words.

use std::collections::{BTreeMap, BTreeSet};

use super::outcomes::{is_ranking, of_answer, of_motion, of_ranks, rank_name};
use super::report::{AnalysedSession, SettingWords, Words};
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::{Latest, Motion, Reader, RunClocks, StoreError, StoredSession, standings};
use parfocal_trial::correction::Subject;
use parfocal_trial::erasure::Erasable;
use parfocal_trial::event::EventKind;
use parfocal_trial::phase::SessionStatus;
use parfocal_trial::protocol::Protocol;
use parfocal_trial::question::{AnswerValue, Question, QuestionKind};
use parfocal_trial::remark::CommentContent;
use parfocal_trial::study::places::Enrolled;

/// A session that counts, with its contribution to the analysis.
pub struct GatheredSession {
    /// The session.
    pub session: SessionId,
    /// The surgeon's code, corrected if it was.
    pub surgeon: String,
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

/// The analysis's line for `session`, as its study knows it, and its contribution if it counts.
///
/// # Errors
/// If the database failed, or holds something that this version cannot read.
pub async fn gather(
    reader: &Reader,
    clocks: &RunClocks,
    protocol: &Protocol,
    session: &Enrolled,
) -> Result<(AnalysedSession, Option<GatheredSession>), StoreError> {
    let line = |surgeon: Option<String>, counts: bool, remark: Option<String>| AnalysedSession {
        session: session.session,
        surgeon,
        site: session.site.clone(),
        counts,
        remark,
    };
    // A withdrawn session contributes nothing, not even the surgeon's code.
    if session.withdrawn {
        return Ok((line(None, false, Some("withdrawn".to_owned())), None));
    }

    let stored = reader.session(session.session).await?;
    let stored = stored.ok_or_else(|| StoreError::Damaged(format!("session {} is not there", session.session)))?;
    let corrections = Latest::of(&reader.corrections(session.session).await?);
    let surgeon = session.surgeon().to_owned();
    match session.status {
        SessionStatus::Completed => {}
        SessionStatus::Aborted => return Ok((line(Some(surgeon), false, Some("aborted".to_owned())), None)),
        SessionStatus::UnderWay => return Ok((line(Some(surgeon), false, Some("not completed".to_owned())), None)),
    }

    let remark = unblinded_before(&stored).then(|| "counts, though it was unblinded before the study was".to_owned());
    let gathered = Gathering::new(protocol, surgeon.clone(), &stored);
    let gathered = gathered.read(reader, clocks, &corrections).await?;
    Ok((line(Some(surgeon), true, remark), Some(gathered)))
}

/// Whether the session was unblinded alone, in an emergency.
fn unblinded_before(stored: &StoredSession) -> bool {
    let mut kinds = stored.events.iter().map(|(_, event)| &event.kind);
    kinds.any(|kind| matches!(kind, EventKind::Unblinded { emergency: true, .. }))
}

/// A session whose contribution is being read.
struct Gathering<'a> {
    protocol: &'a Protocol,
    segments: Vec<SegmentId>,
    gathered: GatheredSession,
}

impl<'a> Gathering<'a> {
    fn new(protocol: &'a Protocol, surgeon: String, stored: &StoredSession) -> Self {
        let session = stored.made.session;
        let mut ran: BTreeMap<&str, usize> = BTreeMap::new();
        let mut settings = Vec::new();
        let mut words = Vec::new();

        for ((_, policy), setting) in stored.made.segments.iter().zip(1..) {
            let repeat = ran.entry(policy.as_str()).or_default();
            *repeat += 1;
            let policy = policy.as_str().to_owned();
            let setting_words =
                SettingWords { session, setting: Some(setting), policy: Some(policy.clone()), words: Vec::new() };
            words.push(setting_words);
            settings.push(GatheredSetting { policy, repeat: *repeat, values: BTreeMap::new() });
        }
        words.push(SettingWords { session, setting: None, policy: None, words: Vec::new() });

        let segments = stored.made.segments.iter().map(|(segment, _)| *segment).collect();
        Self {
            protocol,
            segments,
            gathered: GatheredSession { session, surgeon, settings, whole: BTreeMap::new(), words },
        }
    }

    async fn read(
        mut self,
        reader: &Reader,
        clocks: &RunClocks,
        corrections: &Latest,
    ) -> Result<GatheredSession, StoreError> {
        let session = self.gathered.session;
        let erased: BTreeSet<(Erasable, String)> = reader
            .erasures(session)
            .await?
            .into_iter()
            .map(|stored| (stored.erasure.subject, stored.erasure.record))
            .collect();

        for motion in reader.motions_of_ended(session).await? {
            self.take_motion(&motion);
        }

        for (_, comment) in reader.comments(session).await? {
            let typed = corrections.note(Subject::Comment, &comment.key);
            let is_typed = comment.said == CommentContent::Voice && typed.is_some();
            let text = match comment.said {
                CommentContent::Text(text) | CommentContent::Quick(text) => text,
                CommentContent::Mark => "Marked a moment".to_owned(),
                // A voice comment can be read once it is transcribed.
                CommentContent::Voice => typed.unwrap_or("Voice comment, not typed out yet").to_owned(),
            };
            // The sound may be erased while its transcript is kept.
            let erased = !is_typed && erased.contains(&(Erasable::Comment, comment.key.to_string()));
            self.take_words(comment.segment, Words { question: None, text, late: comment.late, erased });
        }

        let answers = reader.answers(session).await?;
        let standings = standings(&answers, clocks);
        for ((_, answer), standing) in answers.iter().zip(standings).filter(|(_, standing)| standing.counts) {
            let Some(question) = self.protocol.question(&answer.question, answer.segment.is_some()) else { continue };
            let value = corrections.value(&answer.key).unwrap_or(standing.value);
            let erased = erased.contains(&(Erasable::Answer, answer.key.to_string()));
            self.take_answer(question, answer.segment, &value, erased);
        }

        self.gathered.words.retain(|setting| !setting.words.is_empty());
        Ok(self.gathered)
    }

    /// Index of `segment` among the settings, from 0.
    fn place(&self, segment: Option<SegmentId>) -> Option<usize> {
        self.segments.iter().position(|known| Some(*known) == segment)
    }

    fn take_motion(&mut self, motion: &Motion) {
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

    fn take_answer(&mut self, question: &Question, segment: Option<SegmentId>, value: &AnswerValue, erased: bool) {
        if let (QuestionKind::Text, AnswerValue::Text(text)) = (&question.kind, value) {
            let question = Some(question.text.clone());
            self.take_words(segment, Words { question, text: text.clone(), late: false, erased });
            return;
        }

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

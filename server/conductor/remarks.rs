//! What the surgeon says: comments and answers, kept whatever state the session is in.

use super::course::Course;
use super::{ConductError, Shared};
use crate::ids::{SegmentId, SessionId};
use crate::store::{Answer, Comment, Kept, Stamp};
use crate::trial::answers;
use crate::trial::grace::Grace;
use crate::trial::question::AnswerValue;
use crate::trial::remark::{Holding, NewAnswer, NewComment, Said};

impl Shared {
    pub(super) async fn comment(&self, new: NewComment) -> Result<(), ConductError> {
        check_said(&new.said)?;
        let _pen = self.pen.lock().await;
        let current =
            self.live().course_of(new.session).map(|course| (course.state.plan().segments.clone(), course.grace));
        let (segments, grace) = match current {
            Some(current) => current,
            None => self.of_earlier(new.session).await?,
        };
        let stamp = self.stamp();
        // A segment that is not this session's can only come from a broken page: what was said is
        // kept all the same.
        let segment = new.segment.filter(|segment| segments.contains(segment));
        let comment = Comment {
            key: new.key,
            session: new.session,
            segment,
            frame: new.frame,
            frame_run: new.run.filter(|run| (1..=self.store.run()).contains(run)),
            origin: new.origin.plausible(),
            late: grace.is_late(self.run_clock.time(stamp.at)),
            stamp,
            said: new.said,
        };
        let kept = self.store.keep_comment(&comment).await?;
        let mut live = self.live();
        if kept == Kept::New
            && let Some(course) = live.course_of(comment.session)
        {
            course.heard(comment);
            self.publish(&live);
        }
        unless_taken(kept)
    }

    pub(super) async fn answer(&self, new: NewAnswer) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        // What led to the question comes before its answer.
        self.record_stops(&mut pen).await?;

        let checked =
            self.live().course_of(new.session).map(|course| check_answer(course, &new).map(|()| course.grace));
        let grace = match checked {
            Some(checked) => checked?,
            None => match self.load(new.session).await {
                // What was asked cannot be known any more; what was answered is kept all the same.
                Err(ConductError::Unreadable { .. }) => return self.keep_unasked(new).await,
                earlier => {
                    let earlier = earlier?;
                    check_answer(&earlier, &new)?;
                    earlier.grace
                }
            },
        };

        let answer = self.stamped(new, grace);
        let kept = self.store.keep_answer(&answer).await?;
        let mut live = self.live();
        if kept == Kept::New
            && let Some(course) = live.course_of(answer.session)
        {
            let given = answer.given(self.run_clock.run, &self.run_clock.clocks);
            course.state.keep_answer(answer.segment, &answer.question, given);
            self.publish(&live);
        }
        unless_taken(kept)
    }

    /// Keeps an answer to a session whose questions are not known.
    async fn keep_unasked(&self, new: NewAnswer) -> Result<(), ConductError> {
        if let AnswerValue::Text(text) = &new.value {
            answers::check_length(text).map_err(|misfit| ConductError::Invalid(misfit.to_string()))?;
        }
        let (segments, grace) = self.of_earlier(new.session).await?;
        if new.segment.is_some_and(|segment| !segments.contains(&segment)) {
            return Err(ConductError::NotFound("this session has no such setting; reload the page".to_owned()));
        }
        unless_taken(self.store.keep_answer(&self.stamped(new, grace)).await?)
    }

    pub(super) async fn holding(&self, holding: Holding) -> Result<(), ConductError> {
        let _pen = self.pen.lock().await;
        let under_way = self.live().course_of(holding.session).is_some();
        if !under_way {
            self.of_earlier(holding.session).await?;
        }
        Ok(self.store.note_holding(&holding, self.stamp()).await?)
    }

    fn stamped(&self, new: NewAnswer, grace: Grace) -> Answer {
        let NewAnswer { key, session, segment, question, value, origin } = new;
        let stamp = self.stamp();
        let late = grace.is_late(self.run_clock.time(stamp.at));
        Answer { key, session, segment, question, value, origin: origin.plausible(), late, stamp }
    }

    /// The segments of an earlier session, and whether what is said of it still counts: known
    /// whether or not its protocol can still be read, so that a late comment on it is kept.
    async fn of_earlier(&self, session: SessionId) -> Result<(Vec<SegmentId>, Grace), ConductError> {
        let stored = self.store.reader().session(session).await?.ok_or_else(ConductError::no_session)?;
        let grace = stored.grace(&self.run_clock.clocks);
        Ok((stored.made.segments.into_iter().map(|(segment, _)| segment).collect(), grace))
    }

    fn stamp(&self) -> Stamp {
        Stamp { wall: self.clock.wall(), at: self.clock.now() }
    }
}

fn check_said(said: &Said) -> Result<(), ConductError> {
    let (Said::Text(text) | Said::Quick(text)) = said else { return Ok(()) };
    if text.trim().is_empty() {
        return Err(ConductError::Invalid("the comment is empty".to_owned()));
    }
    answers::check_length(text).map_err(|misfit| ConductError::Invalid(misfit.to_string()))
}

fn check_answer(course: &Course, new: &NewAnswer) -> Result<(), ConductError> {
    let known = new.segment.is_none_or(|segment| course.state.plan().position(segment).is_some());
    let question =
        course.protocol.question(&new.question, new.segment.is_some()).filter(|_| known).ok_or_else(|| {
            ConductError::NotFound("this session asks no such question of this setting; reload the page".to_owned())
        })?;
    if !course.state.takes_answers(new.segment) {
        return Err(ConductError::Conflict("this question has not been asked yet".to_owned()));
    }
    answers::check(question, &new.value, course.state.plan().segments.len())
        .map_err(|misfit| ConductError::Invalid(misfit.to_string()))
}

fn unless_taken(kept: Kept) -> Result<(), ConductError> {
    match kept {
        Kept::New | Kept::Before => Ok(()),
        Kept::KeyTaken => {
            Err(ConductError::Conflict("its key already stands for something else; send it with a new key".to_owned()))
        }
    }
}

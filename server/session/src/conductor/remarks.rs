//! The surgeon's comments and answers, stored whatever the session's state.

use super::course::Course;
use super::{ConductError, Shared};
use parfocal_base::boxed;
use parfocal_base::ids::{SegmentId, SessionId};
use parfocal_records::store::{Answer, Comment, KeepOutcome};
use parfocal_trial::acceptance;
use parfocal_trial::grace::Grace;
use parfocal_trial::remark::{Holding, NewAnswer, NewComment};

impl Shared {
    #[boxed]
    pub(super) async fn comment(&self, new: NewComment) -> Result<(), ConductError> {
        acceptance::check_comment(&new.said)?;

        let _pen = self.pen.lock().await;
        let known = |course: &mut Course| SessionFacts {
            segments: course.state.segments().to_vec(),
            grace: course.grace,
            voice: course.protocol.voice,
        };
        let current = self.live().course_of(new.session).map(known);
        let SessionFacts { segments, grace, voice } = match current {
            Some(current) => current,
            None => self.of_earlier(new.session).await?,
        };

        acceptance::check_spoken(&new.said, voice)?;
        let stamp = self.stamp();
        // Only a faulty page can send a segment of another session. Keep the comment anyway.
        let segment = new.segment.filter(|segment| segments.contains(segment));
        let comment = Comment {
            key: new.key,
            session: new.session,
            segment,
            frame: new.frame,
            frame_run: new.run.filter(|run| (1..=self.store.run()).contains(run)),
            sight: new.sight.plausible(),
            origin: new.origin.plausible(),
            late: grace.is_late(self.run_clock.time(stamp.at)),
            stamp,
            said: new.said,
        };

        let kept = self.store.keep_comment(&comment).await?;
        let mut live = self.live();
        if kept == KeepOutcome::New
            && let Some(course) = live.course_of(comment.session)
        {
            course.heard(comment);
            self.publish(&live);
        }
        unless_taken(kept)
    }

    #[boxed]
    pub(super) async fn answer(&self, new: NewAnswer) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        // Events that led to the question are written before its answer.
        self.record_stops(&mut pen).await?;

        let check = |course: &Course| acceptance::check_answer(&new, &course.state).map(|()| course.grace);
        let current = self.live().course_of(new.session).map(|course| check(course));
        let grace = match current {
            Some(checked) => checked?,
            None => match self.load(new.session).await {
                // The questions can no longer be read; keep the answer anyway.
                Err(ConductError::Unreadable { .. }) => return self.keep_unasked(new).await,
                earlier => check(&earlier?)?,
            },
        };

        let answer = self.stamped(new, grace);
        let kept = self.store.keep_answer(&answer).await?;
        let mut live = self.live();
        if kept == KeepOutcome::New
            && let Some(course) = live.course_of(answer.session)
        {
            let given = answer.given(self.run_clock.run, &self.run_clock.clocks);
            course.state.keep_answer(answer.segment, &answer.question, given);
            self.publish(&live);
        }

        unless_taken(kept)
    }

    /// Stores an answer to a session whose questions cannot be read.
    async fn keep_unasked(&self, new: NewAnswer) -> Result<(), ConductError> {
        let SessionFacts { segments, grace, .. } = self.of_earlier(new.session).await?;
        acceptance::check_unasked(&new, &segments)?;
        unless_taken(self.store.keep_answer(&self.stamped(new, grace)).await?)
    }

    #[boxed]
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

    /// What is known of an earlier session, even if its protocol can no longer be read, so that a late comment on it is
    /// stored.
    async fn of_earlier(&self, session: SessionId) -> Result<SessionFacts, ConductError> {
        let stored = self.store.reader().session(session).await?.ok_or_else(ConductError::no_session)?;
        let grace = stored.grace(&self.run_clock.clocks);
        // If the protocol cannot be read, accept voice, so that no comment is lost.
        let voice = stored.protocol().map_or(true, |protocol| protocol.voice);
        let segments = stored.made.segments.into_iter().map(|(segment, _)| segment).collect();
        Ok(SessionFacts { segments, grace, voice })
    }
}

/// What a decision about a comment needs to know of its session.
struct SessionFacts {
    segments: Vec<SegmentId>,
    grace: Grace,
    /// Whether the session accepts spoken comments.
    voice: bool,
}

fn unless_taken(kept: KeepOutcome) -> Result<(), ConductError> {
    match kept {
        KeepOutcome::New | KeepOutcome::Before => Ok(()),
        KeepOutcome::KeyTaken => Err(taken()),
    }
}

pub(super) fn taken() -> ConductError {
    ConductError::Conflict("its key is already used for something else; send it with a new key".to_owned())
}

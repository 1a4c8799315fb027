//! Choosing what is to be in focus: a place in the picture becomes the patch's place in the bright circle.

use std::sync::Arc;

use super::{ConductError, Conductor, Shared};
use parfocal_base::PatchPlace;
use parfocal_base::ids::SessionId;
use parfocal_imaging::place_of;
use parfocal_language::Message;
use parfocal_pipeline::control::Aim;
use parfocal_trial::account::Actor;
use parfocal_trial::permission::{self, CurrentSession, Request};
use parfocal_trial::pointing::{Choice, NewChoice, Touch};
use parfocal_trial::refusal::RefusalKind;

impl Conductor {
    /// Makes the policy look where `by` has chosen. In a session this is recorded, if its protocol allows it. The lens
    /// does not move by it.
    ///
    /// # Errors
    /// If `by` may not do this now, or the place lies outside the picture.
    pub async fn choose(&self, by: impl Into<Actor>, new: NewChoice) -> Result<(), ConductError> {
        let by = by.into();
        if new.follows.is_some() {
            permission::check_following(by.role, new.session.is_some())?;
        }
        let choice = self.shared.choice(new)?;
        match new.session {
            Some(session) => {
                self.to_the_end(move |shared| async move { shared.choose(&by, session, choice).await }).await
            }
            None => self.shared.choose_outside(&by, choice, new.follows),
        }
    }
}

impl Shared {
    /// The place in the bright circle that `new` means.
    fn choice(&self, new: NewChoice) -> Result<Choice, ConductError> {
        let NewChoice { frame, at, .. } = new;
        let Some(Touch { x, y }) = at else {
            return Ok(Choice { frame, at: None, place: PatchPlace::CENTRE });
        };

        let geometry = self.control.status.borrow().geometry;
        let place = place_of((x, y), geometry.cells, geometry.content_area.as_ref())
            .ok_or_else(|| ConductError::Said(RefusalKind::Invalid, Message::new("refused-outside")))?;
        Ok(Choice { frame, at: Some(Touch { x: hundredths(x), y: hundredths(y) }), place })
    }

    /// In session `session`. Does not wait for the disk.
    async fn choose(self: &Arc<Self>, by: &Actor, session: SessionId, choice: Choice) -> Result<(), ConductError> {
        {
            let mut live = self.live();
            let course = live.course_of(session).ok_or_else(ConductError::no_session)?;
            course.choose(by.clone(), choice, self.stamp())?;
            let (place, held) = course.aim().unwrap_or_default();
            let aim = Aim { place, held, choices: live.aim.choices + 1, follows: false };
            self.look(&mut live, aim);
        }

        self.record_promptly().await;
        self.show_and_drive();
        self.wake();
        Ok(())
    }

    fn choose_outside(&self, by: &Actor, choice: Choice, follows: Option<bool>) -> Result<(), ConductError> {
        // Hold the lock until the command is sent. A session that begins in the meantime then sends its own after it.
        let mut live = self.live();
        permission::check(by.role, Request::PlacePatch, CurrentSession::of(live.shown_phase()))?;
        let follows = follows.unwrap_or(live.aim.follows);
        let aim = Aim { place: choice.place, choices: live.aim.choices + 1, held: false, follows };
        self.look(&mut live, aim);
        Ok(())
    }
}

/// A length in cells, as it is recorded.
fn hundredths(cells: f64) -> f64 {
    (cells * 100.0).round() / 100.0
}

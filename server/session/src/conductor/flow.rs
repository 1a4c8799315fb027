//! The order of the steps. An action that moves a session on: decide, write to disk, change the state, show it, command
//! the control loop. An action that stops the session: decide, change the state, command the control loop, and then
//! write to disk and show it.

use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::timeout;

use super::circumstances::Subject;
use super::course::Course;
use super::{ConductError, Live, Pen, Shared, views};
use parfocal_base::FocalPower;
use parfocal_base::boxed;
use parfocal_base::ids::SessionId;
use parfocal_pipeline::control::{Aim, Command, Drive};
use parfocal_records::store::Stamp;
use parfocal_trial::account::Actor;
use parfocal_trial::action::Action;
use parfocal_trial::event::{Event, EventKind};
use parfocal_trial::permission;
use parfocal_trial::phase::Phase;
use parfocal_trial::role::Role;
use parfocal_trial::session::decide_restart;
use parfocal_trial::study::signature::Signature;
use parfocal_trial::tablet::{Presence, TabletReport};

/// How long the screens wait until a stop is on disk. After that they show it as not recorded yet.
const PROMPTLY: Duration = Duration::from_millis(300);

/// The lens stays where it is, outside any setting.
const HOLD: Command = Command::Drive { drive: Drive::Hold { at: None }, segment: None };

impl Shared {
    /// The state in memory. Never hold this lock while waiting for something.
    pub(super) fn live(&self) -> MutexGuard<'_, Live> {
        self.live.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The present time, by both clocks.
    pub(super) fn stamp(&self) -> Stamp {
        Stamp { wall: self.clock.wall(), at: self.clock.now() }
    }

    pub(super) async fn act(
        self: &Arc<Self>,
        by: &Actor,
        session: SessionId,
        action: &Action,
        signature: Option<&Signature>,
    ) -> Result<(), ConductError> {
        let under_way = self.live().course_of(session).is_some();
        match under_way {
            true if action.stops_the_lens() => self.stop(by, session, action).await,
            true => self.move_on(by, session, action, signature).await,
            false => self.act_on_earlier(by, session, action, signature).await,
        }
    }

    /// Carries out an action that does not wait for the disk. The lens is held when this returns, even if recording
    /// fails.
    async fn stop(self: &Arc<Self>, by: &Actor, session: SessionId, action: &Action) -> Result<(), ConductError> {
        let stopped = {
            let mut live = self.live();
            let stamp = self.stamp();
            let course = live.course_of(session).ok_or_else(ConductError::no_session)?;
            course.keep_time(stamp);
            let stopped = course.stop(by.clone(), action.clone(), stamp);
            self.hold(&mut live);
            stopped
        };

        // Record even if the action was refused: the time limit may have stopped something.
        self.record_promptly().await;
        self.show_and_drive();
        self.wake();
        Ok(stopped?)
    }

    /// Carries out an action that takes effect only when it is on disk.
    #[boxed]
    async fn move_on(
        &self,
        by: &Actor,
        session: SessionId,
        action: &Action,
        signature: Option<&Signature>,
    ) -> Result<(), ConductError> {
        // While the disk refuses to record a stop, somebody is trying most of the time. Anyone who asks then gets the
        // reason at once, not after waiting for that attempt and one more.
        let refused = self.live().unrecorded_because.clone();
        let mut pen = match refused {
            Some(because) => self.pen.try_lock().map_err(|_| ConductError::Storage(because))?,
            None => self.pen.lock().await,
        };
        let events = loop {
            self.keep_time();
            if let Some(course) = self.live().course_of(session) {
                course.record_movement();
            }
            self.record_stops(&mut pen).await?;

            let subject = self.live().course_of(session).map(|course| Subject::of(course));
            let subject = subject.ok_or_else(ConductError::no_session)?;
            let circumstances = self.circumstances(&mut pen, subject, action, signature).await?;

            let mut live = self.live();
            let course = live.course_of(session).ok_or_else(ConductError::no_session)?;
            // The session was stopped in the meantime; the stop must be on disk first.
            if course.is_unrecorded() {
                continue;
            }
            break course.begin_writing(by, action, &circumstances, self.stamp())?;
        };
        if events.is_empty() {
            return Ok(());
        }

        let written = self.append(session, &events, signature).await;

        let mut live = self.live();
        if let Some(course) = live.course_of(session) {
            course.written(if written.is_ok() { events } else { Vec::new() });
        }
        live.forget_what_is_done_with();
        drop(live);

        self.show_and_drive();
        self.wake();
        written
    }

    /// Acts on a session that is not the one in memory.
    #[boxed]
    async fn act_on_earlier(
        &self,
        by: &Actor,
        session: SessionId,
        action: &Action,
        signature: Option<&Signature>,
    ) -> Result<(), ConductError> {
        let mut pen = self.pen.lock().await;
        let mut earlier = self.load(session).await?;
        let circumstances = self.circumstances(&mut pen, Subject::of(&earlier), action, signature).await?;
        permission::check_while_on_screen(action)?;
        let events = earlier.begin_writing(by, action, &circumstances, self.stamp())?;
        self.append(session, &events, signature).await
    }

    /// Writes `events` of `session`. An emergency unblinding is also recorded in its study.
    async fn append(
        &self,
        session: SessionId,
        events: &[Event],
        signature: Option<&Signature>,
    ) -> Result<(), ConductError> {
        let unblinding = events.iter().find(|event| matches!(event.kind, EventKind::Unblinded { .. }));
        let enrolment = match (unblinding, signature) {
            (Some(unblinding), Some(signature)) => {
                let enrolment = self.store.reader().enrolment(session).await?;
                enrolment.map(|enrolment| (enrolment, unblinding, signature))
            }
            _ => None,
        };

        match enrolment {
            Some((enrolment, unblinding, signature)) => {
                self.studies.session_unblinded(&enrolment, session, events, unblinding, signature).await
            }
            None => Ok(self.store.append_events(session, events).await?),
        }
    }

    pub(super) async fn load(&self, session: SessionId) -> Result<Course, ConductError> {
        Course::load(self.store.reader(), &self.run_clock, session).await
    }

    /// Resumes the session that was under way when the server ended; the lens is held where it was.
    pub(super) async fn take_up(&self, mut course: Course) -> Result<(), ConductError> {
        let reader = self.store.reader();
        let mut inspected = Duration::ZERO;
        if let Some(segment) = course.state.segment() {
            inspected = reader.noted_clock(segment).await?;
            let place = reader.last_commanded(segment).await?;
            course.was_interrupted_at(place.unwrap_or(course.protocol.start));
        }

        let kinds = decide_restart(&course.state, inspected);
        let events = course.number(&Role::System.into(), kinds, self.stamp());
        self.store.append_events(course.session(), &events).await?;
        course.written(events);

        self.live().course = Some(course);
        self.show_and_drive();
        Ok(())
    }

    /// Ends the current setting if its time is up, and makes an event of a movement by hand that has come to rest.
    /// Returns whether there was something to record.
    pub(super) fn keep_time(&self) -> bool {
        let mut live = self.live();
        let stamp = self.stamp();
        let ended = live.course.as_mut().is_some_and(|course| course.keep_time(stamp));
        if ended {
            self.hold(&mut live);
        }
        let rested = live.course.as_mut().is_some_and(|course| course.record_movement_at_rest(stamp.at));
        ended || rested
    }

    /// Sends the lens to `to` by hand, in a session that is paused or was aborted. Does not wait for the disk.
    pub(super) async fn focus_by_hand(
        self: &Arc<Self>,
        by: &Actor,
        session: SessionId,
        to: FocalPower,
    ) -> Result<(), ConductError> {
        {
            let mut live = self.live();
            let lens_at = self.control.status.borrow().focal_power;
            let course = live.course_of(session).ok_or_else(ConductError::no_session)?;
            course.focus_by_hand(by.clone(), to, lens_at, self.stamp())?;
            self.drive(&mut live);
        }

        self.record_promptly().await;
        self.show_and_drive();
        self.wake();
        Ok(())
    }

    /// Follows what the surgeon's tablets report. May pause the session, which does not wait for the disk.
    pub(super) async fn follow_tablets(self: &Arc<Self>, report: &TabletReport) {
        // On a slow link not every report has a picture; the last one is still on screen.
        if report.size.is_some() || report.presence != Presence::Present {
            self.store.note_surgeon_picture(report.size.map(|size| size.width));
        }

        let changed = {
            let mut live = self.live();
            let stamp = self.stamp();
            let changed = live.course.as_mut().is_some_and(|course| course.follow_tablets(report, stamp));
            if changed {
                self.hold(&mut live);
            }
            changed
        };

        if changed {
            self.record_promptly().await;
            self.show_and_drive();
            self.wake();
        }
    }

    /// Records the stops. Waits for the disk only as long as the screens can wait.
    pub(super) async fn record_promptly(self: &Arc<Self>) {
        let shared = Arc::clone(self);
        // A separate task continues after this function stops waiting.
        let recording = tokio::spawn(async move {
            let mut pen = shared.pen.lock().await;
            // The screens show a failure, and recording is tried again.
            let _ = shared.record_stops(&mut pen).await;
        });

        let _ = timeout(PROMPTLY, recording).await;
    }

    /// Records the stops in order. If the disk refuses some, they are kept for the next attempt.
    ///
    /// # Errors
    /// If the disk or database failed.
    #[boxed]
    pub(super) async fn record_stops(&self, _pen: &mut Pen) -> Result<(), ConductError> {
        loop {
            let (session, events, stops) = {
                let mut live = self.live();
                let Some(course) = live.course.as_ref().filter(|course| course.is_unrecorded()) else {
                    live.unrecorded_because = None;
                    live.forget_what_is_done_with();
                    return Ok(());
                };

                let (events, stops) = course.unrecorded();
                (course.session(), events.to_vec(), stops)
            };

            let written = self.store.append_events(session, &events).await;
            let mut live = self.live();
            match written {
                Ok(()) => {
                    if let Some(course) = live.course_of(session) {
                        course.recorded(events.len(), stops);
                    }
                    if live.unrecorded_because.take().is_some() {
                        tracing::info!("what stopped the session is recorded");
                    }
                }
                Err(error) => {
                    if live.unrecorded_because.is_none() {
                        tracing::error!("what stopped the session is not recorded yet: {error}; it is tried again");
                    }
                    live.unrecorded_because = Some(error.to_string());
                    return Err(error.into());
                }
            }
        }
    }

    pub(super) fn publish(&self, live: &Live) {
        let now = self.clock.now();
        let shown = live.shown();
        let because = live.unrecorded_because.as_deref();
        let (surgeon, operator) = shown.map(|course| views::both(course, because, now)).unzip();
        // The operator first: that view decides which tablets may see the surgeon's.
        replace_if_changed(&self.operator, operator);
        replace_if_changed(&self.surgeon, surgeon);
    }

    /// Shows the session's state, and only then moves the lens: a notice that covers the view must be shown first.
    pub(super) fn show_and_drive(&self) {
        let mut live = self.live();
        self.publish(&live);
        self.drive(&mut live);
    }

    /// Holds the lens if a policy drives it that the session no longer wants.
    fn hold(&self, live: &mut Live) {
        let wanted = live.course.as_ref().and_then(Course::lens_command);
        let policy_drives = matches!(live.commanded, Some(Command::Drive { drive: Drive::Policy { .. }, .. }));
        if policy_drives && wanted != live.commanded {
            let hold = match wanted {
                Some(hold @ Command::Drive { drive: Drive::Hold { .. }, .. }) => hold,
                _ => HOLD,
            };
            self.control.send(hold.clone());
            live.commanded = Some(hold);
        }
        // After it, so that no policy takes a step where a hold on request ends with a pause.
        self.aim(live);
    }

    /// Tells the control loop where the session looks, and whether it holds the focus, if that changed. At the end of a
    /// session the patch goes back to the centre.
    pub(super) fn aim(&self, live: &mut Live) {
        let wanted = live.course.as_ref().and_then(Course::aim);
        if wanted.is_none() && !live.aimed_by_session {
            return;
        }

        live.aimed_by_session = wanted.is_some();
        let (place, held) = wanted.unwrap_or_default();
        self.look(live, Aim { place, held, follows: false, ..live.aim });
    }

    /// Sends `aim` to the control loop if it is another one.
    pub(super) fn look(&self, live: &mut Live, aim: Aim) {
        if aim != live.aim {
            self.control.send(Command::Aim(aim));
            live.aim = aim;
        }
    }

    /// Sends the control loop the session's present command, if it changed.
    pub(super) fn drive(&self, live: &mut Live) {
        // Before it, so that a policy that begins looks at the right place from its first step on.
        self.aim(live);
        let wanted = live.course.as_ref().and_then(Course::lens_command);
        if wanted == live.commanded {
            return;
        }

        let is_ready = live.course.as_ref().is_some_and(|course| course.state.phase() == Phase::Ready);
        if let Some(command) = wanted.clone() {
            self.control.send(command);
        } else if !is_ready {
            // The session has ended. Its last command is no longer valid, and nobody has chosen what drives the lens
            // next.
            self.control.send(HOLD);
        }
        live.commanded = wanted;
    }

    /// Wakes both tasks of [`Conductor::run`](super::Conductor::run).
    pub(super) fn wake(&self) {
        self.changed.notify_one();
        self.to_record.notify_one();
    }
}

fn replace_if_changed<T: PartialEq>(sender: &watch::Sender<Option<Arc<T>>>, value: Option<T>) {
    sender.send_if_modified(|shown| {
        let changed = shown.as_deref() != value.as_ref();
        if changed {
            *shown = value.map(Arc::new);
        }
        changed
    });
}

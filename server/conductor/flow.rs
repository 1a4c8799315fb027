//! The one way that everything goes: decide, to disk, into the state, to the screens, to the control loop.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use tokio::sync::watch;

use super::course::Course;
use super::{ConductError, Live, Shared, views};
use crate::clock::Moment;
use crate::control::{Command, Drive};
use crate::ids::SessionId;
use crate::store::DeviceReport;
use crate::trial::event::EventKind;
use crate::trial::grace::Outstanding;
use crate::trial::session::{decide, decide_restart, decide_time};
use crate::trial::view::{Action, Phase, Role};

impl Shared {
    pub(super) async fn act(&self, by: Role, session: SessionId, action: &Action) -> Result<(), ConductError> {
        let mut live = self.live.lock().await;
        if live.course.as_ref().is_some_and(|course| course.session() == session) {
            self.keep_time(&mut live).await?;
        }
        if let Some(course) = live.course.as_mut().filter(|course| course.session() == session) {
            let kinds = decide(&course.state, by, action, self.clock.now())?;
            self.ask_first(course, action).await?;
            self.record(course, by, kinds).await?;
            self.publish(&live);
            self.drive(&mut live);
            self.changed.notify_one();
            return Ok(());
        }
        let mut earlier = self.load(session).await?;
        let same_set = |course: &Course| !course.state.ended() && course.made.seed == earlier.made.seed;
        if matches!(action, Action::Unblind { .. }) && live.course.as_ref().is_some_and(same_set) {
            let text = "a session of the same balanced set is under way, and this one's order would tell its own; wait for its end";
            return Err(ConductError::Conflict(text.to_owned()));
        }
        if matches!(action, Action::Unblind { .. })
            && let Some((participant, made)) = self.store.reader().blinded_twin(session).await?
        {
            let text = format!(
                "the session of {participant} made at {made} took this one's place and has the same order; unblind that one first"
            );
            return Err(ConductError::Conflict(text));
        }
        let kinds = decide(&earlier.state, by, action, self.clock.now())?;
        self.ask_first(&earlier, action).await?;
        self.record(&mut earlier, by, kinds).await
    }

    /// Refuses to unblind while something may be outstanding, unless that is known.
    async fn ask_first(&self, course: &Course, action: &Action) -> Result<(), ConductError> {
        if !matches!(action, Action::Unblind { despite_outstanding: false, .. }) {
            return Ok(());
        }
        match self.outstanding(course).await? {
            None => Ok(()),
            Some(outstanding) => {
                let text = format!("{outstanding}; to unblind all the same, confirm it (despite_outstanding)");
                Err(ConductError::Conflict(text))
            }
        }
    }

    /// What may still come in for `course`, which unblinding would keep from counting.
    pub(super) async fn outstanding(&self, course: &Course) -> Result<Option<Outstanding>, ConductError> {
        let devices = self.store.reader().surgeon_devices(course.session()).await?;
        let told = |device: &DeviceReport| device.told.map(|(holding, run, at)| (holding, self.clocks.wall(run, at)));
        Ok(course.grace.outstanding(self.time(self.clock.now()), devices.iter().map(told)))
    }

    /// `at`, a moment of this run, on the time that goes on over the server's restarts.
    pub(super) fn time(&self, at: Moment) -> Timestamp {
        self.clocks.wall(self.store.run(), at)
    }

    pub(super) async fn load(&self, session: SessionId) -> Result<Course, ConductError> {
        let course = Course::load(self.store.reader(), &self.clocks, session).await?;
        course.ok_or_else(ConductError::no_session)
    }

    /// Takes up the session that was under way when the server ended.
    pub(super) async fn take_up(&self) -> Result<(), ConductError> {
        let mut live = self.live.lock().await;
        if let Some(course) = live.course.as_mut() {
            let inspected = match course.state.segment() {
                Some(segment) => self.store.reader().noted_clock(segment).await?,
                None => Duration::ZERO,
            };
            let kinds = decide_restart(&course.state, inspected);
            self.record(course, Role::System, kinds).await?;
        }
        self.publish(&live);
        self.drive(&mut live);
        Ok(())
    }

    pub(super) async fn keep_time(&self, live: &mut Live) -> Result<(), ConductError> {
        let Some(course) = live.course.as_mut() else { return Ok(()) };
        let kinds = decide_time(&course.state, self.clock.now());
        if kinds.is_empty() {
            return Ok(());
        }
        self.record(course, Role::System, kinds).await?;
        self.publish(live);
        self.drive(live);
        Ok(())
    }

    /// To disk, then into the state.
    async fn record(&self, course: &mut Course, by: Role, kinds: Vec<EventKind>) -> Result<(), ConductError> {
        if kinds.is_empty() {
            return Ok(());
        }
        let events = course.number(by, kinds, self.clock.now(), self.clock.wall());
        self.store.append_events(course.session(), &events).await?;
        for event in events {
            let at = self.time(event.at);
            course.apply(event, at);
        }
        Ok(())
    }

    pub(super) fn publish(&self, live: &Live) {
        let now = self.clock.now();
        let (surgeon, operator) = live.course.as_ref().map(|course| views::both(course, now)).unzip();
        replace_if_changed(&self.surgeon, surgeon);
        replace_if_changed(&self.operator, operator);
    }

    /// Tells the control loop what the session now asks of it, if that changed.
    fn drive(&self, live: &mut Live) {
        let wanted = live.course.as_ref().and_then(Course::driving);
        if wanted == live.driving {
            return;
        }
        let drive = match (&wanted, live.course.as_ref()) {
            (Some(wanted), _) => Some(wanted.command()),
            (None, Some(course)) if course.state.phase() == Phase::Ready => None,
            (None, _) => Some(Command::Drive { drive: Drive::Hold, segment: None }),
        };
        live.driving = wanted;
        if let Some(command) = drive {
            self.control.send(command);
        }
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

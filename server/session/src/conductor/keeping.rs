//! Background work while the server runs: keeps the time, records what waits for the disk, and erases voice when its
//! retention period is over.

use std::time::Duration;

use tokio::time::sleep;

use super::Conductor;
use super::course::Course;
use parfocal_base::boxed;

/// Interval between two updates of the remaining time. A killed server loses at most this much of a segment's clock.
const BEAT: Duration = Duration::from_secs(1);

impl Conductor {
    /// Keeps time limits, prompts and the remaining time, records what waits for the disk, and erases voice when its
    /// retention period is over. Never returns; drop it to stop.
    #[boxed]
    pub async fn run(self) {
        let keeping_time = async {
            loop {
                let wait = self.keep_time().await;
                tokio::select! {
                    () = sleep(wait) => {}
                    () = self.shared.changed.notified() => {}
                }
            }
        };

        // A separate loop, because recording waits for the disk and the time does not.
        let recording = async {
            let mut clock_fails = false;
            loop {
                if self.record(&mut clock_fails).await {
                    sleep(BEAT).await;
                } else {
                    self.shared.to_record.notified().await;
                }
            }
        };

        tokio::join!(keeping_time, recording, self.clone().keep_voice_no_longer());
    }

    /// Does what is due now, and records what waits for the disk.
    pub async fn tick(&self) {
        self.keep_time().await;
        self.record(&mut false).await;
    }

    /// Records what is not on disk yet; the last chance before the server ends.
    pub async fn record_the_rest(&self) {
        let mut pen = self.shared.pen.lock().await;
        if let Some(course) = self.shared.live().course.as_mut() {
            course.record_what_goes_on(self.shared.stamp());
        }
        if let Err(error) = self.shared.record_stops(&mut pen).await {
            tracing::error!("what stopped the session is lost: {error}; after the next start the session is paused");
        }
    }

    /// Ends the current setting at its limit and shows what the time changes. Returns the time until the next change.
    async fn keep_time(&self) -> Duration {
        if self.shared.keep_time() {
            self.shared.record_promptly().await;
            self.shared.to_record.notify_one();
        }
        self.shared.show_and_drive();

        let live = self.shared.live();
        if live.course.as_ref().is_some_and(Course::is_moved) {
            return BEAT;
        }
        let Some(course) = live.course.as_ref().filter(|course| course.state.running()) else {
            return Duration::from_hours(1);
        };
        let inspected = course.state.inspected(self.shared.clock.now());
        course.until_next_change(inspected).min(BEAT)
    }

    /// Records the stops, and how far the segment's clock is. Returns whether there will be more to record soon.
    /// `clock_fails` says whether noting the clock failed the last time: only the first failure in a row is logged.
    async fn record(&self, clock_fails: &mut bool) -> bool {
        {
            let mut pen = self.shared.pen.lock().await;
            // The screens show a failure, and recording is tried again.
            let _ = self.shared.record_stops(&mut pen).await;
        }

        let (clock, unrecorded) = {
            self.shared.show_and_drive();
            let live = self.shared.live();
            let now = self.shared.clock.now();
            let running = live.course.as_ref().filter(|course| course.state.running());
            let clock = running
                .and_then(|course| Some((course.session(), course.state.segment()?, course.state.inspected(now))));
            (clock, live.course.as_ref().is_some_and(Course::is_unrecorded))
        };

        if let Some((session, segment, inspected)) = clock {
            let noted = self.shared.store.note_clock(session, segment, inspected).await;
            if let Err(error) = &noted
                && !*clock_fails
            {
                tracing::warn!("the time inspected could not be noted: {error}; it is tried again every second");
            }
            *clock_fails = noted.is_err();
        }
        clock.is_some() || unrecorded
    }
}

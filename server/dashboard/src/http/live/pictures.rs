//! The pictures of one page: their size, how many are under way, and when the next may go.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

use super::link::{self, Link};
use super::pace::Pace;
use parfocal_base::clock::{Clock, Moment};
use parfocal_imaging::Size;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::{EncodedFrame, LiveHandle, Picture, Viewer};
use parfocal_trial::tablet::PictureSize;

/// A picture that was sent and is not yet acknowledged.
struct InFlight {
    number: u64,
    size: Option<Size>,
    pixels: PictureSize,
    sent_at: Moment,
}

/// The pictures of one page.
pub(super) struct Pictures {
    clock: Arc<dyn Clock>,
    /// The control loop's status.
    status: watch::Receiver<Arc<ControlStatus>>,
    /// Looks away while the page is hidden.
    viewer: Viewer,
    link: Link,
    /// How many pictures may be under way.
    pace: Pace,
    /// Those that are, the oldest first.
    in_flight: VecDeque<InFlight>,
    /// Before this, no further picture is sent.
    not_before: Instant,
    /// Deadline for the next picture of a larger size.
    due: Instant,
    /// Width in cells of the last picture sent; `None` until known.
    cells: Option<usize>,
    /// Pixels of the screen that it covers; `None` until known.
    screen: Option<u32>,
}

impl Pictures {
    /// The pictures of a page about which nothing is known yet. If it `leads`, recordings of the view follow its size.
    pub(super) fn new(
        live: &LiveHandle,
        leads: bool,
        clock: &Arc<dyn Clock>,
        status: watch::Receiver<Arc<ControlStatus>>,
    ) -> Self {
        let now = clock.now();
        Self {
            clock: Arc::clone(clock),
            status,
            viewer: live.viewer(Size::Cell, leads),
            link: Link::new(live.largest(), now),
            pace: Pace::new(now),
            in_flight: VecDeque::new(),
            not_before: Instant::now(),
            due: Instant::now() + link::PATIENCE,
            cells: None,
            screen: None,
        }
    }

    /// Whether another picture may be sent before one of those under way is acknowledged.
    pub(super) fn may_send(&self) -> bool {
        self.in_flight.len() < self.pace.window()
    }

    /// Waits for the next picture for a visible page; waits forever for a hidden one. `None` if the size changed,
    /// because the last one did not come in time, or if no more will come. Dropping the future loses nothing.
    pub(super) async fn next(&mut self) -> Option<Arc<EncodedFrame>> {
        sleep_until(self.not_before).await;
        let may_miss = self.viewer.asked().is_some_and(|size| size != Size::Cell);

        tokio::select! {
            biased;
            frame = self.viewer.next() => {
                if frame.is_none() {
                    self.viewer.look_away();
                }
                frame
            }
            () = sleep_until(self.due), if may_miss => {
                // While the camera delivers none, pictures of no size come, and the link is not to blame.
                let camera_works = self.status.borrow().camera.working;
                if camera_works {
                    self.link.missed(self.clock.now());
                    self.follow_link();
                }
                self.due = Instant::now() + link::PATIENCE;
                None
            }
        }
    }

    /// Notes that `picture` is sent now.
    pub(super) fn sent(&mut self, picture: &Picture) {
        let size = self.viewer.size();
        let sent_at = self.clock.now();
        self.not_before = Instant::now() + self.pace.gap();
        self.in_flight.push_back(InFlight { number: picture.number, size, pixels: pixels(picture), sent_at });

        let cells = Some(picture.width / picture.per_cell);
        if self.cells != cells {
            self.cells = cells;
            self.look_at_screen();
        }
    }

    /// Notes that the page is done with picture `number`, which it had for `held` milliseconds. It may then get the
    /// next one. Returns the picture's size in pixels, if it was under way.
    pub(super) fn drawn(&mut self, number: u64, held: f64) -> Option<PictureSize> {
        let full = !self.may_send();
        let place = self.in_flight.iter().position(|sent| sent.number == number)?;
        // Pages answer in order.
        let sent = self.in_flight.drain(..=place).next_back()?;

        let now = self.clock.now();
        let took = now.since(sent.sent_at);
        // What the page says need not be true.
        let held = Duration::try_from_secs_f64(held / 1e3).unwrap_or_default().min(took);
        // While a larger size is coming, a picture of the previous size says nothing about it.
        if sent.size == Some(self.link.size()) {
            self.pace.drawn(now, took, held, full);
            self.link.drawn(now, took.saturating_sub(self.pace.round_trip()));
        }
        if !self.viewer.is_growing() {
            self.due = Instant::now() + link::PATIENCE;
        }
        self.follow_link();
        Some(sent.pixels)
    }

    /// Notes whether the page is visible.
    pub(super) fn visible(&mut self, visible: bool) {
        if visible {
            self.in_flight.clear();
            self.due = Instant::now() + link::PATIENCE;
            self.viewer.look(self.link.size());
        } else {
            self.viewer.look_away();
        }
    }

    /// Notes that the whole picture covers `width` pixels of the screen.
    pub(super) fn screen(&mut self, width: u32) {
        self.screen = Some(width);
        self.look_at_screen();
    }

    /// Notes that a ping was answered after `took`.
    pub(super) fn answered(&mut self, took: Duration) {
        self.pace.answered(self.clock.now(), took);
    }

    /// How long the latest pictures took to arrive, on average.
    pub(super) fn travel(&self) -> Duration {
        self.pace.travel()
    }

    /// Whether pictures are smaller than the screen can show, because the link is slow.
    pub(super) fn is_reduced(&self) -> bool {
        self.link.is_reduced()
    }

    /// Whether the link carries every size that the screen can show.
    pub(super) fn carries_all(&self) -> bool {
        self.link.carries_all()
    }

    /// Pixels of the screen that the whole picture covers, and whether the page is visible.
    pub(super) fn on_screen(&self) -> (Option<u32>, bool) {
        (self.screen, self.viewer.size().is_some())
    }

    fn look_at_screen(&mut self) {
        if let Some((width, cells)) = self.screen.zip(self.cells) {
            self.link.screen(width, cells);
            self.follow_link();
        }
    }

    /// Asks for the size that suits the page now.
    fn follow_link(&mut self) {
        let size = self.link.size();
        if self.viewer.resize(size) {
            tracing::debug!(size = size.name(), "a viewer's pictures change size");
            self.pace.resize(self.clock.now());
            self.due = Instant::now() + link::PATIENCE;
        }
    }
}

/// The size of `picture`.
fn pixels(picture: &Picture) -> PictureSize {
    let pixels = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
    PictureSize { width: pixels(picture.width), height: pixels(picture.height) }
}

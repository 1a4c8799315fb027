//! How many pictures may be under way to a page at the same time, and how long one takes to get there.
//!
//! With one picture under way, a distant page gets one a round trip, however fast its link is. So as many may be under
//! way as the round trip needs: while one picture crosses the narrowest place of the link (or is drawn), the others
//! travel. One more than that would only wait in a queue and be old when it is shown.
//!
//! Everything here is judged by pings and acknowledgements, never by the server's own work. So it tells nothing about a
//! policy.

use std::time::Duration;

use parfocal_base::clock::Moment;

/// Most pictures under way: a second of them from a fast camera.
const MOST: usize = 25;

/// The shortest time of a picture is that of the last one to two of these spans.
const PICTURES_SPAN: Duration = Duration::from_secs(15);

/// The same for the round trip. Long, because a ping that waits behind pictures takes too long: a round trip taken for
/// too long lets pictures queue, one taken for too short does not.
const PINGS_SPAN: Duration = Duration::from_mins(5);

/// A picture takes at least this long at the narrowest place: shorter times are not measured reliably.
const LEAST_SERVICE: Duration = Duration::from_millis(2);

/// A part of a picture that fits into the round trip counts as a whole one from here on: with less, pictures would
/// queue.
const ROUNDING: f64 = 0.25;

/// Pictures queue if they take longer than the fastest one by more than half of the time at the narrowest place, and by
/// more than this, which is ordinary unrest.
const UNREST: Duration = Duration::from_millis(20);

/// The share of a picture's time at the narrowest place that has to pass before the next is sent. A bit less than all,
/// so that a picture that was faster than the others leaves no gap.
const GAP: f64 = 0.8;

/// Weight of a new picture in the average of how long one takes to arrive.
const WEIGHT: f64 = 0.25;

/// What is known of the way to one page.
#[derive(Debug)]
pub(super) struct Pace {
    /// How many pictures may be under way.
    window: usize,
    /// The shortest time of a ping and its answer.
    round_trip: Shortest,
    /// The shortest time from sending a picture to its acknowledgement, at the present size.
    shortest: Shortest,
    /// The times of the pictures since the window was last looked at.
    round: Vec<Duration>,
    /// Whether the window was full since then.
    was_full: bool,
    /// Average time from sending a picture to the answer of a page that draws it in no time.
    there_and_back: Option<Duration>,
}

impl Pace {
    /// The pace to a page about which nothing is known yet.
    pub(super) const fn new(now: Moment) -> Self {
        Self {
            window: 1,
            round_trip: Shortest::new(now, PINGS_SPAN),
            shortest: Shortest::new(now, PICTURES_SPAN),
            round: Vec::new(),
            was_full: false,
            there_and_back: None,
        }
    }

    /// How many pictures may be under way.
    pub(super) const fn window(&self) -> usize {
        self.window
    }

    /// The least time between two pictures: most of the time of one at the narrowest place, where the second would wait.
    pub(super) fn gap(&self) -> Duration {
        if self.window == 1 { Duration::ZERO } else { self.service().unwrap_or_default().mul_f64(GAP) }
    }

    /// A picture's time at the narrowest place: that of the fastest picture beyond the round trip.
    fn service(&self) -> Option<Duration> {
        let (round_trip, shortest) = self.round_trip.get().zip(self.shortest.get())?;
        Some(shortest.saturating_sub(round_trip).max(LEAST_SERVICE))
    }

    /// The network's round trip; zero until it is known.
    pub(super) fn round_trip(&self) -> Duration {
        self.round_trip.get().unwrap_or_default()
    }

    /// How long the latest pictures took from sending to their arrival at the page, on average. Half of the round trip
    /// is the way back of the acknowledgement.
    pub(super) fn travel(&self) -> Duration {
        self.there_and_back.unwrap_or_default().saturating_sub(self.round_trip() / 2)
    }

    /// Notes that a ping was answered after `took`.
    pub(super) fn answered(&mut self, now: Moment, took: Duration) {
        self.round_trip.note(now, took);
    }

    /// Begins anew, for pictures of another size.
    pub(super) fn resize(&mut self, now: Moment) {
        self.window = 1;
        self.shortest = Shortest::new(now, PICTURES_SPAN);
        self.round.clear();
        self.was_full = false;
    }

    /// Notes that a picture was acknowledged `took` after it was sent; the page says that it had it for `held` of this
    /// time. `full` says whether as many pictures as possible were under way.
    pub(super) fn drawn(&mut self, now: Moment, took: Duration, held: Duration, full: bool) {
        let there_and_back = took.saturating_sub(held);
        self.there_and_back = Some(
            self.there_and_back
                .map_or(there_and_back, |mean| mean.mul_f64(1.0 - WEIGHT) + there_and_back.mul_f64(WEIGHT)),
        );

        self.shortest.note(now, took);
        self.was_full |= full;
        self.round.push(took);
        if self.round.len() >= self.window {
            self.look();
        }
    }

    /// Changes the window by at most one picture a round trip.
    fn look(&mut self) {
        let mean = self.round.iter().sum::<Duration>() / u32::try_from(self.round.len()).unwrap_or(1).max(1);
        self.round.clear();
        let was_full = std::mem::take(&mut self.was_full);

        let Some((service, shortest)) = self.service().zip(self.shortest.get()) else { return };
        let needed = (1.0 + self.round_trip().div_duration_f64(service) + ROUNDING).floor();
        let needed = (needed as usize).clamp(1, MOST);

        let queues = mean.saturating_sub(shortest) > UNREST.max(service / 2);
        if queues || needed < self.window {
            self.window = (self.window - 1).max(1);
        } else if was_full && needed > self.window {
            self.window += 1;
        }
    }
}

/// The shortest of the latest times.
#[derive(Debug)]
struct Shortest {
    span: Duration,
    since: Moment,
    /// The shortest in this span.
    this: Option<Duration>,
    /// The shortest in the span before.
    before: Option<Duration>,
}

impl Shortest {
    const fn new(now: Moment, span: Duration) -> Self {
        Self { span, since: now, this: None, before: None }
    }

    fn note(&mut self, now: Moment, time: Duration) {
        if now.since(self.since) >= self.span {
            self.before = self.this.take();
            self.since = now;
        }
        self.this = Some(self.this.map_or(time, |shortest| shortest.min(time)));
    }

    fn get(&self) -> Option<Duration> {
        self.this.into_iter().chain(self.before).min()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;

    /// A link on which a message takes `delay` ms in each direction, and a picture `service` ms at its narrowest place
    /// besides. Time goes in steps of a millisecond; there is a new picture every `every` ms.
    struct Way {
        pace: Pace,
        now: u64,
        delay: u64,
        service: u64,
        every: u64,
    }

    /// What came of watching.
    struct Watched {
        pictures: usize,
        /// Longest wait of a picture before the narrowest place, ms, in the second half of the time.
        queued: u64,
        /// Greatest error of the travel that was reckoned, ms, in that time.
        error: u64,
    }

    fn at(ms: u64) -> Moment {
        Moment::from_nanos(ms * 1_000_000)
    }

    impl Way {
        fn new(way: u64, service: u64) -> Self {
            Self { pace: Pace::new(at(0)), now: 0, delay: way, service, every: 20 }
        }

        fn watch(&mut self, seconds: u64) -> Watched {
            let mut acknowledged: VecDeque<(u64, u64)> = VecDeque::new();
            let mut pongs: VecDeque<(u64, u64)> = VecDeque::new();
            let begin = self.now;
            let half = begin + seconds * 500;
            let mut free_at = begin;
            let mut sent_at: Option<u64> = None;
            let mut watched = Watched { pictures: 0, queued: 0, error: 0 };
            while self.now < begin + seconds * 1000 {
                while pongs.front().is_some_and(|(back, _)| *back <= self.now) {
                    let (_, sent) = pongs.pop_front().unwrap();
                    self.pace.answered(at(self.now), Duration::from_millis(self.now - sent));
                }
                while acknowledged.front().is_some_and(|(back, _)| *back <= self.now) {
                    let full = acknowledged.len() >= self.pace.window();
                    let (_, sent) = acknowledged.pop_front().unwrap();
                    watched.pictures += 1;
                    let took = Duration::from_millis(self.now - sent);
                    self.pace.drawn(at(self.now), took, Duration::ZERO, full);
                }
                // A ping waits behind the pictures before it.
                if (self.now - begin).is_multiple_of(1000) {
                    pongs.push_back((free_at.max(self.now) + 2 * self.delay, self.now));
                }
                let gap = u64::try_from(self.pace.gap().as_millis()).unwrap();
                let rested = sent_at.is_none_or(|sent| self.now - sent >= gap);
                if self.now.is_multiple_of(self.every) && rested && acknowledged.len() < self.pace.window() {
                    sent_at = Some(self.now);
                    let starts = free_at.max(self.now);
                    free_at = starts + self.service;
                    acknowledged.push_back((free_at + 2 * self.delay, self.now));
                    if self.now >= half {
                        watched.queued = watched.queued.max(starts - self.now);
                        let travel = free_at + self.delay - self.now;
                        let reckoned = u64::try_from(self.pace.travel().as_millis()).unwrap();
                        watched.error = watched.error.max(travel.abs_diff(reckoned));
                    }
                }
                self.now += 1;
            }
            watched
        }
    }

    #[test]
    fn as_many_pictures_are_under_way_as_the_round_trip_needs_and_none_queues() {
        // Way there and way back, and a picture's time at the narrowest place: 1 Mbit/s and 300 ms; 5 Mbit/s and 50 ms;
        // 300 kbit/s and 100 ms; a theatre's own network.
        for (way, service, least) in [(150, 160, 4.0), (25, 32, 19.0), (50, 530, 1.5), (1, 4, 49.0)] {
            let watched = Way::new(way, service).watch(60);
            let rate = watched.pictures as f64 / 60.0;
            assert!(rate >= least, "{rate} a second over {way} ms, {service} ms a picture");
            assert!(watched.queued <= 30.max(service / 5), "{} ms queued of {service}", watched.queued);
            assert!(watched.error <= 30.max(service / 5), "{} ms wrong of {service}", watched.error);
        }
    }

    #[test]
    fn a_link_that_becomes_slow_empties_its_queue_within_seconds() {
        let mut way = Way::new(150, 20);
        assert!(way.watch(30).pictures > 30 * 40);
        way.service = 200;
        way.watch(6);
        let watched = way.watch(40);
        assert!(watched.queued <= 100, "{} ms queued", watched.queued);
    }

    #[test]
    fn a_page_that_draws_slowly_gets_one_picture_at_a_time() {
        let mut way = Way::new(1, 60);
        way.watch(10);
        assert_eq!(way.pace.window(), 1);
    }

    #[test]
    fn without_an_answer_to_a_ping_one_picture_is_under_way() {
        let mut pace = Pace::new(at(0));
        for second in 1..100 {
            pace.drawn(at(second * 1000), Duration::from_millis(300), Duration::ZERO, true);
        }
        assert_eq!(pace.window(), 1);
    }
}

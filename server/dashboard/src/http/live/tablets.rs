//! The surgeon's pages that are open, with what they report about themselves. The operator sees from this whether a
//! tablet is there, awake and well connected, and the session follows when it goes away.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;
use utoipa::ToSchema;

use crate::doctor::Tablet;
use parfocal_base::clock::Moment;
use parfocal_trial::tablet::{PictureSize, Presence, TabletReport};

/// A tablet that has not been heard for this long is away. Browsers answer a ping every second.
const AWAY: Duration = Duration::from_secs(3);

/// The surgeon's pages that are open. Clone freely.
#[derive(Debug, Clone, Default)]
pub struct OpenTablets(Arc<Mutex<Pages>>);

#[derive(Debug, Default)]
struct Pages {
    /// Pages opened so far.
    count: u64,
    open: BTreeMap<u64, Page>,
    /// When a page on screen was last heard, of those that are closed or hidden by now.
    seen: Option<Moment>,
    /// The smallest picture drawn since the last report, and the number of pictures.
    drawn: Option<(PictureSize, u64)>,
}

#[derive(Debug)]
struct Page {
    tablet: Tablet,
    heard: Moment,
    /// The last picture that it drew.
    size: Option<PictureSize>,
}

impl Page {
    fn is_heard(&self, now: Moment) -> bool {
        now.since(self.heard) < AWAY
    }
}

/// The state of the surgeon's tablet, for the operator.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TabletSign {
    /// Whether one shows the surgeon's page.
    presence: Presence,
    /// Whole seconds since one last did; none if one does, or none ever did.
    away_seconds: Option<u64>,
    /// Whether the link of the page on screen is too slow for the size of pictures that its screen can show.
    slow: bool,
    /// Size of the picture that it shows.
    size: Option<PictureSize>,
}

impl OpenTablets {
    /// The pages that are open, the oldest first.
    pub fn open(&self) -> Vec<Tablet> {
        self.pages().open.values().map(|page| page.tablet.clone()).collect()
    }

    /// The state of the tablets at `now`.
    pub(in crate::http) fn sign(&self, now: Moment) -> TabletSign {
        let pages = self.pages();
        let presence = pages.presence(now);
        let away = pages.seen().filter(|_| presence != Presence::Present).map(|seen| now.since(seen).as_secs());
        let shown = pages.open.values().rev().find(|page| page.tablet.visible && page.is_heard(now));
        TabletSign {
            presence,
            away_seconds: away,
            slow: shown.is_some_and(|page| !page.tablet.carries_all),
            size: shown.and_then(|page| page.size),
        }
    }

    /// Adds a page, heard at `now`; `user_agent` is what its browser calls itself.
    pub(super) fn enter(&self, user_agent: &str, now: Moment) -> OpenTablet {
        let mut pages = self.pages();
        pages.count += 1;
        let number = pages.count;

        let user_agent = user_agent.to_owned();
        let tablet = Tablet { user_agent, picture_width: None, visible: true, carries_all: true };
        pages.open.insert(number, Page { tablet, heard: now, size: None });
        OpenTablet { tablets: self.clone(), number }
    }

    /// What the tablets report at `now`, since the last report.
    pub(super) fn report(&self, now: Moment) -> TabletReport {
        let mut pages = self.pages();
        let drawn = pages.drawn.take();
        TabletReport {
            presence: pages.presence(now),
            size: drawn.map(|(size, _)| size),
            pictures: drawn.map_or(0, |(_, pictures)| pictures),
        }
    }

    fn pages(&self) -> MutexGuard<'_, Pages> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Pages {
    /// When a page on screen was last heard.
    fn seen(&self) -> Option<Moment> {
        let visible = self.open.values().filter(|page| page.tablet.visible).map(|page| page.heard);
        visible.chain(self.seen).max()
    }

    fn presence(&self, now: Moment) -> Presence {
        match self.seen() {
            None => Presence::NeverSeen,
            // A page that is loaded again is gone for a moment only.
            Some(seen) if now.since(seen) < AWAY => Presence::Present,
            Some(_) if self.open.values().any(|page| page.is_heard(now)) => Presence::Hidden,
            Some(_) => Presence::Silent,
        }
    }

    /// Keeps when a page was last heard that is about to be closed or hidden.
    fn leave(&mut self, number: u64) {
        let left = self.open.get(&number).filter(|page| page.tablet.visible).map(|page| page.heard);
        self.seen = self.seen.max(left);
    }
}

/// A page's entry; removed when dropped.
#[derive(Debug)]
#[must_use]
pub(super) struct OpenTablet {
    tablets: OpenTablets,
    number: u64,
}

impl OpenTablet {
    /// Updates the page's state; it was heard at `now`.
    pub(super) fn note(&self, picture_width: Option<u32>, visible: bool, carries_all: bool, now: Moment) {
        let mut pages = self.tablets.pages();
        if !visible {
            pages.leave(self.number);
        }
        if let Some(page) = pages.open.get_mut(&self.number) {
            page.heard = now;
            page.tablet.picture_width = picture_width;
            page.tablet.visible = visible;
            page.tablet.carries_all = carries_all;
        }
    }

    /// Notes that the page has drawn a picture of this size.
    pub(super) fn drawn(&self, size: PictureSize) {
        let mut pages = self.tablets.pages();
        if let Some(page) = pages.open.get_mut(&self.number) {
            page.size = Some(size);
        }
        let (least, pictures) = pages
            .drawn
            .map_or((size, 0), |(least, pictures)| (if size.width < least.width { size } else { least }, pictures));
        pages.drawn = Some((least, pictures + 1));
    }
}

impl Drop for OpenTablet {
    fn drop(&mut self) {
        let mut pages = self.tablets.pages();
        pages.leave(self.number);
        pages.open.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: PictureSize = PictureSize { width: 512, height: 272 };
    const LARGE: PictureSize = PictureSize { width: 2048, height: 1088 };

    fn at(ms: u64) -> Moment {
        Moment::from_nanos(ms * 1_000_000)
    }

    fn presence(tablets: &OpenTablets, ms: u64) -> Presence {
        tablets.report(at(ms)).presence
    }

    #[test]
    fn a_tablet_is_away_once_it_was_silent_for_three_seconds_and_back_when_it_is_heard() {
        let tablets = OpenTablets::default();
        assert_eq!(presence(&tablets, 0), Presence::NeverSeen);
        let page = tablets.enter("a browser", at(1000));
        assert_eq!(presence(&tablets, 3999), Presence::Present);
        assert_eq!(presence(&tablets, 4000), Presence::Silent);
        assert_eq!(tablets.sign(at(6500)).away_seconds, Some(5));
        page.note(None, true, true, at(7000));
        assert_eq!(presence(&tablets, 7000), Presence::Present);
        assert_eq!(tablets.sign(at(7000)).away_seconds, None);
    }

    #[test]
    fn a_page_that_is_loaded_again_is_not_away_and_one_that_is_closed_is() {
        let tablets = OpenTablets::default();
        drop(tablets.enter("a browser", at(1000)));
        assert_eq!(presence(&tablets, 2000), Presence::Present);
        let again = tablets.enter("a browser", at(2500));
        assert_eq!(presence(&tablets, 5000), Presence::Present);
        drop(again);
        assert_eq!(presence(&tablets, 5500), Presence::Silent);
    }

    #[test]
    fn a_page_behind_another_program_is_hidden_though_it_answers() {
        let tablets = OpenTablets::default();
        let page = tablets.enter("a browser", at(1000));
        for second in 2..=6 {
            page.note(None, false, true, at(second * 1000));
        }
        assert_eq!(presence(&tablets, 6500), Presence::Hidden);
        // Another tablet shows the page.
        let _other = tablets.enter("a browser", at(6500));
        assert_eq!(presence(&tablets, 6600), Presence::Present);
    }

    #[test]
    fn a_report_has_the_smallest_picture_and_the_number_of_all_since_the_last_report() {
        let tablets = OpenTablets::default();
        let page = tablets.enter("a browser", at(1000));
        for size in [LARGE, SMALL, LARGE] {
            page.drawn(size);
        }
        let report = tablets.report(at(1100));
        assert_eq!((report.size, report.pictures), (Some(SMALL), 3));
        assert_eq!(tablets.report(at(1200)).size, None);
        assert_eq!(tablets.sign(at(1200)).size, Some(LARGE), "the last one is on screen");
    }
}

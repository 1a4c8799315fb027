//! Checks the surgeon's tablet by what its page reports to the server anyway.

use jiff::{Timestamp, Zoned};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::finding::Finding;

const TABLET: &str = "tablet";

/// A surgeon's page that is open.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tablet {
    /// The browser's user agent string.
    pub user_agent: String,
    /// Pixels of its screen that the whole picture covers from left to right; none until the page has reported them.
    pub picture_width: Option<u32>,
    /// Whether the page is on screen; false if it is behind another program or the screen is off.
    pub visible: bool,
    /// Whether its connection is fast enough for the size of pictures that its screen can show.
    pub carries_all: bool,
}

/// Something that a trial needs of a tablet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TabletPart {
    /// An encrypted connection, without which browsers give neither microphone nor service worker.
    Encrypted,
    /// Storage for comments and answers.
    Storage,
    /// Storage for voice.
    Disk,
    /// The live connection.
    Stream,
    /// Drawing pictures.
    Picture,
    /// The microphone.
    Microphone,
    /// Keeping the screen on.
    ScreenOn,
}

impl TabletPart {
    /// What it is called, and whether a trial cannot do without it.
    const fn about(self) -> (&'static str, bool) {
        match self {
            Self::Encrypted => ("an encrypted connection", false),
            Self::Storage => ("storage for comments", true),
            Self::Disk => ("storage for voice", false),
            Self::Stream => ("the live connection", true),
            Self::Picture => ("drawing pictures", true),
            Self::Microphone => ("the microphone", false),
            Self::ScreenOn => ("keeping the screen on", false),
        }
    }
}

/// A tablet that tried itself on the page for this.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TriedTablet {
    /// The browser's user agent string.
    pub user_agent: String,
    /// When it was tried.
    pub at: Timestamp,
    /// What does not work on it.
    pub failing: Vec<TabletPart>,
}

/// One finding for each tablet that was tried; `now` is the local time.
pub fn tried(tablets: &[TriedTablet], now: &Zoned) -> Vec<Finding> {
    tablets.iter().map(|tablet| tried_one(tablet, now)).collect()
}

fn tried_one(tablet: &TriedTablet, now: &Zoned) -> Finding {
    let at = tablet.at.to_zoned(now.time_zone().clone());
    // A server may run for weeks.
    let format = if at.date() == now.date() { "at %H:%M" } else { "on %Y-%m-%d at %H:%M" };
    let found = format!("{} was tried {}", browser(&tablet.user_agent), at.strftime(format));
    if tablet.failing.is_empty() {
        return Finding::well(TABLET, format!("{found}: everything works."));
    }

    let names: Vec<_> = tablet.failing.iter().map(|part| part.about().0).collect();
    let found = format!("{found}. Does not work: {}.", names.join(", "));
    let advice = "The page /tablet on the tablet says what to do. Then try it again.";
    if tablet.failing.iter().any(|part| part.about().1) {
        return Finding::wrong(TABLET, found, advice);
    }
    Finding::advice(TABLET, found, advice)
}

/// One finding for each open surgeon's page, or one that says that none is open.
pub fn tablets(open: &[Tablet]) -> Vec<Finding> {
    if open.is_empty() {
        let advice = "Scan the code in the card \"Surgeon’s tablet\" with the tablet's camera.";
        return vec![Finding::advice(TABLET, "No surgeon's page is open.", advice)];
    }
    open.iter().map(finding).collect()
}

fn finding(tablet: &Tablet) -> Finding {
    let browser = browser(&tablet.user_agent);
    let width = tablet.picture_width.map_or(String::new(), |width| format!(", the picture {width} pixels wide"));
    let found = format!("The surgeon's page is open in {browser}{width}.");

    if !tablet.visible {
        let found = format!("{found} It is not on screen.");
        return Finding::advice(TABLET, found, "Wake the tablet and bring the page to the front.");
    }
    if !tablet.carries_all {
        let found = format!("{found} Its connection is slow, so it gets smaller pictures than it can show.");
        return Finding::advice(TABLET, found, "Bring the tablet closer to the access point, or use a faster network.");
    }
    Finding::well(TABLET, found)
}

/// The browser and the device that `user_agent` names, in words.
fn browser(user_agent: &str) -> String {
    // A browser's user agent may also name browsers further down, for compatibility, so the first match counts.
    const BROWSERS: [(&str, &str); 8] = [
        ("Edg", "Edge"),
        ("OPR/", "Opera"),
        ("SamsungBrowser", "Samsung Internet"),
        ("Firefox", "Firefox"),
        ("FxiOS", "Firefox"),
        ("CriOS", "Chrome"),
        ("Chrome", "Chrome"),
        ("Safari", "Safari"),
    ];
    // By default, an iPad says that it is a Mac.
    const DEVICES: [(&str, &str); 7] = [
        ("iPad", "an iPad"),
        ("iPhone", "an iPhone"),
        ("Android", "Android"),
        ("Macintosh", "an iPad or a Mac"),
        ("Windows", "Windows"),
        ("CrOS", "a Chromebook"),
        ("Linux", "Linux"),
    ];

    let named = |names: &[(&str, &'static str)]| {
        names.iter().find(|(mark, _)| user_agent.contains(mark)).map(|&(_, name)| name)
    };
    let browser = named(&BROWSERS).unwrap_or("a browser");
    named(&DEVICES).map_or_else(|| browser.to_owned(), |device| format!("{browser} on {device}"))
}

#[cfg(test)]
mod tests {
    use jiff::tz::TimeZone;

    use super::*;
    use crate::doctor::Verdict;

    /// User agents of Safari on an iPad, with its default settings, and of Chrome on an Android tablet.
    const IPAD: &str = "Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7) AppleWebKit/605.1.15 (KHTML, like Gecko) \
                        Version/18.1 Safari/605.1.15";
    const ANDROID: &str = "Mozilla/5.0 (Linux; Android 10; K) AppleWebKit/537.36 (KHTML, like Gecko) \
                           Chrome/131.0.0.0 Safari/537.36";

    fn tablet(visible: bool, carries_all: bool) -> Tablet {
        Tablet { user_agent: ANDROID.into(), picture_width: Some(1180), visible, carries_all }
    }

    #[test]
    fn browsers_are_recognised_by_name() {
        assert_eq!(browser(IPAD), "Safari on an iPad or a Mac");
        assert_eq!(browser(ANDROID), "Chrome on Android");
        assert_eq!(browser("curl/8.5.0"), "a browser");
    }

    #[test]
    fn a_tablet_that_was_tried_tells_what_does_not_work_on_it() {
        let now = Timestamp::from_second(60_000).unwrap().to_zoned(TimeZone::UTC);
        let with = |failing: &[TabletPart]| {
            let at = Timestamp::from_second(50_520).unwrap();
            let tablet = TriedTablet { user_agent: IPAD.into(), at, failing: failing.to_vec() };
            tried(&[tablet], &now).remove(0)
        };
        let well = with(&[]);
        assert_eq!(well.verdict, Verdict::Well);
        assert_eq!(well.found, "Safari on an iPad or a Mac was tried at 14:02: everything works.");
        let silent = with(&[TabletPart::Microphone, TabletPart::ScreenOn]);
        assert_eq!(silent.verdict, Verdict::Advice);
        assert!(silent.found.ends_with("Does not work: the microphone, keeping the screen on."), "{}", silent.found);
        assert_eq!(with(&[TabletPart::Storage]).verdict, Verdict::Wrong);

        let earlier =
            TriedTablet { user_agent: IPAD.into(), at: "1969-12-30T09:30:00Z".parse().unwrap(), failing: vec![] };
        let found = tried(&[earlier], &now).remove(0).found;
        assert_eq!(found, "Safari on an iPad or a Mac was tried on 1969-12-30 at 09:30: everything works.");
    }

    #[test]
    fn a_tablet_that_is_away_asleep_or_slow_is_reported() {
        let of = |open: &[Tablet]| tablets(open).into_iter().map(|finding| finding.verdict).collect::<Vec<_>>();
        assert_eq!(of(&[]), [Verdict::Advice]);
        assert_eq!(of(&[tablet(true, true)]), [Verdict::Well]);
        assert_eq!(of(&[tablet(true, true), tablet(false, true)]), [Verdict::Well, Verdict::Advice]);
        assert_eq!(of(&[tablet(true, false)]), [Verdict::Advice]);
    }
}

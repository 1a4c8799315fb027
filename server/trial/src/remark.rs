//! A surgeon's comments and answers as the page sends them, each with the device and the time of its origin.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::question::AnswerValue;
use parfocal_base::ids::{DeviceId, IdempotencyKey, SegmentId, SessionId};

/// A comment as a surgeon's browser sends it.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewComment {
    /// Idempotency key, made by the browser. The same key again means the same comment.
    pub key: IdempotencyKey,
    /// Session that the surgeon's page was showing when the comment was made.
    pub session: SessionId,
    /// Segment that the page was showing, if any.
    pub segment: Option<SegmentId>,
    /// Number of the frame that was on the screen.
    pub frame: Option<u64>,
    /// Run of the server that counted the frame, as given in the frame's header.
    pub run: Option<i64>,
    /// What the surgeon saw.
    #[serde(flatten)]
    pub sight: Sight,
    /// Device and time of the comment.
    #[serde(flatten)]
    pub origin: Origin,
    /// Content of the comment.
    #[serde(flatten)]
    pub said: CommentContent,
}

/// What a surgeon saw when a comment was made, as the page counted it. A slow link makes pictures smaller and fewer, so
/// “blurred” may be said of the link.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, ToSchema)]
pub struct Sight {
    /// Width of the picture on screen, pixels.
    pub picture_width: Option<u32>,
    /// Pictures drawn a second.
    pub pictures_per_second: Option<f64>,
}

impl Sight {
    /// The same without numbers that no page can have counted.
    #[must_use]
    pub fn plausible(self) -> Self {
        Self {
            picture_width: self.picture_width.filter(|width| (1..=MOST_PIXELS).contains(width)),
            pictures_per_second: self.pictures_per_second.filter(|rate| (0.0..=MOST_A_SECOND).contains(rate)),
        }
    }
}

/// No picture is wider, in pixels.
const MOST_PIXELS: u32 = 65_536;

/// No screen shows more pictures a second.
const MOST_A_SECOND: f64 = 1000.0;

/// No device holds an entry for longer than a year. A device whose clock was set meanwhile, such as one that began in
/// 1970 until it found the network, measures decades.
const LONGEST_WAIT_MS: i64 = 366 * 24 * 60 * 60 * 1000;

/// Device and time of a comment or answer, as the surgeon's page reports them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
pub struct Origin {
    /// Device on which it was given.
    pub device: Option<DeviceId>,
    /// Number that grows with every comment or answer on the device, in all its tabs. Gaps have no meaning.
    pub sequence: Option<i64>,
    /// When it was given: milliseconds since 1970 by the browser's clock.
    pub client_millis: Option<i64>,
    /// Milliseconds that it waited on the device before this attempt to send it.
    pub waited_millis: Option<i64>,
    /// Clock that measured the wait.
    pub waited_by: Option<WaitClock>,
}

impl Origin {
    /// A copy without a wait that is negative or longer than a year. A wait whose clock is not named counts as measured
    /// by the wall clock, which is the less certain one.
    #[must_use]
    pub fn plausible(self) -> Self {
        let waited_millis = self.waited_millis.filter(|waited| (0..=LONGEST_WAIT_MS).contains(waited));
        let waited_by = waited_millis.map(|_| self.waited_by.unwrap_or(WaitClock::WallClock));
        Self { waited_millis, waited_by, ..self }
    }
}

/// The clock with which a page measured how long a comment or answer waited.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WaitClock {
    /// The page's monotonic clock, which nobody can set.
    PageClock,
    /// The device's wall clock. It is used if the page was reloaded or the device slept in the meantime.
    WallClock,
}

names!(WaitClock { PageClock: "page-clock", WallClock: "wall-clock" });

/// The content of a comment.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", content = "text", rename_all = "kebab-case")]
pub enum CommentContent {
    /// A typed text.
    Text(String),
    /// One of the protocol's quick comments.
    Quick(String),
    /// A mark without words ("Mark this moment").
    Mark,
    /// A spoken comment. Its recording follows in pieces.
    Voice,
    /// The surgeon takes back the comment with this key, which stays in the record.
    Withdrawal(IdempotencyKey),
}

impl CommentContent {
    /// Whether this says something by itself; a withdrawal is only about another comment.
    pub const fn says_something(&self) -> bool {
        !matches!(self, Self::Withdrawal(_))
    }

    /// Whether the words are in the comment itself. A mark and a withdrawal have none, a voice comment's are a sound.
    pub const fn has_words(&self) -> bool {
        matches!(self, Self::Text(_) | Self::Quick(_))
    }
}

/// An answer as a surgeon's browser sends it. If there are several answers to a question, the one given last counts, in
/// whatever order they arrive. Items that it leaves open keep their earlier values. The other answers stay in the log.
#[derive(Debug, Clone, PartialEq, Deserialize, ToSchema)]
pub struct NewAnswer {
    /// Idempotency key, made by the browser. The same key again means the same answer.
    pub key: IdempotencyKey,
    /// Session in which the answer was given.
    pub session: SessionId,
    /// Segment that the question is about; none for the closing questions.
    pub segment: Option<SegmentId>,
    /// Id of the question.
    pub question: String,
    /// Value of the answer.
    pub value: AnswerValue,
    /// Device and time of the answer.
    #[serde(flatten)]
    pub origin: Origin,
}

/// The number of comments and answers that a surgeon's device still holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
pub struct Holding {
    /// Session in which they were given.
    pub session: SessionId,
    /// Device that holds them.
    pub device: DeviceId,
    /// Number of comments and answers whose saving the device has not seen confirmed, half-written ones included.
    pub holding: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_page_can_have_counted_is_not_kept() {
        let sight = |width, rate| Sight { picture_width: Some(width), pictures_per_second: Some(rate) }.plausible();
        let kept = Sight { picture_width: Some(512), pictures_per_second: Some(0.0) };
        assert_eq!(sight(512, 0.0), kept);
        assert_eq!(sight(0, -0.5), Sight::default());
        assert_eq!(sight(u32::MAX, 1e9), Sight::default());
        assert_eq!(Sight::default().plausible(), Sight::default());

        let day = 24 * 60 * 60 * 1000;
        let origin =
            |waited| Origin { waited_millis: Some(waited), waited_by: Some(WaitClock::WallClock), ..Origin::default() };
        assert_eq!(origin(300 * day).plausible(), origin(300 * day));
        for impossible in [-1, 50 * 365 * day, i64::MAX] {
            assert_eq!(origin(impossible).plausible(), Origin::default(), "{impossible}");
        }
    }
}

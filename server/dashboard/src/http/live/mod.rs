//! `/live`: the WebSocket that carries pictures and state to one page.
//!
//! Binary messages are frames: the length of the header (u16, little-endian), the header (JSON), the JPEG.
//! Text messages are JSON with a `type`: `session` when the session changes, `status` when the devices' state
//! does, and `beat` every few seconds, so that a page can tell a silently broken link from one with nothing to
//! say. The page acknowledges each frame that it has drawn. Only as many are under way as the round trip needs (see
//! `pace.rs`), and what is sent next is the latest at that time. So no queue forms anywhere, however slow the link. A
//! page that says it is hidden gets no frames.

mod audience;
mod link;
mod message;
mod operator;
mod pace;
mod surgeon;
mod tablet_reports;
mod tablets;

pub(super) use tablet_reports::report_tablets;
pub use tablets::OpenTablets;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Query, State};
use axum::http::HeaderMap;
use axum::http::header::USER_AGENT;
use axum::response::Response;
use bytes::Bytes;
use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use serde::Deserialize;
use tokio::sync::watch;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until, timeout};
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::AppState;
use super::credentials::Pass;
use super::error::Error;
use super::people::SignedIn;
use super::roles::Roles;
use super::shutdown::ended;
use super::tablets::{admit, no_longer_admitted};
use audience::Audience;
use link::Link;
use message::{PageMessage, ServerMessage, close, pack, tell, tenth_millis, whole_tens};
use operator::ForOperator;
use pace::Pace;
use parfocal_base::clock::Moment;
use parfocal_imaging::Size;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::{EncodedFrame, Picture, Watcher};
use parfocal_records::accounts::Token;
use parfocal_trial::role::Role;
use parfocal_trial::tablet::PictureSize;
use surgeon::ForSurgeon;
use tablets::OpenTablet;

/// Interval of pings. Browsers answer them by themselves, and the time of the answer is the network's round trip.
const PING: Duration = Duration::from_secs(1);

/// Pings from one heartbeat to the next. Pages do not hear of pings, so they get this message as well.
const PINGS_A_BEAT: u64 = 5;

/// A page that stays silent through this many pings is gone.
const PATIENT_PINGS: u32 = 10;

/// A connection is dropped if sending a message takes longer than this.
const SEND_LIMIT: Duration = Duration::from_secs(10);

/// Close code for a surgeon's page whose link is no longer valid here. It is one of the codes for private use, chosen
/// to resemble HTTP's 403.
const LINK_OVER: u16 = 4403;

/// Largest message from a page, bytes: pages send nothing longer than acknowledgements.
const LARGEST_REQUEST: usize = 1024;

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct LiveQuery {
    /// The role to be served as, of those that the browser holds; by default, the one that may see least.
    role: Option<Role>,
}

/// Pictures and state, as they come (WebSocket).
#[utoipa::path(get, path = "/live", tag = "stream", params(LiveQuery), responses(
    (status = 101, description = "WebSocket: binary messages are frames, text messages are state"),
    (status = 400, description = "The request is not for a WebSocket", body = super::error::ErrorBody),
    (status = 403, description = "The role is not held", body = super::error::ErrorBody),
    (status = 426, description = "The connection cannot become a WebSocket", body = super::error::ErrorBody)))]
async fn live(
    State(app): State<AppState>,
    roles: Roles,
    SignedIn(person): SignedIn,
    Query(query): Query<LiveQuery>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Result<Response, Error> {
    let role = roles.choose(query.role)?;
    let pass = roles.pass().filter(|_| role == Role::Surgeon);
    let token = person.filter(|_| roles.by_account_alone(role)).map(|person| person.token);
    let upgrade = upgrade.max_message_size(LARGEST_REQUEST).read_buffer_size(LARGEST_REQUEST * 4);
    let browser = headers.get(USER_AGENT).and_then(|name| name.to_str().ok()).unwrap_or_default().to_owned();
    Ok(upgrade.on_upgrade(async move |socket| match role {
        Role::Operator | Role::Researcher => attend::<ForOperator>(socket, Desk::new(app, None, token)).await,
        Role::Surgeon | Role::System => {
            let tablet = app.tablets.enter(&browser, app.clock.now());
            attend::<ForSurgeon>(socket, Desk::new(app, pass, None).of_tablet(tablet)).await;
        }
    }))
}

/// Serves one page until it leaves or the server ends.
async fn attend<A: Audience>(mut socket: WebSocket, mut desk: Desk<A>) {
    while let Ok(Some(message)) = desk.next_message(&mut socket).await {
        let last = matches!(message, Message::Close(_));
        if !matches!(timeout(SEND_LIMIT, socket.send(message)).await, Ok(Ok(()))) || last {
            break;
        }
    }
}

/// Resolves when a page with `pass` is no longer admitted; never for a page without a pass.
fn is_over(app: &AppState, pass: Option<Pass>) -> BoxFuture<'static, Error> {
    let app = AppState::clone(app);
    match pass {
        Some(pass) => async move { no_longer_admitted(&app, pass).await }.boxed(),
        None => std::future::pending().boxed(),
    }
}

/// Error: the page has left or is silent.
struct PageGone;

/// A frame that was sent and is not yet acknowledged.
struct InFlight {
    number: u64,
    size: Size,
    pixels: PictureSize,
    sent_at: Moment,
}

/// The connection to one page: what is known about the page, and what must still be sent to it.
struct Desk<A: Audience> {
    app: AppState,
    /// Set while the page is visible.
    watcher: Option<Watcher>,
    /// The viewers of a larger size, until its first frame arrives.
    coming: Option<Watcher>,
    /// The frames sent and not yet acknowledged, the oldest first.
    in_flight: VecDeque<InFlight>,
    /// How many of them there may be.
    pace: Pace,
    /// Before this, no further picture is sent.
    not_before: Instant,
    /// Pings sent so far, and when the last one was.
    pings: u64,
    pinged_at: Moment,
    /// Number of the last frame sent. Frames of a larger size take longer, and none may follow a later frame.
    last: u64,
    /// Width in cells of the last frame sent, and (`screen`) pixels of the screen that it covers; `None` until known.
    cells: Option<usize>,
    screen: Option<u32>,
    link: Link,
    /// Deadline for the next frame of a larger size.
    due: Instant,
    sessions: watch::Receiver<Option<Arc<A::Session>>>,
    statuses: watch::Receiver<Arc<ControlStatus>>,
    /// The last status sent, so that only changes are sent.
    sent_status: Option<A::Status>,
    shutdown: watch::Receiver<bool>,
    ping: tokio::time::Interval,
    /// Resolves when a surgeon's page is no longer admitted.
    over: BoxFuture<'static, Error>,
    /// The link by which a surgeon's page was let in.
    pass: Option<Pass>,
    /// The sign-in of a page that holds its role only by a personal account.
    token: Option<Token>,
    /// The operator's entry for a surgeon's tablet.
    tablet: Option<OpenTablet>,
    /// Pings since the page last sent anything.
    silent: u32,
    /// The message to send next, before any other.
    next: Option<Message>,
}

impl<A: Audience> Desk<A> {
    fn new(app: AppState, pass: Option<Pass>, token: Option<Token>) -> Self {
        let mut ping = interval(PING);
        ping.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut sessions = A::sessions(&app);
        sessions.mark_changed();

        let mut statuses = app.control.status.clone();
        statuses.mark_changed();

        Self {
            watcher: Some(join::<A>(&app, Size::Cell)),
            coming: None,
            in_flight: VecDeque::new(),
            pace: Pace::new(app.clock.now()),
            not_before: Instant::now(),
            pings: 0,
            pinged_at: app.clock.now(),
            last: 0,
            cells: None,
            screen: None,
            link: Link::new(app.live.largest(), app.clock.now()),
            due: Instant::now() + link::PATIENCE,
            sessions,
            statuses,
            sent_status: None,
            shutdown: app.shutdown.clone(),
            ping,
            over: is_over(&app, pass),
            pass,
            token,
            tablet: None,
            silent: 0,
            next: None,
            app,
        }
    }

    /// The same desk, for a surgeon's tablet.
    fn of_tablet(mut self, tablet: OpenTablet) -> Self {
        self.tablet = Some(tablet);
        self
    }

    /// Waits for the next message for the page. Never returns `Ok(None)`.
    async fn next_message(&mut self, socket: &mut WebSocket) -> Result<Option<Message>, PageGone> {
        if let Some(message) = self.next.take() {
            return Ok(Some(message));
        }

        loop {
            let message = tokio::select! {
                _ = &mut self.over => Some(close(LINK_OVER, "the link is no longer valid")),
                () = ended(&mut self.shutdown) => Some(close(close_code::AWAY, "the server is ending")),
                heard = socket.recv() => match heard {
                    Some(Ok(message)) => {
                        let answer = self.hear(&message)?;
                        self.note_tablet();
                        answer
                    }
                    _ => return Err(PageGone),
                },
                Ok(()) = self.sessions.changed() => self.session(),
                Ok(()) = self.statuses.changed() => self.status(),
                // The first ping goes before the first picture: it then tells the round trip of an empty link.
                _ = self.ping.tick() => self.ping().await?,
                next = Self::next_frame(&mut self.watcher, &mut self.coming, self.not_before, self.due),
                    if self.pings > 0 && self.in_flight.len() < self.pace.window() =>
                {
                    self.take(next)
                }
            };

            if message.is_some() {
                return Ok(message);
            }
        }
    }

    fn hear(&mut self, message: &Message) -> Result<Option<Message>, PageGone> {
        self.silent = 0;
        let text = match message {
            Message::Text(text) => text.as_str(),
            Message::Close(_) => return Err(PageGone),
            Message::Binary(_) => return Ok(Some(close(close_code::UNSUPPORTED, "text is expected"))),
            Message::Pong(payload) => {
                self.answered(payload);
                return Ok(None);
            }
            Message::Ping(_) => return Ok(None),
        };

        match serde_json::from_str(text) {
            Ok(PageMessage::Drawn { frame, held, shown }) => self.drawn(frame, held, shown),
            Ok(PageMessage::Visible { visible: false }) => {
                self.watcher = None;
                self.coming = None;
            }
            Ok(PageMessage::Visible { visible: true }) => {
                self.in_flight.clear();
                self.due = Instant::now() + link::PATIENCE;
                self.watcher.get_or_insert_with(|| join::<A>(&self.app, self.link.size()));
            }
            Ok(PageMessage::Screen { width }) => {
                self.screen = Some(width);
                self.look_at_screen();
            }
            Err(_) => return Ok(Some(close(close_code::POLICY, "unknown message"))),
        }

        Ok(None)
    }

    /// Updates the operator's entry for the surgeon's tablet.
    fn note_tablet(&self) {
        if let Some(tablet) = &self.tablet {
            let now = self.app.clock.now();
            tablet.note(self.screen, self.watcher.is_some(), self.link.carries_all(), now);
        }
    }

    /// Notes the answer to a ping.
    fn answered(&mut self, payload: &[u8]) {
        // The answer to an earlier ping, or to none, says nothing.
        if payload == self.pings.to_be_bytes() {
            let now = self.app.clock.now();
            self.pace.answered(now, now.since(self.pinged_at));
        }
    }

    /// Notes that the page is done with `frame`, which it had for `held` milliseconds and has `shown` or left out. It
    /// may then get the next one.
    fn drawn(&mut self, frame: u64, held: f64, shown: bool) {
        let full = self.in_flight.len() >= self.pace.window();
        let Some(place) = self.in_flight.iter().position(|sent| sent.number == frame) else { return };
        // Pages answer in order.
        let Some(sent) = self.in_flight.drain(..=place).next_back() else { return };

        let now = self.app.clock.now();
        let took = now.since(sent.sent_at);
        // What the page says need not be true.
        let held = Duration::try_from_secs_f64(held / 1e3).unwrap_or_default().min(took);
        if let Some(tablet) = self.tablet.as_ref().filter(|_| shown) {
            tablet.drawn(sent.pixels);
        }
        // While a larger size is coming, a frame of the previous size says nothing about it.
        if sent.size == self.link.size() {
            self.pace.drawn(now, took, held, full);
            self.link.drawn(now, took.saturating_sub(self.pace.round_trip()));
        }
        if self.coming.is_none() {
            self.due = Instant::now() + link::PATIENCE;
        }
        self.follow_link();
    }

    fn look_at_screen(&mut self) {
        if let Some((width, cells)) = self.screen.zip(self.cells) {
            self.link.screen(width, cells);
            self.follow_link();
        }
    }

    /// Joins the viewers of the size that suits the page now. Until the first frame of a larger size arrives, the page
    /// gets frames of the previous size. A smaller size replaces the previous one at once: it arrives soon, and the
    /// previous one was too slow.
    fn follow_link(&mut self) {
        let size = self.link.size();
        let Some(watcher) = &mut self.watcher else { return };
        if self.coming.as_ref().unwrap_or(watcher).size() == size {
            return;
        }

        tracing::debug!(size = size.name(), "a viewer's pictures change size");
        self.pace.resize(self.app.clock.now());
        self.coming = (size > watcher.size()).then(|| join::<A>(&self.app, size));
        if size < watcher.size() {
            *watcher = join::<A>(&self.app, size);
        }
        self.due = Instant::now() + link::PATIENCE;
    }

    fn session(&mut self) -> Option<Message> {
        // The tablet may not see this session; its connection is about to be closed.
        if self.pass.is_some_and(|pass| admit(&self.app, pass).is_err()) {
            return None;
        }

        // Whether a policy may be named depends on the session.
        self.statuses.mark_changed();
        let view = self.sessions.borrow_and_update().clone();
        tell(&ServerMessage::<_, A::Status>::Session { view: view.as_deref() })
    }

    fn status(&mut self) -> Option<Message> {
        let status = A::status(&self.statuses.borrow_and_update(), &self.app);
        if self.sent_status.as_ref() == Some(&status) {
            return None;
        }

        let message = tell(&ServerMessage::<&A::Session, _>::Status(&status));
        self.sent_status = Some(status);
        message
    }

    /// Waits for the next frame for a visible page; waits forever for a hidden one. A frame of a larger size must come
    /// before `due`. Dropping the future loses nothing.
    async fn next_frame(
        watcher: &mut Option<Watcher>,
        coming: &mut Option<Watcher>,
        not_before: Instant,
        due: Instant,
    ) -> Next {
        let Some(watcher) = watcher else { return std::future::pending().await };
        sleep_until(not_before).await;
        let waits = coming.as_ref().unwrap_or(watcher).size() != Size::Cell;

        tokio::select! {
            biased;
            frame = next_of(coming) => frame.map_or(Next::Ended, Next::Changed),
            frame = watcher.next() => frame.map_or(Next::Ended, Next::Frame),
            () = sleep_until(due), if waits => Next::Missed,
        }
    }

    fn take(&mut self, next: Next) -> Option<Message> {
        match next {
            Next::Frame(frame) => self.frame(&frame),
            Next::Changed(frame) => {
                self.watcher = self.coming.take();
                self.frame(&frame)
            }
            Next::Missed => {
                self.link.missed(self.app.clock.now());
                self.follow_link();
                None
            }
            Next::Ended => {
                self.watcher = None;
                self.coming = None;
                None
            }
        }
    }

    fn frame(&mut self, frame: &EncodedFrame) -> Option<Message> {
        let picture = &frame.picture;
        let size = self.watcher.as_ref()?.size();
        if picture.number <= self.last {
            return None;
        }

        let now = self.app.clock.now();
        let age = now.since(picture.exposed_at);
        let travel = whole_tens(self.pace.travel());
        let message =
            pack(&A::header(frame, tenth_millis(age), travel, self.link.is_reduced(), &self.app), &picture.jpeg)?;

        self.last = picture.number;
        self.not_before = Instant::now() + self.pace.gap();
        self.in_flight.push_back(InFlight { number: picture.number, size, pixels: pixels(picture), sent_at: now });
        self.app.metrics.frames_sent.inc();
        self.app.metrics.bytes_sent.inc_by(message.len() as u64);

        let cells = Some(picture.width / picture.per_cell);
        if self.cells != cells {
            self.cells = cells;
            self.look_at_screen();
        }
        Some(Message::Binary(message))
    }

    async fn ping(&mut self) -> Result<Option<Message>, PageGone> {
        self.silent += 1;
        if self.silent > PATIENT_PINGS {
            return Err(PageGone);
        }

        let beats = self.pings.is_multiple_of(PINGS_A_BEAT);
        self.pings += 1;
        self.pinged_at = self.app.clock.now();
        let ping = Message::Ping(Bytes::copy_from_slice(&self.pings.to_be_bytes()));
        if !beats {
            return Ok(Some(ping));
        }

        if let Some(token) = &self.token
            && self.app.accounts.has_ended(token).await.unwrap_or(false)
        {
            return Ok(Some(close(close_code::POLICY, "the sign-in has ended")));
        }

        self.next = tell(&ServerMessage::<&A::Session, &A::Status>::Beat);
        Ok(Some(ping))
    }
}

/// The size of `picture`.
fn pixels(picture: &Picture) -> PictureSize {
    let pixels = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
    PictureSize { width: pixels(picture.width), height: pixels(picture.height) }
}

/// Joins the viewers of `size`.
fn join<A: Audience>(app: &AppState, size: Size) -> Watcher {
    if A::LEADS { app.live.lead(size) } else { app.live.watch(size) }
}

/// The next frame of the size `coming`; waits forever if there is none.
async fn next_of(coming: &mut Option<Watcher>) -> Option<Arc<EncodedFrame>> {
    match coming {
        Some(coming) => coming.next().await,
        None => std::future::pending().await,
    }
}

/// Result of waiting for a frame.
enum Next {
    Frame(Arc<EncodedFrame>),
    /// The first frame of a larger size.
    Changed(Arc<EncodedFrame>),
    /// A larger size did not come in time.
    Missed,
    /// No more frames will come.
    Ended,
}

/// The routes of this file.
pub fn routes() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(live))
}

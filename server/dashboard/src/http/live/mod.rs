//! `/live`: the WebSocket that carries pictures and state to one page.
//!
//! Binary messages are frames: the length of the header (u16, little-endian), the header (JSON), the JPEG.
//! Text messages are JSON with a `type`: `session` when the session changes, `status` when the devices' state
//! does, and `beat` every few seconds, so that a page can tell a silently broken link from one with nothing to
//! say. The page acknowledges each frame that it has drawn. Only as many are under way as the round trip needs (see
//! `pace.rs` and `pictures.rs`), and what is sent next is the latest at that time. So no queue forms anywhere, however
//! slow the link. A page that says it is hidden gets no frames.

mod audience;
mod heartbeat;
mod link;
mod message;
mod operator;
mod pace;
mod pictures;
mod surgeon;
mod tablet_reports;
mod tablets;

pub(super) use tablet_reports::report_tablets;
pub use tablets::OpenTablets;

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade, close_code};
use axum::extract::{Extension, Query, State};
use axum::http::HeaderMap;
use axum::http::header::USER_AGENT;
use axum::response::Response;
use futures_util::future::BoxFuture;
use serde::Deserialize;
use tokio::sync::watch;
use tokio::time::timeout;
use utoipa::IntoParams;

use super::AppState;
use super::admission::{Ground, Over, admit, over};
use super::connections::ended;
use super::error::Error;
use super::people::SignedIn;
use super::permits::Permit;
use super::roles::Roles;
use audience::{Audience, Journey};
use heartbeat::Heartbeat;
use message::{PageMessage, ServerMessage, close, pack, tell, tenth_millis, whole_tens};
use operator::ForOperator;
use parfocal_pipeline::control::ControlStatus;
use parfocal_pipeline::live::{DepthMap, DepthMaps, EncodedFrame};
use parfocal_trial::role::Role;
use pictures::Pictures;
use surgeon::ForSurgeon;
use tablets::OpenTablet;

/// A connection is dropped if sending a message takes longer than this.
const SEND_LIMIT: Duration = Duration::from_secs(10);

/// Close code for a surgeon's page whose link is no longer valid here. It is one of the codes for private use, chosen
/// to resemble HTTP's 403.
const LINK_OVER: u16 = 4403;

/// A depth map is sent with pictures exposed at most so long after its own frame. On a busy machine maps come more
/// slowly than pictures.
const MAP_AGE: Duration = Duration::from_secs(1);

/// Largest message from a page, bytes: pages send nothing longer than acknowledgements.
const LARGEST_REQUEST: usize = 1024;

#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct LiveQuery {
    /// The role to be served as, of those that the browser holds; by default, the one that may see least.
    role: Option<Role>,
}

/// Pictures and state, as they come (WebSocket).
#[utoipa::path(get, path = "/live", tag = "stream", params(LiveQuery), responses(
    (status = 101, description = "WebSocket: binary messages are frames, text messages are state"),
    (status = 400, description = "The request is not for a WebSocket"),
    (status = 403, description = "The role is not held"),
    (status = 426, description = "The connection cannot become a WebSocket")))]
pub(super) async fn live(
    State(app): State<AppState>,
    roles: Roles,
    SignedIn(person): SignedIn,
    Query(query): Query<LiveQuery>,
    headers: HeaderMap,
    permit: Option<Extension<Arc<Permit>>>,
    upgrade: WebSocketUpgrade,
) -> Result<Response, Error> {
    let role = roles.choose(query.role)?;
    let ground = roles.ground(role, person);
    let upgrade = upgrade.max_message_size(LARGEST_REQUEST).read_buffer_size(LARGEST_REQUEST * 4);
    let browser = headers.get(USER_AGENT).and_then(|name| name.to_str().ok()).unwrap_or_default().to_owned();
    Ok(upgrade.on_upgrade(async move |socket| {
        // It counts as a connection until the page has left.
        let _permit = permit;
        match role {
            Role::Operator | Role::Researcher => {
                attend::<ForOperator>(socket, PageConnection::new(app, ground, None)).await;
            }
            Role::Surgeon | Role::System => {
                attend::<ForSurgeon>(socket, PageConnection::new(app, ground, Some(browser))).await;
            }
        }
    }))
}

/// Serves one page until it leaves or the server ends.
async fn attend<A: Audience>(mut socket: WebSocket, mut connection: PageConnection<A>) {
    while let Ok(Some(message)) = connection.next_message(&mut socket).await {
        let last = matches!(message, Message::Close(_));
        if !matches!(timeout(SEND_LIMIT, socket.send(message)).await, Ok(Ok(()))) || last {
            break;
        }
    }
}

/// Error: the page has left or is silent.
struct PageGone;

/// The connection to one page: what the page was told, and what must still be sent to it.
struct PageConnection<A: Audience> {
    app: AppState,
    pictures: Pictures,
    heartbeat: Heartbeat,
    /// What lets the page stay.
    ground: Option<Ground>,
    /// Resolves when the page may no longer stay.
    over: BoxFuture<'static, Over>,
    sessions: watch::Receiver<Option<Arc<A::Session>>>,
    statuses: watch::Receiver<Arc<ControlStatus>>,
    /// The depth maps, while the page wants them.
    depth_maps: Option<DepthMaps>,
    /// The last status sent, so that only changes are sent.
    sent_status: Option<A::Status>,
    shutdown: watch::Receiver<bool>,
    /// What the browser of a surgeon's page calls itself, until the page's first message.
    surgeons_browser: Option<String>,
    /// The operator's entry for a surgeon's tablet, from the page's first message on. The page that tries a tablet also
    /// opens a connection, but sends nothing and does not count.
    tablet: Option<OpenTablet>,
    /// The message to send next, before any other.
    next: Option<Message>,
}

impl<A: Audience> PageConnection<A> {
    fn new(app: AppState, ground: Option<Ground>, surgeons_browser: Option<String>) -> Self {
        let mut sessions = A::sessions(&app);
        sessions.mark_changed();

        let mut statuses = app.control.status.clone();
        statuses.mark_changed();

        Self {
            pictures: Pictures::new(&app.live, A::LEADS, &app.clock, app.control.status.clone()),
            heartbeat: Heartbeat::new(app.clock.now()),
            over: Box::pin(over(AppState::clone(&app), ground.clone())),
            ground,
            sessions,
            statuses,
            depth_maps: None,
            sent_status: None,
            shutdown: app.shutdown.clone(),
            surgeons_browser,
            tablet: None,
            next: None,
            app,
        }
    }

    /// Waits for the next message for the page. Never returns `Ok(None)`.
    async fn next_message(&mut self, socket: &mut WebSocket) -> Result<Option<Message>, PageGone> {
        if let Some(message) = self.next.take() {
            return Ok(Some(message));
        }

        loop {
            let message = tokio::select! {
                over = &mut self.over => Some(match over {
                    Over::Link => close(LINK_OVER, "the link is no longer valid"),
                    Over::SignIn => close(close_code::POLICY, "the sign-in has ended"),
                }),
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
                _ = self.heartbeat.due.tick() => self.ping()?,
                frame = self.pictures.next(), if self.heartbeat.has_begun() && self.pictures.may_send() => {
                    frame.and_then(|frame| self.picture(&frame))
                }
            };

            if message.is_some() {
                return Ok(message);
            }
        }
    }

    fn hear(&mut self, message: &Message) -> Result<Option<Message>, PageGone> {
        self.heartbeat.heard();
        let text = match message {
            Message::Text(text) => text.as_str(),
            Message::Close(_) => return Err(PageGone),
            Message::Binary(_) => return Ok(Some(close(close_code::UNSUPPORTED, "text is expected"))),
            Message::Pong(payload) => {
                if let Some(took) = self.heartbeat.answered(payload, self.app.clock.now()) {
                    self.pictures.answered(took);
                }
                return Ok(None);
            }
            Message::Ping(_) => return Ok(None),
        };

        if let Some(browser) = self.surgeons_browser.take() {
            self.tablet = Some(self.app.tablets.enter(&browser, self.app.clock.now()));
        }
        match serde_json::from_str(text) {
            Ok(PageMessage::Drawn { frame, held, shown }) => {
                let pixels = self.pictures.drawn(frame, held).filter(|_| shown);
                if let Some((tablet, pixels)) = self.tablet.as_ref().zip(pixels) {
                    tablet.drawn(pixels);
                }
            }
            Ok(PageMessage::Visible { visible }) => self.pictures.visible(visible),
            Ok(PageMessage::Screen { width }) => self.pictures.screen(width),
            Ok(PageMessage::Depths { wanted: false }) => self.depth_maps = None,
            Ok(PageMessage::Depths { wanted: true }) => match A::depth_maps(&self.app) {
                Some(maps) => self.depth_maps = Some(maps),
                None => return Ok(Some(close(close_code::POLICY, "not for this page"))),
            },
            Err(_) => return Ok(Some(close(close_code::POLICY, "unknown message"))),
        }

        Ok(None)
    }

    /// Updates the operator's entry for the surgeon's tablet.
    fn note_tablet(&self) {
        if let Some(tablet) = &self.tablet {
            let (width, visible) = self.pictures.on_screen();
            tablet.note(width, visible, self.pictures.carries_all(), self.app.clock.now());
        }
    }

    fn session(&mut self) -> Option<Message> {
        // A page that may not see the session is about to be closed.
        if let Some(Ground::Link(pass)) = self.ground
            && admit(&self.app, pass).is_err()
        {
            return None;
        }

        // Whether a policy may be named depends on the session.
        self.statuses.mark_changed();
        let view = self.sessions.borrow_and_update().clone();
        tell(&ServerMessage::<_, A::Status>::Session { view: view.as_deref() })
    }

    fn status(&mut self) -> Option<Message> {
        // A copy: the loop waits for whoever holds its status.
        let status = Arc::clone(&self.statuses.borrow_and_update());
        let status = A::status(&status, &self.app);
        if self.sent_status.as_ref() == Some(&status) {
            return None;
        }

        let message = tell(&ServerMessage::<&A::Session, _>::Status(&status));
        self.sent_status = Some(status);
        message
    }

    fn picture(&mut self, frame: &EncodedFrame) -> Option<Message> {
        let picture = &frame.picture;
        let journey = Journey {
            age_ms: tenth_millis(self.app.clock.now().since(picture.exposed_at)),
            travel_ms: whole_tens(self.pictures.travel()),
            reduced: self.pictures.is_reduced(),
        };
        let depths = self.depth_maps.as_ref().and_then(|maps| maps.borrow().clone());
        let is_recent = |map: &Arc<DepthMap>| picture.exposed_at.since(map.exposed_at) < MAP_AGE;
        let header = A::header(frame, journey, depths.filter(is_recent), &self.app);
        let message = pack(&header, &picture.jpeg)?;

        self.pictures.sent(picture);
        self.app.metrics.frames_sent.inc();
        self.app.metrics.bytes_sent.inc_by(message.len() as u64);
        Some(Message::Binary(message))
    }

    fn ping(&mut self) -> Result<Option<Message>, PageGone> {
        let (ping, beats) = self.heartbeat.ping(self.app.clock.now()).ok_or(PageGone)?;
        if beats {
            self.next = tell(&ServerMessage::<&A::Session, &A::Status>::Beat);
        }
        Ok(Some(ping))
    }
}

//! OpenIGTLink, by which surgical navigation (3D Slicer) sees the live picture.
//!
//! The messages are our own, because the crate `openigtlink-rust` (0.4) brings sockets, TLS and a logger along with
//! them, and may panic. A thread of low priority makes each picture once for all clients. Every client gets the latest
//! one when it can take it, so a slow one delays nobody.

mod client;
mod disconnections;
mod frame_messages;
mod message;

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use jiff::SignedDuration;
use tokio::net::TcpListener;
use tokio::runtime::Handle;
use tokio::sync::{Notify, watch};
use tokio::time::{MissedTickBehavior, interval, sleep};

use self::disconnections::Disconnections;
use self::frame_messages::FrameMessages;
use crate::control::{ControlStatus, ControlledFrame};
use crate::live::LiveHandle;
use parfocal_base::clock::Clock;
use parfocal_base::guarded;
use parfocal_base::priority;
use parfocal_base::step::Hold;
use parfocal_devices::camera::FrameImage;
use parfocal_imaging::{Developer, GrayImage, RgbImage, Size};

/// Clients at a time.
const MOST_CLIENTS: usize = 16;
/// Pause after the system refused a connection, such as when it has no file left.
const REFUSED: Duration = Duration::from_millis(200);

/// Where pictures and states come from.
pub struct LinkSource {
    /// The loop's frames.
    pub live: LiveHandle,
    /// The loop's state.
    pub status: watch::Receiver<Arc<ControlStatus>>,
    /// Makes pictures of mosaics.
    pub developer: Developer,
    /// Whether a session hides the focal power now.
    pub blinded: Box<dyn Fn() -> bool + Send + Sync>,
    /// The clock.
    pub clock: Arc<dyn Clock>,
    /// Turns true when the server ends.
    pub shutdown: watch::Receiver<bool>,
}

/// What clients get.
#[derive(Debug, Clone, Copy)]
pub struct LinkSettings {
    /// Size of the pictures.
    pub size: Size,
    /// Most pictures a second.
    pub rate: u32,
}

/// Serves clients on `listener` until the server ends.
///
/// # Errors
/// If the system has no thread left.
pub async fn run(listener: TcpListener, source: LinkSource, settings: LinkSettings) -> io::Result<()> {
    let source = Arc::new(source);
    let (messages, _) = watch::channel(None);
    let arrived = Arc::new(Notify::new());

    let publisher = FramePublisher {
        source: Arc::clone(&source),
        settings,
        developer: source.developer.clone(),
        messages: messages.clone(),
        arrived: Arc::clone(&arrived),
    };
    let runtime = Handle::current();
    std::thread::Builder::new().name("openigtlink".into()).spawn(move || {
        priority::lower_further();
        runtime.block_on(publisher.run());
    })?;

    let mut shutdown = source.shutdown.clone();
    tokio::select! {
        () = accept(&listener, &source, &messages, &arrived) => {}
        _ = shutdown.wait_for(|ended| *ended) => {}
    }
    Ok(())
}

async fn accept(
    listener: &TcpListener,
    source: &Arc<LinkSource>,
    messages: &watch::Sender<Option<Arc<FrameMessages>>>,
    arrived: &Notify,
) {
    let clients = Arc::new(AtomicUsize::new(0));
    let disconnections = Arc::new(Disconnections::default());
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            sleep(REFUSED).await;
            continue;
        };
        if clients.load(Ordering::Relaxed) >= MOST_CLIENTS {
            disconnections.log(source.clock.now(), peer, "as many others are connected as can be");
            continue;
        }

        clients.fetch_add(1, Ordering::Relaxed);
        let mut latest = messages.subscribe();
        // A picture made earlier is stale.
        latest.mark_unchanged();
        arrived.notify_one();

        let (source, clients) = (Arc::clone(source), Arc::clone(&clients));
        let disconnections = Arc::clone(&disconnections);
        tokio::spawn(async move {
            let mut shutdown = source.shutdown.clone();
            tokio::select! {
                () = client::serve(stream, peer, latest, &source, &disconnections) => {}
                _ = shutdown.wait_for(|ended| *ended) => {}
            }
            clients.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// How the devices are: the protocol's code and name, and words. The words are those that a surgeon may read: nothing
/// that tells one policy from another.
fn condition(status: &ControlStatus) -> (u16, &'static str, &'static str) {
    const OK: u16 = 1;
    const HARDWARE_FAILURE: u16 = 18;

    if !status.camera.working {
        (HARDWARE_FAILURE, "Camera", "The camera is not delivering pictures.")
    } else if status.held == Some(Hold::LensFailed) {
        (HARDWARE_FAILURE, "Lens", "The lens does not answer; the focus is being held.")
    } else {
        (OK, "OK", "The camera delivers pictures.")
    }
}

/// Makes the pictures while there are clients.
struct FramePublisher {
    source: Arc<LinkSource>,
    settings: LinkSettings,
    developer: Developer,
    messages: watch::Sender<Option<Arc<FrameMessages>>>,
    arrived: Arc<Notify>,
}

impl FramePublisher {
    async fn run(mut self) {
        let mut shutdown = self.source.shutdown.clone();
        let source = Arc::clone(&self.source);
        tokio::select! {
            () = self.work(&source) => {}
            _ = shutdown.wait_for(|ended| *ended) => {}
        }
    }

    async fn work(&mut self, source: &LinkSource) {
        /// Time after which a client that left is noticed while no frames come.
        const LOOK: Duration = Duration::from_secs(1);

        let mut rgb = RgbImage::default();
        let mut gray = GrayImage::default();
        let mut due = interval(Duration::from_secs(1) / self.settings.rate.max(1));
        due.set_missed_tick_behavior(MissedTickBehavior::Delay);

        loop {
            self.arrived.notified().await;
            let mut frames = source.live.frames();
            while self.messages.receiver_count() > 0 {
                due.tick().await;
                tokio::select! {
                    changed = frames.changed() => if changed.is_err() { return },
                    () = sleep(LOOK) => continue,
                }

                let frame = frames.borrow_and_update().clone();
                let Some(frame) = frame else { continue };
                // One bad picture must not end the thread: its clients would get no more.
                if let Ok(messages) = guarded(|| self.messages_of(&frame, source, &mut rgb, &mut gray)) {
                    self.messages.send_replace(Some(Arc::new(messages)));
                } else {
                    tracing::error!("OpenIGTLink: a picture could not be made; continuing with the next");
                }
            }
            self.messages.send_replace(None);
        }
    }

    fn messages_of(
        &mut self,
        frame: &ControlledFrame,
        source: &LinkSource,
        rgb: &mut RgbImage,
        gray: &mut GrayImage,
    ) -> FrameMessages {
        let now = source.clock.now();
        let age = SignedDuration::try_from(now.since(frame.frame.exposed_at)).unwrap_or_default();
        let at = source.clock.wall().checked_sub(age).unwrap_or_default();
        let number = frame.frame.number as u32;
        let hidden = frame.left_by_session || (source.blinded)();
        let focal_power = frame.record.measured.filter(|_| !hidden).map(f64::from);

        match &frame.frame.image {
            FrameImage::Rgb(picture) => FrameMessages::new(picture, 1.0, at, number, focal_power),
            FrameImage::Mosaic(mosaic) => {
                self.developer.develop(mosaic, self.settings.size, rgb, gray);
                // Both sizes cover the same area.
                FrameMessages::new(rgb, 1.0 / self.settings.size.per_cell() as f32, at, number, focal_power)
            }
        }
    }
}

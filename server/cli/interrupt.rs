//! Signals that end a command. Ctrl-C for those that save what they have: the first asks them to stop, the second ends
//! the process at once. Whatever ends it, every lens is let go first.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use tokio::signal::unix::{SignalKind, signal};

use crate::lens;
use crate::notices::tell;

/// Ends the process as `signal` does where nobody listens, once every lens is let go. (An exit would take libtorch down
/// while another thread computes with it.)
fn end_by(signal: i32) {
    lens::let_go_of_all();
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

/// From now on lenses are let go before Ctrl-C, an order to end, or the end of the terminal ends the process. For
/// commands that need not be asked to stop.
///
/// # Errors
/// When the system has no thread or signal handler left.
pub fn let_lenses_go_first() -> io::Result<()> {
    listen(&[SIGINT, SIGTERM, SIGHUP, SIGQUIT])
}

/// The same for commands whose Ctrl-C an [`Interrupt`] listens to.
///
/// # Errors
/// When the system has no thread or signal handler left.
pub fn let_lenses_go_first_beside_an_interrupt() -> io::Result<()> {
    listen(&[SIGTERM, SIGHUP, SIGQUIT])
}

fn listen(ending: &[i32]) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let within = runtime.enter();

    for &ending in ending {
        let mut heard = signal(SignalKind::from_raw(ending))?;
        runtime.spawn(async move {
            heard.recv().await;
            end_by(ending);
        });
    }
    drop(within);

    let thread = std::thread::Builder::new().name("signals".to_owned());
    thread.spawn(move || runtime.block_on(std::future::pending::<()>()))?;
    Ok(())
}

/// Whether Ctrl-C was pressed, and whether anything is left to save then.
#[derive(Debug, Clone, Default)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    saved: Arc<AtomicBool>,
}

impl Interrupt {
    /// Begins to listen. The first Ctrl-C says `notice`.
    ///
    /// # Errors
    /// When the system has no thread or signal handler left.
    pub fn listen(notice: String) -> io::Result<Self> {
        let interrupt = Self::default();
        let heard = interrupt.clone();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;

        std::thread::Builder::new().name("interrupt".to_owned()).spawn(move || {
            runtime.block_on(async {
                while tokio::signal::ctrl_c().await.is_ok() {
                    if heard.asked.swap(true, Ordering::Relaxed) || heard.saved.load(Ordering::Relaxed) {
                        end_by(SIGINT);
                    }
                    tell(format_args!("{notice}; Ctrl-C again to stop at once"));
                }
            });
        })?;

        Ok(interrupt)
    }

    /// Whether to stop.
    #[must_use]
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// From now on Ctrl-C ends the process at once: all there is to save is saved.
    pub fn all_is_saved(&self) {
        self.saved.store(true, Ordering::Relaxed);
    }
}

//! Ctrl-C for commands that save what they have: the first asks them to stop, the second ends the process at once.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::notices::tell;

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
                        // As though nobody listened. An exit would take libtorch down while another thread computes with it.
                        let _ = signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGINT);
                    }
                    tell(format_args!("{notice}; Ctrl-C again to leave at once"));
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

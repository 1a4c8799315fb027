//! Signals that end a command. For commands that save their work, the first Ctrl-C or SIGTERM asks them to stop, and the
//! second ends the process at once. Every lens is released before the process ends.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use tokio::signal::unix::{SignalKind, signal};

use parfocal_base::notices::tell;
use parfocal_devices::lens;

/// Releases every lens, then ends the process as `signal` does by default. (A normal exit would destroy libtorch while
/// another thread computes with it.)
fn end_by(signal: i32) {
    lens::let_go_of_all();
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}

/// Makes SIGINT (Ctrl-C), SIGTERM, SIGHUP (the terminal closes) and SIGQUIT release all lenses before they end the
/// process. For commands that have nothing to save.
///
/// # Errors
/// If the system cannot provide a thread or a signal handler.
pub fn let_lenses_go_first() -> io::Result<()> {
    undo_before_the_end(|| {})
}

/// The same, and calls `undo` before that.
///
/// # Errors
/// If the system cannot provide a thread or a signal handler.
pub fn undo_before_the_end(undo: impl Fn() + Clone + Send + 'static) -> io::Result<()> {
    listen(&[SIGINT, SIGTERM, SIGHUP, SIGQUIT], undo)
}

/// The same for the signals that an [`Interrupt`] does not handle.
///
/// # Errors
/// If the system cannot provide a thread or a signal handler.
pub fn let_lenses_go_first_beside_an_interrupt() -> io::Result<()> {
    listen(&[SIGHUP, SIGQUIT], || {})
}

/// The same for the signals that an [`Interrupt`] does not handle that [asks at a hangup](Interrupt::ask_at_hangup).
///
/// # Errors
/// If the system cannot provide a thread or a signal handler.
pub fn let_lenses_go_first_at_sigquit() -> io::Result<()> {
    listen(&[SIGQUIT], || {})
}

fn listen(ending: &[i32], undo: impl Fn() + Clone + Send + 'static) -> io::Result<()> {
    on_a_thread("signals", || {
        for &ending in ending {
            let mut heard = signal(SignalKind::from_raw(ending))?;
            let undo = undo.clone();
            tokio::spawn(async move {
                heard.recv().await;
                undo();
                end_by(ending);
            });
        }
        Ok(std::future::pending())
    })
}

/// Runs what `listen` returns on a thread of its own, which ends with the process.
fn on_a_thread<W>(name: &str, listen: impl FnOnce() -> io::Result<W>) -> io::Result<()>
where
    W: Future<Output = ()> + Send + 'static,
{
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let within = runtime.enter();
    let waiting = listen()?;
    drop(within);

    let thread = std::thread::Builder::new().name(name.to_owned());
    thread.spawn(move || runtime.block_on(waiting))?;
    Ok(())
}

/// Whether Ctrl-C was pressed or SIGTERM came, and what to say then once everything is saved.
#[derive(Debug, Clone, Default)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    saved: Arc<OnceLock<String>>,
}

impl Interrupt {
    /// Starts to listen. The first signal prints `notice`.
    ///
    /// # Errors
    /// If the system cannot provide a thread or a signal handler.
    pub fn listen(notice: String) -> io::Result<Self> {
        let interrupt = Self::default();
        let heard = interrupt.clone();
        on_a_thread("interrupt", move || {
            let mut interrupted = signal(SignalKind::interrupt())?;
            let mut terminated = signal(SignalKind::terminate())?;
            Ok(async move {
                loop {
                    let ending = tokio::select! {
                        _ = interrupted.recv() => SIGINT,
                        _ = terminated.recv() => SIGTERM,
                    };
                    let is_asked_again = heard.asked.swap(true, Ordering::Relaxed);
                    let saved = heard.saved.get();
                    if let Some(notice) = saved {
                        tell(format_args!("{notice}"));
                    }
                    if is_asked_again || saved.is_some() {
                        end_by(ending);
                    }
                    tell(format_args!("{notice}; Ctrl-C again to stop at once"));
                }
            })
        })?;

        Ok(interrupt)
    }

    /// Makes SIGHUP (the terminal closes) ask as well. However often it comes, it never ends the process at once: a shell
    /// and the system may both send it.
    ///
    /// # Errors
    /// If the system cannot provide a signal handler.
    pub fn ask_at_hangup(&self) -> io::Result<()> {
        signal_hook::flag::register(SIGHUP, Arc::clone(&self.asked)).map(drop)
    }

    /// Whether Ctrl-C was pressed or SIGTERM came, so that the command should stop.
    pub fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }

    /// From now on either prints `notice` and ends the process at once, because everything is saved.
    pub fn all_is_saved(&self, notice: String) {
        let _ = self.saved.set(notice);
    }
}

//! A server within the test program, for what needs neither a process of its own nor a camera: HTTP on a port, the
//! rules, and the records on a disk. Its clock stands still.

use std::net::{IpAddr, SocketAddr};
use std::path::Path;

use parfocal_base::clock::{Clock, ManualClock, SystemClock};
use parfocal_dashboard::http::{self, ServerAddress};
use tokio::net::TcpListener;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;

use super::app::app;
use super::fixture::Trial;

/// A running server; ends when dropped.
pub struct InProcess {
    trial: Trial,
    end: watch::Sender<bool>,
    runtime: Option<Runtime>,
    /// Address on which it listens.
    pub address: SocketAddr,
}

impl InProcess {
    /// Starts a server on the data in `folder`, which listens on a free port of `address`.
    pub fn start(folder: &Path, address: IpAddr, protocols: Option<&Path>) -> Self {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
        let (end, shutdown) = watch::channel(false);

        let starting = async {
            // Commands on the same data use the machine's clock.
            let clock = ManualClock::new(SystemClock.wall());
            let trial = Trial::empty(folder, protocols, 7, clock).await;
            let listener = TcpListener::bind((address, 0)).await.unwrap();
            let address = listener.local_addr().unwrap();
            let app = app(&trial, folder, ServerAddress::new(address, None), shutdown);
            tokio::spawn(trial.conductor.clone().run());
            tokio::spawn(http::run(listener, app, None));
            (trial, address)
        };
        // A thread of its own, because this is called within a test's runtime.
        let (trial, address) = on_a_thread(|| runtime.block_on(starting));
        Self { trial, end, runtime: Some(runtime), address }
    }
}

impl Drop for InProcess {
    fn drop(&mut self) {
        let _ = self.end.send(true);
        // Ends the threads that wait for pictures.
        self.trial.control.frames.close();
        on_a_thread(|| drop(self.runtime.take()));
    }
}

/// Does `work` on a thread of its own, where it may wait.
pub fn on_a_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    std::thread::scope(|scope| scope.spawn(work).join().unwrap())
}

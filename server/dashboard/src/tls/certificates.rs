//! The server's present certificate, and how it is kept up to date.

use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use arc_swap::ArcSwap;
use jiff::Timestamp;
use tokio::task::spawn_blocking;
use tokio::time::{MissedTickBehavior, interval};
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::{CryptoProvider, ring};
use tokio_rustls::rustls::server::{ClientHello, ResolvesServerCert};
use tokio_rustls::rustls::sign::CertifiedKey;

use super::TlsError;
use super::authority::{Authority, PublicAuthority};
use super::facts::Facts;
use super::given::{Contents, Files};
use super::names::Names;
use parfocal_base::clock::Clock;

/// A local certificate is replaced this long before it ends. For a given certificate, warnings begin this long before
/// its end.
const BEFORE_THE_END: Duration = Duration::from_hours(30 * 24);

/// How often the certificate is checked. The machine's addresses change when a cable is plugged in.
const LOOK_EVERY: Duration = Duration::from_mins(1);

/// How often the log warns about a certificate that ends soon.
const WARN_EVERY: Duration = Duration::from_hours(24);

/// The certificate that the server shows, and its source.
pub struct Certificates {
    source: Source,
    provider: Arc<CryptoProvider>,
    shown: ArcSwap<CurrentCertificate>,
}

/// Where certificates come from.
enum Source {
    /// The local authority signs them, for a server that listens on the address `listening`.
    Local { authority: Box<Authority>, listening: IpAddr },
    /// Two files hold them.
    Given { files: Files, last: Mutex<LastLook> },
}

/// What was last found in the two files of a given certificate.
struct LastLook {
    contents: Contents,
    /// Whether it is in use. If not, it was bad when it was found.
    in_use: bool,
}

/// The certificate that the server shows now.
struct CurrentCertificate {
    key: Arc<CertifiedKey>,
    facts: Facts,
    /// Names that a local certificate was requested for.
    wanted: Names,
}

impl Certificates {
    /// Certificates signed by the local authority in `data_dir`, for a server that listens on `listening`.
    ///
    /// # Errors
    /// If the authority cannot be read or stored, is damaged, or is not valid now.
    pub fn local(data_dir: &Path, listening: IpAddr, now: Timestamp) -> Result<Self, TlsError> {
        let provider = Arc::new(ring::default_provider());
        let authority = Box::new(Authority::load_or_create(data_dir, now)?);
        let shown = signed(&authority, Names::of_machine(listening), &provider, now)?;
        let source = Source::Local { authority, listening };
        Ok(Self { source, provider, shown: ArcSwap::from_pointee(shown) })
    }

    /// The certificate in the file `certificate`, with the private key in the file `key`. Both are in PEM form.
    ///
    /// # Errors
    /// If a file cannot be read, or the certificate cannot be used now.
    pub fn given(certificate: PathBuf, key: PathBuf, now: Timestamp) -> Result<Self, TlsError> {
        let provider = Arc::new(ring::default_provider());
        let files = Files { certificate, key };
        let contents = files.read()?;
        let (key, facts) = files.check(&contents, &provider, now)?;

        let shown = CurrentCertificate { key, facts, wanted: Names::default() };
        let source = Source::Given { files, last: Mutex::new(LastLook { contents, in_use: true }) };
        Ok(Self { source, provider, shown: ArcSwap::from_pointee(shown) })
    }

    /// The local authority, which devices must trust first; none if the certificate was given.
    pub fn authority(&self) -> Option<&PublicAuthority> {
        match &self.source {
            Source::Local { authority, .. } => Some(&authority.public),
            Source::Given { .. } => None,
        }
    }

    /// Host and port for links to a server that is reached at `address`. If the certificate does not list the address,
    /// the host is a name that it lists.
    pub fn host(&self, address: SocketAddr) -> String {
        let shown = self.shown.load();
        let names = &shown.facts.names;
        let name = names.hosts.iter().find(|host| !host.starts_with('*') && *host != "localhost");
        // The machine has just got another address. Within a minute, its local certificate will list that too.
        let is_new = matches!(self.source, Source::Local { .. }) && !shown.wanted.addresses.contains(&address.ip());

        match name {
            Some(name) if !names.addresses.contains(&address.ip()) && !address.ip().is_loopback() && !is_new => {
                format!("{name}:{}", address.port())
            }
            _ => address.to_string(),
        }
    }

    /// The TLS settings for connections. Each connection gets the certificate that is current when it begins.
    /// Connections use HTTP/2 or HTTP/1.1.
    ///
    /// # Errors
    /// If the cryptography cannot be set up.
    pub fn settings(self: &Arc<Self>) -> Result<Arc<ServerConfig>, TlsError> {
        let mut settings = ServerConfig::builder_with_provider(Arc::clone(&self.provider))
            .with_safe_default_protocol_versions()?
            .with_no_client_auth()
            .with_cert_resolver(Arc::<Self>::clone(self));
        settings.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
        Ok(Arc::new(settings))
    }

    /// Checks the certificate, and replaces it if necessary: a local one if it ends soon or does not have the machine's
    /// present `names`, a given one if its files were renewed. Returns whether it was replaced.
    ///
    /// # Errors
    /// If no new certificate could be made or read. The present one stays in use.
    pub fn refresh(&self, now: Timestamp, names: impl FnOnce(IpAddr) -> Names) -> Result<bool, TlsError> {
        match &self.source {
            Source::Local { authority, listening } => {
                let names = names(*listening);
                let shown = self.shown.load();
                if shown.wanted == names && now >= shown.facts.from && !shown.ends_soon(now) {
                    return Ok(false);
                }

                self.shown.store(Arc::new(signed(authority, names, &self.provider, now)?));
                tracing::info!("made a new certificate for this server");
                Ok(true)
            }
            Source::Given { files, last } => {
                let contents = files.read()?;
                let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
                let is_known = last.contents == contents;
                if is_known && last.in_use {
                    return Ok(false);
                }

                let checked = files.check(&contents, &self.provider, now);
                *last = LastLook { contents, in_use: checked.is_ok() };
                // A bad one is reported once. It is checked again, because one that begins later becomes good.
                if is_known && checked.is_err() {
                    return Ok(false);
                }
                let (key, facts) = checked?;
                self.shown.store(Arc::new(CurrentCertificate { key, facts, wanted: Names::default() }));
                tracing::info!("the renewed certificate in {} is in use", files.certificate.display());
                Ok(true)
            }
        }
    }

    /// When the present certificate ends.
    pub fn until(&self) -> Timestamp {
        self.shown.load().facts.until
    }

    /// The end of the present certificate, if it ends soon.
    fn near_end(&self, now: Timestamp) -> Option<Timestamp> {
        let shown = self.shown.load();
        shown.ends_soon(now).then_some(shown.facts.until)
    }
}

impl CurrentCertificate {
    fn ends_soon(&self, now: Timestamp) -> bool {
        now.saturating_add(BEFORE_THE_END).unwrap_or(now) >= self.facts.until
    }
}

impl fmt::Debug for Certificates {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.debug_struct("Certificates").field("facts", &self.shown.load().facts).finish_non_exhaustive()
    }
}

impl ResolvesServerCert for Certificates {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(Arc::clone(&self.shown.load().key))
    }
}

fn signed(
    authority: &Authority,
    names: Names,
    provider: &CryptoProvider,
    now: Timestamp,
) -> Result<CurrentCertificate, TlsError> {
    let left_out = authority.not_permitted(&names);
    if !left_out.is_empty() {
        tracing::warn!(
            "the local authority in {} was made before this machine had {}, so browsers there warn of this server; \
             use another of its addresses, or delete the file and let each device trust the new authority",
            authority.path().display(),
            left_out.join(", ")
        );
    }

    let signed = authority.sign(&names, now)?;
    let key = CertifiedKey::from_der(vec![signed.certificate], signed.key, provider)?;
    Ok(CurrentCertificate { key: Arc::new(key), facts: signed.facts, wanted: names })
}

/// Keeps the certificate up to date while the server runs. A failure is logged and tried again; it never stops the
/// server.
pub async fn keep_current(certificates: Arc<Certificates>, clock: Arc<dyn Clock>) {
    let mut ticks = interval(LOOK_EVERY);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut warned: Option<Timestamp> = None;
    let mut problem = None;

    loop {
        ticks.tick().await;
        let now = clock.wall();

        // On a blocking thread, because the files may be on a disk that does not answer.
        let looking = Arc::clone(&certificates);
        let looked = spawn_blocking(move || looking.refresh(now, Names::of_machine)).await;
        let found = match looked {
            Ok(Ok(_)) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(error) => Some(error.to_string()),
        };

        if let Some(error) = found.as_ref().filter(|_| found != problem) {
            tracing::warn!("the server keeps its present certificate: {error}");
        }
        problem = found;

        let is_due = warned.is_none_or(|warned| now.duration_since(warned).unsigned_abs() >= WARN_EVERY);
        if let Some(until) = certificates.near_end(now).filter(|_| is_due) {
            tracing::warn!("the server's certificate ends on {until}; browsers then refuse the server: renew it");
            warned = Some(now);
        }
    }
}

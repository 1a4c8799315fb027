//! The options of `parfocal serve` that say how connections are encrypted.

use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use super::output::Failure;
use parfocal_base::clock::Clock;
use parfocal_dashboard::tls::Certificates;

/// How connections are encrypted.
#[derive(Debug, Args)]
pub struct Encryption {
    /// Encrypt all connections (TLS), with the certificate given, or with one of a local authority that is made in the
    /// data folder at the first start; docs/operations.md says how devices trust it.
    #[arg(long)]
    tls: bool,
    /// The server's certificate in PEM form, followed by any intermediate certificates.
    #[arg(long, value_name = "FILE", requires = "tls", requires = "tls_key")]
    tls_certificate: Option<PathBuf>,
    /// The private key of --tls-certificate in PEM form.
    #[arg(long, value_name = "FILE", requires = "tls", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Let other machines connect without encryption: anyone on the network can read along.
    #[arg(long, conflicts_with = "tls")]
    insecure: bool,
}

impl Encryption {
    /// Refuses an address that other machines can reach, unless connections are encrypted or `--insecure` is given.
    pub fn check(&self, bind: SocketAddr) -> Result<(), Failure> {
        if bind.ip().is_loopback() || self.tls || self.insecure {
            return Ok(());
        }
        let problem = format!("other machines can reach {bind}, and the connection would not be encrypted");
        Err(format!("{problem}; add --tls, or --insecure on a network that you trust").into())
    }

    /// Whether the certificate is given in files, and not made by the local authority.
    pub const fn is_given(&self) -> bool {
        self.tls_certificate.is_some()
    }

    /// The certificates of a server that listens on `listening`, or `None` without TLS.
    pub fn certificates(
        &self,
        data_dir: &Path,
        listening: IpAddr,
        clock: &Arc<dyn Clock>,
    ) -> Result<Option<Certificates>, Failure> {
        if !self.tls {
            return Ok(None);
        }

        let certificates = match (&self.tls_certificate, &self.tls_key) {
            (Some(certificate), Some(key)) => Certificates::given(certificate.clone(), key.clone(), clock.wall())?,
            _ => Certificates::local(data_dir, listening, clock.wall())?,
        };
        Ok(Some(certificates))
    }
}

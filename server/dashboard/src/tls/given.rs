//! A certificate that the site provides in two files, which somebody renews from time to time.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use tokio_rustls::rustls::crypto::CryptoProvider;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::sign::CertifiedKey;
use tokio_rustls::rustls::{Error as RustlsError, InconsistentKeys};

use super::error::TlsError;
use super::facts::Facts;
use super::fitness;

/// The two files of a given certificate.
#[derive(Debug, Clone)]
pub(super) struct Files {
    /// File with the certificate, followed by the intermediate certificates up to its authority.
    pub(super) certificate: PathBuf,
    /// File with the private key.
    pub(super) key: PathBuf,
}

/// The contents of the two files.
#[derive(PartialEq, Eq)]
pub(super) struct Contents {
    certificate: Vec<u8>,
    key: Vec<u8>,
}

impl Files {
    /// Reads both files.
    pub(super) fn read(&self) -> Result<Contents, TlsError> {
        Ok(Contents { certificate: read(&self.certificate)?, key: read(&self.key)? })
    }

    /// Checks the contents of the files, and returns them as a certificate that can be shown now.
    pub(super) fn check(
        &self,
        contents: &Contents,
        provider: &CryptoProvider,
        now: Timestamp,
    ) -> Result<(Arc<CertifiedKey>, Facts), TlsError> {
        let path = || self.certificate.clone();
        check_marks(&self.certificate, &contents.certificate)?;
        check_marks(&self.key, &contents.key)?;
        let chain: Vec<_> = CertificateDer::pem_slice_iter(&contents.certificate)
            .collect::<Result<_, _>>()
            .map_err(|_| TlsError::NoCertificate { path: path() })?;
        let first = chain.first().ok_or_else(|| TlsError::NoCertificate { path: path() })?;

        let unreadable = || TlsError::Unusable { path: path(), reason: "it cannot be read".into() };
        let facts = Facts::read(first).ok_or_else(unreadable)?;
        let private = self.private_key(&contents.key)?;
        self.check_order(&chain, &private, provider)?;

        if let Some(reason) = fitness::unusable_key(first) {
            return Err(TlsError::Unusable { path: path(), reason });
        }
        if !fitness::is_for_servers(first) {
            return Err(TlsError::NotForServers { path: path() });
        }
        if now >= facts.until {
            return Err(TlsError::Expired { path: path(), until: facts.until });
        }
        if now < facts.from {
            return Err(TlsError::NotYetValid { path: path(), from: facts.from, now });
        }
        if facts.names.hosts.is_empty() && facts.names.addresses.is_empty() {
            return Err(TlsError::NoNames { path: path() });
        }

        let key = CertifiedKey::from_der(chain, private, provider);
        let key = key.map_err(|error| self.not_usable(&error))?;
        Ok((Arc::new(key), facts))
    }

    /// Checks that the server's certificate comes first, and each other one signed the one before it.
    fn check_order(
        &self,
        chain: &[CertificateDer<'static>],
        private: &PrivateKeyDer<'static>,
        provider: &CryptoProvider,
    ) -> Result<(), TlsError> {
        let belongs = |certificate: &CertificateDer<'static>| {
            CertifiedKey::from_der(vec![certificate.clone()], private.clone_key(), provider).is_ok()
        };
        let wrong = |problem: String| TlsError::WrongOrder { path: self.certificate.clone(), problem };

        // If the key belongs to none, or cannot be used, a later check reports it. That check also reports the key of
        // an authority beside a chain that is in order.
        let Some(place) = fitness::out_of_order(chain) else { return Ok(()) };
        Err(wrong(match chain.iter().position(belongs) {
            Some(own) if own > 0 => format!("the server's own, to which the key belongs, is number {}", own + 1),
            _ => format!("number {place} did not sign number {}", place - 1),
        }))
    }

    fn private_key(&self, pem: &[u8]) -> Result<PrivateKeyDer<'static>, TlsError> {
        let text = String::from_utf8_lossy(pem);
        // The two forms of an encrypted key: PKCS #8, and OpenSSL's older form.
        if text.contains("BEGIN ENCRYPTED PRIVATE KEY") || text.contains("Proc-Type: 4,ENCRYPTED") {
            return Err(TlsError::KeyNeedsPassphrase { path: self.key.clone() });
        }
        PrivateKeyDer::from_pem_slice(pem).map_err(|_| TlsError::NoKey { path: self.key.clone() })
    }

    fn not_usable(&self, error: &RustlsError) -> TlsError {
        match error {
            RustlsError::InconsistentKeys(InconsistentKeys::KeyMismatch) => {
                TlsError::OtherKey { key: self.key.clone(), certificate: self.certificate.clone() }
            }
            error => TlsError::Unusable { path: self.certificate.clone(), reason: error.to_string() },
        }
    }
}

/// Refuses a text that begins with a byte order mark: PEM knows none, and its first line would be missed.
fn check_marks(path: &Path, contents: &[u8]) -> Result<(), TlsError> {
    let mark = match contents {
        [0xef, 0xbb, 0xbf, ..] => "a byte order mark (BOM)",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "the byte order mark (BOM) of UTF-16",
        _ => return Ok(()),
    };
    Err(TlsError::Marked { path: path.to_owned(), mark })
}

fn read(path: &Path) -> Result<Vec<u8>, TlsError> {
    std::fs::read(path).map_err(|source| TlsError::Unreadable { path: path.to_owned(), source })
}

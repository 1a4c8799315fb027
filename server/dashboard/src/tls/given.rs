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
        let chain: Vec<_> = CertificateDer::pem_slice_iter(&contents.certificate)
            .collect::<Result<_, _>>()
            .map_err(|_| TlsError::NoCertificate { path: path() })?;
        let first = chain.first().ok_or_else(|| TlsError::NoCertificate { path: path() })?;

        let unreadable = || TlsError::Unusable { path: path(), reason: "it cannot be read".into() };
        let facts = Facts::read(first).ok_or_else(unreadable)?;

        if now >= facts.until {
            return Err(TlsError::Expired { path: path(), until: facts.until });
        }
        if now < facts.from {
            return Err(TlsError::NotYetValid { path: path(), from: facts.from, now });
        }
        if facts.names.hosts.is_empty() && facts.names.addresses.is_empty() {
            return Err(TlsError::NoNames { path: path() });
        }

        let key = CertifiedKey::from_der(chain, self.private_key(&contents.key)?, provider);
        let key = key.map_err(|error| self.not_usable(&error))?;
        Ok((Arc::new(key), facts))
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

fn read(path: &Path) -> Result<Vec<u8>, TlsError> {
    std::fs::read(path).map_err(|source| TlsError::Unreadable { path: path.to_owned(), source })
}

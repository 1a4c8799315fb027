//! A certificate that the site provides in two files, which somebody renews from time to time.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use tokio_rustls::rustls::crypto::CryptoProvider;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::sign::CertifiedKey;
use tokio_rustls::rustls::{Error as RustlsError, InconsistentKeys};

use super::facts::Facts;
use super::{TlsError, fitness, unreadable};

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
        let file = self.certificate.display();
        check_marks(&self.certificate, &contents.certificate)?;
        check_marks(&self.key, &contents.key)?;

        let none = || {
            TlsError::File(format!(
                "{file} holds no certificate; it must be in PEM form and begin with -----BEGIN CERTIFICATE-----"
            ))
        };
        let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&contents.certificate).collect();
        let chain = chain.map_err(|_| none())?;
        let first = chain.first().ok_or_else(none)?;

        let facts = Facts::read(first).ok_or_else(|| self.unusable("it cannot be read"))?;
        let private = self.private_key(&contents.key)?;
        self.check_order(&chain, &private, provider)?;

        if let Some(reason) = fitness::unusable_key(first) {
            return Err(self.unusable(&reason));
        }
        if !fitness::is_for_servers(first) {
            return Err(TlsError::File(format!(
                "the certificate in {file} is for clients or other purposes, so every browser refuses it; ask for one \
                 whose extended key usage has server authentication"
            )));
        }

        let Facts { from, until, names } = &facts;
        if now >= *until {
            return Err(TlsError::File(format!(
                "the certificate in {file} ended on {until}; renew it, or leave out --tls-certificate and --tls-key to \
                 use a local authority"
            )));
        }
        if now < *from {
            return Err(TlsError::File(format!(
                "the certificate in {file} begins on {from}, and this machine's clock says {now}; set the clock, or wait"
            )));
        }
        // Browsers check no other names.
        if names.hosts.is_empty() && names.addresses.is_empty() {
            return Err(TlsError::File(format!(
                "the certificate in {file} names no host in its subject alternative names, so every browser refuses it; \
                 ask for one that names this machine"
            )));
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

        // If the key belongs to none, or cannot be used, a later check reports it. That check also reports the key of
        // an authority beside a chain that is in order.
        let Some(place) = fitness::out_of_order(chain) else { return Ok(()) };
        let problem = match chain.iter().position(belongs) {
            Some(own) if own > 0 => format!("the server's own, to which the key belongs, is number {}", own + 1),
            _ => format!("number {place} did not sign number {}", place - 1),
        };
        Err(TlsError::File(format!(
            "the certificates in {} are in the wrong order: {problem}; put the server's certificate first, then each \
             one that signed the one before it",
            self.certificate.display()
        )))
    }

    fn private_key(&self, pem: &[u8]) -> Result<PrivateKeyDer<'static>, TlsError> {
        let file = self.key.display();
        let text = String::from_utf8_lossy(pem);
        // The two forms of an encrypted key: PKCS #8, and OpenSSL's older form.
        if text.contains("BEGIN ENCRYPTED PRIVATE KEY") || text.contains("Proc-Type: 4,ENCRYPTED") {
            return Err(TlsError::File(format!(
                "the private key in {file} is protected by a passphrase, which nobody could enter at a restart; remove \
                 it with `openssl pkey -in FILE -out NEW`, and let only the server's account read the new file"
            )));
        }
        PrivateKeyDer::from_pem_slice(pem).map_err(|_| {
            TlsError::File(format!(
                "{file} holds no private key; it must be in PEM form and begin with -----BEGIN PRIVATE KEY-----"
            ))
        })
    }

    fn not_usable(&self, error: &RustlsError) -> TlsError {
        match error {
            RustlsError::InconsistentKeys(InconsistentKeys::KeyMismatch) => TlsError::File(format!(
                "the private key in {} does not belong to the certificate in {}; give the key that the certificate was \
                 requested with",
                self.key.display(),
                self.certificate.display()
            )),
            error => self.unusable(&error.to_string()),
        }
    }

    fn unusable(&self, reason: &str) -> TlsError {
        TlsError::File(format!(
            "the certificate in {} cannot be used: {reason}; ask for one with an RSA key of 2048 to 8192 bits, an ECDSA \
             key on P-256 or P-384, or an Ed25519 key",
            self.certificate.display()
        ))
    }
}

/// Refuses a text that begins with a byte order mark: PEM knows none, and its first line would be missed.
fn check_marks(path: &Path, contents: &[u8]) -> Result<(), TlsError> {
    let mark = match contents {
        [0xef, 0xbb, 0xbf, ..] => "a byte order mark (BOM)",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "the byte order mark (BOM) of UTF-16",
        _ => return Ok(()),
    };
    Err(TlsError::File(format!(
        "{} begins with {mark}, and so cannot be read; save it again as plain text without it",
        path.display()
    )))
}

fn read(path: &Path) -> Result<Vec<u8>, TlsError> {
    std::fs::read(path).map_err(|error| unreadable(path, &error))
}

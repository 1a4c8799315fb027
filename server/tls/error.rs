//! Why a certificate cannot be used.

use std::path::PathBuf;

use jiff::Timestamp;

/// Why the server has no certificate to show.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file could not be read.
    #[error("cannot read {}: {source}; check the path, and that the account of the server may read the file",
            path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file holds no certificate.
    #[error("{} holds no certificate; it must be in PEM form and begin with -----BEGIN CERTIFICATE-----",
            path.display())]
    NoCertificate {
        /// The file.
        path: PathBuf,
    },
    /// A file holds no private key.
    #[error("{} holds no private key; it must be in PEM form and begin with -----BEGIN PRIVATE KEY-----",
            path.display())]
    NoKey {
        /// The file.
        path: PathBuf,
    },
    /// A private key that only a passphrase opens.
    #[error("the private key in {} is protected by a passphrase, which nobody could enter at a restart; \
             remove it with `openssl pkey -in FILE -out NEW`, and let only the server's account read the new file",
            path.display())]
    KeyNeedsPassphrase {
        /// The file.
        path: PathBuf,
    },
    /// The key is not the certificate's.
    #[error("the private key in {} does not belong to the certificate in {}; give the key that the certificate was \
             requested with", key.display(), certificate.display())]
    OtherKey {
        /// The file with the key.
        key: PathBuf,
        /// The file with the certificate.
        certificate: PathBuf,
    },
    /// Certificate or key are of a kind that cannot be used.
    #[error("the certificate in {} cannot be used: {reason}; ask for one with an RSA, ECDSA or Ed25519 key",
            path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The certificate names nothing that a browser looks at.
    #[error("the certificate in {} names no host in its subject alternative names, so every browser refuses it; \
             ask for one that names this machine", path.display())]
    NoNames {
        /// The file.
        path: PathBuf,
    },
    /// The certificate has ended.
    #[error("the certificate in {} ended on {until}; renew it, or leave out --tls-certificate and --tls-key to use \
             a local authority", path.display())]
    Expired {
        /// The file.
        path: PathBuf,
        /// Its end.
        until: Timestamp,
    },
    /// The certificate has not begun.
    #[error("the certificate in {} begins on {from}, and this machine's clock says {now}; set the clock, or wait",
            path.display())]
    NotYetValid {
        /// The file.
        path: PathBuf,
        /// Its begin.
        from: Timestamp,
        /// What the clock says.
        now: Timestamp,
    },
    /// The local authority could not be kept.
    #[error("cannot keep the local authority in {}: {source}; check the folder's permissions and free space",
            path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The local authority's file is not what was written.
    #[error("the local authority in {} is damaged ({reason}); restore the file, or delete it to make a new authority, \
             which every tablet and laptop must then trust anew", path.display())]
    DamagedAuthority {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The local authority has ended, or has not begun.
    #[error("the local authority in {} is valid from {from} to {until}, and this machine's clock says {now}; set the \
             clock if it is wrong, else delete the file to make a new authority, which every tablet and laptop must \
             then trust anew", path.display())]
    AuthorityNotValid {
        /// The file.
        path: PathBuf,
        /// Its begin.
        from: Timestamp,
        /// Its end.
        until: Timestamp,
        /// What the clock says.
        now: Timestamp,
    },
    /// A certificate could not be made.
    #[error("a certificate could not be made: {0}")]
    Making(#[from] rcgen::Error),
    /// TLS could not be set up.
    #[error("TLS could not be set up: {0}")]
    SettingUp(#[from] tokio_rustls::rustls::Error),
}

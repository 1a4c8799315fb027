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
        /// File that could not be read.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file holds no certificate.
    #[error("{} holds no certificate; it must be in PEM form and begin with -----BEGIN CERTIFICATE-----",
            path.display())]
    NoCertificate {
        /// File without a certificate.
        path: PathBuf,
    },
    /// A file holds no private key.
    #[error("{} holds no private key; it must be in PEM form and begin with -----BEGIN PRIVATE KEY-----",
            path.display())]
    NoKey {
        /// File without a private key.
        path: PathBuf,
    },
    /// The private key is protected by a passphrase.
    #[error("the private key in {} is protected by a passphrase, which nobody could enter at a restart; \
             remove it with `openssl pkey -in FILE -out NEW`, and let only the server's account read the new file",
            path.display())]
    KeyNeedsPassphrase {
        /// File with the private key.
        path: PathBuf,
    },
    /// The private key does not belong to the certificate.
    #[error("the private key in {} does not belong to the certificate in {}; give the key that the certificate was \
             requested with", key.display(), certificate.display())]
    OtherKey {
        /// File with the private key.
        key: PathBuf,
        /// File with the certificate.
        certificate: PathBuf,
    },
    /// A file begins with a mark that editors add.
    #[error("{} begins with {mark}, and so cannot be read; save it again as plain text without it", path.display())]
    Marked {
        /// File that begins with the mark.
        path: PathBuf,
        /// Description of the mark.
        mark: &'static str,
    },
    /// The certificates are not in the order in which they sign one another.
    #[error("the certificates in {} are in the wrong order: {problem}; put the server's certificate first, then each \
             one that signed the one before it", path.display())]
    WrongOrder {
        /// File with the certificates.
        path: PathBuf,
        /// What is out of order.
        problem: String,
    },
    /// The certificate may not stand for a server.
    #[error("the certificate in {} is for clients or other purposes, so every browser refuses it; ask for one whose \
             extended key usage has server authentication", path.display())]
    NotForServers {
        /// File with the certificate.
        path: PathBuf,
    },
    /// The certificate or the key is of a kind that cannot be used.
    #[error("the certificate in {} cannot be used: {reason}; ask for one with an RSA key of 2048 to 8192 bits, an \
             ECDSA key on P-256 or P-384, or an Ed25519 key", path.display())]
    Unusable {
        /// File with the certificate.
        path: PathBuf,
        /// Why it cannot be used.
        reason: String,
    },
    /// The certificate has no subject alternative names, which are the only names that browsers check.
    #[error("the certificate in {} names no host in its subject alternative names, so every browser refuses it; \
             ask for one that names this machine", path.display())]
    NoNames {
        /// File with the certificate.
        path: PathBuf,
    },
    /// The certificate has ended.
    #[error("the certificate in {} ended on {until}; renew it, or leave out --tls-certificate and --tls-key to use \
             a local authority", path.display())]
    Expired {
        /// File with the certificate.
        path: PathBuf,
        /// When the certificate ended.
        until: Timestamp,
    },
    /// The certificate is not valid yet.
    #[error("the certificate in {} begins on {from}, and this machine's clock says {now}; set the clock, or wait",
            path.display())]
    NotYetValid {
        /// File with the certificate.
        path: PathBuf,
        /// When the certificate begins to be valid.
        from: Timestamp,
        /// Time by this machine's clock.
        now: Timestamp,
    },
    /// The local authority could not be stored.
    #[error("cannot keep the local authority in {}: {source}; check the folder's permissions and free space",
            path.display())]
    Unwritable {
        /// File that could not be written.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The local authority's file is damaged.
    #[error("the local authority in {} is damaged ({reason}); restore the file, or delete it to make a new authority, \
             which every tablet and laptop must then trust anew", path.display())]
    DamagedAuthority {
        /// File with the authority.
        path: PathBuf,
        /// Description of the damage.
        reason: &'static str,
    },
    /// The local authority has expired, or is not valid yet.
    #[error("the local authority in {} is valid from {from} to {until}, and this machine's clock says {now}; set the \
             clock if it is wrong, else delete the file to make a new authority, which every tablet and laptop must \
             then trust anew", path.display())]
    AuthorityNotValid {
        /// File with the authority.
        path: PathBuf,
        /// When the authority begins to be valid.
        from: Timestamp,
        /// When the authority ends.
        until: Timestamp,
        /// Time by this machine's clock.
        now: Timestamp,
    },
    /// A certificate could not be made.
    #[error("a certificate could not be made: {0}")]
    Making(#[from] rcgen::Error),
    /// TLS could not be set up.
    #[error("TLS could not be set up: {0}")]
    SettingUp(#[from] tokio_rustls::rustls::Error),
}

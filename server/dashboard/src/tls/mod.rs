//! TLS: the certificate that the server shows, who signs it, and when it is renewed.
//!
//! A site that has a certificate provides it in two files ([`Certificates::given`]). Any other site gets a local
//! authority ([`Certificates::local`]), which is made at the first start and kept in the data folder. Tablets and
//! laptops trust it once. It signs a new certificate at every start, before the last one ends, and whenever this
//! machine's addresses change.

mod authority;
mod certificates;
mod facts;
mod fitness;
mod given;
mod names;

use std::path::Path;

pub use authority::{FOLDER, PublicAuthority};
pub use certificates::{Certificates, keep_current};
pub use names::Names;

/// Why the server has no certificate to show.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file cannot be used, or is not valid now: a sentence that says what to do.
    #[error("{0}")]
    File(String),
    /// A certificate could not be made.
    #[error("a certificate could not be made: {0}")]
    Making(#[from] rcgen::Error),
    /// TLS could not be set up.
    #[error("TLS could not be set up: {0}")]
    SettingUp(#[from] tokio_rustls::rustls::Error),
}

/// The error of a file that could not be read.
fn unreadable(path: &Path, error: &std::io::Error) -> TlsError {
    TlsError::File(format!(
        "cannot read {}: {error}; check the path, and that the account of the server may read the file",
        path.display()
    ))
}

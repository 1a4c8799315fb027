//! TLS: the certificate that the server shows, who signs it, and when it is renewed.
//!
//! A site that has a certificate gives it by its two files ([`Certificates::given`]). Any other site gets a local
//! authority ([`Certificates::local`]), made at the first start and kept in the data folder: tablets and laptops trust
//! it once, and it signs a new certificate at every start, before the last one ends, and whenever this machine's
//! addresses change.

mod authority;
mod certificates;
mod error;
mod facts;
mod given;
mod names;

pub use authority::{FOLDER, PublicAuthority};
pub use certificates::{Certificates, keep_current};
pub use error::TlsError;
pub use names::Names;

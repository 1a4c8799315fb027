//! TLS: the certificate that the server shows, who signs it, and when it is renewed.
//!
//! A site that has a certificate provides it in two files ([`Certificates::given`]). Any other site gets a local
//! authority ([`Certificates::local`]), which is made at the first start and kept in the data folder. Tablets and
//! laptops trust it once. It signs a new certificate at every start, before the last one ends, and whenever this
//! machine's addresses change.

mod authority;
mod certificates;
mod error;
mod facts;
mod fitness;
mod given;
mod names;

pub use authority::{FOLDER, PublicAuthority};
pub use certificates::{Certificates, keep_current};
pub use error::TlsError;
pub use names::Names;

//! How others reach the server: the host in links, and whether connections are encrypted.

use crate::tls::PublicAuthority;

/// How others reach the server.
#[derive(Debug, Clone)]
pub struct Reach {
    /// Host and port, as links name them.
    pub host: String,
    /// Whether connections are encrypted by the server itself.
    pub encrypted: bool,
    /// Whether the server listens on the machine itself alone, where no tablet reaches it.
    pub loopback_only: bool,
    /// The local authority that signed the server's certificate, and that each device must trust.
    pub authority: Option<PublicAuthority>,
}

impl Reach {
    /// How links to the server begin.
    #[must_use]
    pub const fn scheme(&self) -> &'static str {
        if self.encrypted { "https" } else { "http" }
    }

    /// The link that lets a browser in with `key`.
    #[must_use]
    pub fn link(&self, key: &str) -> String {
        self.link_by(&self.host, key)
    }

    /// The same, by another of the server's names.
    #[must_use]
    pub fn link_by(&self, host: &str, key: &str) -> String {
        format!("{}://{host}/enter?key={key}", self.scheme())
    }

    /// The page on which a device learns to trust the server, if it must. Not encrypted: a device that does not trust
    /// the server yet can open it without a warning.
    #[must_use]
    pub fn trust_page(&self) -> Option<String> {
        self.trust_page_by(&self.host)
    }

    /// The same, by another of the server's names.
    #[must_use]
    pub fn trust_page_by(&self, host: &str) -> Option<String> {
        self.authority.as_ref().map(|_| format!("http://{host}/trust"))
    }
}

//! How other devices reach the server: the host in links, and whether connections are encrypted.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;

use jiff::Timestamp;

use crate::doctor::outward;
use crate::tls::{Certificates, PublicAuthority};

/// How other devices reach the server.
#[derive(Debug, Clone)]
pub struct ServerAddress {
    /// The address and port on which the server listens.
    listening: SocketAddr,
    /// The server's certificate; `None` if it does not encrypt.
    certificates: Option<Arc<Certificates>>,
}

impl ServerAddress {
    /// A server that listens on `listening`, and encrypts if it has `certificates`.
    pub const fn new(listening: SocketAddr, certificates: Option<Arc<Certificates>>) -> Self {
        Self { listening, certificates }
    }

    /// Host and port for links. They are determined anew at each call: the machine gets another address when it joins
    /// another network or its cable is plugged in, and a link to the old address no longer works.
    pub fn host(&self) -> String {
        let outward = if self.listening.ip().is_unspecified() { outward() } else { None };
        self.host_from(outward)
    }

    /// The same, for a machine that others reach at the address `outward`.
    fn host_from(&self, outward: Option<IpAddr>) -> String {
        let ip = match outward {
            Some(address) => address,
            // Without a network, only this machine itself reaches the server.
            None if self.listening.ip().is_unspecified() => Ipv4Addr::LOCALHOST.into(),
            None => self.listening.ip(),
        };
        let address = SocketAddr::new(ip, self.listening.port());
        self.certificates.as_ref().map_or_else(|| address.to_string(), |certificates| certificates.host(address))
    }

    /// Whether the server itself encrypts connections.
    pub const fn encrypted(&self) -> bool {
        self.certificates.is_some()
    }

    /// Whether the server listens only on the loopback interface, where no tablet reaches it.
    pub const fn loopback_only(&self) -> bool {
        self.listening.ip().is_loopback()
    }

    /// The local authority that signed the server's certificate and that each device must trust; `None` if there is
    /// none.
    pub fn authority(&self) -> Option<&PublicAuthority> {
        self.certificates.as_ref()?.authority()
    }

    /// When the server's certificate expires; `None` if the server does not encrypt.
    pub fn certificate_until(&self) -> Option<Timestamp> {
        self.certificates.as_ref().map(|certificates| certificates.until())
    }

    /// The scheme of links to the server.
    pub const fn scheme(&self) -> &'static str {
        if self.encrypted() { "https" } else { "http" }
    }

    /// The link that lets a browser in with `key`; `host` is one of the server's names.
    pub fn link_by(&self, host: &str, key: &str) -> String {
        format!("{}://{host}/enter?key={key}", self.scheme())
    }

    /// Address of the page that helps a device to trust the server; `None` if that is not needed. `host` is one of the
    /// server's names. The page is not encrypted, so a device that does not trust the server yet can open it without a
    /// warning.
    pub fn trust_page_by(&self, host: &str) -> Option<String> {
        self.authority().map(|_| format!("http://{host}/trust"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reach(listening: &str) -> ServerAddress {
        ServerAddress::new(listening.parse().unwrap(), None)
    }

    fn ip(address: &str) -> IpAddr {
        address.parse().unwrap()
    }

    #[test]
    fn links_follow_the_machines_address() {
        let everywhere = reach("0.0.0.0:8080");
        assert_eq!(everywhere.host_from(Some(ip("10.0.0.5"))), "10.0.0.5:8080");
        assert_eq!(everywhere.host_from(Some(ip("192.168.7.9"))), "192.168.7.9:8080");
        assert_eq!(everywhere.host_from(None), "127.0.0.1:8080", "in no network");
        assert_eq!(reach("[::]:8080").host_from(Some(ip("10.0.0.5"))), "10.0.0.5:8080");
    }

    #[test]
    fn a_server_on_one_address_is_linked_to_there() {
        assert_eq!(reach("10.0.0.5:8080").host(), "10.0.0.5:8080");
        assert_eq!(reach("127.0.0.1:8080").host(), "127.0.0.1:8080");
    }

    #[test]
    fn an_encrypted_server_links_to_its_present_address_too() {
        let data = tempfile::tempdir().unwrap();
        let listening: SocketAddr = "0.0.0.0:8443".parse().unwrap();
        let now = "2026-06-01T00:00:00Z".parse().unwrap();
        let certificates = Certificates::local(data.path(), Ipv4Addr::LOCALHOST.into(), now).unwrap();
        let address = ServerAddress::new(listening, Some(Arc::new(certificates)));
        assert_eq!(address.link_by(&address.host_from(Some(ip("10.0.0.5"))), "k"), "https://10.0.0.5:8443/enter?key=k");
        assert_eq!(address.link_by(&address.host_from(Some(ip("10.0.0.6"))), "k"), "https://10.0.0.6:8443/enter?key=k");
    }
}

//! Facts that are read from a certificate.

use std::net::IpAddr;

use jiff::Timestamp;
use x509_parser::extensions::GeneralName;
use x509_parser::prelude::{FromDer, X509Certificate};

use super::names::Names;

/// The validity and the names of a certificate.
#[derive(Debug, Clone)]
pub(super) struct Facts {
    /// When it begins to be valid.
    pub(super) from: Timestamp,
    /// When it ends.
    pub(super) until: Timestamp,
    /// Host names and addresses that it is for.
    pub(super) names: Names,
}

impl Facts {
    /// Reads the facts from the certificate `der`; none if it is not a certificate.
    pub(super) fn read(der: &[u8]) -> Option<Self> {
        let (_, certificate) = X509Certificate::from_der(der).ok()?;
        let validity = certificate.validity();
        let mut names = Names::default();

        let listed = certificate.subject_alternative_name().ok().flatten();
        for name in listed.iter().flat_map(|listed| &listed.value.general_names) {
            match name {
                GeneralName::DNSName(host) => drop(names.hosts.insert(host.to_ascii_lowercase())),
                GeneralName::IPAddress(bytes) => names.addresses.extend(address(bytes)),
                _ => {}
            }
        }

        Some(Self {
            from: Timestamp::from_second(validity.not_before.timestamp()).ok()?,
            until: Timestamp::from_second(validity.not_after.timestamp()).ok()?,
            names,
        })
    }
}

/// The names for which an authority may sign certificates: its name constraints (RFC 5280, 4.2.1.10).
#[derive(Debug, Clone)]
pub(super) struct Permitted {
    hosts: Vec<String>,
    /// Network address and mask.
    networks: Vec<(IpAddr, IpAddr)>,
}

impl Permitted {
    /// Reads the name constraints of the certificate `der`; none if it has none, or is not a certificate.
    pub(super) fn read(der: &[u8]) -> Option<Self> {
        let (_, certificate) = X509Certificate::from_der(der).ok()?;
        let constraints = certificate.name_constraints().ok()??;
        let mut permitted = Self { hosts: Vec::new(), networks: Vec::new() };

        for subtree in constraints.value.permitted_subtrees.iter().flatten() {
            match subtree.base {
                GeneralName::DNSName(host) => permitted.hosts.push(host.to_owned()),
                GeneralName::IPAddress(bytes) => {
                    let (network, mask) = bytes.split_at(bytes.len() / 2);
                    permitted.networks.extend(address(network).zip(address(mask)));
                }
                _ => {}
            }
        }
        Some(permitted)
    }

    /// Whether `host` is one of the permitted names, or a subdomain of one.
    pub(super) fn host(&self, host: &str) -> bool {
        let is_below = |name: &String| host.strip_suffix(name.as_str()).is_some_and(|rest| rest.ends_with('.'));
        self.hosts.iter().any(|name| host == name || is_below(name))
    }

    /// Whether `address` is in one of the permitted networks.
    pub(super) fn address(&self, address: IpAddr) -> bool {
        self.networks.iter().any(|(network, mask)| match (address, network, mask) {
            (IpAddr::V4(address), IpAddr::V4(network), IpAddr::V4(mask)) => address & mask == network & mask,
            (IpAddr::V6(address), IpAddr::V6(network), IpAddr::V6(mask)) => address & mask == network & mask,
            _ => false,
        })
    }
}

/// Reads an address as it is encoded in certificates: 4 or 16 bytes.
fn address(bytes: &[u8]) -> Option<IpAddr> {
    let v4 = <[u8; 4]>::try_from(bytes).map(IpAddr::from).ok();
    v4.or_else(|| <[u8; 16]>::try_from(bytes).map(IpAddr::from).ok())
}

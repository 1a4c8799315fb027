//! The names and addresses by which others reach this machine.

use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Host names and addresses, as a certificate lists them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names {
    /// Host names, in lower case.
    pub hosts: BTreeSet<String>,
    /// IP addresses.
    pub addresses: BTreeSet<IpAddr>,
}

impl Names {
    /// The names of this machine, and the present addresses of a server that listens on `listening`.
    pub fn of_machine(listening: IpAddr) -> Self {
        let mut addresses = BTreeSet::from([Ipv4Addr::LOCALHOST.into(), Ipv6Addr::LOCALHOST.into()]);
        if listening.is_unspecified() {
            addresses.extend(interfaces());
        } else {
            addresses.insert(listening);
        }

        Self { hosts: hosts(&machine_name()), addresses }
    }

    /// The names of this machine, and all its addresses.
    pub fn of_whole_machine() -> Self {
        Self::of_machine(Ipv4Addr::UNSPECIFIED.into())
    }
}

/// The machine's own name, in lower case. The kernel may report any text.
fn machine_name() -> String {
    rustix::system::uname().nodename().to_string_lossy().to_ascii_lowercase()
}

/// The host names of a machine called `name`.
fn hosts(name: &str) -> BTreeSet<String> {
    let mut hosts = BTreeSet::from(["localhost".to_owned()]);
    if is_host_name(name) {
        // The name that a machine announces in its local network (mDNS, RFC 6762).
        if !name.contains('.') {
            hosts.insert(format!("{name}.local"));
        }
        hosts.insert(name.to_owned());
    }
    hosts
}

/// Whether `name` is a host name by RFC 1123.
fn is_host_name(name: &str) -> bool {
    let is_label = |label: &str| {
        (1..=63).contains(&label.len())
            && label.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    name.len() <= 253 && name.split('.').all(is_label)
}

/// The addresses of all network interfaces, except those that cannot be used in a link: link-local IPv6 addresses need
/// the name of an interface beside them.
fn interfaces() -> Vec<IpAddr> {
    let found = if_addrs::get_if_addrs().unwrap_or_else(|error| {
        tracing::warn!("the addresses of this machine could not be listed: {error}");
        Vec::new()
    });

    let can_stand_in_a_link = |address: &IpAddr| match address {
        IpAddr::V4(_) => true,
        IpAddr::V6(address) => !address.is_unicast_link_local(),
    };
    found.into_iter().map(|interface| interface.ip()).filter(can_stand_in_a_link).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_goes_by_its_name_and_by_that_name_in_the_local_network() {
        let names = |name: &str| hosts(name).into_iter().collect::<Vec<_>>();
        assert_eq!(names("exoscope-1"), ["exoscope-1", "exoscope-1.local", "localhost"]);
        assert_eq!(names("pc7.hospital.example"), ["localhost", "pc7.hospital.example"]);
        for nonsense in ["", "(none)", "under_score", "-dash", "a..b"] {
            assert_eq!(names(nonsense), ["localhost"], "{nonsense}");
        }
    }

    #[test]
    fn a_server_on_one_address_is_reached_there_and_on_this_machine() {
        let names = Names::of_machine("192.0.2.7".parse().unwrap());
        let addresses: Vec<String> = names.addresses.iter().map(ToString::to_string).collect();
        assert_eq!(addresses, ["127.0.0.1", "192.0.2.7", "::1"]);
    }
}

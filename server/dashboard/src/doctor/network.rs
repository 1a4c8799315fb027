//! The network: where a tablet can reach this machine, and whether its cables suit a GigE camera.

use std::net::{IpAddr, UdpSocket};
use std::path::Path;

use if_addrs::Interface;

use super::finding::Finding;

/// Folder in which Linux lists the network interfaces.
const INTERFACES: &str = "/sys/class/net";
/// Packet size in bytes from which a GigE Vision camera's pictures need few enough packets.
const JUMBO: u32 = 8000;
/// Link speed that a GigE Vision camera needs, Mbit/s.
const GIGABIT: u32 = 1000;
/// Linux's number for wired network hardware (`ARPHRD_ETHER`).
const ETHERNET: u32 = 1;

const NETWORK: &str = "network";
const CAMERA: &str = "camera's network";

/// The addresses at which other devices can reach this machine.
pub fn addresses() -> Finding {
    let found: Vec<String> = reachable_at().iter().map(ToString::to_string).collect();
    if found.is_empty() {
        return Finding::advice(
            NETWORK,
            "This machine is not connected to a network.",
            "Connect it to the tablet's network, unless all pages are opened on this machine.",
        );
    }
    Finding::well(NETWORK, format!("A tablet can reach this machine at {}.", found.join(" or at ")))
}

/// No other device can reach the server, whatever the machine's addresses.
pub fn this_machine_alone() -> Finding {
    Finding::advice(
        NETWORK,
        "Only this machine can connect to the server.",
        "For a tablet, start it with --bind 0.0.0.0:8080 --tls, unless a proxy on this machine passes requests on.",
    )
}

/// The address for links to this machine; `None` if it is not in a network.
pub fn outward() -> Option<IpAddr> {
    reachable_at().first().copied()
}

/// The address from which this machine would reach the world. In networks that lead no further, such as a cable to a
/// tablet or an access point without the internet, its address in each of them.
fn reachable_at() -> Vec<IpAddr> {
    match towards_the_world() {
        Some(address) => vec![address],
        None => in_networks(if_addrs::get_if_addrs().unwrap_or_default()),
    }
}

/// The address on the way to the world; `None` if there is no such way.
///
/// Connecting a datagram socket sends nothing; it only picks the route and so this machine's address on it. The
/// destination is an address reserved for documentation (RFC 5737).
fn towards_the_world() -> Option<IpAddr> {
    let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
    socket.connect("192.0.2.1:9").ok()?;
    socket.local_addr().ok().map(|address| address.ip())
}

/// The IPv4 addresses of those `interfaces` that are up. Addresses that the machine gave itself (RFC 3927) come last: it
/// has them where nobody assigns any, as on a cable to a camera.
fn in_networks(mut interfaces: Vec<Interface>) -> Vec<IpAddr> {
    interfaces.retain(|interface| interface.is_oper_up() && !interface.is_loopback());
    interfaces.sort_by_key(Interface::is_link_local);
    interfaces.iter().map(Interface::ip).filter(IpAddr::is_ipv4).collect()
}

/// Whether each wired network that is up could carry a GigE camera's pictures. Empty if there is no such network.
pub fn camera_links() -> Vec<Finding> {
    let Ok(entries) = std::fs::read_dir(INTERFACES) else { return Vec::new() };
    let mut names: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    names.sort();

    names.iter().filter_map(|interface| Link::read(interface)).map(|link| link.finding()).collect()
}

/// A wired network interface that is up.
#[derive(Debug, PartialEq, Eq)]
struct Link {
    name: String,
    /// Largest packet, bytes.
    mtu: u32,
    /// Mbit/s; `None` if the interface does not report it.
    speed: Option<u32>,
}

impl Link {
    /// Reads the interface in `folder`; `None` if it is not wired, is virtual, or is not up.
    fn read(folder: &Path) -> Option<Self> {
        let text = |name: &str| std::fs::read_to_string(folder.join(name)).ok().map(|text| text.trim().to_owned());
        let number = |name: &str| text(name).and_then(|text| text.parse::<u32>().ok());

        let wired = number("type") == Some(ETHERNET) && !folder.join("wireless").exists();
        // Bridges and other virtual interfaces have no device.
        let real = folder.join("device").exists();
        let up = text("operstate").as_deref() == Some("up");
        if !(wired && real && up) {
            return None;
        }

        let name = folder.file_name()?.to_string_lossy().into_owned();
        Some(Self { name, mtu: number("mtu")?, speed: number("speed") })
    }

    fn finding(&self) -> Finding {
        let name = &self.name;

        if let Some(speed) = self.speed.filter(|&speed| speed < GIGABIT) {
            let found = format!("{name} runs at {speed} Mbit/s; a GigE camera needs {GIGABIT}.");
            return Finding::advice(CAMERA, found, "For a GigE camera, use a cable and a port for gigabit Ethernet.");
        }

        if self.mtu < JUMBO {
            let found = format!("{name} takes packets of {} bytes.", self.mtu);
            let advice = format!("For a GigE camera on {name}, take larger ones: ip link set {name} mtu 9000");
            return Finding::advice(CAMERA, found, advice);
        }

        Finding::well(CAMERA, format!("{name} takes packets of {} bytes.", self.mtu))
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use if_addrs::{IfAddr, IfOperStatus, Ifv4Addr};

    use super::*;
    use crate::doctor::finding::Verdict;

    /// A folder like the one that Linux has for an interface.
    fn interface(mtu: &str, speed: &str, operstate: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("device")).unwrap();
        for (name, value) in [("type", "1\n"), ("mtu", mtu), ("speed", speed), ("operstate", operstate)] {
            std::fs::write(folder.path().join(name), value).unwrap();
        }
        folder
    }

    #[test]
    fn a_machine_in_a_network_of_its_own_is_reached_at_its_address_there() {
        let interface = |ip: &str, oper_status| {
            let Ok(IpAddr::V4(ip)) = ip.parse() else { panic!("{ip}") };
            let netmask = Ipv4Addr::new(255, 255, 255, 0);
            let addr = IfAddr::V4(Ifv4Addr { ip, netmask, prefixlen: 24, broadcast: None });
            Interface { name: String::new(), addr, index: None, oper_status, is_p2p: false }
        };
        let found = in_networks(vec![
            interface("127.0.0.1", IfOperStatus::Up),
            interface("172.17.0.1", IfOperStatus::Down),
            interface("169.254.7.9", IfOperStatus::Up),
            interface("10.42.0.1", IfOperStatus::Up),
        ]);
        let found: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(found, ["10.42.0.1", "169.254.7.9"]);
    }

    #[test]
    fn small_packets_and_slow_cables_are_reported() {
        let verdict = |folder: &tempfile::TempDir| Link::read(folder.path()).unwrap().finding().verdict;
        assert_eq!(verdict(&interface("9000\n", "1000\n", "up\n")), Verdict::Well);
        assert_eq!(verdict(&interface("1500\n", "1000\n", "up\n")), Verdict::Advice);
        assert_eq!(verdict(&interface("9000\n", "100\n", "up\n")), Verdict::Advice);
        // A virtual machine's card reports no speed.
        assert_eq!(verdict(&interface("9000\n", "-1\n", "up\n")), Verdict::Well);
    }

    #[test]
    fn an_interface_that_is_down_is_left_out() {
        assert_eq!(Link::read(interface("1500\n", "1000\n", "down\n").path()), None);
    }
}

//! The network: where a tablet can reach this machine, and whether its cables suit a GigE camera.

use std::net::{IpAddr, UdpSocket};
use std::path::Path;

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

/// The address at which other devices can reach this machine.
pub fn addresses() -> Finding {
    match outward() {
        Some(address) => Finding::well(NETWORK, format!("A tablet can reach this machine at {address}.")),
        None => Finding::advice(
            NETWORK,
            "This machine is not connected to a network.",
            "Connect it to the tablet's network, unless all pages are opened on this machine.",
        ),
    }
}

/// The address from which this machine would reach the world; `None` if it is not in a network.
///
/// Connecting a datagram socket sends nothing; it only picks the route and so this machine's address on it. The
/// destination is an address reserved for documentation (RFC 5737).
pub fn outward() -> Option<IpAddr> {
    let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
    socket.connect("192.0.2.1:9").ok()?;
    socket.local_addr().ok().map(|address| address.ip())
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

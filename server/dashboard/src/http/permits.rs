//! Permits: the limits on the number of connections, per host and in total, and which connection gives way.
//!
//! A connection is a stranger until one of its requests shows a role's key or cookie, or the token of somebody who is
//! signed in. From then on it is a member. Strangers and members have permits of their own, so that no number of
//! strangers can use up the members'. If strangers have none left, the newest gets that of the oldest: a client with a
//! key shows it at once, but one that only wants to use them up waits.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::http::HeaderMap;
use tokio::sync::oneshot;

use super::credentials::holds;
use super::keys::{Keys, ROLES};

/// Largest number of connections of a kind.
#[derive(Debug, Clone, Copy)]
struct Room {
    /// From one host.
    host: usize,
    /// From all hosts together.
    all: usize,
}

/// Limits for strangers. A browser opens up to six connections, and several browsers may share one address.
const STRANGERS: Room = Room { host: 32, all: 128 };

/// Limits for members: some fifteen pages per host. Each page holds a WebSocket, and up to six more connections while
/// it loads. Together with strangers and the server's own files, this is well below the 1,024 files that a process may
/// usually have open.
const MEMBERS: Room = Room { host: 128, all: 512 };

/// All permits.
#[derive(Clone, Default)]
pub struct Permits(Arc<Mutex<GivenPermits>>);

#[derive(Default)]
struct GivenPermits {
    /// By number, so the oldest comes first.
    connections: BTreeMap<u64, Connection>,
    next: u64,
}

struct Connection {
    host: IpAddr,
    member: bool,
    /// Dropped to make the connection give way.
    _stay: oneshot::Sender<()>,
}

/// A connection's permit; freed when dropped.
#[must_use]
pub struct Permit {
    /// The host that the connection came from.
    pub host: IpAddr,
    number: u64,
    permits: Permits,
}

/// Error: there is no permit left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoPermitLeft;

impl Permits {
    /// Gives a connection from `address` a stranger's permit. The receiver fails when the connection must give way.
    pub fn take(&self, address: IpAddr) -> (Permit, oneshot::Receiver<()>) {
        let host = host(address);
        let mut given = self.given();
        if given.count(false, Some(host)) >= STRANGERS.host {
            given.remove_oldest_stranger(Some(host));
        } else if given.count(false, None) >= STRANGERS.all {
            given.remove_oldest_stranger(None);
        }

        let number = given.next;
        given.next += 1;
        let (stay, give_way) = oneshot::channel();
        given.connections.insert(number, Connection { host, member: false, _stay: stay });
        (Permit { host, number, permits: self.clone() }, give_way)
    }

    fn given(&self) -> MutexGuard<'_, GivenPermits> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl GivenPermits {
    fn count(&self, member: bool, host: Option<IpAddr>) -> usize {
        let counts = |there: &&Connection| there.member == member && host.is_none_or(|host| there.host == host);
        self.connections.values().filter(counts).count()
    }

    fn remove_oldest_stranger(&mut self, host: Option<IpAddr>) {
        let gives_way = |there: &Connection| !there.member && host.is_none_or(|host| there.host == host);
        let oldest = self.connections.iter().find(|(_, there)| gives_way(there)).map(|(number, _)| *number);
        if let Some(oldest) = oldest {
            self.connections.remove(&oldest);
        }
    }
}

impl Permit {
    /// Makes the connection a member if a request with `headers` shows one of `keys`, or if somebody is `signed_in`.
    ///
    /// # Errors
    /// If members have no permit left.
    pub fn admit(&self, headers: &HeaderMap, keys: &Keys, signed_in: bool) -> Result<(), NoPermitLeft> {
        if self.is_members() || !signed_in && !ROLES.into_iter().any(|role| holds(headers, keys, role)) {
            return Ok(());
        }
        self.make_members()
    }

    fn is_members(&self) -> bool {
        self.permits.given().connections.get(&self.number).is_some_and(|there| there.member)
    }

    fn make_members(&self) -> Result<(), NoPermitLeft> {
        let mut given = self.permits.given();
        let Some(there) = given.connections.get(&self.number) else {
            // It has just given way.
            return Err(NoPermitLeft);
        };

        if there.member {
            return Ok(());
        }

        if given.count(true, Some(there.host)) >= MEMBERS.host || given.count(true, None) >= MEMBERS.all {
            return Err(NoPermitLeft);
        }

        if let Some(there) = given.connections.get_mut(&self.number) {
            there.member = true;
        }
        Ok(())
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        self.permits.given().connections.remove(&self.number);
    }
}

/// What counts as one host: an IPv4 address, or a whole IPv6 network (/64), because one machine can use any address
/// in it.
fn host(address: IpAddr) -> IpAddr {
    const NETWORK: u128 = !0 << 64;
    match address.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & NETWORK)),
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOST: IpAddr = IpAddr::V4(std::net::Ipv4Addr::new(192, 0, 2, 1));

    fn gave_way(permit: &mut (Permit, oneshot::Receiver<()>)) -> bool {
        permit.1.try_recv() == Err(oneshot::error::TryRecvError::Closed)
    }

    #[test]
    fn the_oldest_stranger_of_a_host_gives_way_and_a_member_never() {
        let permits = Permits::default();
        let mut member = permits.take(HOST);
        member.0.make_members().unwrap();
        let mut strangers: Vec<_> = (0..=STRANGERS.host).map(|_| permits.take(HOST)).collect();
        assert!(gave_way(&mut strangers[0]) && !gave_way(&mut strangers[1]) && !gave_way(&mut member));
        // A stranger that leaves frees its permit.
        strangers.pop();
        let _another = permits.take(HOST);
        assert!(!gave_way(&mut strangers[1]));
    }

    #[test]
    fn strangers_of_many_hosts_have_room_for_so_many_in_all() {
        let permits = Permits::default();
        let host = |number: usize| IpAddr::from([10, 0, 0, u8::try_from(number / 30).unwrap()]);
        let mut strangers: Vec<_> = (0..=STRANGERS.all).map(|number| permits.take(host(number))).collect();
        assert!(gave_way(&mut strangers[0]) && !gave_way(&mut strangers[1]));
    }

    #[test]
    fn members_have_permits_up_to_a_number() {
        let permits = Permits::default();
        let member = |_| {
            let taken = permits.take(HOST);
            taken.0.make_members().unwrap();
            taken
        };

        let _members: Vec<_> = (0..MEMBERS.host).map(member).collect();
        let (one_more, _stay) = permits.take(HOST);
        assert_eq!(one_more.make_members(), Err(NoPermitLeft));
        let (elsewhere, _stay_too) = permits.take("198.51.100.7".parse().unwrap());
        assert_eq!(elsewhere.make_members(), Ok(()));
    }

    #[test]
    fn an_ipv6_network_counts_as_one_host_and_an_embedded_address_as_itself() {
        let counts_as = |address: &str| host(address.parse().unwrap());
        assert_eq!(counts_as("2001:db8::1"), counts_as("2001:db8::ffff:1"));
        assert_ne!(counts_as("2001:db8::1"), counts_as("2001:db8:0:1::1"));
        assert_eq!(counts_as("::ffff:192.0.2.1"), HOST);
    }
}

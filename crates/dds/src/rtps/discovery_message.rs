//! Message to the discovery addresses of all participants that may know this one.
//!
//! RustDDS does not return the discovery address of another participant. So a message is sent to the multicast group,
//! to each participant slot of this host, and to the slots of the discovered endpoints.

use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::thread;
use std::time::Duration;

use rustdds::DomainParticipant;

use crate::environment::DiscoveryRange;

// Ports of a domain (RTPS 2.5, 9.6.2.3).
const PORT_BASE: u32 = 7400;
const PORTS_PER_DOMAIN: u32 = 250;
const DISCOVERY_UNICAST_OFFSET: u32 = 10;
const PORTS_PER_PARTICIPANT: u32 = 2;
const DISCOVERY_MULTICAST: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// Largest number of participants on one host; the ports of more would overlap the next domain.
const PARTICIPANTS_PER_HOST: u32 = 120;

/// Number of transmissions of a repeated message, because datagrams can be lost.
const ROUNDS: usize = 3;
/// Time between two transmissions.
const ROUND_PERIOD: Duration = Duration::from_millis(15);

/// Message with its destinations; can be sent after its participant has been dropped.
#[derive(Debug, Clone)]
pub(crate) struct DiscoveryMessage {
    datagram: Vec<u8>,
    destinations: BTreeSet<SocketAddr>,
    /// Source addresses, one socket each: the source address selects the interface of a multicast.
    sources: Vec<Ipv4Addr>,
}

impl DiscoveryMessage {
    /// Creates a message for the participants that may know `participant`.
    pub(crate) fn new(datagram: Vec<u8>, participant: &DomainParticipant, range: DiscoveryRange) -> Self {
        let endpoints: Vec<SocketAddr> = participant
            .discovered_readers()
            .iter()
            .flat_map(|reader| reader.reader_proxy.unicast_locator_list.clone())
            .chain(
                participant
                    .discovered_writers()
                    .iter()
                    .flat_map(|writer| writer.writer_proxy.unicast_locator_list.clone()),
            )
            .map(SocketAddr::from)
            .collect();
        Self {
            datagram,
            destinations: destinations(participant.domain_id(), range, &endpoints),
            sources: match range {
                DiscoveryRange::Off => Vec::new(),
                DiscoveryRange::Localhost => vec![Ipv4Addr::LOCALHOST],
                DiscoveryRange::Subnet | DiscoveryRange::SystemDefault => {
                    vec![Ipv4Addr::LOCALHOST, Ipv4Addr::UNSPECIFIED]
                }
            },
        }
    }

    /// Sends the message [`ROUNDS`] times, which takes about 30 ms. Send errors are ignored.
    pub(crate) fn send(&self) {
        for round in 0..ROUNDS {
            if round > 0 {
                thread::sleep(ROUND_PERIOD);
            }
            self.send_once();
        }
    }

    /// Sends the message once to each destination.
    pub(crate) fn send_once(&self) {
        for source in &self.sources {
            if let Ok(socket) = UdpSocket::bind((*source, 0)) {
                let from_loopback = socket.local_addr().is_ok_and(|from| from.ip().is_loopback());
                for to in &self.destinations {
                    // Only multicast goes out by both sockets.
                    if to.ip().is_multicast() || to.ip().is_loopback() == from_loopback {
                        let _ = socket.send_to(&self.datagram, to);
                    }
                }
            }
        }
    }
}

/// Returns the port at which a participant of this host receives unicast discovery messages, if it exists.
pub(crate) fn discovery_port(domain_id: u16, participant_id: u16) -> Option<u16> {
    let first = PORT_BASE + PORTS_PER_DOMAIN * u32::from(domain_id) + DISCOVERY_UNICAST_OFFSET;
    u16::try_from(first + PORTS_PER_PARTICIPANT * u32::from(participant_id)).ok()
}

/// Returns the port at which a participant of this host receives unicast samples, if it exists: the one after that of
/// discovery messages.
pub(crate) fn user_port(domain_id: u16, participant_id: u16) -> Option<u16> {
    discovery_port(domain_id, participant_id)?.checked_add(1)
}

/// Returns the discovery addresses of all participants that may know this one: the multicast group, each participant
/// slot of this host, and the slots of the discovered endpoints.
fn destinations(domain_id: u16, range: DiscoveryRange, endpoints: &[SocketAddr]) -> BTreeSet<SocketAddr> {
    if range == DiscoveryRange::Off {
        return BTreeSet::new();
    }
    let first_port = PORT_BASE + PORTS_PER_DOMAIN * u32::from(domain_id);
    let first_unicast = first_port + DISCOVERY_UNICAST_OFFSET;
    let address = |ip: IpAddr, port: u32| u16::try_from(port).ok().map(|port| SocketAddr::new(ip, port));

    let multicast = address(DISCOVERY_MULTICAST.into(), first_port);
    let this_machine = (0..PARTICIPANTS_PER_HOST)
        .filter_map(|slot| address(Ipv4Addr::LOCALHOST.into(), first_unicast + PORTS_PER_PARTICIPANT * slot));
    // User traffic goes to the odd port just above the participant's discovery port.
    let discovered = endpoints.iter().filter_map(|endpoint| {
        let user_port = u32::from(endpoint.port());
        let is_in_slot = (first_unicast + 1..first_port + PORTS_PER_DOMAIN).contains(&user_port)
            && (user_port - first_unicast) % PORTS_PER_PARTICIPANT == 1;
        let is_reachable =
            endpoint.is_ipv4() && (range != DiscoveryRange::Localhost || endpoint.ip().is_loopback());
        (is_in_slot && is_reachable).then(|| address(endpoint.ip(), user_port - 1)).flatten()
    });
    multicast.into_iter().chain(this_machine).chain(discovered).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn localhost_has_loopback_and_multicast_destinations_only() {
        let discovered = ["192.0.2.7:17411".parse().unwrap(), "127.0.0.1:17413".parse().unwrap()];
        let addresses = destinations(40, DiscoveryRange::Localhost, &discovered);
        assert!(addresses.iter().all(|p| p.ip().is_loopback() || p.ip().is_multicast()));
        assert_eq!(addresses.len(), 1 + 120);
        assert!(addresses.contains(&"239.255.0.1:17400".parse().unwrap()));
        assert!(addresses.contains(&"127.0.0.1:17410".parse().unwrap()));
        assert!(destinations(40, DiscoveryRange::Off, &discovered).is_empty());
    }

    #[test]
    fn discovered_hosts_are_addressed_at_their_discovery_port() {
        let discovered: Vec<SocketAddr> = [
            "192.0.2.7:17411",
            "192.0.2.7:17411",
            "192.0.2.8:17416", // an even port is not a user port
            "192.0.2.9:50000", // not from the port formula
            "[2001:db8::1]:17411",
        ]
        .iter()
        .map(|text| text.parse().unwrap())
        .collect();
        let addresses = destinations(40, DiscoveryRange::Subnet, &discovered);
        assert_eq!(addresses.len(), 1 + 120 + 1);
        assert!(addresses.contains(&"192.0.2.7:17410".parse().unwrap()));
    }

    #[test]
    fn the_last_domain_does_not_overflow_the_ports() {
        let addresses = destinations(232, DiscoveryRange::Subnet, &[]);
        assert!(addresses.iter().all(|p| p.port() >= 65400));
        assert!(addresses.len() > 60);
    }
}

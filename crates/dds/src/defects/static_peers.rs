//! Announcement of the participant to the hosts in `ROS_STATIC_PEERS`, for networks without multicast.
//!
//! **Symptom:** without multicast, a node is not discovered by the hosts that it names.
//!
//! **Upstream:** RustDDS 0.15.1 announces its participant by multicast and to the participants of this host, and has no
//! list of initial peers.
//!
//! **Test:** `test_py/test_two_hosts.py`.
//!
//! **Superfluous when** RustDDS has initial peers.
//!
//! A socket on a discovery port of this host receives the announcements too, and they are forwarded as they are to the
//! discovery ports of the peers, which respond to the participant itself.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, ToSocketAddrs, UdpSocket};
use std::thread;

use rustdds::{DomainParticipant, RTPSEntity};
use tracing::warn;

use crate::hosts;
use crate::rtps::discovery_message::discovery_port;

/// Number of participants of this host to which RustDDS 0.15 sends its announcement.
const ANNOUNCED_PARTICIPANTS: u16 = 12;
/// Number of participants of a peer that receive the announcement.
const PARTICIPANTS_OF_PEER: u16 = 32;
/// Octets of the GUID prefix in the header of a message (RTPS 2.5, 9.4.4).
const GUID_PREFIX: std::ops::Range<usize> = 8..20;

/// Starts a thread that forwards the announcements of a participant to `peers`, names or addresses of hosts, until the
/// process ends. Errors are logged.
pub(crate) fn announce(participant: &DomainParticipant, peers: &[String]) {
    let (own, domain_id, peers) = (participant.guid().to_bytes(), participant.domain_id(), peers.to_vec());
    if peers.is_empty() {
        return;
    }
    let forward = move || {
        if let Err(error) = forward(&own[..12], domain_id, &peers) {
            warn!("this node is not announced to ROS_STATIC_PEERS ({}): {error}", peers.join(", "));
        }
    };
    if let Err(error) = thread::Builder::new().name("static peers".to_owned()).spawn(forward) {
        warn!("this node is not announced to ROS_STATIC_PEERS: {error}");
    }
}

fn forward(own: &[u8], domain_id: u16, peers: &[String]) -> io::Result<()> {
    let announcements = bind(domain_id)?;
    let out = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    let mut buffer = vec![0; 1 << 16];
    for peer in peers.iter().filter(|peer| addresses(peer, domain_id).is_empty()) {
        warn!(
            "ROS_STATIC_PEERS: {} has no IPv4 address at present; entries are names or IPv4 addresses of hosts, separated \
             by semicolons, and names are looked up again",
            peer.escape_debug()
        );
    }
    loop {
        let (length, _) = announcements.recv_from(&mut buffer)?;
        let datagram = &buffer[..length];
        if datagram.get(GUID_PREFIX) == Some(own) {
            for address in peers.iter().flat_map(|peer| addresses(peer, domain_id)) {
                hosts::permit(*address.ip());
                // The peer may be unreachable at present.
                let _ = out.send_to(datagram, address);
            }
        }
    }
}

/// Returns the discovery addresses of a peer. Its name is resolved each time, since it may appear later.
fn addresses(peer: &str, domain_id: u16) -> Vec<SocketAddrV4> {
    let ipv4 = |address| match address {
        SocketAddr::V4(address) => Some(*address.ip()),
        SocketAddr::V6(_) => None,
    };
    let resolved = (peer, 0).to_socket_addrs().into_iter().flatten().filter_map(ipv4);
    let ports = (0..PARTICIPANTS_OF_PEER).filter_map(|id| discovery_port(domain_id, id));
    let ports: Vec<u16> = ports.collect();
    resolved.flat_map(|host| ports.iter().map(move |port| SocketAddrV4::new(host, *port))).collect()
}

/// Binds the highest discovery port of this host that receives announcements and is free.
fn bind(domain_id: u16) -> io::Result<UdpSocket> {
    let mut ports = (0..ANNOUNCED_PARTICIPANTS).rev().filter_map(|id| discovery_port(domain_id, id));
    let socket = ports.find_map(|port| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok());
    socket.ok_or_else(|| io::Error::new(io::ErrorKind::AddrInUse, "no free discovery port on this host"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_has_the_discovery_ports_of_its_participants() {
        let addresses = addresses("192.0.2.7", 40);
        assert_eq!(addresses.len(), 32);
        assert_eq!(addresses[0], "192.0.2.7:17410".parse().unwrap());
        assert_eq!(addresses[31], "192.0.2.7:17472".parse().unwrap());
        assert!(super::addresses("::1", 40).is_empty());
    }
}

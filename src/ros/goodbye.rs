//! The last word of a participant or of a writer, in a form that Fast DDS understands.
//!
//! RustDDS disposes of its participant when it is dropped, with a DATA submessage that carries the
//! key (the participant's GUID) as a parameter list of 28 octets. Fast DDS passes over any key-only
//! payload of more than 16 octets, finds no PID_KEY_HASH among the inline QoS either, and so does
//! not learn *who* left: the node stays in its graph until the lease ends, after about 50 s. The
//! same holds for single endpoints. The datagram here says it with the key hash, which every
//! implementation has to take (RTPS 2.5, 9.6.4.8):
//!
//! ```text
//! RTPS header (20) | DATA (4 + 20): SPDP writer, sequence number |
//!     PID_KEY_HASH: participant GUID | PID_STATUS_INFO: disposed, unregistered | PID_SENTINEL
//! ```

use std::{
    collections::BTreeSet,
    net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket},
    thread,
    time::Duration,
};

use rustdds::{DomainParticipant, RTPSEntity};

use super::environment::DiscoveryRange;
use super::rtps::{Data, EntityId, Guid, Message};

// RTPS 2.5, 9.6.2.3: the ports of a domain.
const PORT_BASE: u32 = 7400;
const PORTS_PER_DOMAIN: u32 = 250;
const DISCOVERY_UNICAST_OFFSET: u32 = 10;
const PORTS_PER_PARTICIPANT: u32 = 2;
const DISCOVERY_MULTICAST: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// Participants on one machine: with more, the ports would run into the next domain's.
const PARTICIPANTS_PER_HOST: u32 = 120;

/// 9.3.1.3: the writer of the announcements.
const SPDP_WRITER: EntityId = [0x00, 0x01, 0x00, 0xc2];
/// That of announcements of writers.
const SEDP_PUBLICATIONS_WRITER: EntityId = [0x00, 0x00, 0x03, 0xc2];
const PID_KEY_HASH: u16 = 0x0070;
const PID_STATUS_INFO: u16 = 0x0071;
const DISPOSED_AND_UNREGISTERED: [u8; 4] = [0, 0, 0, 3];

/// Readers keep only what is newer than the last announcement; those count up from 1, one every
/// few seconds.
const LAST_SEQUENCE_NUMBER: i64 = 1 << 32;

/// Datagrams get lost: the word is given this many times, this far apart.
const ROUNDS: usize = 3;
const ROUND_PERIOD: Duration = Duration::from_millis(15);

/// A goodbye that is ready to be sent, also when its participant is already gone.
#[derive(Debug, Clone)]
pub(super) struct Goodbye {
    datagram: Vec<u8>,
    destinations: BTreeSet<SocketAddr>,
    /// One socket for each: the source address selects the interface of a multicast.
    sources: Vec<Ipv4Addr>,
}

impl Goodbye {
    /// Notes who `participant` is, and whom it has met so far.
    pub(super) fn of(participant: &DomainParticipant, range: DiscoveryRange) -> Self {
        let guid = participant.guid().to_bytes();
        Self::with(dispose_datagram(&guid, SPDP_WRITER, LAST_SEQUENCE_NUMBER), participant, range)
    }

    /// Of one of its writers. RustDDS announces writers in samples that are numbered: `number` is that of the one in which
    /// it disposes of this writer, which it is about to send. Who has this one takes that for a repetition.
    pub(super) fn of_writer(
        writer: &Guid,
        number: i64,
        participant: &DomainParticipant,
        range: DiscoveryRange,
    ) -> Self {
        Self::with(dispose_datagram(writer, SEDP_PUBLICATIONS_WRITER, number), participant, range)
    }

    fn with(datagram: Vec<u8>, participant: &DomainParticipant, range: DiscoveryRange) -> Self {
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

    /// Sends it some times; takes about 30 ms. What cannot be reached is left alone: there is nobody to tell.
    pub(super) fn send(&self) {
        for round in 0..ROUNDS {
            if round > 0 {
                thread::sleep(ROUND_PERIOD);
            }
            self.send_once();
        }
    }

    /// Sends it once.
    pub(super) fn send_once(&self) {
        for source in &self.sources {
            if let Ok(socket) = UdpSocket::bind((*source, 0)) {
                let from_loopback = socket.local_addr().is_ok_and(|from| from.ip().is_loopback());
                for to in &self.destinations {
                    // Nothing but multicast may go out by both.
                    if to.ip().is_multicast() || to.ip().is_loopback() == from_loopback {
                        let _ = socket.send_to(&self.datagram, to);
                    }
                }
            }
        }
    }
}

/// The whole datagram for the participant or the endpoint with this GUID, as that sample of this writer of announcements.
fn dispose_datagram(guid: &Guid, writer: EntityId, sequence_number: i64) -> Vec<u8> {
    Message::from(guid).data(&Data {
        writer,
        sequence_number,
        inline_qos: &[(PID_KEY_HASH, guid), (PID_STATUS_INFO, &DISPOSED_AND_UNREGISTERED)],
        payload: None,
    })
}

/// Every place where a participant that may know us listens for discovery: the multicast group,
/// each participant slot of this machine, and the slots of the endpoints that we have met.
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
    let met = endpoints.iter().filter_map(|endpoint| {
        let user_port = u32::from(endpoint.port());
        let in_a_slot = (first_unicast + 1..first_port + PORTS_PER_DOMAIN).contains(&user_port)
            && (user_port - first_unicast) % PORTS_PER_PARTICIPANT == 1;
        let reachable =
            endpoint.is_ipv4() && (range != DiscoveryRange::Localhost || endpoint.ip().is_loopback());
        (in_a_slot && reachable).then(|| address(endpoint.ip(), user_port - 1)).flatten()
    });
    multicast.into_iter().chain(this_machine).chain(met).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datagram_carries_the_key_hash_that_fast_dds_looks_for() {
        let guid: [u8; 16] = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 1, 0xc1];
        let datagram = dispose_datagram(&guid, SPDP_WRITER, LAST_SEQUENCE_NUMBER);
        assert_eq!(&datagram[..8], b"RTPS\x02\x04\x01\x12");
        assert_eq!(datagram[8..20], guid[..12]);
        assert_eq!(datagram[20..24], [0x15, 0x03, 52, 0]);
        assert_eq!(datagram.len(), 24 + 52);
        // Flags, octets to inline QoS, reader, writer, sequence number 1·2³² + 0.
        assert_eq!(datagram[24..44], [0, 0, 16, 0, 0, 0, 0, 0, 0, 1, 0, 0xc2, 1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(datagram[44..48], [0x70, 0, 16, 0]);
        assert_eq!(datagram[48..64], guid);
        assert_eq!(datagram[64..], [0x71, 0, 4, 0, 0, 0, 0, 3, 1, 0, 0, 0]);
    }

    #[test]
    fn localhost_never_leaves_the_machine() {
        let met = ["192.0.2.7:17411".parse().unwrap(), "127.0.0.1:17413".parse().unwrap()];
        let places = destinations(40, DiscoveryRange::Localhost, &met);
        assert!(places.iter().all(|p| p.ip().is_loopback() || p.ip().is_multicast()));
        assert_eq!(places.len(), 1 + 120);
        assert!(places.contains(&"239.255.0.1:17400".parse().unwrap()));
        assert!(places.contains(&"127.0.0.1:17410".parse().unwrap()));
        assert!(destinations(40, DiscoveryRange::Off, &met).is_empty());
    }

    #[test]
    fn hosts_that_were_met_are_told_at_their_discovery_port() {
        let met: Vec<SocketAddr> = [
            "192.0.2.7:17411",
            "192.0.2.7:17411",
            "192.0.2.8:17416", // an even port is nobody's user port
            "192.0.2.9:50000", // not from the port formula
            "[2001:db8::1]:17411",
        ]
        .iter()
        .map(|text| text.parse().unwrap())
        .collect();
        let places = destinations(40, DiscoveryRange::Subnet, &met);
        assert_eq!(places.len(), 1 + 120 + 1);
        assert!(places.contains(&"192.0.2.7:17410".parse().unwrap()));
    }

    #[test]
    fn the_last_domain_does_not_overflow_the_ports() {
        let places = destinations(232, DiscoveryRange::Subnet, &[]);
        assert!(places.iter().all(|p| p.port() >= 65400));
        assert!(places.len() > 60);
    }
}

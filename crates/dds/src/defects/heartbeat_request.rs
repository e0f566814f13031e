//! Request of a HEARTBEAT from a Fast DDS publisher that RustDDS has matched late.
//!
//! **Symptom:** the message of `ros2 topic pub --once` is lost in one of ten cases; the first message of a publisher that
//! is older than the node arrives after 3 s, and its announcements after 1 s.
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/rtps_writer_proxy.rs` line 94: the first ACKNACK of a reader, which requests the
//! HEARTBEAT that it has missed before the match, has the count 0, which Fast DDS takes for a repetition; its base is 1
//! (RTPS 2.5, 8.3.5.5), for which Fast DDS restarts its heartbeat period of 3 s. Without a HEARTBEAT RustDDS waits for
//! sample 1.
//!
//! **Test:** `test_py/test_publish_once.py`, `test_py/test_faults_process.py`.
//!
//! **Superfluous when** RustDDS counts ACKNACKs from 1 and sends the first with base 0.
//!
//! [`HeartbeatRequests`] sends two datagrams as soon as a publisher is matched:
//!
//! ```text
//! to the own reader: RTPS header (20), INFO_DST (4 + 12), INFO_REPLY (4 + 32): socket of the request |
//!     HEARTBEAT (4 + 28): samples 1 to 0, count 1
//! to the publisher: RTPS header (20) | INFO_DST (4 + 12) | ACKNACK (4 + 24): base 0, empty, count 1 |
//!     NACK_FRAG (4 + 32): sample 1, fragments {1}, count 1
//! ```
//!
//! - The empty HEARTBEAT in the name of the publisher lets RustDDS spend count 1 for an ACKNACK that goes nowhere. The
//!   publisher has used count 1 for the HEARTBEAT at the match.
//! - Fast DDS answers the ACKNACK with a HEARTBEAT, since its base is 0 and its count new. To that, RustDDS answers
//!   with count 2, which is new, too.
//! - The NACK_FRAG reports the first fragment of sample 1 as missing. Fast DDS repeats the whole sample with a HEARTBEAT,
//!   if it still has it. RustDDS discards samples that it has already received. RustDDS never uses count 1 for a
//!   NACK_FRAG: its first two counts go to ACKNACKs.
//!
//! The HEARTBEATs of the announcements of a participant are requested if no endpoint of it is known after 0.15 s; an
//! earlier request would reach participants that do not know the node yet. A publisher that learns of the node after the
//! request discards it, and its first HEARTBEAT, of count 1, seems a repetition of the empty one: requests are repeated for
//! a second, and ignored by one that has accepted an ACKNACK.

use std::collections::VecDeque;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::time::{Duration, Instant};

use rustdds::{DomainParticipant, GUID, RTPSEntity};
use tracing::debug;

use crate::environment::DiscoveryRange;
use crate::rtps::discovery_message::{DiscoveryMessage, discovery_port, user_port};
use crate::rtps::{EntityId, Guid, Message, entity, is_secured};

/// First two octets of the participant id of Fast DDS (RTPS 2.5, 9.3.1.1).
const VENDOR_FAST_DDS: [u8; 2] = [0x01, 0x0f];
/// Writers of the announcements of publishers and subscriptions (9.3.1.3). The last octet of their readers is
/// `READER_KIND`.
const ANNOUNCEMENT_WRITERS: [EntityId; 2] = [[0, 0, 3, 0xc2], [0, 0, 4, 0xc2]];
const READER_KIND: u8 = 0xc7;
/// Mask of an entity kind that is zero for endpoints of the application.
const BUILT_IN: u8 = 0xf0;

/// Time between two requests, and from the discovery of a participant to the first one.
const PERIOD: Duration = Duration::from_millis(150);
/// Number of repetitions of a request.
const REPETITIONS: u32 = 6;
/// Count of the messages: the first one that Fast DDS and RustDDS do not take for a duplicate.
const COUNT: u32 = 1;

/// Request that may be repeated.
#[derive(Debug, Clone, Copy)]
enum Request {
    /// To a publisher of a reader of this node.
    Publisher { reader: GUID, writer: GUID },
    /// To a participant without known endpoints.
    Participant(GUID),
}

/// Requests of HEARTBEATs from new publishers and participants.
pub(crate) struct HeartbeatRequests {
    socket: UdpSocket,
    /// Address of the socket, which reads nothing.
    address: SocketAddrV4,
    /// Requests to be sent, by their times, each with the number of those sent before.
    queue: VecDeque<(Instant, Request, u32)>,
}

impl HeartbeatRequests {
    /// Opens the socket. Returns `None` and logs the reason if the system provides none.
    pub(crate) fn open() -> Option<Self> {
        let open = || {
            let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
            socket.set_nonblocking(true)?;
            let address = SocketAddrV4::new(Ipv4Addr::LOCALHOST, socket.local_addr()?.port());
            Ok::<_, io::Error>(HeartbeatRequests { socket, address, queue: VecDeque::new() })
        };
        open()
            .inspect_err(|error| debug!("no HEARTBEAT is requested from publishers: no UDP socket: {error}"))
            .ok()
    }

    /// Requests a HEARTBEAT and the first sample of a publisher that has just been matched with a reader of `participant`.
    pub(crate) fn add_publisher(&mut self, participant: &DomainParticipant, reader: GUID, writer: GUID) {
        if !is_secured() && needs_request(&reader.to_bytes(), &writer.to_bytes()) {
            self.send(participant, DiscoveryRange::Off, Request::Publisher { reader, writer }, 0);
        }
    }

    /// Records a participant that has just been discovered.
    pub(crate) fn add_participant(&mut self, other: GUID) {
        if !is_secured() && other.to_bytes()[..2] == VENDOR_FAST_DDS {
            self.queue.push_back((Instant::now() + PERIOD, Request::Participant(other), 0));
        }
    }

    /// Sends the requests of `participant`, which is announced in `range`, when they are due. Does not end. Cancel-safe.
    pub(crate) async fn run(&mut self, participant: &DomainParticipant, range: DiscoveryRange) {
        while let Some(&(due, _, _)) = self.queue.front() {
            tokio::time::sleep_until(due.into()).await;
            if let Some((_, request, sent)) = self.queue.pop_front() {
                self.send(participant, range, request, sent);
            }
        }
        std::future::pending().await
    }

    /// Sends a request for the `sent`-th time after the first, and queues the next one.
    fn send(&mut self, participant: &DomainParticipant, range: DiscoveryRange, request: Request, sent: u32) {
        match request {
            Request::Publisher { reader, writer } => {
                self.request_of_publisher(participant, reader, writer, sent == 0);
            }
            Request::Participant(other) if has_endpoints(participant, &other.to_bytes()) => return,
            Request::Participant(other) => self.request_of_participant(participant, other, range, sent == 0),
        }
        if sent < REPETITIONS {
            self.queue.push_back((Instant::now() + PERIOD, request, sent + 1));
        }
    }

    fn request_of_publisher(
        &self,
        participant: &DomainParticipant,
        reader: GUID,
        writer: GUID,
        is_first: bool,
    ) {
        let (own, other) = (reader.to_bytes(), writer.to_bytes());
        if let Some(port) = user_port(participant.domain_id(), participant.participant_id())
            && is_first
        {
            self.send_empty_heartbeat(&own, &other, port);
        }
        let request = request(&own, &other);
        for to in addresses(participant, writer) {
            // The publisher may have exited already.
            let _ = self.socket.send_to(&request, to);
        }
    }

    fn request_of_participant(
        &self,
        participant: &DomainParticipant,
        other: GUID,
        range: DiscoveryRange,
        is_first: bool,
    ) {
        let (own, other) = (participant.guid().to_bytes(), other.to_bytes());
        if let Some(port) = discovery_port(participant.domain_id(), participant.participant_id())
            && is_first
        {
            for writer in ANNOUNCEMENT_WRITERS {
                let [own, other] = [(own, reader_of(writer)), (other, writer)].map(endpoint);
                self.send_empty_heartbeat(&own, &other, port);
            }
        }
        DiscoveryMessage::new(announcement_request(&own, &other), participant, range).send_once();
    }

    /// Sends a HEARTBEAT in the name of a writer to a reader of this node at a port of this host.
    fn send_empty_heartbeat(&self, reader: &Guid, writer: &Guid, port: u16) {
        let heartbeat = empty_heartbeat(reader, writer, self.address);
        // Without it, the publisher discards the next ACKNACK.
        let _ = self.socket.send_to(&heartbeat, (Ipv4Addr::LOCALHOST, port));
    }
}

/// Returns true if an endpoint of the participant `other` has been discovered.
fn has_endpoints(participant: &DomainParticipant, other: &Guid) -> bool {
    let is_own = |endpoint: GUID| endpoint.to_bytes()[..12] == other[..12];
    participant.discovered_readers().iter().any(|reader| is_own(reader.reader_proxy.remote_reader_guid))
        || participant
            .discovered_writers()
            .iter()
            .any(|writer| is_own(writer.writer_proxy.remote_writer_guid))
}

/// Returns the built-in reader of a built-in writer.
fn reader_of(writer: EntityId) -> EntityId {
    [writer[0], writer[1], writer[2], READER_KIND]
}

/// Returns the datagram from the readers of the announcements of `other`.
fn announcement_request(own: &Guid, other: &Guid) -> Vec<u8> {
    let message = Message::from_participant(own).to(other);
    let request = |message: Message, writer| message.initial_acknack(reader_of(writer), writer, COUNT);
    ANNOUNCEMENT_WRITERS.into_iter().fold(message, request).octets()
}

/// Returns true for an application writer of Fast DDS and an application reader.
///
/// Other middleware answers the ACKNACK of RustDDS. Built-in writers are requested by participant.
fn needs_request(reader: &Guid, writer: &Guid) -> bool {
    writer[..2] == VENDOR_FAST_DDS && (reader[15] | writer[15]) & BUILT_IN == 0
}

/// Returns the unicast addresses at which a publisher receives ACKNACKs and NACK_FRAGs.
fn addresses(participant: &DomainParticipant, writer: GUID) -> Vec<SocketAddr> {
    participant
        .discovered_writers()
        .into_iter()
        .filter(|found| found.writer_proxy.remote_writer_guid == writer)
        .flat_map(|found| found.writer_proxy.unicast_locator_list)
        .map(SocketAddr::from)
        .filter(|address| address.is_ipv4() && !address.ip().is_unspecified() && address.port() != 0)
        .collect()
}

/// Returns the datagram from the reader to the writer.
fn request(reader: &Guid, writer: &Guid) -> Vec<u8> {
    let [from, of] = [reader, writer].map(entity);
    Message::from_participant(reader)
        .to(writer)
        .initial_acknack(from, of, COUNT)
        .nack_frag(from, of, 1, COUNT)
}

/// Returns the datagram in the name of the writer to the reader, with the address of the reply.
fn empty_heartbeat(reader: &Guid, writer: &Guid, reply: SocketAddrV4) -> Vec<u8> {
    let message = Message::from_participant(writer).to(reader).reply_to(reply);
    message.empty_heartbeat(entity(reader), entity(writer), COUNT)
}

/// Returns the GUID of an endpoint of the participant of `guid`.
fn endpoint((mut guid, entity): (Guid, EntityId)) -> Guid {
    guid[12..].copy_from_slice(&entity);
    guid
}

#[cfg(test)]
mod tests {
    use super::*;

    const READER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 3, 4];
    const WRITER: Guid = [1, 0x0f, 21, 22, 23, 24, 25, 26, 0, 0, 0, 0, 0, 0, 0x13, 3];

    #[test]
    fn the_request_goes_from_the_reader_to_the_writer() {
        let datagram = request(&READER, &WRITER);
        assert_eq!(datagram[8..20], READER[..12]);
        assert_eq!(datagram[24..36], WRITER[..12]);
        assert_eq!(datagram[36..40], [0x06, 1, 24, 0]);
        assert_eq!(datagram[40..48], [0, 0, 3, 4, 0, 0, 0x13, 3]);
        assert_eq!(datagram[64..68], [0x12, 1, 32, 0]);
        assert_eq!(datagram[68..84], [0, 0, 3, 4, 0, 0, 0x13, 3, 0, 0, 0, 0, 1, 0, 0, 0]);
        // Counts of RustDDS continue with 2: a higher one here would make Fast DDS discard them.
        assert_eq!(datagram[60..64], [1, 0, 0, 0]);
        assert_eq!(datagram[96..], [1, 0, 0, 0]);
    }

    #[test]
    fn the_heartbeat_has_the_name_of_the_writer() {
        let datagram = empty_heartbeat(&READER, &WRITER, "127.0.0.1:9".parse().unwrap());
        assert_eq!(datagram[8..20], WRITER[..12]);
        assert_eq!(datagram[24..36], READER[..12]);
        assert_eq!(datagram[36..40], [0x0f, 1, 32, 0]);
        assert_eq!(datagram[72..84], [0x07, 1, 28, 0, 0, 0, 3, 4, 0, 0, 0x13, 3]);
    }

    #[test]
    fn a_participant_is_requested_to_repeat_its_announcements() {
        let datagram = announcement_request(&READER, &WRITER);
        assert_eq!(datagram.len(), 36 + 2 * 28);
        assert_eq!(datagram[36..48], [0x06, 1, 24, 0, 0, 0, 3, 0xc7, 0, 0, 3, 0xc2]);
        assert_eq!(datagram[64..76], [0x06, 1, 24, 0, 0, 0, 4, 0xc7, 0, 0, 4, 0xc2]);
    }

    #[test]
    fn only_application_endpoints_of_fast_dds_are_requested() {
        let with = |mut guid: Guid, index: usize, value: u8| {
            guid[index] = value;
            guid
        };
        assert!(needs_request(&READER, &WRITER));
        assert!(!needs_request(&READER, &with(WRITER, 1, 0x12)), "RustDDS");
        assert!(!needs_request(&READER, &with(WRITER, 1, 0x10)), "Cyclone DDS");
        assert!(!needs_request(&with(READER, 15, 0xc7), &with(WRITER, 15, 0xc2)), "discovery");
    }
}

//! Request of a HEARTBEAT from a Fast DDS publisher that RustDDS has matched late.
//!
//! A Fast DDS participant writes to a new reader as soon as its own side has matched, about 1 ms after discovery.
//! RustDDS ignores messages of a writer that it has not matched yet, which takes a few milliseconds, longer on a loaded
//! machine. It misses the HEARTBEAT that Fast DDS sends at the match, and the samples that follow at once. From a
//! publisher that has published before, RustDDS accepts no sample without a HEARTBEAT, since it waits for sample 1.
//!
//! After matching, RustDDS sends an ACKNACK that requests a HEARTBEAT. Its count is 0, which Fast DDS takes for a
//! duplicate, and its sequence number base is 1 (RTPS 2.5, 8.3.5.5), for which Fast DDS restarts its heartbeat period of
//! 3 s. So the first message of a publisher that is older than the node would wait for 3 s, and that of a publisher
//! that sends one message and exits, such as `ros2 topic pub --once`, would be lost.
//!
//! [`HeartbeatRequest`] sends two datagrams as soon as a publisher is matched:
//!
//! ```text
//! to the publisher: RTPS header (20) | INFO_DST (4 + 12) | ACKNACK (4 + 24): base 0, empty, count 1 |
//!     NACK_FRAG (4 + 32): sample 1, fragments {1}, count 1
//! to the own reader: RTPS header (20), INFO_DST (4 + 12), HEARTBEAT (4 + 28): samples 1 to 0, count 1
//! ```
//!
//! - Fast DDS answers the ACKNACK with a HEARTBEAT, since its base is 0.
//! - The NACK_FRAG reports the first fragment of sample 1 as missing. Fast DDS repeats the whole sample with a HEARTBEAT,
//!   if it still has it. RustDDS discards samples that it has already received. RustDDS never uses count 1 for a
//!   NACK_FRAG: its first two counts go to ACKNACKs.
//! - Fast DDS discards the next ACKNACK of RustDDS, whose count is 1 as well. The empty HEARTBEAT in the name of the
//!   publisher lets RustDDS spend that count at once. The answer to the publisher's own HEARTBEAT has count 2. The
//!   publisher has used count 1 for the HEARTBEAT at the match.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
};

use rustdds::{DomainParticipant, GUID};
use tracing::debug;

use super::dispose::user_port;
use super::rtps::{Guid, Message, entity, is_secured};

/// First two octets of the participant id of Fast DDS (RTPS 2.5, 9.3.1.1).
const VENDOR_FAST_DDS: [u8; 2] = [0x01, 0x0f];
/// Mask of an entity kind that is zero for endpoints of the application.
const BUILT_IN: u8 = 0xf0;

/// Count of the messages: the first one that Fast DDS and RustDDS do not take for a duplicate.
const COUNT: u32 = 1;

/// Socket that requests a HEARTBEAT from each newly matched publisher.
pub(super) struct HeartbeatRequest(UdpSocket);

impl HeartbeatRequest {
    /// Opens the socket. Returns `None` and logs the reason if the system provides none.
    pub(super) fn open() -> Option<Self> {
        match socket() {
            Ok(socket) => Some(HeartbeatRequest(socket)),
            Err(error) => {
                debug!("no HEARTBEAT is requested from publishers: no UDP socket: {error}");
                None
            }
        }
    }

    /// Requests a HEARTBEAT and the first sample of a publisher that has just been matched with a reader of `participant`.
    pub(super) fn send(&self, participant: &DomainParticipant, reader: GUID, writer: GUID) {
        let (own, other) = (reader.to_bytes(), writer.to_bytes());
        if is_secured() || !needs_request(&own, &other) {
            return;
        }
        let request = request(&own, &other);
        for to in addresses(participant, writer) {
            // The publisher may have exited already.
            let _ = self.0.send_to(&request, to);
        }
        if let Some(port) = user_port(participant.domain_id(), participant.participant_id()) {
            // Without it, the publisher discards the next ACKNACK.
            let _ = self.0.send_to(&empty_heartbeat(&own, &other), (Ipv4Addr::LOCALHOST, port));
        }
    }
}

/// Returns true for an application writer of Fast DDS and an application reader.
///
/// Other middleware answers the ACKNACK of RustDDS. Built-in endpoints are excluded: they would answer only after 0.1 s.
fn needs_request(reader: &Guid, writer: &Guid) -> bool {
    writer[..2] == VENDOR_FAST_DDS && (reader[15] | writer[15]) & BUILT_IN == 0
}

fn socket() -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.set_nonblocking(true)?;
    Ok(socket)
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

/// Returns the datagram in the name of the writer to the reader.
fn empty_heartbeat(reader: &Guid, writer: &Guid) -> Vec<u8> {
    Message::from_participant(writer).to(reader).empty_heartbeat(entity(reader), entity(writer), COUNT)
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
        let datagram = empty_heartbeat(&READER, &WRITER);
        assert_eq!(datagram[8..20], WRITER[..12]);
        assert_eq!(datagram[24..36], READER[..12]);
        assert_eq!(datagram[36..48], [0x07, 1, 28, 0, 0, 0, 3, 4, 0, 0, 0x13, 3]);
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

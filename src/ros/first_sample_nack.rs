//! NACK_FRAG that requests the first sample of a Fast DDS publisher that RustDDS has matched late.
//!
//! A Fast DDS participant writes to a new reader as soon as its own side has matched, about 1 ms after discovery.
//! RustDDS ignores samples of a writer that it has not matched yet, which takes a few milliseconds, longer on a loaded
//! machine. After matching, RustDDS sends an ACKNACK that acknowledges nothing and requests a heartbeat. Its sequence
//! number base is 1 (RTPS 2.5, 8.3.5.5). Fast DDS answers at once only if the base is 0, otherwise after its heartbeat
//! period of 3 s. A publisher that sends one message and exits, such as `ros2 topic pub --once`, has left by then, and
//! its sample is lost.
//!
//! [`FirstSampleNack`] sends one datagram as soon as a publisher is matched. It reports the first fragment of sample
//! 1 as missing. Fast DDS then repeats the whole sample with a heartbeat, from which RustDDS detects further missing
//! samples. RustDDS discards samples that it has already received.
//!
//! ```text
//! RTPS header (20) | INFO_DST (4 + 12): the publisher's participant |
//!     NACK_FRAG (4 + 32): reader of this node, the writer, sample 1, fragments {1}, count 1
//! ```
//!
//! An ACKNACK cannot serve here: ACKNACKs carry a count, RustDDS would use the same count again, and Fast DDS would
//! discard that ACKNACK as a duplicate. NACK_FRAGs have a count of their own, and RustDDS never uses count 1 for one:
//! its first two counts go to ACKNACKs.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
};

use rustdds::{DomainParticipant, GUID};
use tracing::debug;

use super::rtps::{Guid, Message, entity, is_secured};

/// First two octets of the participant id of Fast DDS (RTPS 2.5, 9.3.1.1).
const VENDOR_FAST_DDS: [u8; 2] = [0x01, 0x0f];
/// Mask of an entity kind that is zero for endpoints of the application.
const BUILT_IN: u8 = 0xf0;

/// Socket that sends a NACK_FRAG to each newly matched publisher.
pub(super) struct FirstSampleNack(UdpSocket);

impl FirstSampleNack {
    /// Opens the socket. Returns `None` and logs the reason if the system provides none.
    pub(super) fn open() -> Option<Self> {
        match socket() {
            Ok(socket) => Some(FirstSampleNack(socket)),
            Err(error) => {
                debug!("samples published before discovery are not requested: no UDP socket: {error}");
                None
            }
        }
    }

    /// Requests the first sample of a publisher that has just been matched with a reader of `participant`.
    pub(super) fn request_first_sample(&self, participant: &DomainParticipant, reader: GUID, writer: GUID) {
        let (own, other) = (reader.to_bytes(), writer.to_bytes());
        if is_secured() || !needs_request(&own, &other) {
            return;
        }
        let datagram = datagram(&own, &other);
        for to in addresses(participant, writer) {
            // The publisher may have exited already.
            let _ = self.0.send_to(&datagram, to);
        }
    }
}

/// Returns true for an application writer of Fast DDS and an application reader.
///
/// Other middleware answers the ACKNACK. Built-in endpoints are excluded: they would answer only after 0.1 s.
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
fn datagram(reader: &Guid, writer: &Guid) -> Vec<u8> {
    Message::from_participant(reader).to(writer).nack_frag(entity(reader), entity(writer), 1, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const READER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 3, 4];
    const WRITER: Guid = [1, 0x0f, 21, 22, 23, 24, 25, 26, 0, 0, 0, 0, 0, 0, 0x13, 3];

    #[test]
    fn the_datagram_requests_sample_1_from_the_reader_to_the_writer() {
        let datagram = datagram(&READER, &WRITER);
        assert_eq!(datagram[8..20], READER[..12]);
        assert_eq!(datagram[24..36], WRITER[..12]);
        assert_eq!(datagram[40..56], [0, 0, 3, 4, 0, 0, 0x13, 3, 0, 0, 0, 0, 1, 0, 0, 0]);
        // Counts of RustDDS begin at 2: a higher one here would make Fast DDS discard them.
        assert_eq!(datagram[68..], [1, 0, 0, 0]);
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

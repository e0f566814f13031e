//! Asks a publisher again for what it sent before RustDDS had heard of it.
//!
//! Fast DDS tells its participants of a new publisher and writes to them as soon as *it* has
//! matched, about a millisecond later. RustDDS passes over samples of a writer that it does not know
//! yet; it takes a few milliseconds to get to know one, and longer on a busy machine. When it has
//! matched, it says so with an ACKNACK that acknowledges nothing and asks for a heartbeat. Its
//! sequence number base is 1, as RTPS has it (8.3.5.5); Fast DDS sends that heartbeat at once only
//! if the base is 0, otherwise after its heartbeat period of 3 s. A publisher that sends and leaves,
//! as `ros2 topic pub --once`, does not live that long, and its sample is lost.
//!
//! The datagram here is sent as soon as a publisher is matched and asks for its first sample, as
//! if a fragment of it were missing. Fast DDS repeats the whole sample, with a heartbeat, by which
//! RustDDS finds out what else is missing. What it already has, it passes over.
//!
//! ```text
//! RTPS header (20) | INFO_DST (4 + 12): the publisher's participant |
//!     NACK_FRAG (4 + 32): our reader, the writer, sample 1, fragments {1}, count 1
//! ```
//!
//! Why not by an ACKNACK: those are numbered, and a number that is used here RustDDS would use
//! again; Fast DDS would take its next one for a copy. NACK_FRAGs have numbers of their own, and
//! RustDDS never gives one the number 1: its first two numbers go to ACKNACKs.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
};

use rustdds::{DomainParticipant, GUID};
use tracing::debug;

use super::rtps::{Guid, Message, entity, is_secured};

/// How a participant's id begins (9.3.1.1).
const VENDOR_FAST_DDS: [u8; 2] = [0x01, 0x0f];
/// Of an entity kind: 0 for those that an application makes.
const BUILT_IN: u8 = 0xf0;

/// Asks publishers that are matched.
pub(super) struct Asker(UdpSocket);

impl Asker {
    /// Ready to ask; none where there is no socket to be had.
    pub(super) fn open() -> Option<Self> {
        match socket() {
            Ok(socket) => Some(Asker(socket)),
            Err(error) => {
                debug!("what publishers send before they are known is not asked for: {error}");
                None
            }
        }
    }

    /// Asks a publisher that has just been matched with a reader of `participant`.
    pub(super) fn matched(&self, participant: &DomainParticipant, reader: GUID, writer: GUID) {
        let (own, other) = (reader.to_bytes(), writer.to_bytes());
        if is_secured() || !is_asked(&own, &other) {
            return;
        }
        let datagram = datagram(&own, &other);
        for to in addresses(participant, writer) {
            // The publisher may be gone already: then there is nothing to be had.
            let _ = self.0.send_to(&datagram, to);
        }
    }
}

/// Other middleware answers the ACKNACK. Discovery's own endpoints are not asked: they would take
/// 0.1 s to answer.
fn is_asked(reader: &Guid, writer: &Guid) -> bool {
    writer[..2] == VENDOR_FAST_DDS && (reader[15] | writer[15]) & BUILT_IN == 0
}

fn socket() -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// Where a publisher listens to its readers.
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

/// The whole datagram from the reader to the writer.
fn datagram(reader: &Guid, writer: &Guid) -> Vec<u8> {
    Message::from(reader).to(writer).nack_frag(entity(reader), entity(writer), 1, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    const READER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 3, 4];
    const WRITER: Guid = [1, 0x0f, 21, 22, 23, 24, 25, 26, 0, 0, 0, 0, 0, 0, 0x13, 3];

    #[test]
    fn the_first_sample_is_asked_for_in_the_readers_name() {
        let datagram = datagram(&READER, &WRITER);
        assert_eq!(datagram[8..20], READER[..12]);
        assert_eq!(datagram[24..36], WRITER[..12]);
        assert_eq!(datagram[40..56], [0, 0, 3, 4, 0, 0, 0x13, 3, 0, 0, 0, 0, 1, 0, 0, 0]);
        // RustDDS's own begin at 2: a higher one here would make Fast DDS pass over them.
        assert_eq!(datagram[68..], [1, 0, 0, 0]);
    }

    #[test]
    fn only_applications_of_fast_dds_are_asked() {
        let with = |mut guid: Guid, place: usize, value: u8| {
            guid[place] = value;
            guid
        };
        assert!(is_asked(&READER, &WRITER));
        assert!(!is_asked(&READER, &with(WRITER, 1, 0x12)), "RustDDS");
        assert!(!is_asked(&READER, &with(WRITER, 1, 0x10)), "Cyclone DDS");
        assert!(!is_asked(&with(READER, 15, 0xc7), &with(WRITER, 15, 0xc2)), "discovery");
    }
}

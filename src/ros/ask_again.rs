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

use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, StatusEvented};
use tracing::debug;

const PROTOCOL_VERSION: [u8; 2] = [2, 4];
const VENDOR_FAST_DDS: [u8; 2] = [0x01, 0x0f];
/// RustDDS, in whose name this is sent.
const VENDOR_RUSTDDS: [u8; 2] = [0x01, 0x12];
const SUBMESSAGE_INFO_DST: u8 = 0x0e;
const SUBMESSAGE_NACK_FRAG: u8 = 0x12;
const FLAG_LITTLE_ENDIAN: u8 = 0x01;
/// Of an entity kind: 0 for those that an application makes.
const BUILT_IN: u8 = 0xf0;

/// Asks every publisher that is matched from now on, until the task is ended.
pub(super) async fn run(participant: DomainParticipant) {
    let socket = match open() {
        Ok(socket) => socket,
        Err(error) => {
            debug!("what publishers send before they are known is not asked for: {error}");
            return;
        }
    };
    let listener = participant.status_listener();
    let mut events = listener.as_async_status_stream();
    while let Some(event) = events.next().await {
        let DomainParticipantStatusEvent::RemoteWriterMatched { local_reader, remote_writer } = event else {
            continue;
        };
        let (reader, writer) = (local_reader.to_bytes(), remote_writer.to_bytes());
        if !is_asked(&reader, &writer) {
            continue;
        }
        let datagram = datagram(&reader, &writer);
        for to in addresses(&participant, remote_writer) {
            // The publisher may be gone already, or its socket full: then there is nothing to be had.
            let _ = socket.send_to(&datagram, to);
        }
    }
}

fn open() -> io::Result<UdpSocket> {
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

/// Other middleware answers the ACKNACK; discovery repeats itself.
fn is_asked(reader: &[u8; 16], writer: &[u8; 16]) -> bool {
    // A participant's id begins with its vendor.
    writer[..2] == VENDOR_FAST_DDS && (reader[15] | writer[15]) & BUILT_IN == 0
}

/// The whole datagram from the reader to the writer with these GUIDs.
fn datagram(reader: &[u8; 16], writer: &[u8; 16]) -> Vec<u8> {
    let mut question = Vec::with_capacity(32);
    question.extend(&reader[12..]);
    question.extend(&writer[12..]);
    // The sequence number is two words, the high one first.
    for word in [0_u32, 1] {
        question.extend(word.to_le_bytes());
    }
    // A set of fragments: its base, its length in bits, its bits from the highest on; the count.
    for word in [1_u32, 1, 1 << 31, 1] {
        question.extend(word.to_le_bytes());
    }

    let mut datagram = Vec::with_capacity(72);
    datagram.extend(b"RTPS");
    datagram.extend(PROTOCOL_VERSION);
    datagram.extend(VENDOR_RUSTDDS);
    datagram.extend(&reader[..12]);
    for (kind, body) in [(SUBMESSAGE_INFO_DST, &writer[..12]), (SUBMESSAGE_NACK_FRAG, &question)] {
        datagram.extend([kind, FLAG_LITTLE_ENDIAN]);
        datagram.extend((body.len() as u16).to_le_bytes());
        datagram.extend(body);
    }
    datagram
}

#[cfg(test)]
mod tests {
    use super::*;

    const READER: [u8; 16] = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 3, 4];
    const WRITER: [u8; 16] = [1, 0x0f, 21, 22, 23, 24, 25, 26, 0, 0, 0, 0, 0, 0, 0x13, 3];

    #[test]
    fn a_sample_sent_before_the_match_is_asked_for() {
        let datagram = datagram(&READER, &WRITER);
        assert_eq!(&datagram[..8], b"RTPS\x02\x04\x01\x12");
        assert_eq!(datagram[8..20], READER[..12]);
        assert_eq!(datagram[20..24], [0x0e, 1, 12, 0]);
        assert_eq!(datagram[24..36], WRITER[..12]);
        assert_eq!(datagram[36..40], [0x12, 1, 32, 0]);
        assert_eq!(datagram[40..48], [0, 0, 3, 4, 0, 0, 0x13, 3]);
        // Sample 0·2³² + 1, fragments from 1, one bit, set; count.
        assert_eq!(datagram[48..56], [0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(datagram[56..], [1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0x80, 1, 0, 0, 0]);
    }

    #[test]
    fn only_applications_of_fast_dds_are_asked() {
        assert!(is_asked(&READER, &WRITER));
        let with = |mut guid: [u8; 16], place: usize, value: u8| {
            guid[place] = value;
            guid
        };
        assert!(!is_asked(&READER, &with(WRITER, 1, 0x12)), "RustDDS");
        assert!(!is_asked(&READER, &with(WRITER, 1, 0x10)), "Cyclone DDS");
        assert!(!is_asked(&with(READER, 15, 0xc7), &with(WRITER, 15, 0xc2)), "discovery");
    }
}

//! Eviction of the announcement of a participant whose lease has expired.
//!
//! **Symptom:** a participant that was stopped for longer than its lease (Fast DDS: 20 s) and continues stays unknown.
//!
//! **Upstream:** RustDDS 0.15.1, `src/discovery/discovery.rs`: the topic of the announcements keeps the newest 64 of all
//! participants, also of removed ones, and Fast DDS repeats an announcement under the same sequence number, which RustDDS
//! ignores as long as it is kept.
//!
//! **Test:** `test_py/test_faults_subscribers.py`.
//!
//! **Superfluous when** RustDDS drops the announcement of a participant that it removes.
//!
//! 64 samples of a participant that does not exist displace the old announcement; they dispose of that participant, which
//! has no effect.
//!
//! ```text
//! RTPS header (20) | DATA (4 + 20): SPDP writer, sequence number |
//!     PID_STATUS_INFO: disposed, unregistered | PID_SENTINEL | key: PID_PARTICIPANT_GUID | PID_SENTINEL
//! ```

use std::io;
use std::net::{Ipv4Addr, UdpSocket};

use rustdds::{DomainParticipant, RTPSEntity};

use super::dispose::{DISPOSED_AND_UNREGISTERED, PID_STATUS_INFO};
use crate::rtps::discovery_message::discovery_port;
use crate::rtps::{Data, Guid, Message, PARTICIPANTS_WRITER, PL_CDR_LE, is_secured};

/// Number of announcements that RustDDS 0.15 keeps.
const CACHED_ANNOUNCEMENTS: i64 = 64;
const PID_PARTICIPANT_GUID: [u8; 4] = [0x50, 0x00, 16, 0];
const PID_SENTINEL: [u8; 4] = [0x01, 0x00, 0, 0];
/// First two octets of the participant id of RustDDS (RTPS 2.5, 9.3.1.1).
const VENDOR: [u8; 2] = [0x01, 0x12];
/// Entity id of a participant (RTPS 2.5, 9.3.1.3).
const PARTICIPANT: [u8; 4] = [0x00, 0x00, 0x01, 0xc1];

/// Sender of the samples that displace old announcements.
#[derive(Debug, Default)]
pub(crate) struct AnnouncementEviction {
    /// Number of samples sent so far.
    sent: i64,
}

impl AnnouncementEviction {
    /// Displaces the announcements in the cache of `participant`. Nothing is sent under DDS Security.
    ///
    /// # Errors
    /// Error of the operating system if a datagram cannot be sent.
    pub(crate) fn evict(&mut self, participant: &DomainParticipant) -> io::Result<()> {
        let port = discovery_port(participant.domain_id(), participant.participant_id());
        let Some(port) = port.filter(|_| !is_secured()) else { return Ok(()) };
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        let guid = nonexistent(&participant.guid().to_bytes());
        for _ in 0..CACHED_ANNOUNCEMENTS {
            self.sent += 1;
            socket.send_to(&datagram(&guid, self.sent), (Ipv4Addr::LOCALHOST, port))?;
        }
        Ok(())
    }
}

/// Returns the GUID of a participant that does not exist, different for each participant `own`.
fn nonexistent(own: &Guid) -> Guid {
    let mut guid = [0xff; 16];
    guid[..2].copy_from_slice(&VENDOR);
    guid[6..12].copy_from_slice(&own[6..12]);
    guid[12..].copy_from_slice(&PARTICIPANT);
    guid
}

fn datagram(guid: &Guid, sequence_number: i64) -> Vec<u8> {
    let key = [PID_PARTICIPANT_GUID.as_slice(), guid, &PID_SENTINEL].concat();
    Message::from_participant(guid).key(&Data {
        writer: PARTICIPANTS_WRITER,
        sequence_number,
        inline_qos: &[(PID_STATUS_INFO, &DISPOSED_AND_UNREGISTERED)],
        payload: Some((&PL_CDR_LE, &key)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datagram_disposes_of_a_participant_by_its_key() {
        let own: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 1, 0xc1];
        let guid = nonexistent(&own);
        let datagram = datagram(&guid, 3);
        assert_ne!(guid[..12], own[..12]);
        assert_eq!(datagram[8..20], guid[..12]);
        // DATA with inline QoS and key, of 20 + 12 + 4 + 24 octets.
        assert_eq!(datagram[20..24], [0x15, 0x0b, 60, 0]);
        assert_eq!(datagram[32..44], [0, 1, 0, 0xc2, 0, 0, 0, 0, 3, 0, 0, 0]);
        assert_eq!(datagram[44..56], [0x71, 0, 4, 0, 0, 0, 0, 3, 1, 0, 0, 0]);
        assert_eq!(datagram[56..64], [0, 3, 0, 0, 0x50, 0, 16, 0]);
        assert_eq!(datagram[64..80], guid);
        assert_eq!(datagram[80..], [1, 0, 0, 0]);
    }
}

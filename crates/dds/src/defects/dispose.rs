//! Dispose messages of the participant and of a writer, in a form that Fast DDS understands.
//!
//! **Symptom:** a node that has ended stays in the graph of Fast DDS until its lease expires, after about 50 s; a writer
//! that is replaced, for ever.
//!
//! **Upstream:** RustDDS 0.15.1 disposes by a DATA whose key is a parameter list of 28 octets. Fast DDS 2.14 ignores keys of
//! more than 16 octets and finds no PID_KEY_HASH among the inline QoS.
//!
//! **Test:** `test_py/test_shutdown.py`, `test_py/test_graph.py`; of a writer `test_py/test_late_readers.py`.
//!
//! **Superfluous when** RustDDS sends PID_KEY_HASH (RTPS 2.5, 9.6.4.8).
//!
//! ```text
//! RTPS header (20) | DATA (4 + 20): SPDP or SEDP writer, sequence number |
//!     PID_KEY_HASH: GUID | PID_STATUS_INFO: disposed, unregistered | PID_SENTINEL
//! ```

use rustdds::{DomainParticipant, RTPSEntity};

use crate::environment::DiscoveryRange;
use crate::rtps::discovery_message::DiscoveryMessage;
use crate::rtps::{Data, EntityId, Guid, Message, PARTICIPANTS_WRITER};

/// Built-in writer of writer announcements (RTPS 2.5, 9.3.1.3).
const SEDP_PUBLICATIONS_WRITER: EntityId = [0x00, 0x00, 0x03, 0xc2];
const PID_KEY_HASH: u16 = 0x0070;
pub(crate) const PID_STATUS_INFO: u16 = 0x0071;
pub(crate) const DISPOSED_AND_UNREGISTERED: [u8; 4] = [0, 0, 0, 3];

/// Sequence number of the participant's dispose message. Readers accept only numbers above the last announcement;
/// announcements count up from 1, one every few seconds.
const LAST_SEQUENCE_NUMBER: i64 = 1 << 32;

/// Returns the dispose message of `participant`, for the participants discovered so far. It can be sent after the
/// participant has been dropped.
pub(crate) fn of_participant(participant: &DomainParticipant, range: DiscoveryRange) -> DiscoveryMessage {
    let guid = participant.guid().to_bytes();
    DiscoveryMessage::new(
        dispose_datagram(&guid, PARTICIPANTS_WRITER, LAST_SEQUENCE_NUMBER),
        participant,
        range,
    )
}

/// Returns the dispose message of one writer of `participant`.
///
/// RustDDS announces writers by numbered samples. `number` is the sequence number of the sample in which RustDDS is
/// about to dispose of this writer ([`super::announced_writers`]). A participant that has received this message takes
/// the one of RustDDS for a repetition.
pub(crate) fn of_writer(
    writer: &Guid,
    number: i64,
    participant: &DomainParticipant,
    range: DiscoveryRange,
) -> DiscoveryMessage {
    DiscoveryMessage::new(dispose_datagram(writer, SEDP_PUBLICATIONS_WRITER, number), participant, range)
}

/// Returns the datagram that disposes of the participant or endpoint `guid`, as sample `sequence_number` of the
/// built-in `writer`.
fn dispose_datagram(guid: &Guid, writer: EntityId, sequence_number: i64) -> Vec<u8> {
    Message::from_participant(guid).data(&Data {
        writer,
        sequence_number,
        inline_qos: &[(PID_KEY_HASH, guid), (PID_STATUS_INFO, &DISPOSED_AND_UNREGISTERED)],
        payload: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datagram_contains_the_key_hash_that_fast_dds_requires() {
        let guid: [u8; 16] = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 1, 0xc1];
        let datagram = dispose_datagram(&guid, PARTICIPANTS_WRITER, LAST_SEQUENCE_NUMBER);
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
}

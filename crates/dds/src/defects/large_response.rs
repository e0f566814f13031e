//! Delivery of service responses that RustDDS would send in malformed fragments.
//!
//! **Symptom:** a response of more than the path's MTU never arrives, and no later one of that service does.
//!
//! **Upstream:** RustDDS 0.15.1, `src/messages/submessages/data_frag.rs` line 305: the inline QoS of a fragment is written
//! as an `Option`, with an extra octet in front of the parameter list. A response has inline QoS, the identity of its
//! request; samples of topics have none.
//!
//! **Test:** `test_py/test_large_responses.py`.
//!
//! **Superfluous when** RustDDS writes the parameter list alone.
//!
//! A response that may be fragmented is sent twice: by RustDDS, which handles sequence numbers and heartbeats, and by this
//! module as one well-formed DATA submessage in one datagram, for the same writer and with the same sequence number:
//!
//! ```text
//! RTPS header (20) | INFO_TS (4 + 8) | DATA (4 + 20): response writer, sequence number |
//!     PID_RELATED_SAMPLE_IDENTITY, by both its numbers | PID_SENTINEL | CDR_LE | response
//! ```
//!
//! A reader accepts the first copy that it can read, acknowledges it, and ignores the others. The datagram goes to
//! every client of the service, because each client has to account for each sample. It is repeated for some seconds,
//! because RustDDS cannot repair its loss. A final GAP releases clients that never received it: they lose one
//! response instead of all later ones. On a network with a smaller MTU, IP fragments the datagram. A response longer than
//! [`LARGEST_DATAGRAM`] is rejected before RustDDS gets it, because its fragments would block the clients permanently.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustdds::{RepresentationIdentifier, serialization};
use serde::Serialize;

use crate::rtps::readers::Readers;
use crate::rtps::{CDR_LE, Data, Guid, Message, entity, is_secured, sequence_number};

/// Largest datagram that Fast DDS's UDP transport reads, octets.
const LARGEST_DATAGRAM: usize = 65_500;
/// Largest payload that RustDDS sends unfragmented if the MTU is at least 700, octets.
const NEVER_FRAGMENTED: usize = 512;
/// Largest response under DDS Security, octets. RustDDS sends it encrypted and unfragmented if the MTU is at least
/// 1500; a datagram of this module would be readable by everyone.
const LARGEST_PROTECTED: usize = 1024;
/// Time between two datagrams of a service. A burst of them, together with the malformed fragments, must not overflow
/// the receive buffer of a client, about 200 kB by default.
const PACE: Duration = Duration::from_millis(2);
/// Delays of the repetitions of a datagram, each after the previous transmission.
const REPETITION_DELAYS: [Duration; 5] = [
    Duration::from_millis(10),
    Duration::from_millis(40),
    Duration::from_millis(200),
    Duration::from_millis(800),
    Duration::from_secs(2),
];
/// Delays of the GAPs after the last repetition, each after the previous transmission.
const GAP_DELAYS: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(4)];

/// PID_RELATED_SAMPLE_IDENTITY (RTPS 2.5, 9.6.4).
const PID_RELATED_SAMPLE_IDENTITY: u16 = 0x0083;
/// Number that eProsima used for PID_RELATED_SAMPLE_IDENTITY before its standardization.
const PID_RELATED_SAMPLE_IDENTITY_EPROSIMA: u16 = 0x800f;

/// Reason why a response cannot be delivered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LargeResponseError {
    #[error("the response cannot be encoded: {0}")]
    Encoding(String),
    #[error("the response has {0} octets; the limit is {1}; request fewer items at a time")]
    TooLong(usize, usize),
}

/// Sender of the datagrams of one response writer.
#[derive(Debug)]
pub(crate) struct LargeResponses(Readers);

impl LargeResponses {
    /// Creates a sender to the readers of the response writer.
    pub(crate) fn new(readers: Readers) -> Self {
        Self(readers)
    }

    /// Encodes a response for [`Self::datagram`]. Returns `None` if it is small enough for RustDDS alone.
    ///
    /// # Errors
    /// [`LargeResponseError`] if the response cannot be encoded or is too long; RustDDS must not get it then.
    pub(crate) fn encode<A: Serialize>(response: &A) -> Result<Option<Vec<u8>>, LargeResponseError> {
        let mut payload = Vec::new();
        serialization::to_writer_with_rep_id(&mut payload, response, RepresentationIdentifier::CDR_LE)
            .map_err(|error| LargeResponseError::Encoding(error.to_string()))?;
        let is_secured = is_secured();
        let limit = if is_secured {
            LARGEST_PROTECTED
        } else {
            // The overhead does not depend on writer, request and time.
            LARGEST_DATAGRAM - datagram(&[0; 16], 0, &[0; 24], &[], UNIX_EPOCH).len()
        };
        if payload.len() > limit {
            return Err(LargeResponseError::TooLong(payload.len(), limit));
        }
        Ok((payload.len() > NEVER_FRAGMENTED && !is_secured).then_some(payload))
    }

    /// Returns the datagram of the response to the sample `request` of `client` that RustDDS wrote as sample `number`.
    pub(crate) fn datagram(&self, client: &Guid, request: i64, number: i64, payload: &[u8]) -> Vec<u8> {
        datagram(&self.0.writer, number, &identity(client, request), payload, SystemTime::now())
    }

    /// Sends a datagram for the first time and waits for [`PACE`].
    pub(crate) async fn send(&self, datagram: &[u8]) {
        self.0.send(datagram);
        tokio::time::sleep(PACE).await;
    }

    /// Repeats the datagram of sample `number`, then sends GAPs to clients that did not receive it.
    pub(crate) async fn repeat(&self, datagram: Vec<u8>, number: i64) {
        for wait in REPETITION_DELAYS {
            tokio::time::sleep(wait).await;
            // The set of clients is read again: a new one has to account for this sample, too.
            self.0.send(&datagram);
        }
        drop(datagram);
        let gap = Message::from_participant(&self.0.writer).gap(entity(&self.0.writer), number, number + 1);
        for wait in GAP_DELAYS {
            tokio::time::sleep(wait).await;
            self.0.send(&gap);
        }
    }
}

/// Returns the datagram of a response.
fn datagram(writer: &Guid, number: i64, identity: &[u8; 24], payload: &[u8], time: SystemTime) -> Vec<u8> {
    Message::from_participant(writer).timestamp(time).data(&Data {
        writer: entity(writer),
        sequence_number: number,
        inline_qos: &[
            (PID_RELATED_SAMPLE_IDENTITY, identity),
            (PID_RELATED_SAMPLE_IDENTITY_EPROSIMA, identity),
        ],
        payload: Some((&CDR_LE, payload)),
    })
}

/// Returns the sample identity of a request: GUID, then sequence number (DDS-RPC 1.0, 7.5.1.1.1).
fn identity(client: &Guid, number: i64) -> [u8; 24] {
    let mut octets = [0; 24];
    octets[..16].copy_from_slice(client);
    octets[16..].copy_from_slice(&sequence_number(number));
    octets
}

#[cfg(test)]
mod tests {
    use super::*;

    const WRITER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0f, 0x03];
    const CLIENT: Guid = [0x01, 0x0f, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 0, 0, 0x0d, 0x04];

    #[test]
    fn the_datagram_names_the_request_by_both_parameters() {
        let octets = datagram(&WRITER, 2, &identity(&CLIENT, 5), &[0x42; 600], UNIX_EPOCH);
        assert_eq!(octets[..8], *b"RTPS\x02\x04\x01\x12");
        assert_eq!(octets[8..20], WRITER[..12]);
        assert_eq!(octets[20..32], [0x09, 0x01, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        // DATA with inline QoS and data: 20 + 2·28 + 4 + 604 = 684 octets.
        assert_eq!(octets[32..40], [0x15, 0x07, 0xac, 0x02, 0, 0, 16, 0]);
        assert_eq!(octets[40..56], [0, 0, 0, 0, 0, 0, 0x0f, 0x03, 0, 0, 0, 0, 2, 0, 0, 0]);
        for (start, id) in [(56, [0x83, 0x00]), (84, [0x0f, 0x80])] {
            assert_eq!(octets[start..start + 2], id);
            assert_eq!(octets[start + 2..start + 4], [24, 0]);
            assert_eq!(octets[start + 4..start + 20], CLIENT);
            assert_eq!(octets[start + 20..start + 28], [0, 0, 0, 0, 5, 0, 0, 0]);
        }
        assert_eq!(octets[112..120], [0x01, 0, 0, 0, 0x00, 0x01, 0x00, 0x00]);
        assert_eq!(octets[120..], [0x42; 600]);
    }

    #[test]
    fn small_responses_are_sent_by_rustdds_only_and_too_long_ones_are_rejected() {
        // A string is encoded as its length, itself, and a zero.
        let text = |length: usize| "a".repeat(length - 5);
        assert!(matches!(LargeResponses::encode(&text(NEVER_FRAGMENTED)), Ok(None)));
        let large = LargeResponses::encode(&text(NEVER_FRAGMENTED + 1));
        assert!(matches!(large, Ok(Some(payload)) if payload.len() == NEVER_FRAGMENTED + 1));
        let limit = LARGEST_DATAGRAM - 120;
        assert!(matches!(LargeResponses::encode(&text(limit)), Ok(Some(_))));
        let error = LargeResponses::encode(&text(limit + 1)).unwrap_err();
        assert!(error.to_string().contains("65381 octets"), "{error}");
    }
}

//! Responses of more than some thousand octets, in a form that reaches its client.
//!
//! RustDDS 0.15 sends a sample that exceeds the path's MTU in fragments (DATA_FRAG), and its
//! fragments are malformed when they carry inline QoS: an octet too many stands before the parameter
//! list. A response has inline QoS, the identity of its request; readers drop every such fragment,
//! and being reliable, wait for that sample before they give out any later one. Samples of topics
//! have no inline QoS and come through at any size.
//!
//! So a response that may be fragmented is sent twice: by RustDDS, which keeps the books (sequence
//! numbers, heartbeats), and from here as one well-formed DATA submessage in one datagram, in the
//! name of the same writer and under the same sequence number:
//!
//! ```text
//! RTPS header (20) | INFO_TS (4 + 8) | DATA (4 + 20): response writer, sequence number |
//!     PID_RELATED_SAMPLE_IDENTITY, by both its numbers | PID_SENTINEL | CDR_LE | response
//! ```
//!
//! A reader takes the first copy that it can read, acknowledges it, and passes over the others. The
//! datagram goes to every client of the service, for each has to account for each sample. It is
//! given several times over some seconds, for RustDDS cannot repair its loss, and a GAP in the end
//! lets those go on whom it never reached: they miss one response, not all that follow. On a network
//! with a smaller MTU, IP fragments it.
//!
//! The limit is [`LARGEST_DATAGRAM`]. A longer response must not be handed to RustDDS either, or its
//! fragments would block the clients for good.

use std::collections::BTreeSet;
use std::time::{Duration, SystemTime};

use ros2_client::Context;
use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::service::RmwRequestId;
use rustdds::{RepresentationIdentifier, serialization};
use serde::{Deserialize, Serialize};

use super::readers::Readers;
use super::rtps::{CDR_LE, Data, Guid, Message, entity, is_secured, sequence_number};

/// Fast DDS's UDP transport reads no more of a datagram.
const LARGEST_DATAGRAM: usize = 65_500;
/// RustDDS sends this many octets unfragmented wherever the MTU is 700 or more.
const NEVER_FRAGMENTED: usize = 512;
/// The longest response of a secured participant, octets: RustDDS sends it unfragmented, with what protects it,
/// wherever the MTU is 1500. In a datagram of our own it would be readable for all.
const LARGEST_PROTECTED: usize = 1024;
/// From one datagram to the next of a service: what a client's socket can hold, some 200 KB by
/// default, must not overflow with this and the useless fragments.
const PACE: Duration = Duration::from_millis(2);
/// When the datagram is given again, after the time before.
const REPEATS: [Duration; 5] = [
    Duration::from_millis(10),
    Duration::from_millis(40),
    Duration::from_millis(200),
    Duration::from_millis(800),
    Duration::from_secs(2),
];
/// After those: when a client that still waits for the sample is told to go on without it.
const GIVE_UP: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(4)];

/// RTPS 2.5, 9.6.4: PID_RELATED_SAMPLE_IDENTITY,
const PID_RELATED_SAMPLE_IDENTITY: u16 = 0x0083;
/// and the number that eProsima gave it before that.
const PID_RELATED_SAMPLE_IDENTITY_EPROSIMA: u16 = 0x800f;

/// Why a response cannot be delivered.
#[derive(Debug, thiserror::Error)]
pub(super) enum LargeResponseError {
    #[error("it cannot be encoded: {0}")]
    Encoding(String),
    #[error("it is {0} octets long, and {1} is the most that can be delivered; ask for less at once")]
    TooLong(usize, usize),
}

/// Sends the datagrams of one response writer.
#[derive(Debug)]
pub(super) struct LargeResponses(Readers);

impl LargeResponses {
    /// To the readers of that writer.
    pub(super) fn new(readers: Readers) -> Self {
        Self(readers)
    }

    /// Encodes a response, to be given to [`Self::datagram`] once RustDDS has written it; `None` when
    /// it is so small that RustDDS delivers it.
    ///
    /// # Errors
    /// [`LargeResponseError`] when it can be delivered by nobody: then RustDDS must not have it.
    pub(super) fn encode<A: Serialize>(response: &A) -> Result<Option<Vec<u8>>, LargeResponseError> {
        let mut payload = Vec::new();
        serialization::to_writer_with_rep_id(&mut payload, response, RepresentationIdentifier::CDR_LE)
            .map_err(|error| LargeResponseError::Encoding(error.to_string()))?;
        // The overhead does not depend on what identifies the sample.
        let identity = [0; 24];
        let secured = is_secured();
        let most = if secured {
            LARGEST_PROTECTED
        } else {
            LARGEST_DATAGRAM - data(&[0; 16], 0, &inline_qos(&identity), &[]).overhead()
        };
        if payload.len() > most {
            return Err(LargeResponseError::TooLong(payload.len(), most));
        }
        Ok((payload.len() > NEVER_FRAGMENTED && !secured).then_some(payload))
    }

    /// The datagram of the response that RustDDS wrote as sample `number`.
    pub(super) fn datagram(&self, request: &RmwRequestId, number: i64, payload: &[u8]) -> Vec<u8> {
        datagram(&self.0.writer, number, request, payload, SystemTime::now())
    }

    /// Sends a datagram for the first time, and gives its readers the time to take it in.
    pub(super) async fn send(&self, datagram: &[u8]) {
        self.0.send(datagram);
        tokio::time::sleep(PACE).await;
    }

    /// Sends the datagram of sample `number` again, as often as it takes; then frees whoever never
    /// got it.
    pub(super) async fn repeat(&self, datagram: Vec<u8>, number: i64) {
        for wait in REPEATS {
            tokio::time::sleep(wait).await;
            // The clients are looked up anew: one may have come that has to account for this sample.
            self.0.send(&datagram);
        }
        drop(datagram);
        let gap = Message::from(&self.0.writer).gap(entity(&self.0.writer), number, number + 1);
        for wait in GIVE_UP {
            tokio::time::sleep(wait).await;
            self.0.send(&gap);
        }
    }
}

/// The whole datagram.
fn datagram(writer: &Guid, number: i64, request: &RmwRequestId, payload: &[u8], time: SystemTime) -> Vec<u8> {
    let identity = identity(request);
    Message::from(writer).timestamp(time).data(&data(writer, number, &inline_qos(&identity), payload))
}

fn data<'a>(
    writer: &Guid,
    sequence_number: i64,
    inline_qos: &'a [(u16, &'a [u8])],
    payload: &'a [u8],
) -> Data<'a> {
    Data { writer: entity(writer), sequence_number, inline_qos, payload: Some((&CDR_LE, payload)) }
}

fn inline_qos(identity: &[u8; 24]) -> [(u16, &[u8]); 2] {
    [(PID_RELATED_SAMPLE_IDENTITY, identity), (PID_RELATED_SAMPLE_IDENTITY_EPROSIMA, identity)]
}

/// The request's sample identity: GUID, then sequence number (DDS-RPC 1.0, 7.5.1.1.1).
fn identity(request: &RmwRequestId) -> [u8; 24] {
    let mut octets = [0; 24];
    octets[..16].copy_from_slice(&request.writer_gid.to_bytes16());
    octets[16..].copy_from_slice(&sequence_number(request.sequence_number));
    octets
}

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`, which the crate hands out closed.
#[derive(Deserialize)]
struct Entities {
    #[serde(rename = "gid")]
    _participant: Guid,
    #[serde(rename = "node_entities_info_seq")]
    nodes: Vec<NodeEntities>,
}

#[derive(Deserialize)]
struct NodeEntities {
    #[serde(rename = "node_namespace")]
    _namespace: String,
    #[serde(rename = "node_name")]
    _name: String,
    #[serde(rename = "reader_gid_seq")]
    _readers: Vec<Guid>,
    #[serde(rename = "writer_gid_seq")]
    writers: Vec<Guid>,
}

/// The writers that `context` announces at present.
pub(super) fn writers(context: &Context) -> BTreeSet<Guid> {
    announced(&context.participant_entities_info()).unwrap_or_default()
}

fn announced(info: &ParticipantEntitiesInfo) -> Option<BTreeSet<Guid>> {
    let encoding = RepresentationIdentifier::CDR_LE;
    let mut octets = Vec::new();
    serialization::to_writer_with_rep_id(&mut octets, info, encoding).ok()?;
    let (entities, _) =
        serialization::deserialize_from_cdr_with_rep_id::<Entities>(&octets, encoding).ok()?;
    Some(entities.nodes.into_iter().flat_map(|node| node.writers).collect())
}

#[cfg(test)]
mod tests {
    use std::time::UNIX_EPOCH;

    use ros2_client::entities_info::NodeEntitiesInfo;
    use ros2_client::{Gid, NodeName};

    use super::*;

    const WRITER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0f, 0x03];
    const CLIENT: Guid = [0x01, 0x0f, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 0, 0, 0x0d, 0x04];

    #[test]
    fn the_datagram_names_the_request_by_both_parameters() {
        let request = RmwRequestId { writer_gid: Gid::from(CLIENT), sequence_number: 5 };
        let octets = datagram(&WRITER, 2, &request, &[0x42; 600], UNIX_EPOCH);
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
    fn what_is_small_is_left_to_the_crate_and_what_is_too_long_to_nobody() {
        // A string is encoded as its length, itself, and a zero.
        let text = |length: usize| "a".repeat(length - 5);
        assert!(matches!(LargeResponses::encode(&text(NEVER_FRAGMENTED)), Ok(None)));
        let large = LargeResponses::encode(&text(NEVER_FRAGMENTED + 1));
        assert!(matches!(large, Ok(Some(payload)) if payload.len() == NEVER_FRAGMENTED + 1));
        let most = LARGEST_DATAGRAM - 120;
        assert!(matches!(LargeResponses::encode(&text(most)), Ok(Some(_))));
        let error = LargeResponses::encode(&text(most + 1)).unwrap_err();
        assert!(error.to_string().contains("65381 octets"), "{error}");
    }

    #[test]
    fn announced_writers_are_read_from_the_closed_message() {
        let mut node = NodeEntitiesInfo::new(NodeName::new("/cell", "axes").unwrap());
        node.add_reader(Gid::from(CLIENT));
        node.add_writer(Gid::from(WRITER));
        let info = ParticipantEntitiesInfo::new(Gid::from([7; 16]), vec![node]);
        assert_eq!(announced(&info), Some(BTreeSet::from([WRITER])));
    }
}

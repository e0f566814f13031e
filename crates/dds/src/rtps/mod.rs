//! RTPS messages that the node sends beside RustDDS, and their encoding: header, INFO_TS, INFO_DST, INFO_REPLY, ACKNACK,
//! NACK_FRAG, HEARTBEAT, GAP and DATA with inline QoS.
//!
//! All fields are little endian. Section numbers refer to RTPS 2.5.

pub(crate) mod datagram;
pub(crate) mod discovery_message;
pub(crate) mod readers;

use std::net::SocketAddrV4;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Protocol version of RustDDS (8.3.3.1.2, 9.4.4).
const PROTOCOL_VERSION: [u8; 2] = [2, 4];
/// Vendor id of RustDDS, whose participant sends these messages.
const VENDOR: [u8; 2] = [0x01, 0x12];

// Kinds of submessages (9.4.5.1.1).
const SUBMESSAGE_PAD: u8 = 0x01;
pub(crate) const SUBMESSAGE_ACKNACK: u8 = 0x06;
pub(crate) const SUBMESSAGE_HEARTBEAT: u8 = 0x07;
pub(crate) const SUBMESSAGE_GAP: u8 = 0x08;
const SUBMESSAGE_INFO_TS: u8 = 0x09;
const SUBMESSAGE_INFO_SRC: u8 = 0x0c;
const SUBMESSAGE_INFO_DST: u8 = 0x0e;
const SUBMESSAGE_INFO_REPLY: u8 = 0x0f;
pub(crate) const SUBMESSAGE_NACK_FRAG: u8 = 0x12;
pub(crate) const SUBMESSAGE_HEARTBEAT_FRAG: u8 = 0x13;
pub(crate) const SUBMESSAGE_DATA: u8 = 0x15;
pub(crate) const SUBMESSAGE_DATA_FRAG: u8 = 0x16;
// Flags of submessages (9.4.5.1.2), and of DATA (9.4.5.3.1).
const FLAG_LITTLE_ENDIAN: u8 = 0x01;
const FLAG_INLINE_QOS: u8 = 0x02;
const FLAG_DATA: u8 = 0x04;
const FLAG_KEY: u8 = 0x08;
/// Octets from this field to the inline QoS: reader id, writer id, sequence number (9.4.5.3).
const OCTETS_TO_INLINE_QOS: u16 = 16;
/// Kind of a locator with an IPv4 address (9.3.2.3).
const LOCATOR_UDP_V4: u32 = 1;
/// Writer of the announcements of participants, SPDP (9.3.1.3).
pub(crate) const PARTICIPANTS_WRITER: EntityId = [0, 1, 0x00, 0xc2];
/// Writer of the announcements of readers, SEDP (9.3.1.5).
const SUBSCRIPTIONS_WRITER: EntityId = [0, 0, 0x04, 0xc2];
// Parameters of these announcements (9.6.4.9).
const PID_PARTICIPANT_GUID: u16 = 0x0050;
const PID_TOPIC_NAME: u16 = 0x0005;
const PID_DURABILITY: u16 = 0x001d;
const PID_ENDPOINT_GUID: u16 = 0x005a;
/// End of a parameter list (9.4.2.11).
const PID_SENTINEL: u16 = 0x0001;

/// Encapsulation header CDR_LE with options 0 (10.2).
pub(crate) const CDR_LE: [u8; 4] = [0x00, 0x01, 0x00, 0x00];

/// Encapsulation header PL_CDR_LE with options 0 (10.2).
pub(crate) const PL_CDR_LE: [u8; 4] = [0x00, 0x03, 0x00, 0x00];

/// True if the participant of this process uses DDS Security. Messages of this module are neither encrypted nor signed.
static SECURED: AtomicBool = AtomicBool::new(false);

/// Restricts this module to the dispose message of the participant, for a participant with DDS Security.
#[cfg(feature = "security")]
pub(crate) fn set_secured() {
    SECURED.store(true, Ordering::Relaxed);
}

/// Returns true if messages must be protected, which only RustDDS can do.
pub(crate) fn is_secured() -> bool {
    SECURED.load(Ordering::Relaxed)
}

/// Global identifier of an endpoint: prefix of the participant in 12 octets, then entity id (9.3.1).
pub type Guid = [u8; 16];
/// Entity id (9.3.1.2).
pub(crate) type EntityId = [u8; 4];

/// Entity id for all readers (9.3.1.3).
pub(crate) const ANY_READER: EntityId = [0, 0, 0, 0];

/// Returns the entity id of a GUID.
pub(crate) fn entity(guid: &Guid) -> EntityId {
    [guid[12], guid[13], guid[14], guid[15]]
}

/// Encodes a sequence number: two words, the high one first (9.4.2.5).
pub(crate) fn sequence_number(number: i64) -> [u8; 8] {
    let mut octets = [0; 8];
    octets[..4].copy_from_slice(&((number >> 32) as u32).to_le_bytes());
    octets[4..].copy_from_slice(&(number as u32).to_le_bytes());
    octets
}

/// DATA submessage to all readers of the writer (8.3.8.2).
#[derive(Debug)]
pub(crate) struct Data<'a> {
    /// Writer of the sample.
    pub writer: EntityId,
    /// Sequence number of the sample.
    pub sequence_number: i64,
    /// Parameters without the sentinel; lengths are multiples of 4.
    pub inline_qos: &'a [(u16, &'a [u8])],
    /// Encapsulation header and payload, if the sample has one.
    pub payload: Option<(&'a [u8; 4], &'a [u8])>,
}

/// RTPS message under construction.
#[derive(Debug)]
pub(crate) struct Message(Vec<u8>);

impl Message {
    /// Creates a message with the header of the participant of `guid` (8.3.3.1).
    pub(crate) fn from_participant(guid: &Guid) -> Self {
        let mut octets = Vec::with_capacity(128);
        octets.extend(b"RTPS");
        octets.extend(PROTOCOL_VERSION);
        octets.extend(VENDOR);
        octets.extend(&guid[..12]);
        Message(octets)
    }

    /// Appends a submessage of a few octets.
    fn append(mut self, kind: u8, parts: &[&[u8]]) -> Self {
        let content = parts.concat();
        self.0.extend([kind, FLAG_LITTLE_ENDIAN, content.len() as u8, 0]);
        self.0.extend(content);
        self
    }

    /// Appends INFO_TS: source time of the samples that follow (8.3.8.11), in seconds and 2⁻³² s (9.3.2.1).
    pub(crate) fn timestamp(self, time: SystemTime) -> Self {
        let since = time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
        let fraction = (u64::from(since.subsec_nanos()) << 32) / 1_000_000_000;
        let time = [since.as_secs() as u32, fraction as u32].map(u32::to_le_bytes);
        self.append(SUBMESSAGE_INFO_TS, &[time.as_flattened()])
    }

    /// Appends a GAP as last submessage and returns the octets: samples `first` to `end` − 1 of `writer` are irrelevant
    /// (8.3.8.4). Readers that have received them keep them.
    pub(crate) fn gap(self, writer: EntityId, first: i64, end: i64) -> Vec<u8> {
        self.gap_of_reader(ANY_READER, writer, first, end)
    }

    /// Appends a GAP as [`gap`](Self::gap) does, for one reader.
    pub(crate) fn gap_of_reader(self, reader: EntityId, writer: EntityId, first: i64, end: i64) -> Vec<u8> {
        // At the end an empty set that begins behind the gap (9.4.2.6).
        let numbers = [first, end].map(sequence_number);
        self.append(SUBMESSAGE_GAP, &[&reader, &writer, numbers.as_flattened(), &[0; 4]]).0
    }

    /// Appends INFO_DST: the submessages that follow are for the participant of `guid` (8.3.8.7).
    pub(crate) fn to(self, guid: &Guid) -> Self {
        self.append(SUBMESSAGE_INFO_DST, &[&guid[..12]])
    }

    /// Appends INFO_REPLY: replies to the submessages that follow go to `address` (8.3.8.8).
    ///
    /// RustDDS 0.15 reads an octet more than the specification has: 0 without multicast addresses.
    pub(crate) fn reply_to(self, address: SocketAddrV4) -> Self {
        let locator = [1, LOCATOR_UDP_V4, u32::from(address.port()), 0, 0, 0].map(u32::to_le_bytes);
        self.append(SUBMESSAGE_INFO_REPLY, &[locator.as_flattened(), &address.ip().octets(), &[0; 4]])
    }

    /// Appends an ACKNACK of `reader` that has received nothing from `writer`, not even its first sequence number, and
    /// requests a HEARTBEAT (8.3.8.1). `count` numbers the ACKNACKs of the reader.
    pub(crate) fn initial_acknack(self, reader: EntityId, writer: EntityId, count: u32) -> Self {
        // Empty set from 0 (9.4.2.6), then the count.
        self.append(SUBMESSAGE_ACKNACK, &[&reader, &writer, &[0; 12], &count.to_le_bytes()])
    }

    /// Returns the octets.
    pub(crate) fn octets(self) -> Vec<u8> {
        self.0
    }

    /// Appends a HEARTBEAT of a writer without samples as last submessage and returns the octets; it requests an ACKNACK
    /// (8.3.8.6). `count` numbers the HEARTBEATs of the writer.
    pub(crate) fn empty_heartbeat(self, reader: EntityId, writer: EntityId, count: u32) -> Vec<u8> {
        let (first_last, count) = ([1, 0].map(sequence_number), count.to_le_bytes());
        self.append(SUBMESSAGE_HEARTBEAT, &[&reader, &writer, first_last.as_flattened(), &count]).0
    }

    /// Appends a NACK_FRAG as last submessage and returns the octets: `reader` requests the first fragment of sample
    /// `sample` of `writer` (8.3.8.10). `count` numbers the NACK_FRAGs of the reader.
    pub(crate) fn nack_frag(self, reader: EntityId, writer: EntityId, sample: i64, count: u32) -> Vec<u8> {
        // Fragment number set: base, number of bits, bits from the highest on (9.4.2.8); then the count.
        let (sample, words) = (sequence_number(sample), [1, 1, 1 << 31, count].map(u32::to_le_bytes));
        self.append(SUBMESSAGE_NACK_FRAG, &[&reader, &writer, &sample, words.as_flattened()]).0
    }

    /// Appends a DATA as last submessage and returns the octets.
    ///
    /// The length field is valid up to 65 535 octets, more than a datagram holds.
    pub(crate) fn data(self, data: &Data<'_>) -> Vec<u8> {
        self.data_or_key(data, FLAG_DATA)
    }

    /// Appends a DATA whose payload is the key of the sample, as last submessage, and returns the octets.
    pub(crate) fn key(self, data: &Data<'_>) -> Vec<u8> {
        self.data_or_key(data, FLAG_KEY)
    }

    fn data_or_key(mut self, data: &Data<'_>, payload_flag: u8) -> Vec<u8> {
        let octets = &mut self.0;
        let flags = FLAG_INLINE_QOS | data.payload.map_or(0, |_| payload_flag);
        octets.extend([SUBMESSAGE_DATA, FLAG_LITTLE_ENDIAN | flags]);
        let length_at = octets.len();
        octets.extend([0, 0]);
        octets.extend([0, 0]); // extra flags
        octets.extend(OCTETS_TO_INLINE_QOS.to_le_bytes());
        octets.extend(ANY_READER);
        octets.extend(data.writer);
        octets.extend(sequence_number(data.sequence_number));
        for (id, value) in data.inline_qos.iter().chain([&(PID_SENTINEL, [].as_slice())]) {
            octets.extend(id.to_le_bytes());
            octets.extend((value.len() as u16).to_le_bytes());
            octets.extend(*value);
        }
        if let Some((encapsulation, payload)) = data.payload {
            octets.extend(encapsulation);
            octets.extend(payload);
        }
        let length = octets.len() - length_at - 2;
        octets[length_at..length_at + 2].copy_from_slice(&(length as u16).to_le_bytes());
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUID: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0f, 0x03];

    #[test]
    fn a_data_submessage_has_the_layout_of_the_specification() {
        let data = Data {
            writer: entity(&GUID),
            sequence_number: (1 << 32) + 7,
            inline_qos: &[(0x0083, &[0xaa; 24])],
            payload: Some((&CDR_LE, &[1, 2, 3, 4, 5])),
        };
        let time = UNIX_EPOCH + Duration::from_millis(3_500);
        let message = Message::from_participant(&GUID).timestamp(time).data(&data);
        let mut expected = b"RTPS\x02\x04\x01\x12".to_vec();
        expected.extend(&GUID[..12]);
        // INFO_TS of 8 octets: 3 s and one half.
        expected.extend([0x09, 0x01, 8, 0, 3, 0, 0, 0, 0, 0, 0, 0x80]);
        // DATA with inline QoS and data, of 20 + 28 + 4 + 9 octets.
        expected.extend([0x15, 0x07, 61, 0, 0, 0, 16, 0]);
        expected.extend([0, 0, 0, 0, 0, 0, 0x0f, 0x03, 1, 0, 0, 0, 7, 0, 0, 0]);
        expected.extend([0x83, 0x00, 24, 0]);
        expected.extend([0xaa; 24]);
        expected.extend([0x01, 0x00, 0, 0]);
        expected.extend([0x00, 0x01, 0x00, 0x00, 1, 2, 3, 4, 5]);
        assert_eq!(message, expected);
    }

    #[test]
    fn a_nack_frag_has_the_layout_of_the_specification() {
        let writer = [1, 0x0f, 21, 22, 23, 24, 25, 26, 0, 0, 0, 0, 0, 0, 0x13, 3];
        let message =
            Message::from_participant(&GUID).to(&writer).nack_frag([0, 0, 3, 4], entity(&writer), 1, 7);
        assert_eq!(message[20..24], [0x0e, 1, 12, 0]);
        assert_eq!(message[24..36], writer[..12]);
        assert_eq!(message[36..48], [0x12, 1, 32, 0, 0, 0, 3, 4, 0, 0, 0x13, 3]);
        // Sample 0·2³² + 1; fragments from 1, one bit, which is set; the count.
        assert_eq!(message[48..56], [0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(message[56..], [1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0x80, 7, 0, 0, 0]);
    }

    #[test]
    fn an_info_reply_has_one_ipv4_locator() {
        let message = Message::from_participant(&GUID).reply_to("127.0.0.1:7413".parse().unwrap()).octets();
        assert_eq!(message[20..32], [0x0f, 1, 32, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(message[32..36], [0xf5, 0x1c, 0, 0]);
        assert_eq!(message[36..], [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 127, 0, 0, 1, 0, 0, 0, 0]);
    }

    #[test]
    fn an_acknack_and_a_heartbeat_have_the_layout_of_the_specification() {
        let (reader, writer) = ([0, 0, 3, 4], [0, 0, 0x13, 3]);
        let message = Message::from_participant(&GUID).initial_acknack(reader, writer, 9).octets();
        assert_eq!(message[20..32], [0x06, 1, 24, 0, 0, 0, 3, 4, 0, 0, 0x13, 3]);
        assert_eq!(message[32..], [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0]);
        let message = Message::from_participant(&GUID).empty_heartbeat(reader, writer, 9);
        assert_eq!(message[20..32], [0x07, 1, 28, 0, 0, 0, 3, 4, 0, 0, 0x13, 3]);
        assert_eq!(message[32..], [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 0, 0, 0]);
    }

    #[test]
    fn a_sample_without_payload_has_no_data_flag() {
        let data = Data { writer: [0, 1, 0, 0xc2], sequence_number: 1, inline_qos: &[], payload: None };
        let message = Message::from_participant(&GUID).data(&data);
        assert_eq!(message[20..24], [0x15, 0x03, 24, 0]);
        // The sequence number, then nothing but the sentinel.
        assert_eq!(message[36..], [0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }

    #[test]
    fn a_gap_has_the_layout_of_the_specification() {
        let message = Message::from_participant(&GUID).gap(entity(&GUID), 9, 10);
        assert_eq!(message[20..32], [0x08, 0x01, 28, 0, 0, 0, 0, 0, 0, 0, 0x0f, 0x03]);
        assert_eq!(message[32..], [0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 10, 0, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn the_length_field_is_valid_for_the_longest_datagram() {
        let payload = vec![0; 65_380];
        let data =
            Data { writer: [0; 4], sequence_number: 1, inline_qos: &[], payload: Some((&CDR_LE, &payload)) };
        let message = Message::from_participant(&GUID).data(&data);
        let length = u16::from_le_bytes([message[22], message[23]]);
        assert_eq!(usize::from(length), message.len() - 24);
    }
}

//! Submessages of a received datagram, without their meaning.

use super::{
    EntityId, FLAG_LITTLE_ENDIAN, Guid, SUBMESSAGE_DATA_FRAG, SUBMESSAGE_INFO_DST, SUBMESSAGE_INFO_SRC,
    SUBMESSAGE_INFO_TS, SUBMESSAGE_PAD, sequence_number,
};

/// Length of the header of a message (9.4.4).
const HEADER: usize = 20;
/// GUID prefix in the header of a message.
const PREFIX: std::ops::Range<usize> = 8..20;

/// Submessage in a datagram. Offsets of its fields count from the end of the submessage header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Submessage {
    /// Kind (9.4.5.1.1).
    pub kind: u8,
    /// GUID prefix of the participant that sends it.
    pub source: [u8; 12],
    is_little_endian: bool,
    /// Octets of the content in the datagram.
    start: usize,
    end: usize,
}

/// Returns the submessages of a datagram up to the first invalid one; none if it is not of RTPS.
pub(crate) fn submessages(datagram: &[u8]) -> impl Iterator<Item = Submessage> + use<> {
    let is_rtps = datagram.len() >= HEADER && datagram.starts_with(b"RTPS");
    let mut source = [0; 12];
    let (mut found, mut at) = (Vec::new(), HEADER);
    if is_rtps {
        source.copy_from_slice(&datagram[PREFIX]);
    }
    while is_rtps && let Some(mut submessage) = submessage_at(datagram, at) {
        if submessage.kind == SUBMESSAGE_INFO_SRC
            && let Some(prefix) = submessage.field(datagram, 8)
        {
            source = prefix;
        }
        submessage.source = source;
        at = submessage.end;
        found.push(submessage);
    }
    found.into_iter()
}

fn submessage_at(datagram: &[u8], at: usize) -> Option<Submessage> {
    let &[kind, flags, first, second] = datagram.get(at..at + 4)? else {
        return None;
    };
    let length = [first, second];
    let is_little_endian = flags & FLAG_LITTLE_ENDIAN != 0;
    let length = if is_little_endian { u16::from_le_bytes(length) } else { u16::from_be_bytes(length) };
    let start = at + 4;
    // Length 0 means the rest of the datagram, except for PAD and INFO_TS (9.4.5.1.3).
    let extends = length == 0 && !matches!(kind, SUBMESSAGE_PAD | SUBMESSAGE_INFO_TS);
    let end = if extends { datagram.len() } else { start + usize::from(length) };
    (end <= datagram.len()).then_some(Submessage { kind, source: [0; 12], is_little_endian, start, end })
}

/// Returns true if the datagram is of RTPS, ends with its last submessage, and states the length of that.
pub(crate) fn ends_with_length(datagram: &[u8]) -> bool {
    submessages(datagram).last().is_some_and(|last| {
        last.end == datagram.len() && datagram[last.start - 2..last.start] != [0, 0] && last.start < last.end
    })
}

impl Submessage {
    /// Returns a field of `N` octets, or `None` if the submessage is shorter.
    fn field<const N: usize>(&self, datagram: &[u8], offset: usize) -> Option<[u8; N]> {
        let start = self.start + offset;
        let octets = datagram.get(start..start + N).filter(|_| start + N <= self.end)?;
        octets.try_into().ok()
    }

    /// Returns an entity id.
    pub(crate) fn entity(&self, datagram: &[u8], offset: usize) -> Option<EntityId> {
        self.field(datagram, offset)
    }

    /// Returns a number of 16 bits.
    pub(crate) fn u16(&self, datagram: &[u8], offset: usize) -> Option<u16> {
        let octets = self.field(datagram, offset)?;
        Some(if self.is_little_endian { u16::from_le_bytes(octets) } else { u16::from_be_bytes(octets) })
    }

    /// Returns a number of 32 bits.
    pub(crate) fn u32(&self, datagram: &[u8], offset: usize) -> Option<u32> {
        let octets = self.field(datagram, offset)?;
        Some(if self.is_little_endian { u32::from_le_bytes(octets) } else { u32::from_be_bytes(octets) })
    }

    /// Returns a sequence number: two words, the high one first (9.4.2.5).
    pub(crate) fn sequence_number(&self, datagram: &[u8], offset: usize) -> Option<i64> {
        let (high, low) = (self.u32(datagram, offset)?, self.u32(datagram, offset + 4)?);
        Some(i64::from(high.cast_signed()) << 32 | i64::from(low))
    }

    /// Overwrites a number of 32 bits, which the submessage must contain.
    pub(crate) fn write_u32(&self, datagram: &mut [u8], offset: usize, value: u32) {
        let octets = if self.is_little_endian { value.to_le_bytes() } else { value.to_be_bytes() };
        if self.field::<4>(datagram, offset).is_some() {
            datagram[self.start + offset..][..4].copy_from_slice(&octets);
        }
    }

    /// Overwrites a sequence number, which the submessage must contain.
    pub(crate) fn write_sequence_number(&self, datagram: &mut [u8], offset: usize, value: i64) {
        self.write_u32(datagram, offset, (value >> 32) as u32);
        self.write_u32(datagram, offset + 4, value as u32);
    }
}

/// Returns submessages of the participant of `writer` to all participants: INFO_SRC, INFO_DST, and a DATA_FRAG with the last
/// of `fragments` fragments of one byte.
pub(crate) fn single_fragment(writer: &Guid, reader: EntityId, number: i64, fragments: u32) -> Vec<u8> {
    let mut octets = vec![SUBMESSAGE_INFO_SRC, FLAG_LITTLE_ENDIAN, 20, 0, 0, 0, 0, 0];
    octets.extend(super::PROTOCOL_VERSION);
    octets.extend(super::VENDOR);
    octets.extend(&writer[..12]);
    octets.extend([SUBMESSAGE_INFO_DST, FLAG_LITTLE_ENDIAN, 12, 0]);
    octets.extend([0; 12]);
    // 32 octets of fields and a payload of one byte, padded.
    octets.extend([SUBMESSAGE_DATA_FRAG, FLAG_LITTLE_ENDIAN, 33, 0, 0, 0, 28, 0]);
    octets.extend(reader);
    octets.extend(&writer[12..]);
    octets.extend(sequence_number(number));
    octets.extend(fragments.to_le_bytes());
    octets.extend([1, 0, 1, 0]);
    octets.extend(fragments.to_le_bytes());
    octets.push(0);
    octets
}

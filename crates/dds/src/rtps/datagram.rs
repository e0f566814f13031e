//! Submessages of a received datagram, without their meaning.

use super::{
    EntityId, FLAG_DATA, FLAG_INLINE_QOS, FLAG_LITTLE_ENDIAN, Guid, PARTICIPANTS_WRITER, PID_DURABILITY,
    PID_ENDPOINT_GUID, PID_PARTICIPANT_GUID, PID_SENTINEL, PID_TOPIC_NAME, SUBMESSAGE_DATA,
    SUBMESSAGE_DATA_FRAG, SUBMESSAGE_GAP, SUBMESSAGE_INFO_DST, SUBMESSAGE_INFO_SRC, SUBMESSAGE_INFO_TS,
    SUBMESSAGE_PAD, SUBSCRIPTIONS_WRITER, sequence_number,
};

/// Length of the header of a message (9.4.4).
const HEADER: usize = 20;
/// Largest number of numbers in a set (9.4.2.6).
const MAX_NUMBERS: u32 = 256;
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

/// Reader as it is announced to other participants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ReaderAnnouncement {
    /// Identifier.
    pub guid: Guid,
    /// Name of its topic in DDS.
    pub topic: String,
    /// True if it gets no samples from before its matching.
    pub is_volatile: bool,
}

/// Identifiers and values of a parameter list.
type Parameters<'a> = Vec<(u16, &'a [u8])>;

/// Returns the parameters of a list, with the octets behind its sentinel, up to the first invalid one (9.4.2.11).
fn parameters(octets: &[u8], is_little_endian: bool) -> (Parameters<'_>, &[u8]) {
    let number = |octets: [u8; 2]| {
        if is_little_endian { u16::from_le_bytes(octets) } else { u16::from_be_bytes(octets) }
    };
    let (mut found, mut rest) = (Vec::new(), octets);
    while let [a, b, c, d, behind @ ..] = rest {
        let (id, length) = (number([*a, *b]), usize::from(number([*c, *d])));
        if id == PID_SENTINEL {
            return (found, behind);
        }
        let Some((value, behind)) = behind.split_at_checked(length) else { break };
        found.push((id, value));
        rest = behind;
    }
    (found, &[])
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

    /// Returns the parameters of a DATA of the writer `writer` and whether their numbers are little-endian; `None` for other
    /// submessages and other content.
    fn announced<'a>(&self, datagram: &'a [u8], writer: EntityId) -> Option<(Parameters<'a>, bool)> {
        let flags = datagram[self.start - 3];
        if self.kind != SUBMESSAGE_DATA || self.entity(datagram, 8)? != writer || flags & FLAG_DATA == 0 {
            return None;
        }
        // Offset from the end of the field (9.4.5.3).
        let behind_header = self.start + 4 + usize::from(self.u16(datagram, 2)?);
        let mut octets = datagram.get(behind_header..self.end)?;
        if flags & FLAG_INLINE_QOS != 0 {
            octets = parameters(octets, self.is_little_endian).1;
        }
        let ([0, kind @ (2 | 3), _, _], list) = octets.split_first_chunk::<4>()? else { return None };
        let is_little_endian = *kind == 3;
        Some((parameters(list, is_little_endian).0, is_little_endian))
    }

    /// Returns the participant that a DATA announces; `None` for other samples, and for one without its identifier.
    pub(crate) fn announced_participant(&self, datagram: &[u8]) -> Option<Guid> {
        let (list, _) = self.announced(datagram, PARTICIPANTS_WRITER)?;
        let (_, guid) = list.iter().find(|(id, _)| *id == PID_PARTICIPANT_GUID)?;
        guid.first_chunk().copied()
    }

    /// Returns the reader that a DATA announces; `None` for other samples, and for one without the parameters.
    pub(crate) fn announced_reader(&self, datagram: &[u8]) -> Option<ReaderAnnouncement> {
        let (list, is_little_endian) = self.announced(datagram, SUBSCRIPTIONS_WRITER)?;
        let value = |id: u16| list.iter().find(|(found, _)| *found == id).map(|(_, value)| *value);
        let number = |octets: &[u8]| {
            let octets = *octets.first_chunk::<4>()?;
            Some(if is_little_endian { u32::from_le_bytes(octets) } else { u32::from_be_bytes(octets) })
        };
        let name = value(PID_TOPIC_NAME)?;
        let length = (number(name)? as usize).checked_sub(1)?;
        Some(ReaderAnnouncement {
            guid: *value(PID_ENDPOINT_GUID)?.first_chunk()?,
            topic: String::from_utf8(name.get(4..4 + length)?.to_vec()).ok()?,
            is_volatile: value(PID_DURABILITY).and_then(number).unwrap_or(0) == 0,
        })
    }

    /// Lets the set of sequence numbers (9.4.2.6) of an ACKNACK begin at `base`, without the numbers before it. Returns `None`, without
    /// change, if the set is invalid.
    pub(crate) fn move_number_set(&self, datagram: &mut [u8], offset: usize, base: i64) -> Option<()> {
        let (first, count) = (self.sequence_number(datagram, offset)?, self.u32(datagram, offset + 8)?);
        if count > MAX_NUMBERS {
            return None;
        }
        // The count of the submessage is behind the set.
        self.u32(datagram, offset + 12 + 4 * count.div_ceil(32) as usize)?;
        let word_of = |index: u32| offset + 12 + 4 * (index / 32) as usize;
        let words: Vec<u32> = (0..count.div_ceil(32))
            .map(|word| self.u32(datagram, word_of(32 * word)))
            .collect::<Option<_>>()?;
        let mut moved = vec![0; words.len()];
        for index in 0..count {
            let is_set = words[(index / 32) as usize] << (index % 32) & 1 << 31 != 0;
            if is_set && let Ok(new) = u32::try_from(first + i64::from(index) - base) {
                moved[(new / 32) as usize] |= 1 << (31 - new % 32);
            }
        }
        self.write_sequence_number(datagram, offset, base);
        for (word, value) in (0..).zip(moved) {
            self.write_u32(datagram, word_of(32 * word), value);
        }
        Some(())
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

    /// Overwrites a DATA_FRAG of the sample `number`, of at least 32 octets, by a GAP of this number.
    pub(crate) fn replace_fragment_by_gap(&self, datagram: &mut [u8], number: i64) {
        datagram[self.start - 4] = SUBMESSAGE_GAP;
        datagram[self.start - 3] &= FLAG_LITTLE_ENDIAN;
        datagram.copy_within(self.start + 4..self.start + 12, self.start);
        self.write_sequence_number(datagram, 8, number);
        self.write_sequence_number(datagram, 16, number + 1);
        self.write_u32(datagram, 24, 0);
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

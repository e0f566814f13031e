//! Bounds on received datagrams, before RustDDS allocates the memory that they announce.
//!
//! **Symptom:** two datagrams of any host, an announcement of a participant and a HEARTBEAT, GAP or DATA_FRAG with a far
//! number or a large size, take all memory of the machine within seconds.
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/rtps_writer_proxy.rs` line 178 (`missing_seqnums`) and line 296
//! (`irrelevant_changes_range`) list each number of a range; `src/rtps/fragment_assembler.rs` line 53 allocates the announced
//! size of a sample at its first fragment.
//!
//! **Test:** `test_py/test_hostile_datagrams.py`.
//!
//! **Superfluous when** RustDDS bounds the three.
//!
//! The range of a HEARTBEAT or GAP is shortened: RustDDS requests the rest after it has received the first part. A
//! fragment is discarded if its sample is larger than [`MAX_SAMPLE`], or if incomplete samples would exceed
//! [`MAX_INCOMPLETE`]; a reliable writer repeats it. RustDDS discards an incomplete sample only when the same reader
//! receives a further fragment 10 s later. After that time an invalid fragment is appended to a received datagram,
//! which has this effect alone.
//!
//! RustDDS keeps as many requests of a service as its depth, also those taken. A fragmented request that is longer than
//! [`MAX_REQUEST`] is replaced by a GAP, so that the client does not repeat it.

use std::collections::{HashMap, HashSet};
use std::net::Ipv4Addr;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::warn;

use crate::rtps::datagram::{self, Submessage};
use crate::rtps::{
    EntityId, Guid, SUBMESSAGE_ACKNACK, SUBMESSAGE_DATA, SUBMESSAGE_DATA_FRAG, SUBMESSAGE_GAP,
    SUBMESSAGE_HEARTBEAT, SUBMESSAGE_HEARTBEAT_FRAG, SUBMESSAGE_NACK_FRAG,
};

/// Largest number of samples in the range of a HEARTBEAT or GAP.
const MAX_RANGE: i64 = 1 << 17;
/// Largest sequence number; a writer with 1 µs between samples reaches it after 36 000 years.
const MAX_NUMBER: i64 = 1 << 60;
/// Largest fragmented sample, bytes: a trajectory of 1 000 000 points of five axes with all derivatives has 200 MB.
const MAX_SAMPLE: u32 = 256 << 20;
/// Largest request of a service other than those for goals, bytes: a thousand parameters have some 100 kB.
const MAX_REQUEST: u32 = 256 << 10;
/// Largest number of fragments of a sample; those of ROS 2 implementations have at least 1 kB.
const MAX_FRAGMENTS: u32 = 1 << 18;
/// Largest total size of the incomplete samples, bytes.
const MAX_INCOMPLETE: u64 = 384 << 20;
/// Size that an incomplete sample counts at least, bytes.
const MIN_COUNTED: u64 = 4 << 10;
/// Time without fragments after which RustDDS may discard a sample, with a margin.
const IDLE_TIME: Duration = Duration::from_secs(11);
/// Time between the two requests to discard it: RustDDS ignores one within 2 s after another.
const REPEAT_TIME: Duration = Duration::from_secs(3);
/// Largest datagram over IPv4, bytes.
const MAX_DATAGRAM: usize = 65_507;

static INCOMPLETE: Mutex<Option<IncompleteSamples>> = Mutex::new(None);

/// Bounds the datagram in the first `length` octets of `buffer`, in place. Returns its new length, or `None` if it must be
/// discarded.
pub(crate) fn bound(buffer: &mut [u8], length: usize, source: Ipv4Addr, now: Instant) -> Option<usize> {
    let mut incomplete = INCOMPLETE.lock().unwrap_or_else(PoisonError::into_inner);
    let incomplete = incomplete.get_or_insert_default();
    let datagram = &mut buffer[..length];
    for submessage in datagram::submessages(datagram) {
        if let Err(reason) = bound_submessage(datagram, &submessage, incomplete, now) {
            warn!("datagram of {source} discarded: {reason}");
            return None;
        }
    }
    Some(incomplete.discard_idle(buffer, length, now))
}

/// Bounds the requests of a writer to [`MAX_REQUEST`].
pub(crate) fn bound_requests(writer: Guid) {
    let mut incomplete = INCOMPLETE.lock().unwrap_or_else(PoisonError::into_inner);
    incomplete.get_or_insert_default().request_writers.insert(writer);
}

/// Removes the writers that have left.
pub(crate) fn retain_requests(is_present: impl Fn(&Guid) -> bool) {
    let mut incomplete = INCOMPLETE.lock().unwrap_or_else(PoisonError::into_inner);
    incomplete.get_or_insert_default().request_writers.retain(is_present);
}

fn bound_submessage(
    datagram: &mut [u8],
    submessage: &Submessage,
    incomplete: &mut IncompleteSamples,
    now: Instant,
) -> Result<(), String> {
    let numbers: &[usize] = match submessage.kind {
        SUBMESSAGE_HEARTBEAT | SUBMESSAGE_GAP => &[8, 16],
        SUBMESSAGE_ACKNACK | SUBMESSAGE_NACK_FRAG | SUBMESSAGE_HEARTBEAT_FRAG => &[8],
        SUBMESSAGE_DATA | SUBMESSAGE_DATA_FRAG => &[12],
        _ => return Ok(()),
    };
    let read = |at: &usize| submessage.sequence_number(datagram, *at);
    let values: Vec<i64> = numbers.iter().filter_map(read).collect();
    if let Some(number) = values.iter().find(|number| !(0..=MAX_NUMBER).contains(*number)) {
        return Err(format!("its sequence number {number} is not between 0 and {MAX_NUMBER}"));
    }
    match (submessage.kind, values.as_slice()) {
        (SUBMESSAGE_HEARTBEAT, &[first, last]) if last - first >= MAX_RANGE => {
            submessage.write_sequence_number(datagram, 16, first + MAX_RANGE - 1);
        }
        // From 1 on, RustDDS moves the number of the next sample and lists nothing.
        (SUBMESSAGE_GAP, &[first, end]) if first > 1 && end - first > MAX_RANGE => {
            submessage.write_sequence_number(datagram, 16, first + MAX_RANGE);
            // The set of single numbers would be relative to the old end.
            submessage.write_u32(datagram, 24, 0);
        }
        (SUBMESSAGE_DATA_FRAG, &[number]) => match Fragment::read(datagram, submessage, number) {
            Some(fragment) if incomplete.is_too_long_request(&fragment) => {
                if fragment.first == 1 {
                    warn!("request of {} bytes ignored; at most {MAX_REQUEST} are allowed", fragment.size);
                }
                submessage.replace_fragment_by_gap(datagram, number);
            }
            Some(fragment) => incomplete.add(&fragment, now)?,
            None => {}
        },
        _ => {}
    }
    Ok(())
}

/// Fragments in a DATA_FRAG (8.3.8.3).
#[derive(Debug, Clone, Copy)]
struct Fragment {
    writer: Guid,
    reader: EntityId,
    number: i64,
    /// First fragment, from 1.
    first: u32,
    /// Number of fragments.
    count: u32,
    /// Size of a fragment, bytes.
    fragment_size: u32,
    /// Size of the sample, bytes.
    size: u32,
}

impl Fragment {
    /// Reads the fragments of a submessage, or `None` if it is invalid for RustDDS.
    fn read(datagram: &[u8], submessage: &Submessage, number: i64) -> Option<Self> {
        let mut writer = [0; 16];
        writer[..12].copy_from_slice(&submessage.source);
        writer[12..].copy_from_slice(&submessage.entity(datagram, 8)?);
        let count_and_size = [24, 26].map(|at| submessage.u16(datagram, at));
        let fragment = Fragment {
            writer,
            reader: submessage.entity(datagram, 4)?,
            number,
            first: submessage.u32(datagram, 20)?,
            count: u32::from(count_and_size[0]?),
            fragment_size: u32::from(count_and_size[1]?),
            size: submessage.u32(datagram, 28)?,
        };
        let last = fragment.first.checked_add(fragment.count)?.checked_sub(1)?;
        let is_valid = (1..=fragment.size).contains(&fragment.fragment_size)
            && fragment.first >= 1
            && fragment.count >= 1
            && last <= fragment.fragments();
        is_valid.then_some(fragment)
    }

    /// Returns the number of fragments of the sample.
    fn fragments(&self) -> u32 {
        self.size.div_ceil(self.fragment_size)
    }
}

/// Sample of which fragments are missing.
#[derive(Debug)]
struct IncompleteSample {
    fragments: u32,
    is_received: Vec<bool>,
    missing: u32,
    bytes: u64,
    reader: EntityId,
    /// Time of the last fragment, or of the request to discard the sample.
    last: Instant,
    is_discarded_once: bool,
}

/// Samples of which RustDDS has received some fragments, by writer and sequence number.
#[derive(Debug, Default)]
struct IncompleteSamples {
    samples: HashMap<(Guid, i64), IncompleteSample>,
    bytes: u64,
    /// Writers of requests that are bounded to [`MAX_REQUEST`].
    request_writers: HashSet<Guid>,
    /// Time of the last search for idle samples.
    searched: Option<Instant>,
}

impl IncompleteSamples {
    fn is_too_long_request(&self, fragment: &Fragment) -> bool {
        fragment.size > MAX_REQUEST && self.request_writers.contains(&fragment.writer)
    }

    /// Adds fragments.
    ///
    /// # Errors
    /// Reason for which RustDDS must not receive them.
    fn add(&mut self, fragment: &Fragment, now: Instant) -> Result<(), String> {
        let Fragment { size, .. } = *fragment;
        let fragments = fragment.fragments();
        if size > MAX_SAMPLE || fragments > MAX_FRAGMENTS {
            return Err(format!(
                "its sample has {size} bytes in {fragments} fragments; at most {MAX_SAMPLE} and {MAX_FRAGMENTS} are allowed"
            ));
        }
        let key = (fragment.writer, fragment.number);
        let counted = u64::from(size).max(MIN_COUNTED);
        if !self.samples.contains_key(&key) && self.bytes + counted > MAX_INCOMPLETE {
            return Err(format!(
                "incomplete samples have {} bytes; {size} more exceed {MAX_INCOMPLETE}",
                self.bytes
            ));
        }
        let total = &mut self.bytes;
        let sample = self.samples.entry(key).or_insert_with(|| {
            *total += counted;
            IncompleteSample {
                fragments,
                is_received: vec![false; fragments as usize],
                missing: fragments,
                bytes: counted,
                reader: fragment.reader,
                last: now,
                is_discarded_once: false,
            }
        });
        if fragment.first - 1 + fragment.count > sample.fragments {
            return Err(format!("its sample has {} fragments, not {fragments}", sample.fragments));
        }
        (sample.last, sample.is_discarded_once) = (now, false);
        for index in fragment.first - 1..fragment.first - 1 + fragment.count {
            if !std::mem::replace(&mut sample.is_received[index as usize], true) {
                sample.missing -= 1;
            }
        }
        if sample.missing == 0 {
            self.remove(&key);
        }
        Ok(())
    }

    fn remove(&mut self, key: &(Guid, i64)) {
        if let Some(sample) = self.samples.remove(key) {
            self.bytes -= sample.bytes;
        }
    }

    /// Appends a fragment to the datagram in the first `length` octets of `buffer` that lets RustDDS discard an idle sample,
    /// if there is one. Returns the new length.
    fn discard_idle(&mut self, buffer: &mut [u8], length: usize, now: Instant) -> usize {
        if self.samples.is_empty() || self.searched.is_some_and(|at| now - at < Duration::from_millis(100)) {
            return length;
        }
        self.searched = Some(now);
        let wait = |sample: &IncompleteSample| if sample.is_discarded_once { REPEAT_TIME } else { IDLE_TIME };
        let is_idle = |(_, sample): &(_, &mut IncompleteSample)| {
            now.saturating_duration_since(sample.last) > wait(sample)
        };
        let Some((&key, sample)) = self.samples.iter_mut().find(is_idle) else {
            return length;
        };
        let Some(appended) = append_invalid_fragment(buffer, length, &key, sample) else {
            return length;
        };
        if sample.is_discarded_once {
            self.remove(&key);
        } else {
            (sample.last, sample.is_discarded_once) = (now, true);
        }
        appended
    }
}

/// Appends a fragment behind the last one of the sample `key`. Returns the new length, or `None` if the datagram has no
/// space for it.
///
/// RustDDS rejects the fragment, then discards the idle samples of the reader. If it has no such sample, it creates one
/// with one byte for each fragment.
fn append_invalid_fragment(
    buffer: &mut [u8],
    length: usize,
    (writer, number): &(Guid, i64),
    sample: &IncompleteSample,
) -> Option<usize> {
    let octets = datagram::single_fragment(writer, sample.reader, *number, sample.fragments + 1);
    let end = length + octets.len();
    let is_possible = end <= buffer.len().min(MAX_DATAGRAM) && datagram::ends_with_length(&buffer[..length]);
    is_possible.then(|| buffer[length..end].copy_from_slice(&octets)).map(|()| end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rtps::Message;

    const WRITER: Guid = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 3, 0xc2];

    /// Returns a datagram with one little-endian submessage.
    fn with_submessage(kind: u8, parts: &[&[u8]]) -> Vec<u8> {
        let content = parts.concat();
        let mut octets = Message::from_participant(&WRITER).octets();
        octets.extend([kind, 1, content.len() as u8, 0]);
        octets.extend(content);
        octets
    }

    fn number(value: i64) -> [u8; 8] {
        crate::rtps::sequence_number(value)
    }

    fn fragment(sample: i64, first: u32, fragment_size: u16, size: u32) -> Vec<u8> {
        let head = [0, 0, 28, 0, 0, 0, 0, 0, 0, 0, 3, 0xc2];
        let (first, size) = (first.to_le_bytes(), size.to_le_bytes());
        let count = [1, 0];
        with_submessage(
            SUBMESSAGE_DATA_FRAG,
            &[&head, &number(sample), &first, &count, &fragment_size.to_le_bytes(), &size, &[0; 8]],
        )
    }

    /// Bounds a datagram at a time, with space behind it.
    fn bounded(incomplete: &mut IncompleteSamples, datagram: &[u8], now: Instant) -> Result<Vec<u8>, String> {
        let mut buffer = datagram.to_vec();
        for submessage in datagram::submessages(datagram) {
            bound_submessage(&mut buffer, &submessage, incomplete, now)?;
        }
        buffer.resize(datagram.len() + 200, 0);
        let length = incomplete.discard_idle(&mut buffer, datagram.len(), now);
        buffer.truncate(length);
        Ok(buffer)
    }

    #[test]
    fn ranges_of_heartbeat_and_gap_are_shortened_and_ordinary_ones_unchanged() {
        let (now, mut none) = (Instant::now(), IncompleteSamples::default());
        let ids = [0, 0, 3, 0xc7, 0, 0, 3, 0xc2];
        let heartbeat =
            |last| with_submessage(SUBMESSAGE_HEARTBEAT, &[&ids, &number(5), &number(last), &[1, 0, 0, 0]]);
        assert_eq!(bounded(&mut none, &heartbeat(1_000_000_000_000), now), Ok(heartbeat(4 + MAX_RANGE)));
        assert_eq!(bounded(&mut none, &heartbeat(4), now), Ok(heartbeat(4)));
        assert_eq!(bounded(&mut none, &heartbeat(4 + MAX_RANGE), now), Ok(heartbeat(4 + MAX_RANGE)));
        assert!(bounded(&mut none, &heartbeat(i64::MAX), now).is_err());
        assert!(bounded(&mut none, &heartbeat(-1), now).is_err());
        let gap = |first, end, bits: u32| {
            let bits = bits.to_le_bytes();
            with_submessage(SUBMESSAGE_GAP, &[&ids, &number(first), &number(end), &bits, &[0xff; 4]])
        };
        assert_eq!(bounded(&mut none, &gap(2, 1 << 40, 32), now), Ok(gap(2, 2 + MAX_RANGE, 0)));
        assert_eq!(bounded(&mut none, &gap(1, 1 << 40, 32), now), Ok(gap(1, 1 << 40, 32)));
        assert_eq!(bounded(&mut none, &gap(7, 9, 32), now), Ok(gap(7, 9, 32)));
    }

    #[test]
    fn announced_sizes_are_bounded_for_one_sample_and_in_total() {
        let (now, mut incomplete) = (Instant::now(), IncompleteSamples::default());
        let mut add = |sample, first, fragment_size, size| {
            bounded(&mut incomplete, &fragment(sample, first, fragment_size, size), now).is_ok()
        };
        assert!(!add(1, 1, 60_000, u32::MAX));
        assert!(!add(1, 1, 1, 1 << 20), "a million fragments of one byte");
        assert!(add(1, 1, 60_000, 200 << 20));
        assert!(add(2, 1, 60_000, 180 << 20));
        assert!(!add(3, 1, 60_000, 180 << 20));
        assert!(add(3, 1, 60_000, 100_000));
        assert!(add(3, 2, 60_000, 100_000));
        assert_eq!(incomplete.bytes, 380 << 20, "the complete sample counts no more");
    }

    #[test]
    fn a_long_request_is_replaced_by_a_gap_of_its_number() {
        let (now, mut incomplete) = (Instant::now(), IncompleteSamples::default());
        let long = fragment(7, 1, 60_000, MAX_REQUEST + 1);
        assert_eq!(bounded(&mut incomplete, &long, now), Ok(long.clone()));
        incomplete = IncompleteSamples { request_writers: HashSet::from([WRITER]), ..Default::default() };
        let allowed = fragment(6, 1, 60_000, MAX_REQUEST);
        assert_eq!(bounded(&mut incomplete, &allowed, now), Ok(allowed.clone()));
        let replaced = bounded(&mut incomplete, &long, now).expect("not discarded");
        let ids = [0, 0, 0, 0, 0, 0, 3, 0xc2];
        let gap = with_submessage(SUBMESSAGE_GAP, &[&ids, &number(7), &number(8), &[0; 4]]);
        // The octets behind the GAP belong to its submessage, and are ignored.
        assert_eq!(replaced.len(), long.len());
        assert_eq!((replaced[20], replaced[21]), (SUBMESSAGE_GAP, 1));
        assert_eq!(replaced[24..52], gap[24..]);
        assert_eq!(incomplete.samples.len(), 1, "the allowed request alone");
    }

    #[test]
    fn an_idle_sample_is_discarded_by_an_invalid_fragment_and_counts_no_more() {
        let (began, mut incomplete) = (Instant::now(), IncompleteSamples::default());
        let at = |seconds| began + Duration::from_secs(seconds);
        bounded(&mut incomplete, &fragment(1, 1, 60_000, 200 << 20), began).unwrap();
        let other = Message::from_participant(&[9; 16]).empty_heartbeat([0; 4], [0, 0, 1, 2], 1);
        assert_eq!(bounded(&mut incomplete, &other, at(10)), Ok(other.clone()));
        for seconds in [12, 16] {
            let longer = bounded(&mut incomplete, &other, at(seconds)).unwrap();
            assert_eq!(longer[..other.len()], other);
            let appended: Vec<_> = datagram::submessages(&longer).collect();
            let last = appended.last().unwrap();
            assert_eq!((last.kind, last.source), (SUBMESSAGE_DATA_FRAG, WRITER[..12].try_into().unwrap()));
            // Behind the last fragment, of a size that takes no memory.
            let read = Fragment::read(&longer, last, 1).unwrap();
            let fragments = (200_u32 << 20).div_ceil(60_000);
            assert_eq!((read.first, read.size, read.writer), (fragments + 1, fragments + 1, WRITER));
        }
        assert_eq!(incomplete.bytes, 0);
        assert_eq!(bounded(&mut incomplete, &other, at(30)), Ok(other.clone()));
    }

    #[test]
    fn anything_but_rtps_passes() {
        let now = Instant::now();
        for octets in [b"".as_slice(), b"RTPS", &[0xff; 200]] {
            assert_eq!(bounded(&mut IncompleteSamples::default(), octets, now), Ok(octets.to_vec()));
        }
    }
}

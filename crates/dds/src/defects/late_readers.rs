//! History of transient-local writers for the readers that join later.
//!
//! **Symptom:** a reader that joins later receives all samples of the last seconds: a volatile one too, and a transient-local
//! one more than the depth of the topic.
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/writer.rs`: line 2100 decides by the durability of the writer alone which samples a
//! new reader does not get, and `handle_cache_cleaning` removes samples beyond the depth every 6 s only.
//!
//! **Test:** `test_py/test_result_history.py`.
//!
//! **Superfluous when** RustDDS decides by the durability of the reader and by the depth.
//!
//! The announcement of a reader (SEDP) determines its first sample, before RustDDS receives the announcement. An ACKNACK of
//! the reader that requests earlier samples is changed, so that it acknowledges them, and the reader gets a GAP of them.

use std::collections::HashMap;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use rustdds::DomainParticipant;
use tokio::sync::mpsc;

use crate::rtps::datagram::{self, ReaderAnnouncement, Submessage};
use crate::rtps::readers::Readers;
use crate::rtps::{EntityId, Guid, Message, SUBMESSAGE_ACKNACK, SUBMESSAGE_DATA, entity, is_secured};

/// Largest number of readers whose first sample is stored.
const MAX_READERS: usize = 1 << 16;
/// Largest number of GAPs that wait to be sent. A reader whose GAP is not sent repeats its request.
const MAX_GAPS: usize = 256;

static HISTORIES: Mutex<Option<Histories>> = Mutex::new(None);

fn with<T>(act: impl FnOnce(&mut Histories) -> T) -> T {
    act(HISTORIES.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default())
}

/// Adds a transient-local writer of a topic (its name in DDS) that keeps `depth` samples and has written `written`.
pub(crate) fn add(topic: String, writer: Guid, depth: usize, written: Arc<AtomicI64>) {
    let depth = i64::try_from(depth).unwrap_or(i64::MAX);
    with(|histories| histories.add(WriterHistory { topic, writer: entity(&writer), depth, written }));
}

/// Removes the readers that have left.
pub(crate) fn retain(is_present: impl Fn(&Guid) -> bool) {
    with(|histories| histories.first.retain(|(reader, _), _| is_present(reader)));
}

/// Returns the GAPs to be sent, which replace those of an earlier call.
pub(crate) fn gaps() -> mpsc::Receiver<ReaderGap> {
    let (sender, receiver) = mpsc::channel(MAX_GAPS);
    with(|histories| histories.gaps = Some(sender));
    receiver
}

/// Handles a received datagram, before RustDDS does.
pub(crate) fn receive(datagram: &mut [u8]) {
    with(|histories| {
        if !histories.writers.is_empty() && !is_secured() {
            histories.receive(datagram);
        }
    });
}

/// Samples from `first` to `end` − 1 that a reader does not get.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ReaderGap {
    reader: Guid,
    writer: EntityId,
    first: i64,
    end: i64,
}

impl ReaderGap {
    /// Sends the GAP to its reader.
    pub(crate) fn send(&self, participant: &DomainParticipant) {
        let mut writer = own_prefix(participant);
        writer[12..].copy_from_slice(&self.writer);
        let readers = Readers::new(writer, String::new(), participant.clone());
        let message = Message::from_participant(&writer).to(&self.reader);
        match readers {
            Ok(readers) => readers.send_to(
                &self.reader,
                &message.gap_of_reader(entity(&self.reader), self.writer, self.first, self.end),
            ),
            Err(error) => tracing::warn!("a GAP could not be sent: {error}"),
        }
    }
}

fn own_prefix(participant: &DomainParticipant) -> Guid {
    rustdds::RTPSEntity::guid(participant).to_bytes()
}

/// Transient-local writer of this node.
#[derive(Debug)]
struct WriterHistory {
    /// Name in DDS.
    topic: String,
    writer: EntityId,
    depth: i64,
    /// Number of the last sample.
    written: Arc<AtomicI64>,
}

#[derive(Debug, Default)]
struct Histories {
    writers: Vec<WriterHistory>,
    /// Number of the first sample of each reader of a writer.
    first: HashMap<(Guid, EntityId), i64>,
    gaps: Option<mpsc::Sender<ReaderGap>>,
}

impl Histories {
    /// Adds a writer in place of that of an earlier participant.
    fn add(&mut self, history: WriterHistory) {
        self.first.retain(|(_, writer), _| *writer != history.writer);
        self.writers.retain(|known| known.writer != history.writer);
        self.writers.push(history);
    }

    fn receive(&mut self, datagram: &mut [u8]) {
        for submessage in datagram::submessages(datagram) {
            match submessage.kind {
                SUBMESSAGE_DATA => {
                    if let Some(reader) = submessage.announced_reader(datagram) {
                        self.add_reader(&reader);
                    }
                }
                SUBMESSAGE_ACKNACK => {
                    if let Some(gap) = self.acknowledge_older(datagram, &submessage)
                        && let Some(gaps) = &self.gaps
                    {
                        let _ = gaps.try_send(gap);
                    }
                }
                _ => {}
            }
        }
    }

    /// Determines the first sample of a reader; an announcement that is repeated does not change it.
    fn add_reader(&mut self, reader: &ReaderAnnouncement) {
        for history in self.writers.iter().filter(|history| history.topic == reader.topic) {
            let written = history.written.load(Ordering::Relaxed);
            let kept = if reader.is_volatile { 0 } else { history.depth };
            if self.first.len() < MAX_READERS {
                let first = (written - kept + 1).max(1);
                self.first.entry((reader.guid, history.writer)).or_insert(first);
            }
        }
    }

    /// Changes an ACKNACK that requests samples before the first one of its reader. Returns the GAP for the reader.
    fn acknowledge_older(&self, datagram: &mut [u8], acknack: &Submessage) -> Option<ReaderGap> {
        let (reader, writer) = (acknack.entity(datagram, 0)?, acknack.entity(datagram, 4)?);
        let mut guid = [0; 16];
        guid[..12].copy_from_slice(&acknack.source);
        guid[12..].copy_from_slice(&reader);
        let end = *self.first.get(&(guid, writer))?;
        let first = acknack.sequence_number(datagram, 8)?;
        if first >= end {
            return None;
        }
        acknack.move_number_set(datagram, 8, end)?;
        Some(ReaderGap { reader: guid, writer, first: first.max(1), end })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rtps::sequence_number;

    const READER: Guid = [1, 0x0f, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0d, 0x04];
    const WRITER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0f, 0x03];

    fn submessage(kind: u8, flags: u8, parts: &[&[u8]]) -> Vec<u8> {
        let content = parts.concat();
        let mut octets = Message::from_participant(&READER).octets();
        octets.extend([kind, flags, content.len() as u8, 0]);
        octets.extend(content);
        octets
    }

    /// Returns the announcement of the reader on a topic with a durability: 0 volatile, 1 transient local.
    fn announcement(topic: &str, durability: u8, with_inline_qos: bool) -> Vec<u8> {
        let mut name = ((topic.len() + 1) as u32).to_le_bytes().to_vec();
        name.extend(topic.bytes());
        name.resize((name.len() + 4) & !3, 0);
        let inline: &[u8] = &[0x70, 0, 4, 0, 9, 9, 9, 9, 1, 0, 0, 0];
        let parts: [&[u8]; 11] = [
            &[0, 0, 16, 0, 0, 0, 4, 0xc7, 0, 0, 4, 0xc2],
            &sequence_number(3),
            if with_inline_qos { inline } else { &[] },
            &[0, 3, 0, 0],
            &[0x5a, 0, 16, 0],
            &READER,
            &[0x05, 0, name.len() as u8, 0],
            &name,
            &[0x1d, 0, 4, 0, durability, 0, 0, 0],
            &[1, 0, 0, 0],
            &[],
        ];
        submessage(SUBMESSAGE_DATA, if with_inline_qos { 0x07 } else { 0x05 }, &parts)
    }

    /// Returns an ACKNACK that requests numbers from `base` on by bits.
    fn acknack(base: i64, count: u32, words: &[u32]) -> Vec<u8> {
        let words: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let ids = [entity(&READER), entity(&WRITER)].concat();
        let parts: [&[u8]; 5] = [&ids, &sequence_number(base), &count.to_le_bytes(), &words, &[7, 0, 0, 0]];
        submessage(SUBMESSAGE_ACKNACK, 1, &parts)
    }

    fn histories(written: i64, depth: usize) -> (Histories, mpsc::Receiver<ReaderGap>) {
        let (sender, receiver) = mpsc::channel(4);
        let mut histories = Histories { gaps: Some(sender), ..Histories::default() };
        let depth = depth as i64;
        let (topic, writer) = ("rt/results".to_owned(), entity(&WRITER));
        histories.add(WriterHistory { topic, writer, depth, written: Arc::new(AtomicI64::new(written)) });
        (histories, receiver)
    }

    #[test]
    fn the_announcement_determines_the_first_sample() {
        for (topic, durability, with_inline_qos, first) in [
            ("rt/results", 0, false, Some(41)),
            ("rt/results", 1, true, Some(36)),
            ("rt/result", 1, false, None),
        ] {
            let (mut histories, _) = histories(40, 5);
            histories.receive(&mut announcement(topic, durability, with_inline_qos));
            assert_eq!(
                histories.first.get(&(READER, entity(&WRITER))).copied(),
                first,
                "{topic} {durability}"
            );
            // The first sample stays when the announcement is repeated.
            histories.writers[0].written.store(90, Ordering::Relaxed);
            histories.receive(&mut announcement(topic, durability, with_inline_qos));
            assert_eq!(histories.first.get(&(READER, entity(&WRITER))).copied(), first);
        }
    }

    #[test]
    fn requests_of_older_samples_are_acknowledged_and_the_reader_gets_a_gap() {
        let (mut histories, mut gaps) = histories(40, 5);
        histories.receive(&mut announcement("rt/results", 1, false));
        // Numbers 1 to 40 are requested, of which 36 to 40 are kept.
        let mut datagram = acknack(1, 40, &[u32::MAX, 0xff00_0000]);
        histories.receive(&mut datagram);
        assert_eq!(datagram, acknack(36, 40, &[0xf800_0000, 0]));
        let gap = ReaderGap { reader: READER, writer: entity(&WRITER), first: 1, end: 36 };
        assert_eq!(gaps.try_recv(), Ok(gap));
        // A preemptive ACKNACK, and later requests.
        let mut datagram = acknack(0, 0, &[]);
        histories.receive(&mut datagram);
        assert_eq!((datagram, gaps.try_recv()), (acknack(36, 0, &[]), Ok(gap)));
        let later = acknack(38, 3, &[0xe000_0000]);
        let mut datagram = later.clone();
        histories.receive(&mut datagram);
        assert_eq!(datagram, later);
        assert!(gaps.try_recv().is_err());
    }

    #[test]
    fn invalid_datagrams_and_other_readers_are_unchanged() {
        let (mut histories, mut gaps) = histories(40, 5);
        let mut datagram = acknack(1, 40, &[u32::MAX, 0xff00_0000]);
        let before = datagram.clone();
        histories.receive(&mut datagram);
        assert_eq!(datagram, before, "no announcement");
        let announced = announcement("rt/results", 1, true);
        for length in 0..announced.len() {
            histories.receive(&mut announced[..length].to_vec());
        }
        histories.receive(&mut announced.clone());
        for bits in [41, 256, u32::MAX] {
            // More bits than the submessage has.
            let mut datagram = acknack(1, bits, &[u32::MAX]);
            let before = datagram.clone();
            histories.receive(&mut datagram);
            assert_eq!(datagram, before);
        }
        assert!(gaps.try_recv().is_err());
    }
}

//! A reader that takes nothing any more, and would hold up everybody.
//!
//! RustDDS keeps what a reliable reader has not acknowledged, up to a number of samples; then it writes nothing more
//! until that reader has gone. Fast DDS 2.14 has readers that never acknowledge again: one with KEEP_LAST that lost
//! samples, and had as many newer ones as it is deep before they were repeated, passes over each repetition
//! and asks for it again. It takes a flood for that.
//!
//! They are told that the oldest half of what waits is not to be had (GAP). Such a reader goes on then; those
//! that have the samples keep them; and one that only was slow misses them, so that it is given time.

use std::sync::atomic::{AtomicI64, Ordering};

use rustdds::{DomainParticipant, GUID};
use tracing::warn;

use super::readers::Readers;
use super::rtps::{Message, entity, is_secured};

/// The readers of a topic, and how far it has been written.
#[derive(Debug)]
pub(super) struct Deaf {
    writer: GUID,
    topic: String,
    participant: DomainParticipant,
    /// Samples that are kept for those that have not acknowledged them.
    kept: i64,
    /// Number of the last sample.
    written: AtomicI64,
}

impl Deaf {
    /// The readers of `writer` on `topic`, by its name in DDS, for whom it keeps so many samples, before it has
    /// written anything.
    pub(super) fn new(writer: GUID, topic: String, kept: usize, participant: DomainParticipant) -> Self {
        let kept = i64::try_from(kept).unwrap_or(i64::MAX);
        Deaf { writer, topic, participant, kept, written: AtomicI64::new(0) }
    }

    /// Number of the last sample.
    pub(super) fn written(&self) -> i64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Another sample has been written.
    pub(super) fn wrote(&self) {
        self.written.fetch_add(1, Ordering::Relaxed);
    }

    /// Tells all readers to do without the oldest samples.
    pub(super) fn give_up(&self, waited_s: u64) {
        if is_secured() {
            return;
        }
        let (from, before) = oldest(self.written(), self.kept);
        let name = self.topic.trim_start_matches("rt");
        warn!(
            "a reader of {name} has acknowledged nothing for {waited_s} s, and {} messages wait for it: the oldest {} are \
             given up",
            self.kept,
            before - from
        );
        let writer = self.writer.to_bytes();
        match Readers::new(writer, self.topic.clone(), self.participant.clone()) {
            Ok(readers) => readers.send(&Message::from(&writer).gap(entity(&writer), from, before)),
            Err(error) => warn!("they cannot be given up: {error}"),
        }
    }
}

/// The oldest half of the `kept` samples that wait after `written`: the first of them, and the one behind the last.
fn oldest(written: i64, kept: i64) -> (i64, i64) {
    let first = (written - kept + 1).max(1);
    (first, first + kept / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_what_waits_is_given_up() {
        // Samples 1809 to 10 000 wait.
        assert_eq!(oldest(10_000, 8192), (1809, 1809 + 4096));
        assert_eq!(oldest(31, 32), (1, 17));
    }
}

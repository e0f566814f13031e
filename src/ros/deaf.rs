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
use tracing::{debug, warn};

use super::readers::Readers;
use super::rtps::{Message, entity, is_secured};

/// The readers of a topic, and how far it has been written.
#[derive(Debug)]
pub(super) struct Deaf {
    /// None where there is no socket to be had.
    readers: Option<Readers>,
    /// Samples that are kept for those that have not acknowledged them.
    kept: i64,
    /// Number of the last sample.
    written: AtomicI64,
}

impl Deaf {
    /// The readers of `writer` on `topic`, by its name in DDS, for whom it keeps so many samples, before it has
    /// written anything.
    pub(super) fn new(writer: GUID, topic: String, kept: usize, participant: DomainParticipant) -> Self {
        let readers = Readers::new(writer.to_bytes(), topic, participant);
        let readers =
            readers.inspect_err(|error| debug!("readers that take nothing are waited for: {error}")).ok();
        Deaf { readers, kept: i64::try_from(kept).unwrap_or(i64::MAX), written: AtomicI64::new(0) }
    }

    /// Another sample has been written.
    pub(super) fn wrote(&self) {
        self.written.fetch_add(1, Ordering::Relaxed);
    }

    /// Tells all readers to do without the oldest samples.
    pub(super) fn give_up(&self, waited_s: u64) {
        let Some(readers) = self.readers.as_ref().filter(|_| !is_secured()) else { return };
        let (from, before) = oldest(self.written.load(Ordering::Relaxed), self.kept);
        let topic = readers.topic.trim_start_matches("rt");
        warn!(
            "a reader of {topic} has acknowledged nothing for {waited_s} s, and {} messages wait for it: the oldest {} \
             are given up",
            self.kept,
            before - from
        );
        readers.send(&Message::from(&readers.writer).gap(entity(&readers.writer), from, before));
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

//! GAP that unblocks a writer stalled by a reader that acknowledges nothing.
//!
//! **Symptom:** one subscriber with a shallow history stops a topic for all subscribers, and in `fast` the axes.
//!
//! **Upstream:** Fast DDS 2.14: a KEEP_LAST reader that lost samples, and received as many newer ones as its depth before
//! the lost ones were repeated, discards each repetition and requests it again (`can_change_be_added_nts`). RustDDS 0.15.1
//! blocks all writes at a number of unacknowledged samples until that reader leaves.
//!
//! **Test:** the unit tests of `src/ros/topics/output.rs` and of this module; `test_py/test_faults_subscribers.py`.
//!
//! **Superfluous when** Fast DDS accepts the repetitions.
//!
//! After a timeout, a GAP declares the oldest half of the unacknowledged samples irrelevant. A stalled reader then
//! continues. Readers that have received those samples keep them. A reader that was only slow loses them, which is
//! why the timeout is long.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use rustdds::{DomainParticipant, GUID};
use tracing::warn;

use crate::rtps::readers::Readers;
use crate::rtps::{Message, entity, is_secured};

/// Sample count of a writer, and the GAP to its readers if they stall it.
#[derive(Debug)]
pub(crate) struct StalledReaders {
    writer: GUID,
    topic: String,
    participant: DomainParticipant,
    /// Largest number of unacknowledged samples that the middleware keeps.
    max_unacknowledged: i64,
    /// Sequence number of the last sample written.
    pub(crate) written: Arc<AtomicI64>,
}

impl StalledReaders {
    /// Creates the state for `writer` on `topic` (its name in DDS), before the first sample.
    ///
    /// `max_unacknowledged` is the number of unacknowledged samples at which the writer blocks.
    pub(crate) fn new(
        writer: GUID,
        topic: String,
        max_unacknowledged: usize,
        participant: DomainParticipant,
    ) -> Self {
        let max_unacknowledged = i64::try_from(max_unacknowledged).unwrap_or(i64::MAX);
        StalledReaders { writer, topic, participant, max_unacknowledged, written: Arc::default() }
    }

    /// Returns the sequence number of the last sample written, 0 before the first.
    pub(crate) fn written(&self) -> i64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Counts one more written sample.
    pub(crate) fn record_write(&self) {
        self.written.fetch_add(1, Ordering::Relaxed);
    }

    /// Sends a GAP over the oldest half of the unacknowledged samples to all readers of the topic.
    ///
    /// `waited_s` is the time without acknowledgment, s, for the log. Nothing is sent under DDS Security.
    pub(crate) fn send_gap(&self, waited_s: u64) {
        if is_secured() {
            return;
        }
        let (first, end) = oldest_half(self.written(), self.max_unacknowledged);
        if first == end {
            return;
        }
        let name = self.topic.trim_start_matches("rt");
        warn!(
            "stalled reader on {name}: no sample acknowledged (ACKNACK) for {waited_s} s, {} samples pending; the \
             oldest {} are discarded (GAP)",
            self.written() - first + 1,
            end - first
        );
        let writer = self.writer.to_bytes();
        match Readers::new(writer, self.topic.clone(), self.participant.clone()) {
            Ok(readers) => {
                readers.send(&Message::from_participant(&writer).gap(entity(&writer), first, end));
            }
            Err(error) => warn!("the GAP for {name} could not be sent: {error}"),
        }
    }
}

/// Returns the oldest half of the unacknowledged samples after `written`: first number, and the number behind the last.
///
/// It contains only written numbers: readers would ignore the samples that get them later. It is empty if fewer samples are
/// written than may be unacknowledged: the write then waits for the socket or the processor, not for a reader.
fn oldest_half(written: i64, max_unacknowledged: i64) -> (i64, i64) {
    if written + 1 < max_unacknowledged {
        return (1, 1);
    }
    let first = (written - max_unacknowledged + 1).max(1);
    (first, first + (written - first + 2) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gap_covers_the_oldest_half_of_the_unacknowledged_samples() {
        // Samples 1809 to 10 000 are unacknowledged.
        assert_eq!(oldest_half(10_000, 8192), (1809, 1809 + 4096));
        assert_eq!(oldest_half(31, 32), (1, 17));
        // Few samples are written, and the write waits for another reason.
        assert_eq!(oldest_half(200, 8192), (1, 1));
        assert_eq!(oldest_half(0, 8192), (1, 1));
    }
}

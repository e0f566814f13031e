//! Taps: input of the messages of a topic to the recording.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use serde::Serialize;

use super::shared::{QUEUE_BYTES, RecordingEntry, Shared};
use crate::ros_interface::TopicDirection;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::files::encode_cdr;
use virtual_axes_io::messages::Recorded;

/// Overhead of a queued message, bytes.
const ENTRY_BYTES: usize = 128;

/// Recorder of the messages of one topic; does nothing if there is no recording.
pub struct Tap<M>(Option<TopicTap<M>>);

struct TopicTap<M> {
    shared: Arc<Shared>,
    topic: usize,
    direction: TopicDirection,
    /// Function that returns the time stamp of a message, ns.
    time: fn(&M) -> Nanoseconds,
}

impl<M> Tap<M> {
    /// Creates a tap that records nothing.
    pub fn none() -> Self {
        Tap(None)
    }

    /// Returns true if there is a recording.
    pub fn is_recording(&self) -> bool {
        self.0.is_some()
    }

    pub(super) fn new(shared: Arc<Shared>, topic: usize, direction: TopicDirection) -> Self
    where
        M: Recorded,
    {
        Tap(Some(TopicTap { shared, topic, direction, time: M::time }))
    }
}

impl<M: Serialize> Tap<M> {
    /// Records a message that is being published or has just been received. Waits for a full queue only where outputs
    /// wait.
    pub async fn record(&self, message: &M) {
        let Some(topic) = &self.0 else { return };
        let shared = &topic.shared;
        let is_queued = match topic.entry(message) {
            Some((entry, size)) => topic.queue(entry, size).await,
            None => false,
        };
        if !is_queued
            && shared.left_out.fetch_add(1, Ordering::Relaxed) == 0
            && shared.end_reason.get().is_none()
        {
            tracing::warn!(
                "recording {}: messages are left out because the file is written too slowly",
                shared.path
            );
        }
    }
}

impl<M: Serialize> TopicTap<M> {
    /// Serializes a message with its times. Returns it with its size in the queue, bytes, or `None` if writing has
    /// ended.
    fn entry(&self, message: &M) -> Option<(RecordingEntry, u32)> {
        if self.shared.free_bytes.is_closed() {
            return None;
        }
        let stamp = u64::try_from((self.time)(message)).unwrap_or(0);
        let now = (self.shared.clock)();
        // In `fast` a message is built before the clock reaches its time.
        let log = if self.direction == TopicDirection::Out { now.max(stamp) } else { now };
        let publish = if stamp == 0 { log } else { stamp };
        let mut data = Vec::new();
        encode_cdr(message, &mut data).ok()?;
        // A message longer than the queue takes the whole queue.
        let size = u32::try_from(data.len() + ENTRY_BYTES).map_or(QUEUE_BYTES, |size| size.min(QUEUE_BYTES));
        Some((RecordingEntry::Message { topic: self.topic, log, publish, data, permit: None }, size))
    }

    async fn queue(&self, mut entry: RecordingEntry, size: u32) -> bool {
        let free_bytes = Arc::clone(&self.shared.free_bytes);
        let acquired = match self.shared.is_blocking {
            true => free_bytes.acquire_many_owned(size).await.ok(),
            false => free_bytes.try_acquire_many_owned(size).ok(),
        };
        let Some(acquired) = acquired else { return false };
        if let RecordingEntry::Message { permit, .. } = &mut entry {
            *permit = Some(acquired);
        }
        self.shared.entries.send(entry).is_ok()
    }
}

//! Where the messages of a topic enter the recording.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;
use tokio::sync::watch;

use super::thread::Entry;
use super::{QUEUE_BYTES, Shared};
use crate::ros::outputs::WhenFull;
use crate::ros::pace::Health;
use virtual_axes_core::config::TimeMode;
use virtual_axes_core::units::Nanoseconds;
use virtual_axes_io::files::encode;
use virtual_axes_io::messages::Recorded;

/// Bytes that a queued message takes beside its own.
const ENTRY_BYTES: usize = 128;

/// Whether the node publishes a topic or listens to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// It listens.
    In,
    /// It publishes.
    Out,
}

/// The node's clock.
pub(super) struct Clock {
    pub(super) time: TimeMode,
    pub(super) health: watch::Receiver<Health>,
}

impl Clock {
    /// ns since the Unix epoch; not before it.
    fn now(&self) -> u64 {
        let health = self.health.borrow();
        let begins_with_the_system = self.time == TimeMode::Fast && health.periods == 0;
        if self.time == TimeMode::Real || begins_with_the_system {
            let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
            return u64::try_from(since_epoch.as_nanos()).unwrap_or(u64::MAX);
        }
        u64::try_from(health.time).unwrap_or(0)
    }
}

/// Records the messages of one topic, if there is a recording.
pub struct Tap<M>(Option<Line<M>>);

struct Line<M> {
    shared: Arc<Shared>,
    topic: usize,
    direction: Direction,
    /// What a message says its time is.
    time: fn(&M) -> Nanoseconds,
}

impl<M> Tap<M> {
    /// Records nothing.
    pub fn none() -> Self {
        Tap(None)
    }

    /// Whether there is a recording.
    pub fn records(&self) -> bool {
        self.0.is_some()
    }

    pub(super) fn new(shared: Arc<Shared>, topic: usize, direction: Direction) -> Self
    where
        M: Recorded,
    {
        Tap(Some(Line { shared, topic, direction, time: M::time }))
    }
}

impl<M: Serialize> Tap<M> {
    /// Records a message that is published or has come in now; waits for room only where outputs wait.
    pub async fn record(&self, message: &M) {
        let Some(line) = &self.0 else { return };
        let shared = &line.shared;
        let is_queued = match line.entry(message) {
            Some((entry, size)) => line.queue(entry, size).await,
            None => false,
        };
        if !is_queued && shared.left_out.fetch_add(1, Ordering::Relaxed) == 0 && shared.ended.get().is_none()
        {
            tracing::warn!(
                "recording {}: messages are left out, the file is written too slowly",
                shared.path
            );
        }
    }
}

impl<M: Serialize> Line<M> {
    /// The message as bytes with its times, and the room that it takes; `None` where nothing is written any more.
    fn entry(&self, message: &M) -> Option<(Entry, u32)> {
        if self.shared.room.is_closed() {
            return None;
        }
        let stamp = u64::try_from((self.time)(message)).unwrap_or(0);
        let now = self.shared.clock.now();
        // In `fast` a message is made before the clock shows its instant.
        let log = if self.direction == Direction::Out { now.max(stamp) } else { now };
        let publish = if stamp == 0 { log } else { stamp };
        let mut data = Vec::new();
        encode(message, &mut data).ok()?;
        // What is longer than the queue takes all of it.
        let size = u32::try_from(data.len() + ENTRY_BYTES).map_or(QUEUE_BYTES, |size| size.min(QUEUE_BYTES));
        Some((Entry::Message { topic: self.topic, log, publish, data, room: None }, size))
    }

    async fn queue(&self, mut entry: Entry, size: u32) -> bool {
        let room = Arc::clone(&self.shared.room);
        let taken = match self.shared.when_full {
            WhenFull::Wait | WhenFull::WaitForAWhile => room.acquire_many_owned(size).await.ok(),
            WhenFull::Drop => room.try_acquire_many_owned(size).ok(),
        };
        let Some(taken) = taken else { return false };
        if let Entry::Message { room, .. } = &mut entry {
            *room = Some(taken);
        }
        self.shared.entries.send(entry).is_ok()
    }
}

//! What the node publishes: one queue and one task per topic, so that a subscriber that is slow on
//! one topic delays no other, and none delays the machine.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tracing::warn;

use super::endpoints::Publisher;
use super::recorder::Tap;

/// What happens when a queue is full because its subscribers are slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhenFull {
    /// The message is dropped and counted: the machine is in step with the wall clock.
    Drop,
    /// The sender waits: the machine runs as fast as its subscribers can take it.
    Wait,
}

/// Messages that a queue holds in front of the middleware when it may drop: 1.5 s at the default rate.
const DROPPING_QUEUE: usize = 256;
/// Messages that a queue holds when its sender waits instead.
const WAITING_QUEUE: usize = 8;

/// Length of a queue.
pub fn queue_length(when_full: WhenFull) -> usize {
    match when_full {
        WhenFull::Drop => DROPPING_QUEUE,
        WhenFull::Wait => WAITING_QUEUE,
    }
}

/// The sending end of a topic.
pub struct Output<M> {
    queue: mpsc::Sender<M>,
    tap: Tap<M>,
    when_full: WhenFull,
    dropped: Arc<AtomicU64>,
}

/// Starts the tasks that publish, one for each topic.
pub struct Publishing<'a> {
    /// Counts what is dropped, of all topics.
    pub dropped: &'a Arc<AtomicU64>,
    /// Where the tasks run.
    pub tasks: &'a mut JoinSet<()>,
}

impl Publishing<'_> {
    /// Starts the task that publishes what comes through the queue; it ends when the output is dropped.
    pub fn start<M: Serialize + Send + Sync + 'static>(
        &mut self,
        publisher: Publisher<M>,
        when_full: WhenFull,
    ) -> Output<M> {
        let (queue, mut messages) = mpsc::channel(queue_length(when_full));
        let Publisher { network, tap } = publisher;
        self.tasks.spawn(async move {
            while let Some(message) = messages.recv().await {
                if network.async_publish(message).await.is_err() {
                    warn!("a message could not be published");
                }
            }
        });
        Output { queue, tap, when_full, dropped: Arc::clone(self.dropped) }
    }
}

impl<M: Serialize + Send + Sync + 'static> Output<M> {
    /// Hands a message over, to the recording first: a subscriber that is slow leaves no gap there.
    pub async fn send(&self, message: M) {
        self.tap.record(&message).await;
        match self.when_full {
            WhenFull::Wait => {
                // The task ends only after this output has been dropped.
                let _ = self.queue.send(message).await;
            }
            WhenFull::Drop => {
                if self.queue.try_send(message).is_err() {
                    self.dropped.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
    }
}

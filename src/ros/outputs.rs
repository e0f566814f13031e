//! What the node publishes: at once while the middleware has room, otherwise through one queue and one
//! task per topic, so that a subscriber that is slow on one topic delays no other, and none delays the
//! machine.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use futures::FutureExt;
use serde::Serialize;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tracing::warn;

use super::endpoints::Publisher;
use super::heard::{Heard, Listeners};
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

/// A message on its way to the middleware.
type Write = Pin<Box<dyn Future<Output = ()> + Send>>;

/// The sending end of a topic.
pub struct Output<M: Serialize> {
    network: Arc<ros2_client::Publisher<M>>,
    /// Messages that the middleware had no room for, in order.
    queue: mpsc::Sender<Write>,
    /// How many those are, the one that waits for room among them.
    behind: Arc<AtomicUsize>,
    tap: Tap<M>,
    heard: Heard,
    when_full: WhenFull,
    dropped: Arc<AtomicU64>,
}

/// Starts the tasks that publish, one for each topic.
pub struct Publishing<'a> {
    /// Counts what is dropped, of all topics.
    pub dropped: &'a Arc<AtomicU64>,
    /// Who listens to what.
    pub listeners: &'a mut Listeners,
    /// Where the tasks run.
    pub tasks: &'a mut JoinSet<()>,
}

impl Publishing<'_> {
    /// Starts the task that waits for slow subscribers; it ends when the output is dropped.
    pub fn start<M: Serialize + Send + Sync + 'static>(
        &mut self,
        publisher: Publisher<M>,
        when_full: WhenFull,
    ) -> Output<M> {
        let (queue, mut writes) = mpsc::channel::<Write>(queue_length(when_full));
        let behind = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&behind);
        self.tasks.spawn(async move {
            while let Some(write) = writes.recv().await {
                write.await;
                left.fetch_sub(1, Ordering::Release);
            }
        });
        let Publisher { network, tap, volatile } = publisher;
        let heard = match volatile {
            Some(name) if !tap.records() => self.listeners.of(network.guid(), name),
            _ => Heard::always(),
        };
        let dropped = Arc::clone(self.dropped);
        Output { network: Arc::new(network), queue, behind, tap, heard, when_full, dropped }
    }
}

impl<M: Serialize + Send + Sync + 'static> Output<M> {
    /// Whether anybody listens or will get to know it: a message that nobody hears need not be made.
    pub fn is_heard(&self) -> bool {
        self.heard.is()
    }

    /// Hands a message over, to the recording first: a subscriber that is slow leaves no gap there.
    pub async fn send(&self, message: M) {
        self.tap.record(&message).await;
        let network = Arc::clone(&self.network);
        let mut write: Write = Box::pin(async move {
            if network.async_publish(message).await.is_err() {
                warn!("a message could not be published");
            }
        });
        // At once where nothing waits, so that a period wakes no task for each of its topics.
        if self.behind.load(Ordering::Acquire) == 0 && (&mut write).now_or_never().is_some() {
            return;
        }
        self.behind.fetch_add(1, Ordering::AcqRel);
        let is_queued = match self.when_full {
            // The task ends only after this output has been dropped.
            WhenFull::Wait => self.queue.send(write).await.is_ok(),
            WhenFull::Drop => self.queue.try_send(write).is_ok(),
        };
        if !is_queued {
            self.behind.fetch_sub(1, Ordering::AcqRel);
            if self.when_full == WhenFull::Drop {
                self.dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

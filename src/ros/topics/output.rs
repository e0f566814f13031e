//! Outgoing messages: written at once while the middleware has space, otherwise through one queue and one task per
//! topic.
//!
//! A slow subscriber of one topic therefore delays no other topic, and in real time no subscriber delays the axes.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;

use futures::FutureExt;
use serde::Serialize;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tracing::warn;

use super::recorder::Tap;
use virtual_axes_dds::Publisher;

/// Length of a queue that drops: 1.5 s of messages at the default rate.
const DROPPING_QUEUE: usize = 256;
/// Length of a queue whose sender waits.
const BLOCKING_QUEUE: usize = 8;
/// Longest time for which a sender waits for space in a queue.
const BLOCK_TIMEOUT: Duration = Duration::from_secs(1);

/// Returns the time without acknowledgment after which a reader counts as stalled and gets a GAP.
///
/// If messages are dropped, the middleware already holds 50 s of them at the default rate when it blocks, so the time
/// is short. Where no message may be lost, it is longer: the subscriber may be paused in a debugger.
fn stall_timeout(overflow: OverflowPolicy) -> Duration {
    match overflow {
        OverflowPolicy::Drop | OverflowPolicy::BlockWithTimeout => Duration::from_secs(5),
        OverflowPolicy::Block => Duration::from_secs(30),
    }
}

/// Returns the queue length of a policy, in messages.
pub fn queue_length(overflow: OverflowPolicy) -> usize {
    match overflow {
        OverflowPolicy::Drop => DROPPING_QUEUE,
        OverflowPolicy::Block | OverflowPolicy::BlockWithTimeout => BLOCKING_QUEUE,
    }
}

/// Pending write of a message to the middleware.
type Write = Pin<Box<dyn Future<Output = ()> + Send>>;

/// Output of a topic.
pub struct Output<M: Serialize> {
    publisher: Publisher<M>,
    queue: Queue,
    tap: Tap<M>,
}

/// Queue of writes for which the middleware had no space, in order.
struct Queue {
    /// Held from the first poll of a write until it is written or queued, so that no later write overtakes it.
    order: tokio::sync::Mutex<()>,
    writes: mpsc::Sender<Write>,
    /// Number of queued writes, including the one in progress.
    pending: Arc<AtomicUsize>,
    overflow: OverflowPolicy,
    /// True after the last sender has timed out.
    is_stalled: AtomicBool,
    dropped: Arc<AtomicU64>,
}

impl Queue {
    /// Creates the queue and the task that empties it, which ends when the queue is dropped.
    ///
    /// The task calls `on_stall` each time a write has waited for another `timeout_after`.
    fn new(
        overflow: OverflowPolicy,
        dropped: &Arc<AtomicU64>,
        timeout_after: Duration,
        on_stall: impl Fn() + Send + 'static,
    ) -> (Self, impl Future<Output = ()> + Send + 'static) {
        let (writes, mut queued) = mpsc::channel::<Write>(queue_length(overflow));
        let pending = Arc::new(AtomicUsize::new(0));
        let remaining = Arc::clone(&pending);
        let task = async move {
            while let Some(mut write) = queued.recv().await {
                while timeout(timeout_after, &mut write).await.is_err() {
                    on_stall();
                }
                remaining.fetch_sub(1, Ordering::Release);
            }
        };
        let dropped = Arc::clone(dropped);
        let (order, is_stalled) = (tokio::sync::Mutex::default(), AtomicBool::new(false));
        (Queue { order, writes, pending, overflow, is_stalled, dropped }, task)
    }

    /// Writes at once if nothing is queued, so that a position cycle wakes no task per topic; queues otherwise.
    async fn write(&self, mut write: Write) {
        let _order = self.order.lock().await;
        if self.pending.load(Ordering::Acquire) == 0 && (&mut write).now_or_never().is_some() {
            return;
        }
        self.pending.fetch_add(1, Ordering::AcqRel);
        if !self.push(write).await {
            self.pending.fetch_sub(1, Ordering::AcqRel);
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Queues a write. Returns false if the queue is full and the policy forbids waiting, or the wait timed out.
    async fn push(&self, write: Write) -> bool {
        let may_block = match self.overflow {
            OverflowPolicy::Drop => false,
            OverflowPolicy::Block => return self.writes.send(write).await.is_ok(),
            OverflowPolicy::BlockWithTimeout => !self.is_stalled.load(Ordering::Relaxed),
        };
        let is_queued = if may_block {
            self.writes.send_timeout(write, BLOCK_TIMEOUT).await.is_ok()
        } else {
            self.writes.try_send(write).is_ok()
        };
        self.is_stalled.store(!is_queued, Ordering::Relaxed);
        is_queued
    }
}

impl<M: Serialize + Clone + Send + Sync + 'static> Output<M> {
    /// Creates the output of `publisher`, and the task that writes its queued messages; `dropped` counts those that are
    /// dropped.
    pub(super) fn new(
        publisher: Publisher<M>,
        tap: Tap<M>,
        overflow: OverflowPolicy,
        dropped: &Arc<AtomicU64>,
    ) -> (Self, impl Future<Output = ()> + Send + 'static) {
        let (stalled, stall_timeout) = (publisher.clone(), stall_timeout(overflow));
        let (queue, task) = Queue::new(overflow, dropped, stall_timeout, move || {
            stalled.discard_unacknowledged(stall_timeout)
        });
        (Output { publisher, queue, tap }, task)
    }

    /// Returns true if the topic has a matched subscription, is transient local, or is recorded; otherwise the
    /// message need not be built.
    pub fn has_subscriptions(&self) -> bool {
        self.tap.is_recording() || self.publisher.has_subscriptions()
    }

    /// Records and publishes the message that `build` returns, if something receives it.
    pub async fn send_if_used(&self, build: impl FnOnce() -> M) {
        if self.has_subscriptions() {
            self.send(build()).await;
        }
    }

    /// Records a message and publishes it. A slow subscriber causes no gap in the recording.
    pub async fn send(&self, message: M) {
        self.tap.record(&message).await;
        let publisher = self.publisher.clone();
        let write = Box::pin(async move {
            if !publisher.publish(message).await {
                warn!("a message could not be published");
            }
        });
        self.queue.write(write).await;
    }
}

/// Policy for a queue that is full because its subscribers are slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OverflowPolicy {
    /// The message is dropped and counted; used where the axes follow the wall clock.
    Drop,
    /// The sender waits; used where the axes run as fast as subscribers can receive.
    Block,
    /// The sender waits for at most 1 s. After a timeout messages are dropped and counted until the queue has space
    /// again, so that a stalled subscriber is waited for only once.
    BlockWithTimeout,
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::task::Poll;
    use std::time::Instant;

    use super::*;
    use futures::future::pending;
    use tokio::sync::watch;

    /// Test subscriber that receives writes while `open`, counted.
    struct Reader {
        open: watch::Sender<bool>,
        read: Arc<AtomicUsize>,
    }

    impl Reader {
        fn new() -> Self {
            Reader { open: watch::channel(false).0, read: Arc::default() }
        }

        fn write(&self) -> Write {
            let (mut open, read) = (self.open.subscribe(), Arc::clone(&self.read));
            Box::pin(async move {
                if open.wait_for(|open| *open).await.is_err() {
                    pending::<()>().await;
                }
                read.fetch_add(1, Ordering::Relaxed);
            })
        }
    }

    /// Fills the queue of a stalled reader. Returns the time that `more` further writes take.
    async fn fill(queue: &Queue, reader: &Reader, more: usize) -> Duration {
        // One more than the queue holds is being written.
        for _ in 0..BLOCKING_QUEUE + 1 {
            queue.write(reader.write()).await;
            tokio::task::yield_now().await;
        }
        let began = Instant::now();
        for _ in 0..more {
            queue.write(reader.write()).await;
        }
        began.elapsed()
    }

    /// The task that publishes results handles commands next, so a stalled reader must not delay a stop.
    #[tokio::test]
    async fn a_stalled_reader_of_results_is_waited_for_only_once() {
        const MORE: u32 = 1000;
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (queue, task) = Queue::new(OverflowPolicy::BlockWithTimeout, &dropped, BLOCK_TIMEOUT, || {});
        let task = tokio::spawn(task);
        let waited = fill(&queue, &reader, MORE as usize).await;
        assert!(waited >= BLOCK_TIMEOUT && waited < BLOCK_TIMEOUT * MORE / 10, "{waited:?}");
        assert_eq!(dropped.load(Ordering::Relaxed), u64::from(MORE));
        reader.open.send_replace(true);
        while queue.pending.load(Ordering::Relaxed) > 0 {
            tokio::task::yield_now().await;
        }
        assert_eq!(reader.read.load(Ordering::Relaxed), BLOCKING_QUEUE + 1);
        // The queue waits again after the reader has resumed.
        reader.open.send_replace(false);
        assert!(fill(&queue, &reader, 1).await >= BLOCK_TIMEOUT);
        drop(queue);
        reader.open.send_replace(true);
        task.await.expect("it ends");
    }

    #[tokio::test]
    async fn a_write_does_not_overtake_one_that_has_found_no_space() {
        let dropped = Arc::new(AtomicU64::new(0));
        let (queue, task) = Queue::new(OverflowPolicy::Drop, &dropped, BLOCK_TIMEOUT, || {});
        let (queue, written) = (Arc::new(queue), Arc::new(Mutex::new(Vec::new())));
        let record = |name| {
            let written = Arc::clone(&written);
            move || written.lock().expect("not poisoned").push(name)
        };
        // The second write begins after the first has found no space and before it is queued.
        let later: Arc<Mutex<Option<Write>>> = Arc::default();
        let (same_queue, write_second, slot) = (Arc::clone(&queue), record("second"), Arc::clone(&later));
        let mut begin_second =
            Some(async move { same_queue.write(Box::pin(async move { write_second() })).await });
        let write_first = record("first");
        let first = std::future::poll_fn(move |context| match begin_second.take() {
            Some(second) => {
                let mut second: Write = Box::pin(second);
                if second.as_mut().poll(context).is_pending() {
                    *slot.lock().expect("not poisoned") = Some(second);
                }
                Poll::Pending
            }
            None => {
                write_first();
                Poll::Ready(())
            }
        });
        queue.write(Box::pin(first)).await;
        let task = tokio::spawn(task);
        let second = later.lock().expect("not poisoned").take();
        if let Some(second) = second {
            second.await;
        }
        drop(queue);
        task.await.expect("it ends");
        assert_eq!(*written.lock().expect("not poisoned"), ["first", "second"]);
    }

    #[tokio::test]
    async fn a_blocking_queue_loses_no_message_of_a_slow_reader() {
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (queue, task) = Queue::new(OverflowPolicy::Block, &dropped, BLOCK_TIMEOUT, || {});
        let task = tokio::spawn(task);
        let opener = reader.open.clone();
        let opens = tokio::spawn(async move {
            for n in 0.. {
                opener.send_replace(n % 2 == 0);
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        });
        for _ in 0..10 * BLOCKING_QUEUE {
            queue.write(reader.write()).await;
        }
        drop(queue);
        task.await.expect("it ends");
        opens.abort();
        let counts = (reader.read.load(Ordering::Relaxed), dropped.load(Ordering::Relaxed));
        assert_eq!(counts, (10 * BLOCKING_QUEUE, 0));
    }

    #[tokio::test]
    async fn a_stalled_reader_is_reported_repeatedly_until_it_resumes() {
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (stalls, is_stalled) = (Arc::new(AtomicUsize::new(0)), Arc::new(tokio::sync::Notify::new()));
        let (count, notify) = (Arc::clone(&stalls), Arc::clone(&is_stalled));
        let on_stall = move || {
            count.fetch_add(1, Ordering::Relaxed);
            notify.notify_one();
        };
        let (queue, task) = Queue::new(OverflowPolicy::Block, &dropped, Duration::from_millis(5), on_stall);
        let task = tokio::spawn(task);
        queue.write(reader.write()).await;
        for _ in 0..3 {
            is_stalled.notified().await;
        }
        reader.open.send_replace(true);
        drop(queue);
        task.await.expect("it ends");
        assert_eq!(reader.read.load(Ordering::Relaxed), 1);
        assert!(stalls.load(Ordering::Relaxed) >= 3);
    }
}

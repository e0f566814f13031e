//! What the node publishes: at once while the middleware has room, otherwise through one queue and one
//! task per topic, so that a subscriber that is slow on one topic delays no other, and none delays the
//! machine.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use futures::FutureExt;
use rustdds::qos::HasQoSPolicy;
use rustdds::{DomainParticipant, TopicDescription};
use serde::Serialize;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::endpoints::Publisher;
use super::heard::{Heard, Listeners};
use super::recorder::Tap;
use super::writers::{Renewals, Succession, Writer};

/// What happens when a queue is full because its subscribers are slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WhenFull {
    /// The message is dropped and counted: the machine is in step with the wall clock.
    Drop,
    /// The sender waits: the machine runs as fast as its subscribers can take it.
    Wait,
    /// The sender waits for subscribers that are slow, but not for one that stands still: after [`PATIENCE`]
    /// messages are dropped and counted until there is room again.
    WaitForAWhile,
}

/// Messages that a queue holds in front of the middleware when it may drop: 1.5 s at the default rate.
const DROPPING_QUEUE: usize = 256;
/// Messages that a queue holds when its sender waits instead.
const WAITING_QUEUE: usize = 8;
/// How long a sender waits for room in a queue that does not move.
const PATIENCE: Duration = Duration::from_secs(1);

/// How long a reader may acknowledge nothing, once the middleware keeps no more for it, before it is told to do without
/// some of what it lacks. Where messages are dropped meanwhile, that is 50 s of them at the default rate already; where
/// nothing is to be lost, it may be in a debugger.
fn longest_wait(when_full: WhenFull) -> Duration {
    match when_full {
        WhenFull::Drop | WhenFull::WaitForAWhile => Duration::from_secs(5),
        WhenFull::Wait => Duration::from_secs(30),
    }
}

/// Length of a queue.
pub fn queue_length(when_full: WhenFull) -> usize {
    match when_full {
        WhenFull::Drop => DROPPING_QUEUE,
        WhenFull::Wait | WhenFull::WaitForAWhile => WAITING_QUEUE,
    }
}

/// A message on its way to the middleware.
type Write = Pin<Box<dyn Future<Output = ()> + Send>>;

/// The sending end of a topic.
pub struct Output<M: Serialize> {
    writers: Arc<Succession<Writer<M>>>,
    queue: Queue,
    tap: Tap<M>,
    heard: Heard,
}

/// Messages that the middleware had no room for, in order.
struct Queue {
    writes: mpsc::Sender<Write>,
    /// How many those are, the one that waits for room among them.
    behind: Arc<AtomicUsize>,
    when_full: WhenFull,
    /// Whether the last sender's patience came to an end.
    stands_still: AtomicBool,
    dropped: Arc<AtomicU64>,
}

impl Queue {
    /// The queue, and the task that empties it, which ends when the queue is dropped; it says so when a write has waited
    /// for another `longest`.
    fn new(
        when_full: WhenFull,
        dropped: &Arc<AtomicU64>,
        longest: Duration,
        stuck: impl Fn() + Send + 'static,
    ) -> (Self, impl Future<Output = ()> + Send + 'static) {
        let (writes, mut queued) = mpsc::channel::<Write>(queue_length(when_full));
        let behind = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&behind);
        let task = async move {
            while let Some(mut write) = queued.recv().await {
                while timeout(longest, &mut write).await.is_err() {
                    stuck();
                }
                left.fetch_sub(1, Ordering::Release);
            }
        };
        let dropped = Arc::clone(dropped);
        (Queue { writes, behind, when_full, stands_still: AtomicBool::new(false), dropped }, task)
    }

    /// Writes at once where nothing waits, so that a period wakes no task for each of its topics; queues otherwise.
    async fn write(&self, mut write: Write) {
        if self.behind.load(Ordering::Acquire) == 0 && (&mut write).now_or_never().is_some() {
            return;
        }
        self.behind.fetch_add(1, Ordering::AcqRel);
        if !self.push(write).await {
            self.behind.fetch_sub(1, Ordering::AcqRel);
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Whether there was room, or came to be. The task that makes it ends only after this queue has been dropped.
    async fn push(&self, write: Write) -> bool {
        let may_wait = match self.when_full {
            WhenFull::Drop => false,
            WhenFull::Wait => return self.writes.send(write).await.is_ok(),
            WhenFull::WaitForAWhile => !self.stands_still.load(Ordering::Relaxed),
        };
        let is_queued = if may_wait {
            self.writes.send_timeout(write, PATIENCE).await.is_ok()
        } else {
            self.writes.try_send(write).is_ok()
        };
        self.stands_still.store(!is_queued, Ordering::Relaxed);
        is_queued
    }
}

/// Starts the tasks that publish, one for each topic.
pub struct Publishing<'a> {
    /// Whose readers they are.
    pub participant: &'a DomainParticipant,
    /// Counts what is dropped, of all topics.
    pub dropped: &'a Arc<AtomicU64>,
    /// Who listens to what.
    pub listeners: &'a mut Listeners,
    /// Where the tasks run.
    pub tasks: &'a mut JoinSet<()>,
    /// Renews the writers.
    pub renewals: &'a mut Renewals,
}

impl Publishing<'_> {
    /// Starts the task that waits for slow subscribers; it ends when the output is dropped.
    pub fn start<M: Serialize + Send + Sync + 'static>(
        &mut self,
        publisher: Publisher<M>,
        when_full: WhenFull,
    ) -> Output<M> {
        let Publisher { network, tap, topic, volatile, kept } = publisher;
        let heard = if volatile && !tap.records() {
            self.listeners.of(network.guid(), topic.name())
        } else {
            Heard::always()
        };
        let writers = Arc::new(Succession::new(Writer::new(network, &topic, kept, self.participant)));
        let longest = longest_wait(when_full);
        let stuck = Arc::clone(&writers);
        let (queue, task) = Queue::new(when_full, self.dropped, longest, move || {
            stuck.current().deaf.give_up(longest.as_secs())
        });
        self.tasks.spawn(task);
        if topic.qos().is_volatile() {
            self.renewals.add(Arc::clone(&writers), topic, kept, self.participant.clone());
        }
        Output { writers, queue, tap, heard }
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
        let writers = Arc::clone(&self.writers);
        let write = Box::pin(async move { writers.turn(Instant::now).write(message).await });
        self.queue.write(write).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures::future::pending;
    use tokio::sync::watch;

    /// Where writes go to while `open`, counted.
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

    /// A queue with a reader that stands still, full, and how long it then takes to write `more`.
    async fn fill(queue: &Queue, reader: &Reader, more: usize) -> Duration {
        // One more than the queue holds is being written.
        for _ in 0..WAITING_QUEUE + 1 {
            queue.write(reader.write()).await;
            tokio::task::yield_now().await;
        }
        let began = Instant::now();
        for _ in 0..more {
            queue.write(reader.write()).await;
        }
        began.elapsed()
    }

    /// Who writes results reads commands next: a stop that follows a refusal was not heard.
    #[tokio::test]
    async fn a_reader_of_results_that_stands_still_is_not_waited_for_again_and_again() {
        const MORE: u32 = 1000;
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (queue, task) = Queue::new(WhenFull::WaitForAWhile, &dropped, PATIENCE, || {});
        let task = tokio::spawn(task);
        let waited = fill(&queue, &reader, MORE as usize).await;
        assert!(waited >= PATIENCE && waited < PATIENCE * MORE / 10, "{waited:?}");
        assert_eq!(dropped.load(Ordering::Relaxed), u64::from(MORE));
        reader.open.send_replace(true);
        while queue.behind.load(Ordering::Relaxed) > 0 {
            tokio::task::yield_now().await;
        }
        assert_eq!(reader.read.load(Ordering::Relaxed), WAITING_QUEUE + 1);
        // It is waited for again when it has gone on.
        reader.open.send_replace(false);
        assert!(fill(&queue, &reader, 1).await >= PATIENCE);
        drop(queue);
        reader.open.send_replace(true);
        task.await.expect("it ends");
    }

    #[tokio::test]
    async fn a_reader_that_is_slow_misses_nothing_where_it_is_waited_for() {
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (queue, task) = Queue::new(WhenFull::Wait, &dropped, PATIENCE, || {});
        let task = tokio::spawn(task);
        let opener = reader.open.clone();
        let opens = tokio::spawn(async move {
            for n in 0.. {
                opener.send_replace(n % 2 == 0);
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
        });
        for _ in 0..10 * WAITING_QUEUE {
            queue.write(reader.write()).await;
        }
        drop(queue);
        task.await.expect("it ends");
        opens.abort();
        let counts = (reader.read.load(Ordering::Relaxed), dropped.load(Ordering::Relaxed));
        assert_eq!(counts, (10 * WAITING_QUEUE, 0));
    }

    #[tokio::test]
    async fn a_reader_that_takes_nothing_is_told_to_do_without_until_it_goes_on() {
        let (reader, dropped) = (Reader::new(), Arc::new(AtomicU64::new(0)));
        let (told, is_told) = (Arc::new(AtomicUsize::new(0)), Arc::new(tokio::sync::Notify::new()));
        let (count, notify) = (Arc::clone(&told), Arc::clone(&is_told));
        let stuck = move || {
            count.fetch_add(1, Ordering::Relaxed);
            notify.notify_one();
        };
        let (queue, task) = Queue::new(WhenFull::Wait, &dropped, Duration::from_millis(5), stuck);
        let task = tokio::spawn(task);
        queue.write(reader.write()).await;
        for _ in 0..3 {
            is_told.notified().await;
        }
        reader.open.send_replace(true);
        drop(queue);
        task.await.expect("it ends");
        assert_eq!(reader.read.load(Ordering::Relaxed), 1);
        assert!(told.load(Ordering::Relaxed) >= 3);
    }
}

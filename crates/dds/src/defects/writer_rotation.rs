//! Rotation of DataWriters: a volatile topic gets a new writer after 2¹⁹ samples.
//!
//! **Symptom:** after three hours at 6 ms, each best-effort subscription to a topic costs 40 MB for its lifetime.
//!
//! **Upstream:** RustDDS 0.15.1, `src/rtps/rtps_reader_proxy.rs` line 506, `set_pending_gap_up_to`: for each matched reader,
//! a volatile writer builds a set of the sequence numbers of all samples that it has ever written, because they are
//! irrelevant (GAP) to that reader, some 30 octets each, in the thread that sends everything. The set lives until the
//! reader acknowledges, or until a best-effort reader leaves.
//!
//! **Test:** `test_py/test_late_readers.py`.
//!
//! **Superfluous when** RustDDS stores the GAP as a range.
//!
//! The next writer, numbered from 1, is created 5 s before its use, for its discovery, and the previous one disposed of
//! 30 s after it. The creation of a writer also makes RustDDS match the discovered readers of the topic: the topics of a
//! participant that has returned get new writers ([`super::returned_participants`]).

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::{Context, Node};
use rustdds::{DomainParticipant, Topic, TopicDescription};
use serde::Serialize;
use tokio::time::MissedTickBehavior;
use tracing::warn;

use super::announced_writers::dispose_sequence_number;
use super::dispose;
use super::returned_participants::RemoteParticipants;
use super::stalled_readers::StalledReaders;
use crate::environment::DiscoveryRange;
use crate::rtps::{Guid, is_secured};

/// Number of samples after which a writer is replaced: 52 minutes at the default rate.
const MAX_SAMPLES: i64 = 1 << 19;
/// Time from the creation of a new writer until it is used, in which readers discover it.
const DISCOVERY_TIME: Duration = Duration::from_secs(5);
/// Time for which a replaced writer is kept for readers that have not acknowledged its last samples.
const RETENTION_TIME: Duration = Duration::from_secs(30);
/// Period at which the sample counts are checked.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// Current writer of a topic and, during a rotation, the next or the previous one.
#[derive(Debug)]
struct WriterRotation<W>(Mutex<Generations<W>>);

#[derive(Debug)]
struct Generations<W> {
    current: Arc<W>,
    /// Next writer, and the time of its creation.
    next: Option<(Arc<W>, Instant)>,
    /// Previous writer, and the time of its replacement.
    previous: Option<(Arc<W>, Instant)>,
}

impl<W> WriterRotation<W> {
    /// Creates a rotation that begins with `first`.
    pub(crate) fn new(first: W) -> Self {
        WriterRotation(Mutex::new(Generations { current: Arc::new(first), next: None, previous: None }))
    }

    fn lock(&self) -> MutexGuard<'_, Generations<W>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the writer of the last sample.
    pub(crate) fn current(&self) -> Arc<W> {
        Arc::clone(&self.lock().current)
    }

    /// Returns the writer of the next sample; switches to the new writer when [`DISCOVERY_TIME`] has passed.
    pub(crate) fn advance(&self, now: impl FnOnce() -> Instant) -> Arc<W> {
        let mut generations = self.lock();
        if let Some((_, since)) = generations.next {
            let now = now();
            if now.duration_since(since) >= DISCOVERY_TIME {
                generations.replace_current(now);
            }
        }
        Arc::clone(&generations.current)
    }

    /// Returns true if no rotation is in progress.
    pub(crate) fn is_single(&self) -> bool {
        let generations = self.lock();
        generations.next.is_none() && generations.previous.is_none()
    }

    /// Adds the next writer, created at `now`.
    pub(crate) fn prepare(&self, next: W, now: Instant) {
        self.lock().next = Some((Arc::new(next), now));
    }

    /// Takes out the previous writer when [`RETENTION_TIME`] has passed.
    pub(crate) fn take_retired(&self, now: Instant) -> Option<Arc<W>> {
        let retired = self.lock().previous.take_if(|(_, since)| now.duration_since(*since) >= RETENTION_TIME);
        retired.map(|(writer, _)| writer)
    }
}

impl<W> Generations<W> {
    fn replace_current(&mut self, now: Instant) {
        if let Some((next, _)) = self.next.take() {
            self.previous = Some((std::mem::replace(&mut self.current, next), now));
        }
    }
}

/// Writer of a topic, with the handling of its stalled readers.
pub(crate) struct Writer<M: Serialize> {
    network: ros2_client::Publisher<M>,
    /// Sample count, and GAP for readers that do not acknowledge.
    pub(crate) readers: StalledReaders,
}

impl<M: Serialize> Writer<M> {
    /// Creates a writer of `topic`; `max_unacknowledged` is the number of unacknowledged samples at which it blocks.
    fn new(
        network: ros2_client::Publisher<M>,
        topic: &Topic,
        max_unacknowledged: usize,
        participant: &DomainParticipant,
    ) -> Self {
        let readers =
            StalledReaders::new(network.guid(), topic.name(), max_unacknowledged, participant.clone());
        Writer { network, readers }
    }

    /// Writes a message as soon as the middleware has space for it. Returns false if the middleware rejects it.
    async fn write(&self, message: M) -> bool {
        let is_written = self.network.async_publish(message).await.is_ok();
        if is_written {
            self.readers.record_write();
        }
        is_written
    }
}

/// Writers of a topic.
pub(crate) struct TopicWriters<M: Serialize> {
    rotation: WriterRotation<Writer<M>>,
    topic: Topic,
    participant: DomainParticipant,
    max_unacknowledged: usize,
}

impl<M: Serialize + Send + Sync + 'static> TopicWriters<M> {
    /// Creates the writers of `topic`, which begin with `network`.
    pub(crate) fn new(
        network: ros2_client::Publisher<M>,
        topic: Topic,
        max_unacknowledged: usize,
        participant: DomainParticipant,
    ) -> Self {
        let rotation = WriterRotation::new(Writer::new(network, &topic, max_unacknowledged, &participant));
        TopicWriters { rotation, topic, participant, max_unacknowledged }
    }

    /// Returns the writer of the last sample.
    pub(crate) fn current(&self) -> Arc<Writer<M>> {
        self.rotation.current()
    }

    /// Writes a message as soon as the middleware has space for it. Returns false if the middleware rejects it.
    pub(crate) async fn write(&self, message: M) -> bool {
        self.rotation.advance(Instant::now).write(message).await
    }
}

/// Topic of any message type whose writers rotate.
pub(crate) trait RotatedTopic: Send + Sync {
    /// Creates the next writer if the current one has written at least `min_samples`. Returns true if it does.
    fn prepare_next(&self, node: &mut Node, min_samples: i64, now: Instant) -> Result<bool, String>;
    /// Drops the previous writer when its retention time has passed, after a call of `dispose` with its GUID.
    fn retire(&self, now: Instant, dispose: &mut dyn FnMut(Guid));
    /// Returns the name of the topic in DDS.
    fn name(&self) -> String;
}

impl<M: Serialize + Send + Sync + 'static> RotatedTopic for TopicWriters<M> {
    fn prepare_next(&self, node: &mut Node, min_samples: i64, now: Instant) -> Result<bool, String> {
        let is_due = self.rotation.is_single() && self.rotation.current().readers.written() >= min_samples;
        if is_due {
            let network = node.create_publisher(&self.topic, None).map_err(|e| e.to_string())?;
            let writer = Writer::new(network, &self.topic, self.max_unacknowledged, &self.participant);
            self.rotation.prepare(writer, now);
        }
        Ok(is_due)
    }

    fn retire(&self, now: Instant, dispose: &mut dyn FnMut(Guid)) {
        if let Some(retired) = self.rotation.take_retired(now) {
            dispose(retired.network.guid().to_bytes());
        }
    }

    fn name(&self) -> String {
        self.topic.name()
    }
}

/// Topics of the node, whose writers are rotated.
#[derive(Default)]
pub(crate) struct RotatedTopics(Mutex<Vec<Arc<dyn RotatedTopic>>>);

/// Node that owns the rotated writers.
pub(crate) struct RotationContext<'a> {
    /// Node of the writers.
    pub node: &'a Mutex<Node>,
    /// ROS context of the node.
    pub context: &'a Context,
    /// Network range in which the node is announced.
    pub range: DiscoveryRange,
    /// Other participants.
    pub participants: &'a RemoteParticipants,
    /// Number of writers that ros2-client does not list.
    pub unlisted_writers: &'a AtomicUsize,
}

impl RotatedTopics {
    /// Adds a topic with its writers.
    pub(crate) fn add(&self, writers: Arc<dyn RotatedTopic>) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(writers);
    }

    fn topics(&self) -> Vec<Arc<dyn RotatedTopic>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Rotates the writers until the task is aborted.
    pub(crate) async fn run(&self, owner: RotationContext<'_>) {
        let mut timer = tokio::time::interval(POLL_PERIOD);
        timer.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let (mut returned, mut disposed) = (HashSet::new(), 0);
        loop {
            timer.tick().await;
            let now = Instant::now();
            let topics = self.topics();
            owner.retire(&topics, &mut disposed, now);
            owner.prepare_next(&topics, &mut returned, now);
        }
    }
}

/// Returns the number of samples after which a writer is replaced.
///
/// A Fast DDS participant that is just being discovered should not receive a new announcement before the older ones, so
/// the replacement waits until discovery is settled, but not for ever.
fn min_samples(is_settled: bool) -> i64 {
    if is_settled { MAX_SAMPLES } else { 2 * MAX_SAMPLES }
}

impl RotationContext<'_> {
    /// Drops the previous writers whose retention time has passed; counts them in `disposed`.
    fn retire(&self, topics: &[Arc<dyn RotatedTopic>], disposed: &mut usize, now: Instant) {
        for topic in topics {
            topic.retire(now, &mut |writer| {
                if !is_secured() {
                    let participant = self.context.domain_participant();
                    let unlisted = self.unlisted_writers.load(Ordering::Relaxed);
                    let number = dispose_sequence_number(self.context, unlisted, *disposed);
                    dispose::of_writer(&writer, number, &participant, self.range).send_once();
                }
                *disposed += 1;
            });
        }
    }

    /// Creates the next writers of the topics that are due, or are in `returned`, the topics (names in DDS) of
    /// participants that have returned.
    fn prepare_next(&self, topics: &[Arc<dyn RotatedTopic>], returned: &mut HashSet<String>, now: Instant) {
        let is_settled = self.participants.is_settled(now);
        if is_settled {
            returned.extend(self.topics_of_returned());
        }
        for topic in topics {
            let name = topic.name();
            let min_samples = if returned.contains(&name) { 0 } else { min_samples(is_settled) };
            let node = &mut self.node.lock().unwrap_or_else(PoisonError::into_inner);
            match topic.prepare_next(node, min_samples, now) {
                Ok(true) => drop(returned.remove(&name)),
                Ok(false) => {}
                Err(reason) => {
                    warn!("cannot create a new writer for {}: {reason}", name.trim_start_matches("rt"));
                }
            }
        }
        // Only a rotation in progress delays the next one.
        returned.retain(|name| topics.iter().any(|topic| topic.name() == *name));
    }

    /// Returns the topics (names in DDS) read by participants that have returned after their lease had expired.
    fn topics_of_returned(&self) -> HashSet<String> {
        let returned = self.participants.take_returned();
        if returned.is_empty() {
            return HashSet::new();
        }
        let readers = self.context.domain_participant().discovered_readers();
        let of_returned = readers.iter().filter(|reader| {
            returned.iter().any(|guid| guid.prefix == reader.reader_proxy.remote_reader_guid.prefix)
        });
        of_returned.map(|reader| reader.subscription_topic_data.topic_name().clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_writer_is_used_after_the_discovery_time_and_the_previous_one_is_retained() {
        let began = Instant::now();
        let writers = WriterRotation::new("first");
        let at = |seconds: u64| began + Duration::from_secs(seconds);
        let advance = |seconds| *writers.advance(|| at(seconds));
        assert_eq!((advance(0), writers.is_single()), ("first", true));
        writers.prepare("second", at(10));
        assert_eq!((advance(14), writers.is_single()), ("first", false));
        // No sample has been written since the discovery time; the next one is written by the second.
        assert_eq!(*writers.current(), "first");
        assert_eq!((advance(100), *writers.current()), ("second", "second"));
        assert_eq!((writers.take_retired(at(129)), writers.is_single()), (None, false));
        assert_eq!((writers.take_retired(at(130)).as_deref(), writers.is_single()), (Some(&"first"), true));
        assert_eq!(advance(200), "second");
    }
}

//! Rotation of DataWriters: a volatile topic gets a new writer after 2¹⁹ samples, to bound RustDDS's gap sets.
//!
//! For each matched reader, a volatile writer of RustDDS builds a set of the sequence numbers of all samples that it
//! has ever written, because they are irrelevant (GAP) to that reader. The set takes about 30 bytes per sample and is
//! built in the thread that sends everything. It lives until the reader acknowledges, or until a best-effort reader
//! leaves. A topic therefore gets a new writer, numbered from 1, after [`MAX_SAMPLES`] samples, and the previous
//! writer is disposed of.
//!
//! The creation of a writer also makes RustDDS match the discovered readers of the topic. Therefore the topics of a
//! participant that returns after its lease has expired get new writers ([`super::remote_participants`]).

use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::{Context, Node};
use tokio::time::MissedTickBehavior;
use tracing::warn;

use super::announced_writers::dispose_sequence_number;
use super::dispose;
use super::environment::DiscoveryRange;
use super::remote_participants::RemoteParticipants;
use super::renewal::Renewal;
use super::rtps::is_secured;
use super::topic_writers::RotatedTopic;

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
pub(super) struct WriterRotation<W>(Mutex<Generations<W>>);

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
    pub(super) fn new(first: W) -> Self {
        WriterRotation(Mutex::new(Generations { current: Arc::new(first), next: None, previous: None }))
    }

    fn lock(&self) -> MutexGuard<'_, Generations<W>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the writer of the last sample.
    pub(super) fn current(&self) -> Arc<W> {
        Arc::clone(&self.lock().current)
    }

    /// Returns the writer of the next sample; switches to the new writer when [`DISCOVERY_TIME`] has passed.
    pub(super) fn advance(&self, now: impl FnOnce() -> Instant) -> Arc<W> {
        let mut generations = self.lock();
        if let Some((_, since)) = generations.next {
            let now = now();
            if now.duration_since(since) >= DISCOVERY_TIME {
                generations.replace_current(now);
            }
        }
        Arc::clone(&generations.current)
    }

    /// Replaces the current writer at once. Returns it.
    pub(super) fn replace(&self, next: Arc<W>) -> Arc<W> {
        std::mem::replace(&mut self.lock().current, next)
    }

    /// Returns true if no rotation is in progress.
    pub(super) fn is_single(&self) -> bool {
        let generations = self.lock();
        generations.next.is_none() && generations.previous.is_none()
    }

    /// Adds the next writer, created at `now`.
    pub(super) fn prepare(&self, next: W, now: Instant) {
        self.lock().next = Some((Arc::new(next), now));
    }

    /// Takes out the previous writer when [`RETENTION_TIME`] has passed.
    pub(super) fn take_retired(&self, now: Instant) -> Option<Arc<W>> {
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

/// Topics of the node, whose writers are rotated if they are volatile.
#[derive(Default)]
pub struct RotatedTopics(Vec<Arc<dyn RotatedTopic>>);

/// Node that owns the rotated writers.
pub(super) struct RotationContext {
    /// Node of the writers.
    pub node: Node,
    /// ROS context of the node.
    pub context: Context,
    /// Network range in which the node is announced.
    pub range: DiscoveryRange,
    /// Other participants.
    pub participants: RemoteParticipants,
    /// Number of writers disposed of so far.
    pub disposed: usize,
}

/// Number of writers that ros2-client does not list: the response writers of `send_goal` and `get_result`
/// (`Service::for_action`) of the two actions, `~/follow_joint_trajectory` and `~/run_program`.
const WRITERS_OUTSIDE_NODES: usize = 4;

impl RotatedTopics {
    /// Adds a topic with its writers.
    pub(super) fn add(&mut self, writers: Arc<dyn RotatedTopic>) {
        self.0.push(writers);
    }

    /// Rotates the writers, and renews the participant when it is due, until the task is aborted.
    pub(super) async fn run(self, mut owner: RotationContext, mut renewal: Renewal) {
        let mut timer = tokio::time::interval(POLL_PERIOD);
        timer.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut returned = HashSet::new();
        loop {
            timer.tick().await;
            let now = Instant::now();
            self.retire(&mut owner, now);
            self.prepare_next(&mut owner, &mut returned, now);
            let is_single = self.0.iter().all(|topic| topic.is_single());
            if renewal.is_due(now) && is_single {
                renewal.run(&self.0, &mut owner).await;
            }
        }
    }

    /// Drops the previous writers whose retention time has passed.
    fn retire(&self, owner: &mut RotationContext, now: Instant) {
        for topic in &self.0 {
            topic.retire(now, &mut |writer| {
                if !is_secured() {
                    let participant = owner.context.domain_participant();
                    let number =
                        dispose_sequence_number(&owner.context, WRITERS_OUTSIDE_NODES, owner.disposed);
                    dispose::of_writer(&writer, number, &participant, owner.range).send_once();
                }
                owner.disposed += 1;
            });
        }
    }

    /// Creates the next writers of the topics that are due, or are in `returned`, the topics (names in DDS) of
    /// participants that have returned.
    fn prepare_next(&self, owner: &mut RotationContext, returned: &mut HashSet<String>, now: Instant) {
        let is_settled = owner.participants.is_settled(now);
        if is_settled {
            returned.extend(owner.topics_of_returned());
        }
        let rotating = || self.0.iter().filter(|topic| topic.is_rotating());
        for topic in rotating() {
            let name = topic.name();
            let min_samples = if returned.contains(&name) { 0 } else { min_samples(is_settled) };
            match topic.prepare_next(&mut owner.node, min_samples, now) {
                Ok(true) => drop(returned.remove(&name)),
                Ok(false) => {}
                Err(reason) => {
                    warn!("cannot create a new writer for {}: {reason}", name.trim_start_matches("rt"));
                }
            }
        }
        // Only a rotation in progress delays the next one.
        returned.retain(|name| rotating().any(|topic| topic.name() == *name));
    }
}

/// Returns the number of samples after which a writer is replaced.
///
/// A Fast DDS participant that is just being discovered should not receive a new announcement before the older ones, so
/// the replacement waits until discovery is settled, but not for ever.
fn min_samples(is_settled: bool) -> i64 {
    if is_settled { MAX_SAMPLES } else { 2 * MAX_SAMPLES }
}

impl RotationContext {
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

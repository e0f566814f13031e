//! The writer of a topic, which is another one once it has written much.
//!
//! When a reader comes, a volatile writer of RustDDS's makes a set of the numbers of all samples that it has ever
//! written, since they are not for that reader: some 30 bytes for each, in the thread that sends everything. It has the
//! set until the reader acknowledges, for one of best effort as long as that is there. A topic therefore gets a new
//! writer after [`MANY`] samples, with numbers from 1 on, and the old one takes its leave.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::{Context, Node};
use rustdds::{DomainParticipant, Topic, TopicDescription};
use serde::Serialize;
use tracing::warn;

use super::deaf::Deaf;
use super::environment::DiscoveryRange;
use super::goodbye::Goodbye;
use super::rtps::{Guid, is_secured};

/// Samples that a writer writes at most before there is another: 52 minutes of them at the default rate.
const MANY: i64 = 1 << 19;
/// How long readers have to find a writer before it begins to write.
const FOUND: Duration = Duration::from_secs(5);
/// How long a writer stays for readers that have not acknowledged the last of its samples.
const STAYS: Duration = Duration::from_secs(30);
/// How often it is looked whether one has written much.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// A writer, and what is to be done when its readers take nothing.
pub(super) struct Writer<M: Serialize> {
    network: ros2_client::Publisher<M>,
    /// Its readers.
    pub(super) deaf: Deaf,
}

impl<M: Serialize> Writer<M> {
    /// Of samples of `topic`, of which it keeps so many for readers that have not acknowledged them.
    pub(super) fn new(
        network: ros2_client::Publisher<M>,
        topic: &Topic,
        kept: usize,
        participant: &DomainParticipant,
    ) -> Self {
        let deaf = Deaf::new(network.guid(), topic.name(), kept, participant.clone());
        Writer { network, deaf }
    }

    /// Hands a message to the middleware as soon as that has room for it.
    pub(super) async fn write(&self, message: M) {
        match self.network.async_publish(message).await {
            Ok(()) => self.deaf.wrote(),
            Err(_) => warn!("a message could not be published"),
        }
    }
}

/// One that writes, and for some time its successor or its predecessor.
#[derive(Debug)]
pub(super) struct Succession<W>(Mutex<Generations<W>>);

#[derive(Debug)]
struct Generations<W> {
    writes: Arc<W>,
    /// Who is next, and since when readers can find it.
    next: Option<(Arc<W>, Instant)>,
    /// Who was before, and until when.
    before: Option<(Arc<W>, Instant)>,
}

impl<W> Succession<W> {
    /// Of `first`.
    pub(super) fn new(first: W) -> Self {
        Succession(Mutex::new(Generations { writes: Arc::new(first), next: None, before: None }))
    }

    fn lock(&self) -> MutexGuard<'_, Generations<W>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Who wrote the last sample.
    pub(super) fn current(&self) -> Arc<W> {
        Arc::clone(&self.lock().writes)
    }

    /// Who writes the next one.
    pub(super) fn turn(&self, now: impl FnOnce() -> Instant) -> Arc<W> {
        let mut generations = self.lock();
        if let Some((_, since)) = generations.next {
            let now = now();
            if now.duration_since(since) >= FOUND {
                generations.succeed(now);
            }
        }
        Arc::clone(&generations.writes)
    }

    /// Whether there is only one.
    fn is_alone(&self) -> bool {
        let generations = self.lock();
        generations.next.is_none() && generations.before.is_none()
    }

    fn prepare(&self, next: W, now: Instant) {
        self.lock().next = Some((Arc::new(next), now));
    }

    /// The predecessor, once it has stayed long enough.
    fn retired(&self, now: Instant) -> Option<Arc<W>> {
        let gone = self.lock().before.take_if(|(_, since)| now.duration_since(*since) >= STAYS);
        gone.map(|(before, _)| before)
    }
}

impl<W> Generations<W> {
    fn succeed(&mut self, now: Instant) {
        if let Some((next, _)) = self.next.take() {
            self.before = Some((std::mem::replace(&mut self.writes, next), now));
        }
    }
}

/// Topics whose writers are renewed.
#[derive(Default)]
pub struct Renewals(Vec<Box<dyn Renewed>>);

/// Who has the writers.
pub struct Owner {
    /// Their node.
    pub node: Node,
    /// Where that lives.
    pub context: Context,
    /// Where it is known.
    pub range: DiscoveryRange,
}

/// Writers that the crate does not know of: of responses to the requests of goals and results
/// (`service::Service::of_action`).
const NOT_OF_THE_NODE: i64 = 2;

impl Owner {
    /// Writers that have been announced, each in a sample.
    fn announced(&self) -> i64 {
        // The crate tells the number of a node's writers in no other way.
        let entities = serde_json::to_value(self.context.participant_entities_info()).unwrap_or_default();
        let nodes = entities["node_entities_info_seq"].as_array().map_or(&[][..], Vec::as_slice);
        let writers =
            nodes.iter().filter_map(|node| node["writer_gid_seq"].as_array()).map(Vec::len).sum::<usize>();
        i64::try_from(writers).unwrap_or(0) + NOT_OF_THE_NODE
    }
}

/// Such a topic, of whatever type.
trait Renewed: Send {
    /// Creates a writer where the present one has written much.
    fn look(&self, node: &mut Node, now: Instant) -> Result<(), String>;
    /// Lets the last writer go when it has stayed long enough, after `goodbye` to its GUID.
    fn retire(&self, now: Instant, goodbye: &mut dyn FnMut(Guid));
    /// Its name in DDS.
    fn name(&self) -> String;
}

struct Renewable<M: Serialize> {
    writers: Arc<Succession<Writer<M>>>,
    topic: Topic,
    kept: usize,
    participant: DomainParticipant,
}

impl<M: Serialize + Send + Sync + 'static> Renewed for Renewable<M> {
    fn look(&self, node: &mut Node, now: Instant) -> Result<(), String> {
        if self.writers.is_alone() && self.writers.current().deaf.written() >= MANY {
            let network = node.create_publisher(&self.topic, None).map_err(|e| e.to_string())?;
            self.writers.prepare(Writer::new(network, &self.topic, self.kept, &self.participant), now);
        }
        Ok(())
    }

    fn retire(&self, now: Instant, goodbye: &mut dyn FnMut(Guid)) {
        if let Some(retired) = self.writers.retired(now) {
            goodbye(retired.network.guid().to_bytes());
        }
    }

    fn name(&self) -> String {
        self.topic.name()
    }
}

impl Renewals {
    /// Looks after the writers of a topic.
    pub(super) fn add<M: Serialize + Send + Sync + 'static>(
        &mut self,
        writers: Arc<Succession<Writer<M>>>,
        topic: Topic,
        kept: usize,
        participant: DomainParticipant,
    ) {
        self.0.push(Box::new(Renewable { writers, topic, kept, participant }));
    }

    /// Renews them until the task is ended.
    pub async fn run(self, mut owner: Owner) {
        let mut timer = tokio::time::interval(LOOK_PERIOD);
        // Writers that were disposed of, each in a sample.
        let mut disposed = 0;
        loop {
            timer.tick().await;
            let now = Instant::now();
            for topic in &self.0 {
                topic.retire(now, &mut |writer| {
                    disposed += 1;
                    if !is_secured() {
                        let participant = owner.context.domain_participant();
                        let number = owner.announced() + disposed;
                        Goodbye::of_writer(&writer, number, &participant, owner.range).send_once();
                    }
                });
                if let Err(reason) = topic.look(&mut owner.node, now) {
                    let name = topic.name();
                    warn!("{} gets no new writer: {reason}", name.trim_start_matches("rt"));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_successor_writes_when_it_could_be_found_and_the_predecessor_stays_for_some_time() {
        let began = Instant::now();
        let writers = Succession::new("first");
        let at = |seconds: u64| began + Duration::from_secs(seconds);
        let turn = |seconds| *writers.turn(|| at(seconds));
        assert_eq!((turn(0), writers.is_alone()), ("first", true));
        writers.prepare("second", at(10));
        assert_eq!((turn(14), writers.is_alone()), ("first", false));
        // Nothing was written for long; then at once by the second.
        assert_eq!(*writers.current(), "first");
        assert_eq!((turn(100), *writers.current()), ("second", "second"));
        assert_eq!((writers.retired(at(129)), writers.is_alone()), (None, false));
        assert_eq!((writers.retired(at(130)).as_deref(), writers.is_alone()), (Some(&"first"), true));
        assert_eq!(turn(200), "second");
    }
}

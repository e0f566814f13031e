//! Writers of a topic: the current one, the next and previous ones during a rotation ([`super::writer_rotation`])
//! or a renewal of the participant ([`super::renewal`]), and the messages kept for late joiners.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use futures::FutureExt;
use futures::future::BoxFuture;
use ros2_client::{Context, Node};
use rustdds::policy::History;
use rustdds::qos::HasQoSPolicy;
use rustdds::{DomainParticipant, Topic, TopicDescription, TopicKind};
use serde::Serialize;

use super::renewable::RenewableEndpoint;
use super::rtps::Guid;
use super::stalled_readers::StalledReaders;
use super::writer_rotation::WriterRotation;

/// Writer of a topic, with the handling of its stalled readers.
pub(super) struct Writer<M: Serialize> {
    network: ros2_client::Publisher<M>,
    /// Sample count, and GAP for readers that do not acknowledge.
    pub(super) readers: StalledReaders,
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

/// Writers of a topic, with the newest messages of a transient-local topic.
pub(super) struct TopicWriters<M: Serialize> {
    rotation: WriterRotation<Writer<M>>,
    place: Mutex<Place>,
    /// Writer of the next participant with its topic until the switch, of the previous one after it.
    other: Mutex<Option<(Arc<Writer<M>>, Place)>>,
    max_unacknowledged: usize,
    /// Messages for late joiners; `None` if durability is volatile.
    kept: Option<tokio::sync::Mutex<KeptMessages<M>>>,
}

/// DDS topic and the participant that owns it.
struct Place {
    topic: Topic,
    participant: DomainParticipant,
}

impl<M: Serialize + Clone + Send + Sync + 'static> TopicWriters<M> {
    /// Creates the writers of `topic`, which begin with `network`.
    pub(super) fn new(
        network: ros2_client::Publisher<M>,
        topic: Topic,
        max_unacknowledged: usize,
        participant: DomainParticipant,
    ) -> Self {
        let qos = topic.qos();
        let kept = (!qos.is_volatile()).then(|| {
            let depth = match qos.history() {
                Some(History::KeepLast { depth }) => usize::try_from(depth).unwrap_or(1),
                _ => max_unacknowledged,
            };
            let lifespan = qos.lifespan().map(|lifespan| lifespan.duration.to_std());
            tokio::sync::Mutex::new(KeptMessages::new(depth, lifespan))
        });
        let rotation = WriterRotation::new(Writer::new(network, &topic, max_unacknowledged, &participant));
        let place = Mutex::new(Place { topic, participant });
        TopicWriters { rotation, place, other: Mutex::new(None), max_unacknowledged, kept }
    }

    /// Returns the writer of the last sample.
    pub(super) fn current(&self) -> Arc<Writer<M>> {
        self.rotation.current()
    }

    /// Writes a message as soon as the middleware has space for it. Returns false if the middleware rejects it.
    pub(super) async fn write(&self, message: M) -> bool {
        let writer = match &self.kept {
            None => self.rotation.advance(Instant::now),
            Some(kept) => {
                // With the lock, so that a switch is before or after both.
                let mut kept = kept.lock().await;
                kept.push(message.clone(), Instant::now());
                self.rotation.advance(Instant::now)
            }
        };
        writer.write(message).await
    }

    fn lock_place(&self) -> MutexGuard<'_, Place> {
        self.place.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock_other(&self) -> MutexGuard<'_, Option<(Arc<Writer<M>>, Place)>> {
        self.other.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn create_writer(&self, node: &mut Node, place: &Place) -> Result<Writer<M>, String> {
        let network = node.create_publisher(&place.topic, None).map_err(|e| e.to_string())?;
        Ok(Writer::new(network, &place.topic, self.max_unacknowledged, &place.participant))
    }

    /// Writes the kept messages that the writer of the next participant has not written.
    async fn replay_kept(&self, kept: &mut KeptMessages<M>) {
        let next = self.lock_other().as_ref().map(|(writer, _)| Arc::clone(writer));
        if let Some(writer) = next {
            for message in kept.take_unreplayed(Instant::now()) {
                writer.write(message).await;
            }
        }
    }
}

/// Topic of any message type, whose writers rotate if it is volatile.
pub(super) trait RotatedTopic: RenewableEndpoint {
    /// Returns true if the writers rotate.
    fn is_rotating(&self) -> bool;
    /// Creates the next writer if the current one has written at least `min_samples`. Returns true if it does.
    fn prepare_next(&self, node: &mut Node, min_samples: i64, now: Instant) -> Result<bool, String>;
    /// Drops the previous writer when its retention time has passed, after a call of `dispose` with its GUID.
    fn retire(&self, now: Instant, dispose: &mut dyn FnMut(Guid));
    /// Returns true if no rotation is in progress.
    fn is_single(&self) -> bool;
    /// Returns the name of the topic in DDS.
    fn name(&self) -> String;
}

impl<M: Serialize + Clone + Send + Sync + 'static> RotatedTopic for TopicWriters<M> {
    fn is_rotating(&self) -> bool {
        self.kept.is_none()
    }

    fn prepare_next(&self, node: &mut Node, min_samples: i64, now: Instant) -> Result<bool, String> {
        let is_due = self.rotation.is_single() && self.rotation.current().readers.written() >= min_samples;
        if is_due {
            let writer = self.create_writer(node, &self.lock_place())?;
            self.rotation.prepare(writer, now);
        }
        Ok(is_due)
    }

    fn retire(&self, now: Instant, dispose: &mut dyn FnMut(Guid)) {
        if let Some(retired) = self.rotation.take_retired(now) {
            dispose(retired.network.guid().to_bytes());
        }
    }

    fn is_single(&self) -> bool {
        self.rotation.is_single()
    }

    fn name(&self) -> String {
        self.lock_place().topic.name()
    }
}

impl<M: Serialize + Clone + Send + Sync + 'static> RenewableEndpoint for TopicWriters<M> {
    fn prepare(&self, node: &mut Node, context: &Context) -> Result<(), String> {
        let participant = context.domain_participant();
        let (name, type_name, qos) = {
            let place = self.lock_place();
            (place.topic.name(), place.topic.get_type().name().to_owned(), place.topic.qos())
        };
        let topic = participant
            .create_topic(name, type_name, &qos, TopicKind::NoKey)
            .map_err(|error| error.to_string())?;
        let place = Place { topic, participant };
        let writer = Arc::new(self.create_writer(node, &place)?);
        *self.lock_other() = Some((writer, place));
        Ok(())
    }

    fn replay(&self) -> BoxFuture<'_, ()> {
        async move {
            if let Some(kept) = &self.kept {
                self.replay_kept(&mut *kept.lock().await).await;
            }
        }
        .boxed()
    }

    fn switch(&self) -> BoxFuture<'_, ()> {
        async move {
            let mut kept = None;
            if let Some(messages) = &self.kept {
                let mut messages = messages.lock().await;
                self.replay_kept(&mut messages).await;
                kept = Some(messages);
            }
            if let Some((writer, place)) = &mut *self.lock_other() {
                *writer = self.rotation.replace(Arc::clone(writer));
                std::mem::swap(&mut *self.lock_place(), place);
            }
            drop(kept);
        }
        .boxed()
    }

    fn is_predecessor_in_use(&self) -> bool {
        self.lock_other().as_ref().is_some_and(|(writer, _)| Arc::strong_count(writer) > 1)
    }

    fn release(&self) {
        let other = self.lock_other().take();
        if let (Some(_), Some(kept)) = (&other, &self.kept)
            && let Ok(mut kept) = kept.try_lock()
        {
            kept.replayed = 0;
        }
        drop(other);
    }
}

/// Newest messages of a transient-local topic.
#[derive(Debug)]
struct KeptMessages<M> {
    depth: usize,
    lifespan: Option<Duration>,
    messages: VecDeque<(M, Instant)>,
    /// Number of messages so far.
    count: u64,
    /// Value of the count up to which the writer of the next participant has written the messages.
    replayed: u64,
}

impl<M: Clone> KeptMessages<M> {
    fn new(depth: usize, lifespan: Option<Duration>) -> Self {
        KeptMessages { depth, lifespan, messages: VecDeque::new(), count: 0, replayed: 0 }
    }

    fn push(&mut self, message: M, now: Instant) {
        while self.messages.len() >= self.depth.max(1) {
            self.messages.pop_front();
        }
        self.messages.push_back((message, now));
        self.count += 1;
    }

    /// Returns the messages since the last call that have not expired.
    fn take_unreplayed(&mut self, now: Instant) -> Vec<M> {
        let count = usize::try_from(self.count - self.replayed).unwrap_or(usize::MAX);
        self.replayed = self.count;
        let first = self.messages.len().saturating_sub(count);
        let is_alive = |since: Instant| self.lifespan.is_none_or(|lifespan| now - since <= lifespan);
        let messages = self.messages.iter().skip(first).filter(|(_, since)| is_alive(*since));
        messages.map(|(message, _)| message.clone()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_messages_are_replayed_once_unless_expired() {
        let (mut kept, began) = (KeptMessages::new(3, Some(Duration::from_secs(10))), Instant::now());
        let at = |seconds: u64| began + Duration::from_secs(seconds);
        (0..5).for_each(|second| kept.push(second, at(second)));
        assert_eq!(kept.take_unreplayed(at(13)), [3, 4]);
        assert!(kept.take_unreplayed(at(13)).is_empty());
        kept.push(5, at(13));
        assert_eq!(kept.take_unreplayed(at(13)), [5]);
    }
}

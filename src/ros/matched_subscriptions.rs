//! Matched subscriptions of each topic: messages without subscribers are not built.

use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, LostReason, StatusEvented};

use tokio::sync::watch;
use tracing::debug;

use super::announcement_eviction::AnnouncementEviction;
use super::heartbeat_request::HeartbeatRequests;
use super::own_participants::OwnParticipants;
use super::remote_endpoints::{EndpointCounter, RemoteEndpoints};
use super::remote_participants::RemoteParticipants;
use super::rtps::Guid;

/// Period at which topics without readers are detected. A new reader is reported by an event at once.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// Shared flag: true if a topic has matched subscriptions.
#[derive(Debug, Clone)]
pub struct MatchedSubscriptions(Arc<AtomicBool>);

impl MatchedSubscriptions {
    /// Returns a flag that is always true, for a topic whose messages are always built.
    pub fn always() -> Self {
        MatchedSubscriptions(Arc::new(AtomicBool::new(true)))
    }

    /// Returns true if the topic has at least one matched subscription.
    pub fn has_any(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    fn set(&self, has_any: bool) {
        self.0.store(has_any, Ordering::Relaxed);
    }
}

/// Topics whose matched subscriptions are tracked.
#[derive(Debug, Default, Clone)]
pub struct MatchedSubscriptionTracker(Vec<TrackedTopic>);

#[derive(Debug, Clone)]
struct TrackedTopic {
    writer: GUID,
    /// Name of the topic in DDS.
    name: String,
    matched: MatchedSubscriptions,
}

impl MatchedSubscriptionTracker {
    /// Adds the topic `name` (its name in DDS) of `writer`. Returns its flag, which is false until a reader is matched.
    pub fn add(&mut self, writer: GUID, name: String) -> MatchedSubscriptions {
        let matched = MatchedSubscriptions(Arc::new(AtomicBool::new(false)));
        self.0.push(TrackedTopic { writer, name, matched: matched.clone() });
        matched
    }

    /// Records that a reader has been matched with `writer`. Returns false if the writer is unknown.
    fn record_match(&self, writer: GUID) -> bool {
        let topic = self.0.iter().find(|topic| topic.writer == writer);
        topic.inspect(|topic| topic.matched.set(true)).is_some()
    }

    /// Updates all flags from the readers that `participant` has discovered.
    fn poll(&self, participant: &DomainParticipant) {
        let readers = participant.discovered_readers();
        self.update(&readers.iter().map(|r| r.subscription_topic_data.topic_name().as_str()).collect());
    }

    /// Sets the flags of the topics in `names` and clears all others.
    fn update(&self, names: &HashSet<&str>) {
        self.0.iter().for_each(|topic| topic.matched.set(names.contains(topic.name.as_str())));
    }
}

/// Handling of the status events of a participant: updates the matched subscriptions, requests a HEARTBEAT of
/// matched writers, counts discovered endpoints, and records the participants.
///
/// A participant delivers each event to one listener only, so one task handles all of them.
pub(super) struct DiscoveryEvents {
    /// Participant that discovers.
    pub participant: DomainParticipant,
    /// Topics whose matched subscriptions are tracked; none before their publishers exist.
    pub tracker: watch::Receiver<MatchedSubscriptionTracker>,
    /// Participants of this process.
    pub own: OwnParticipants,
    /// Counter of the discovered endpoints.
    pub counter: Arc<EndpointCounter>,
    /// Other participants.
    pub participants: RemoteParticipants,
    /// True while the node uses this participant. Before and after, no flag is changed and no HEARTBEAT requested.
    pub is_current: Arc<AtomicBool>,
}

impl DiscoveryEvents {
    /// Handles the events until the task is aborted.
    pub(super) async fn run(self) {
        let DiscoveryEvents { participant, tracker, own, counter, participants, is_current } = self;
        let is_current = || is_current.load(Ordering::Relaxed);
        let mut heartbeats = HeartbeatRequests::open();
        let mut eviction = AnnouncementEviction::default();
        let mut remote = RemoteEndpoints::new(|guid: &Guid| own.contains(guid), counter);
        let status = participant.status_listener();
        let mut events = status.as_async_status_stream();
        let mut timer = tokio::time::interval(POLL_PERIOD);
        loop {
            tokio::select! {
                event = events.next() => match event {
                    Some(DomainParticipantStatusEvent::RemoteReaderMatched { local_writer, .. }) => {
                        // The writer of a rotated topic is not in the list.
                        if is_current() && !tracker.borrow().record_match(local_writer) {
                            tracker.borrow().poll(&participant);
                        }
                    }
                    Some(DomainParticipantStatusEvent::RemoteWriterMatched { local_reader, remote_writer }) => {
                        if let Some(requests) = heartbeats.as_mut().filter(|_| is_current()) {
                            requests.add_publisher(&participant, local_reader, remote_writer);
                        }
                    }
                    Some(event) => {
                        if let (Some(requests), DomainParticipantStatusEvent::ParticipantDiscovered { dpd }) =
                            (heartbeats.as_mut().filter(|_| is_current()), &event)
                        {
                            requests.add_participant(dpd.guid);
                        }
                        remote.update(&event);
                        participants.update(&event, Instant::now());
                        if is_expired(&event)
                            && let Err(error) = eviction.evict(&participant)
                        {
                            debug!("a participant that returns may stay undiscovered: {error}");
                        }
                    }
                    None => return,
                },
                () = async {
                    match &mut heartbeats {
                        Some(requests) => requests.run(&participant, own.range()).await,
                        None => std::future::pending().await,
                    }
                } => {}
                _ = timer.tick() => if is_current() {
                    tracker.borrow().poll(&participant);
                },
            }
        }
    }
}

/// Returns true if the lease of a participant has expired.
fn is_expired(event: &DomainParticipantStatusEvent) -> bool {
    use DomainParticipantStatusEvent::ParticipantLost;
    matches!(event, ParticipantLost { reason: LostReason::Timeout { .. }, .. })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_has_matched_subscriptions_from_its_first_reader_until_the_last_has_left() {
        let writer = |n: u8| GUID::from_bytes([n; 16]);
        let mut tracker = MatchedSubscriptionTracker::default();
        let (states, pose) =
            (tracker.add(writer(1), "rt/states".to_owned()), tracker.add(writer(2), "rt/pose".to_owned()));
        assert_eq!((states.has_any(), pose.has_any()), (false, false));
        tracker.record_match(writer(1));
        assert_eq!((states.has_any(), pose.has_any()), (true, false));
        tracker.update(&HashSet::from(["rt/states", "rt/pose"]));
        assert_eq!((states.has_any(), pose.has_any()), (true, true));
        tracker.update(&HashSet::from(["rt/pose"]));
        assert_eq!((states.has_any(), pose.has_any()), (false, true));
        tracker.update(&HashSet::new());
        assert!(MatchedSubscriptions::always().has_any() && !pose.has_any());
    }
}

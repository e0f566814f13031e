//! Matched subscriptions of each topic: messages without subscribers are not built.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rustdds::{DomainParticipant, GUID};

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

/// Shared list of the topics whose matched subscriptions are tracked.
#[derive(Debug, Default, Clone)]
pub struct MatchedSubscriptionTracker(Arc<Mutex<Vec<TrackedTopic>>>);

#[derive(Debug, Clone)]
struct TrackedTopic {
    writer: GUID,
    /// Name of the topic in DDS.
    name: String,
    matched: MatchedSubscriptions,
}

impl MatchedSubscriptionTracker {
    /// Adds the topic `name` (its name in DDS) of `writer`. Returns its flag, which is false until a reader is matched.
    pub fn add(&self, writer: GUID, name: String) -> MatchedSubscriptions {
        let matched = MatchedSubscriptions(Arc::new(AtomicBool::new(false)));
        self.lock().push(TrackedTopic { writer, name, matched: matched.clone() });
        matched
    }

    /// Records that a reader has been matched with `writer`. Returns false if the writer is unknown.
    pub fn record_match(&self, writer: GUID) -> bool {
        let topics = self.lock();
        let topic = topics.iter().find(|topic| topic.writer == writer);
        topic.inspect(|topic| topic.matched.set(true)).is_some()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<TrackedTopic>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Updates all flags from the readers that `participant` has discovered.
    pub fn poll(&self, participant: &DomainParticipant) {
        let readers = participant.discovered_readers();
        self.update(&readers.iter().map(|r| r.subscription_topic_data.topic_name().as_str()).collect());
    }

    /// Sets the flags of the topics in `names` and clears all others.
    fn update(&self, names: &HashSet<&str>) {
        self.lock().iter().for_each(|topic| topic.matched.set(names.contains(topic.name.as_str())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_has_matched_subscriptions_from_its_first_reader_until_the_last_has_left() {
        let writer = |n: u8| GUID::from_bytes([n; 16]);
        let tracker = MatchedSubscriptionTracker::default();
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

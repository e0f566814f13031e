//! Log of remote endpoints whose QoS does not match: the middleware connects neither side, and rcl reports it in a node of its
//! own only.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use rustdds::policy::Liveliness;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, QosPolicies};
use tracing::warn;

use super::node_names::NodeNames;

/// Number of own subscriptions of each topic, by DDS name.
#[derive(Debug, Default)]
pub(crate) struct OwnSubscriptions(Mutex<HashMap<String, usize>>);

impl OwnSubscriptions {
    /// Counts a subscription to the topic `name`.
    pub(crate) fn add(&self, name: &str) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner).entry(name.to_owned()).or_default() += 1;
    }

    /// Returns true if the topic `name` has subscriptions with several durabilities, of which one matches.
    fn has_several(&self, name: &str) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get(name).is_some_and(|&count| count > 1)
    }
}

/// Logs the topic, the policy and the remedy of an endpoint of `event` that does not match. `names` are those of the nodes of
/// other participants, `own` the subscriptions of this node.
pub(super) fn log(
    event: &DomainParticipantStatusEvent,
    participant: &DomainParticipant,
    names: &NodeNames,
    own: &OwnSubscriptions,
) {
    use DomainParticipantStatusEvent as Event;
    let reader = |guid: &GUID| {
        let readers = participant.discovered_readers().into_iter();
        let mut readers = readers.filter(|one| one.reader_proxy.remote_reader_guid == *guid);
        readers.next().map(|one| one.subscription_topic_data)
    };
    let (guid, policy, topic, what) = match event {
        Event::RemoteReaderQosIncompatible { remote_reader, requested_qos, offered_qos, .. } => {
            let topic = reader(remote_reader).map(|data| data.topic_name().clone());
            (remote_reader, failed_policy(offered_qos, requested_qos), topic, "subscription")
        }
        Event::RemoteWriterQosIncompatible { remote_writer, requested_qos, offered_qos, .. } => {
            let writers = participant.discovered_writers().into_iter();
            let mut writers = writers.filter(|one| one.writer_proxy.remote_writer_guid == *remote_writer);
            let topic = writers.next().map(|one| one.publication_topic_data.topic_name);
            (remote_writer, failed_policy(offered_qos, requested_qos), topic, "publisher")
        }
        // RustDDS matches any kind of liveliness (docs/internals/upstream-reports.md).
        Event::RemoteReaderMatched { remote_reader, .. } => match reader(remote_reader) {
            Some(data) if is_manual(&data.qos()) => {
                (remote_reader, "liveliness".to_owned(), Some(data.topic_name().clone()), "subscription")
            }
            _ => return,
        },
        _ => return,
    };
    let topic = topic.unwrap_or_default();
    if what == "publisher" && policy == "durability" && own.has_several(&topic) {
        return;
    }
    let node = names.get(&guid.to_bytes());
    warn!(
        "{}: the QoS of the {what} of {} does not match ({policy}): no messages are exchanged; change it there, or with the \
         parameters qos.TOPIC of this node",
        topic.strip_prefix("rt").unwrap_or(&topic),
        node.map_or("another participant".to_owned(), |name| format!("node {name}"))
    );
}

/// Returns true for a kind of liveliness that no writer of this node offers: theirs is automatic.
fn is_manual(requested: &QosPolicies) -> bool {
    requested.liveliness().is_some_and(|liveliness| !matches!(liveliness, Liveliness::Automatic { .. }))
}

/// Returns the name of the first policy that is offered worse than requested, as in the QoS parameters.
fn failed_policy(offered: &QosPolicies, requested: &QosPolicies) -> String {
    let failed = offered.compliance_failure_wrt(requested);
    failed.map_or("unknown policy".to_owned(), |policy| format!("{policy:?}").to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::qos::QoSProfile;

    #[test]
    fn the_policy_that_fails_is_named() {
        let profile = |is_reliable, is_transient_local| {
            QoSProfile { is_reliable, is_transient_local, ..QoSProfile::reliable(1) }.of_reader()
        };
        for (offered, requested, policy) in [
            (profile(false, false), profile(true, false), "reliability"),
            (profile(true, false), profile(true, true), "durability"),
            (profile(true, true), profile(false, false), "unknown policy"),
        ] {
            assert_eq!(failed_policy(&offered, &requested), policy);
        }
    }

    #[test]
    fn a_topic_with_two_subscriptions_has_several() {
        let subscriptions = OwnSubscriptions::default();
        subscriptions.add("rt/a");
        assert!(!subscriptions.has_several("rt/a") && !subscriptions.has_several("rt/b"));
        subscriptions.add("rt/a");
        assert!(subscriptions.has_several("rt/a"));
    }
}

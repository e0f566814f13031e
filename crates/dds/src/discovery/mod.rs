//! Discovery: matched subscriptions, remote endpoints and participants, names of nodes.

mod incompatible_qos;
mod matched_subscriptions;
pub(crate) mod node_names;
mod remote_endpoints;

pub(crate) use matched_subscriptions::MatchedSubscriptions;
pub use remote_endpoints::EndpointCounts;

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use futures::StreamExt;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, LostReason, RTPSEntity, StatusEvented};
use tracing::debug;

use crate::defects::announcement_eviction::AnnouncementEviction;
use crate::defects::heartbeat_request::HeartbeatRequests;
use crate::defects::returned_participants::RemoteParticipants;
use crate::defects::{datagram_bounds, late_readers};
use crate::environment::DiscoveryRange;
use crate::rtps::Guid as Gid;
use incompatible_qos::OwnSubscriptions;
use matched_subscriptions::MatchedSubscriptionTracker;
use node_names::NodeNames;
use remote_endpoints::{RemoteEndpoints, count_present};

/// Period at which topics without readers are detected. A new reader is reported by an event at once.
const POLL_PERIOD: Duration = Duration::from_secs(1);

/// Publisher of another participant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicEndpointInfo {
    /// Fully qualified name of the topic; `None` if it is not a ROS topic.
    pub topic_name: Option<String>,
    /// DDS name of the type.
    pub topic_type: String,
    /// Identifier of the publisher.
    pub endpoint_gid: Gid,
    /// Fully qualified name of the first node of its participant, if it is known.
    pub node_name: Option<String>,
}

/// Findings of the discovery, updated by [`run`].
#[derive(Default)]
pub(crate) struct Findings {
    /// Topics whose matched subscriptions are tracked.
    pub matched: MatchedSubscriptionTracker,
    /// Counts of remote endpoints.
    pub endpoints: EndpointCounts,
    /// Other participants.
    pub participants: RemoteParticipants,
    /// Names of the nodes of other participants.
    pub names: NodeNames,
    /// Own subscriptions.
    pub subscriptions: OwnSubscriptions,
    /// DDS names of the topics with bounded requests.
    pub bounded_requests: Mutex<HashSet<String>>,
}

impl Findings {
    /// Updates the filters of datagrams: writers of bounded requests, and readers that have left.
    fn update_filters(&self, event: &DomainParticipantStatusEvent) {
        match event {
            DomainParticipantStatusEvent::WriterDetected { writer } => {
                let topics = self.bounded_requests.lock().unwrap_or_else(PoisonError::into_inner);
                if topics.contains(&writer.topic_name) {
                    datagram_bounds::bound_requests(writer.guid.to_bytes());
                }
            }
            DomainParticipantStatusEvent::WriterLost { guid, .. } => {
                let lost = guid.to_bytes();
                datagram_bounds::retain_requests(|writer| *writer != lost);
            }
            DomainParticipantStatusEvent::ReaderLost { guid, .. } => {
                let lost = guid.to_bytes();
                late_readers::retain(|reader| *reader != lost);
            }
            DomainParticipantStatusEvent::ParticipantLost { id, .. } => {
                let is_present = |guid: &Gid| GUID::from_bytes(*guid).prefix != *id;
                datagram_bounds::retain_requests(is_present);
                late_readers::retain(is_present);
            }
            _ => {}
        }
    }

    /// Returns the publishers of other participants that `participant` has discovered.
    pub(crate) fn publishers(&self, participant: &DomainParticipant) -> Vec<TopicEndpointInfo> {
        let own = participant.guid().prefix;
        let writers = participant.discovered_writers().into_iter();
        let remote = writers.filter(|writer| writer.writer_proxy.remote_writer_guid.prefix != own);
        let info = remote.map(|writer| {
            let endpoint_gid = writer.writer_proxy.remote_writer_guid.to_bytes();
            let data = writer.publication_topic_data;
            TopicEndpointInfo {
                topic_name: data.topic_name.strip_prefix("rt").map(str::to_owned),
                topic_type: data.type_name,
                endpoint_gid,
                node_name: self.names.get(&endpoint_gid),
            }
        });
        info.collect()
    }
}

/// Handles the status events of `participant`, which is announced in `range`, until the task is aborted: updates the
/// findings, requests a HEARTBEAT of matched writers, and evicts old announcements.
///
/// A participant delivers each event to one listener only, so one task handles all of them.
pub(crate) async fn run(participant: &DomainParticipant, range: DiscoveryRange, findings: &Findings) {
    let mut heartbeats = HeartbeatRequests::open();
    let mut gaps = late_readers::gaps();
    let mut eviction = AnnouncementEviction::default();
    let mut remote = RemoteEndpoints::new(participant.guid(), findings.endpoints.clone());
    let status = participant.status_listener();
    let mut events = status.as_async_status_stream();
    let mut timer = tokio::time::interval(POLL_PERIOD);
    loop {
        tokio::select! {
            event = events.next() => match event {
                Some(event @ DomainParticipantStatusEvent::RemoteReaderMatched { local_writer, .. }) => {
                    // The writer of a rotated topic is not in the list.
                    if !findings.matched.record_match(local_writer) {
                        findings.matched.poll(participant);
                    }
                    incompatible_qos::log(&event, participant, &findings.names, &findings.subscriptions);
                }
                Some(DomainParticipantStatusEvent::RemoteWriterMatched { local_reader, remote_writer }) => {
                    if let Some(requests) = &mut heartbeats {
                        requests.add_publisher(participant, local_reader, remote_writer);
                    }
                }
                Some(event) => {
                    if let (Some(requests), DomainParticipantStatusEvent::ParticipantDiscovered { dpd }) =
                        (&mut heartbeats, &event)
                    {
                        requests.add_participant(dpd.guid);
                    }
                    remote.update(&event);
                    findings.update_filters(&event);
                    incompatible_qos::log(&event, participant, &findings.names, &findings.subscriptions);
                    findings.participants.update(&event, Instant::now());
                    findings.names.update(&event);
                    if is_expired(&event)
                        && let Err(error) = eviction.evict(participant)
                    {
                        debug!("a participant that returns may stay undiscovered: {error}");
                    }
                }
                None => return,
            },
            () = async {
                match &mut heartbeats {
                    Some(requests) => requests.run(participant, range).await,
                    None => std::future::pending().await,
                }
            } => {}
            Some(gap) = gaps.recv() => gap.send(participant),
            _ = timer.tick() => {
                findings.matched.poll(participant);
                findings.endpoints.update_departed(count_present(participant));
            }
        }
    }
}

/// Returns true if the lease of a participant has expired.
fn is_expired(event: &DomainParticipantStatusEvent) -> bool {
    use DomainParticipantStatusEvent::ParticipantLost;
    matches!(event, ParticipantLost { reason: LostReason::Timeout { .. }, .. })
}

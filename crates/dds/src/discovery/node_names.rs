//! Names of the nodes of other participants, and detection of a duplicate name.
//!
//! Nodes with the same name share topics, services and parameters, so a client gets the response of either. Every
//! participant announces its nodes on `ros_discovery_info`. The message type of ros2-client 0.12 rejects a whole message
//! if one name is invalid; this module has its own.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures::StreamExt;
use ros2_client::NodeName;
use rustdds::dds::CreateResult;
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantStatusEvent, QosPolicyBuilder, RTPSEntity, TopicKind, no_key,
};
use serde::Deserialize;
use tracing::{debug, warn};

use crate::rtps::Guid as Gid;

/// Discovery topic of rmw_dds_common.
const TOPIC: &str = "ros_discovery_info";
/// DDS type of the discovery topic.
const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Depth of the reader. With `KEEP_ALL`, RustDDS would store the reception time of every message ever read.
const DEPTH: i32 = 1024;

/// Largest number of participants whose nodes are remembered.
const MAX_PARTICIPANTS: usize = 1000;

/// Shared names of the nodes of other participants, by GUID prefix.
#[derive(Debug, Clone, Default)]
pub(crate) struct NodeNames(Arc<Mutex<HashMap<[u8; 12], String>>>);

impl NodeNames {
    fn lock(&self) -> MutexGuard<'_, HashMap<[u8; 12], String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the full name of the first node of the participant of an endpoint; `None` if it is not known.
    pub(super) fn get(&self, endpoint: &Gid) -> Option<String> {
        self.lock().get(&endpoint[..12]).cloned()
    }

    /// Removes the names of a participant that has left.
    pub(super) fn update(&self, event: &DomainParticipantStatusEvent) {
        if let DomainParticipantStatusEvent::ParticipantLost { id, .. } = event {
            self.lock().retain(|prefix, _| prefix.as_slice() != id.as_ref());
        }
    }

    fn insert(&self, info: &ParticipantEntitiesInfo) {
        let prefix = std::array::from_fn(|i| info.gid[i]);
        // A name from the network is logged only if it is valid.
        let valid = |node: &NodeEntitiesInfo| NodeName::new(&node.namespace, &node.name).ok();
        let mut names = self.lock();
        if let Some(name) = info.nodes.iter().find_map(valid)
            && (names.len() < MAX_PARTICIPANTS || names.contains_key(&prefix))
        {
            names.insert(prefix, name.fully_qualified_name());
        }
    }
}

/// Message `rmw_dds_common/msg/ParticipantEntitiesInfo`.
#[derive(Debug, Deserialize)]
struct ParticipantEntitiesInfo {
    gid: Gid,
    nodes: Vec<NodeEntitiesInfo>,
}

/// Message `rmw_dds_common/msg/NodeEntitiesInfo`.
#[derive(Debug, Deserialize)]
struct NodeEntitiesInfo {
    namespace: String,
    name: String,
    _readers: Vec<Gid>,
    _writers: Vec<Gid>,
}

impl ParticipantEntitiesInfo {
    /// Returns true if the participant is not `own` and announces a node with the name of `node`.
    fn is_duplicate(&self, own: &Gid, node: &NodeName) -> bool {
        self.gid[..12] != own[..12]
            && self.nodes.iter().any(|n| n.namespace == node.namespace() && n.name == node.base_name())
    }
}

/// Subscribes to `ros_discovery_info`. The returned task records the `names` of nodes, and logs one warning when another
/// participant announces a node with the name of `node`.
pub(crate) fn watch(
    participant: &DomainParticipant,
    node: NodeName,
    names: NodeNames,
) -> impl Future<Output = ()> + use<> {
    let own = participant.guid().to_bytes();
    let reader = subscribe(participant)
        .inspect_err(|error| {
            debug!("duplicate node names are not detected: cannot subscribe to {TOPIC}: {error}");
        })
        .ok();
    async move {
        let Some(reader) = reader else { return };
        let mut samples = reader.async_sample_stream();
        let mut has_warned = false;
        while let Some(sample) = samples.next().await {
            // Samples that cannot be decoded are ignored.
            let Ok(sample) = sample else { continue };
            names.insert(sample.value());
            if !has_warned && sample.value().is_duplicate(&own, &node) {
                has_warned = true;
                warn!(
                    "duplicate node name: another node in this domain is named {}; rename one of them \
                     (-r __node:=NAME)",
                    node.fully_qualified_name()
                );
            }
        }
    }
}

fn subscribe(
    participant: &DomainParticipant,
) -> CreateResult<no_key::DataReaderCdr<ParticipantEntitiesInfo>> {
    let qos = QosPolicyBuilder::new()
        .durability(Durability::TransientLocal)
        .reliability(Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .history(History::KeepLast { depth: DEPTH })
        .build();
    let topic = participant.create_topic(TOPIC.to_owned(), TYPE.to_owned(), &qos, TopicKind::NoKey)?;
    participant.create_subscriber(&qos)?.create_datareader_no_key_cdr(&topic, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_full_name_in_another_participant_is_a_duplicate() {
        let info = |gid: Gid, namespace: &str, name: &str| ParticipantEntitiesInfo {
            gid,
            nodes: vec![NodeEntitiesInfo {
                namespace: namespace.to_owned(),
                name: name.to_owned(),
                _readers: Vec::new(),
                _writers: Vec::new(),
            }],
        };
        let (own, other) = ([1; 16], [2; 16]);
        let node = NodeName::new("/cell", "mill").unwrap();
        assert!(info(other, "/cell", "mill").is_duplicate(&own, &node));
        assert!(!info(own, "/cell", "mill").is_duplicate(&own, &node));
        assert!(!info(other, "/", "mill").is_duplicate(&own, &node));
        assert!(!info(other, "/cell", "lathe").is_duplicate(&own, &node));
    }
}

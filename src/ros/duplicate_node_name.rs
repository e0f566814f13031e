//! Detection of a duplicate node name.
//!
//! Nodes with the same name share topics, services and parameters, so a client gets the response of either. Every
//! participant announces its nodes on `ros_discovery_info`.

use futures::StreamExt;
use rustdds::dds::CreateResult;
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{DomainParticipant, QosPolicyBuilder, TopicKind, no_key};
use serde::Deserialize;
use tracing::{debug, warn};

use super::names::NodeFqn;
use super::own_participants::OwnParticipants;

/// Discovery topic of rmw_dds_common.
const TOPIC: &str = "ros_discovery_info";
/// DDS type of the discovery topic.
const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Depth of the reader. With `KEEP_ALL`, RustDDS would store the reception time of every message ever read.
const DEPTH: i32 = 1024;

type Gid = [u8; 16];

/// Message `rmw_dds_common/msg/ParticipantEntitiesInfo`. The type of ros2-client rejects the whole message if one
/// name is invalid.
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
    /// Returns true if the participant does not belong to this process (`is_own`) and announces a node with the name of
    /// `node`.
    fn is_duplicate(&self, is_own: impl Fn(&Gid) -> bool, node: &NodeFqn) -> bool {
        !is_own(&self.gid)
            && self.nodes.iter().any(|n| n.namespace == node.namespace() && n.name == node.name())
    }
}

/// Subscribes to `ros_discovery_info`. The returned task logs one warning when a participant that is not in `own`
/// announces a node with the name of `node`.
pub(super) fn watch(
    participant: &DomainParticipant,
    node: NodeFqn,
    own: OwnParticipants,
) -> impl Future<Output = ()> + use<> {
    let reader = subscribe(participant)
        .inspect_err(|error| {
            debug!("duplicate node names are not detected: cannot subscribe to {TOPIC}: {error}");
        })
        .ok();
    async move {
        let Some(reader) = reader else { return };
        let mut samples = reader.async_sample_stream();
        while let Some(sample) = samples.next().await {
            // Samples that cannot be decoded are ignored.
            if sample.is_ok_and(|sample| sample.value().is_duplicate(|gid| own.contains(gid), &node)) {
                warn!(
                    "duplicate node name: another node in this domain is named {node}; rename one of them \
                     (-r __node:=NAME)"
                );
                return;
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
        let node = NodeFqn::new("/cell", "mill").unwrap();
        assert!(info(other, "/cell", "mill").is_duplicate(|gid| *gid == own, &node));
        assert!(!info(own, "/cell", "mill").is_duplicate(|gid| *gid == own, &node));
        assert!(!info(other, "/", "mill").is_duplicate(|gid| *gid == own, &node));
        assert!(!info(other, "/cell", "lathe").is_duplicate(|gid| *gid == own, &node));
    }
}

//! Tells when another node has this one's name.
//!
//! Nodes of one name work, and share topics, services and parameters: whoever asks for one gets an
//! answer of either. Every participant says which nodes it has on `ros_discovery_info`.

use futures::StreamExt;
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{DomainParticipant, QosPolicyBuilder, RTPSEntity, TopicKind};
use serde::Deserialize;
use tracing::{debug, warn};

use super::names::NodeFqn;

/// The topic, and its type, as rmw_dds_common has them.
const TOPIC: &str = "ros_discovery_info";
const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Messages that may wait. With `KEEP_ALL` RustDDS would remember when each came that has ever been taken.
const DEPTH: i32 = 1024;

type Gid = [u8; 16];

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`. The crate's own type refuses a whole message for
/// one name that it does not like.
#[derive(Debug, Deserialize)]
struct ParticipantEntitiesInfo {
    gid: Gid,
    nodes: Vec<NodeEntitiesInfo>,
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`.
#[derive(Debug, Deserialize)]
struct NodeEntitiesInfo {
    namespace: String,
    name: String,
    _readers: Vec<Gid>,
    _writers: Vec<Gid>,
}

impl ParticipantEntitiesInfo {
    /// Whether another participant than `own` has a node of the name of `node`.
    fn has_namesake(&self, own: Gid, node: &NodeFqn) -> bool {
        self.gid != own && self.nodes.iter().any(|n| n.namespace == node.namespace() && n.name == node.name())
    }
}

/// Warns once, as soon as another participant has a node of the name of `node`.
pub(super) async fn watch(participant: DomainParticipant, node: NodeFqn) {
    let qos = QosPolicyBuilder::new()
        .durability(Durability::TransientLocal)
        .reliability(Reliability::Reliable { max_blocking_time: rustdds::Duration::ZERO })
        .history(History::KeepLast { depth: DEPTH })
        .build();
    let reader = participant
        .create_topic(TOPIC.to_owned(), TYPE.to_owned(), &qos, TopicKind::NoKey)
        .and_then(|topic| {
            let subscriber = participant.create_subscriber(&qos)?;
            subscriber.create_datareader_no_key_cdr::<ParticipantEntitiesInfo>(&topic, None)
        });
    let reader = match reader {
        Ok(reader) => reader,
        Err(error) => {
            debug!("other nodes' names are not looked at: {error}");
            return;
        }
    };
    let own = participant.guid().to_bytes();
    let mut samples = reader.async_sample_stream();
    while let Some(sample) = samples.next().await {
        // What cannot be read is no concern of this node.
        if sample.is_ok_and(|sample| sample.value().has_namesake(own, &node)) {
            warn!("another node in this domain is named {node}; give one of them another name (-r __node:=)");
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_full_name_elsewhere_is_a_namesake() {
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
        assert!(info(other, "/cell", "mill").has_namesake(own, &node));
        assert!(!info(own, "/cell", "mill").has_namesake(own, &node));
        assert!(!info(other, "/", "mill").has_namesake(own, &node));
        assert!(!info(other, "/cell", "lathe").has_namesake(own, &node));
    }
}

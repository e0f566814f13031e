//! Sequence number of the next dispose of a writer, and the writers that the participant has announced (SEDP).
//!
//! **Symptom:** without the number, the dispose of [`super::dispose`] is ignored as a repetition, or waits for samples
//! that do not exist.
//!
//! **Upstream:** RustDDS 0.15.1 does not report the sequence numbers of its SEDP writer; ros2-client 0.12.1 returns the
//! endpoints of its nodes only as a message with private fields (`src/entities_info.rs`), which is encoded here and
//! decoded with a type of this module.
//!
//! **Test:** the unit tests below fail if the layout of the message or the numbering changes.
//!
//! **Superfluous when** [`super::dispose`] is.

use std::collections::BTreeSet;

use ros2_client::Context;
use ros2_client::entities_info::ParticipantEntitiesInfo;
use rustdds::{RepresentationIdentifier, serialization};
use serde::Deserialize;

use crate::rtps::Guid;

/// Layout of `rmw_dds_common/msg/ParticipantEntitiesInfo` as ros2-client names its fields.
#[derive(Deserialize)]
struct Entities {
    #[serde(rename = "gid")]
    _participant: Guid,
    #[serde(rename = "node_entities_info_seq")]
    nodes: Vec<NodeEntities>,
}

/// Layout of `rmw_dds_common/msg/NodeEntitiesInfo`.
#[derive(Deserialize)]
struct NodeEntities {
    #[serde(rename = "node_namespace")]
    _namespace: String,
    #[serde(rename = "node_name")]
    _name: String,
    #[serde(rename = "reader_gid_seq")]
    _readers: Vec<Guid>,
    #[serde(rename = "writer_gid_seq")]
    writers: Vec<Guid>,
}

/// Returns the GUIDs of all writers that the nodes of `context` have created, including those dropped since.
///
/// The set is empty if the message of ros2-client cannot be decoded.
pub(crate) fn announced_writers(context: &Context) -> BTreeSet<Guid> {
    decode(&context.participant_entities_info()).unwrap_or_default()
}

/// Returns the sequence number of the SEDP sample in which RustDDS disposes of the next writer.
///
/// RustDDS numbers its publication announcements from 1: one sample for each writer created and one for each writer
/// disposed of. `outside_nodes` is the number of writers created without a node of `context`, which
/// [`announced_writers`] does not contain; `disposed` is the number of writers disposed of so far.
pub(crate) fn dispose_sequence_number(context: &Context, outside_nodes: usize, disposed: usize) -> i64 {
    let written = announced_writers(context).len() + outside_nodes + disposed;
    i64::try_from(written + 1).unwrap_or(i64::MAX)
}

fn decode(info: &ParticipantEntitiesInfo) -> Option<BTreeSet<Guid>> {
    let encoding = RepresentationIdentifier::CDR_LE;
    let mut octets = Vec::new();
    serialization::to_writer_with_rep_id(&mut octets, info, encoding).ok()?;
    let (entities, _) =
        serialization::deserialize_from_cdr_with_rep_id::<Entities>(&octets, encoding).ok()?;
    Some(entities.nodes.into_iter().flat_map(|node| node.writers).collect())
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::{Duration, Instant};

    use ros2_client::entities_info::NodeEntitiesInfo;
    use ros2_client::{Gid, Node, NodeName, NodeOptions, Publisher};
    use rustdds::{
        DomainParticipant, DomainParticipantStatusEvent, GUID, QosPolicies, StatusEvented, TopicKind,
    };

    use super::*;
    use crate::defects::dispose;
    use crate::environment::{DiscoveryRange, Environment};

    const WRITER: Guid = [1, 0x12, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0, 0x0f, 0x03];
    const READER: Guid = [0x01, 0x0f, 9, 9, 9, 9, 9, 9, 9, 9, 9, 9, 0, 0, 0x0d, 0x04];
    /// Domain of this test only.
    const DOMAIN: &str = "193";
    const TIMEOUT: Duration = Duration::from_secs(20);
    /// Time in which a dispose message that is accepted takes effect.
    const SETTLE: Duration = Duration::from_secs(1);

    #[test]
    fn writers_are_decoded_from_the_message_with_private_fields() {
        let mut node = NodeEntitiesInfo::new(NodeName::new("/cell", "axes").unwrap());
        node.add_reader(Gid::from(READER));
        node.add_writer(Gid::from(WRITER));
        let info = ParticipantEntitiesInfo::new(Gid::from([7; 16]), vec![node]);
        assert_eq!(decode(&info), Some(BTreeSet::from([WRITER])));
    }

    fn open() -> Context {
        let environment = Environment::from_lookup(|name| match name {
            "ROS_DOMAIN_ID" => Some(DOMAIN.to_owned()),
            "ROS_AUTOMATIC_DISCOVERY_RANGE" => Some("LOCALHOST".to_owned()),
            _ => None,
        });
        let participant = environment.unwrap().participant_builder().build().unwrap();
        Context::from_domain_participant(participant).unwrap()
    }

    fn publisher(node: &mut Node, dds: &DomainParticipant, name: &str) -> Publisher<u8> {
        let qos = QosPolicies::builder().build();
        let type_name = "std_msgs::msg::dds_::UInt8_".to_owned();
        let topic = dds.create_topic(name.to_owned(), type_name, &qos, TopicKind::NoKey).unwrap();
        node.create_publisher(&topic, None).unwrap()
    }

    /// Waits until `observer` has discovered `writers`.
    fn wait_for_discovery(observer: &DomainParticipant, writers: &BTreeSet<Guid>) {
        let began = Instant::now();
        loop {
            let discovered: BTreeSet<Guid> = observer
                .discovered_writers()
                .iter()
                .map(|found| found.writer_proxy.remote_writer_guid.to_bytes())
                .collect();
            if discovered.is_superset(writers) {
                return;
            }
            assert!(
                began.elapsed() < TIMEOUT,
                "{} of {} writers discovered",
                discovered.len(),
                writers.len()
            );
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Returns true if `observer` reports within [`SETTLE`] that `writer` has left.
    fn is_lost(observer: &DomainParticipant, writer: GUID) -> bool {
        let began = Instant::now();
        let status = observer.status_listener();
        while began.elapsed() < SETTLE {
            match status.try_recv_status() {
                Some(DomainParticipantStatusEvent::WriterLost { guid, .. }) if guid == writer => return true,
                Some(_) => {}
                None => thread::sleep(Duration::from_millis(5)),
            }
        }
        false
    }

    /// A participant ignores a dispose message whose number it has received already, and defers one that is too high.
    /// The message takes effect only if its number is exactly the next one.
    #[test]
    fn the_predicted_number_is_the_next_one_of_the_sedp_writer_of_rustdds() {
        let (context, observing) = (open(), open());
        let (dds, observer) = (context.domain_participant(), observing.domain_participant());
        let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
        let mut node = context.new_node(NodeName::new("/", "announced").unwrap(), options).unwrap();
        let first = publisher(&mut node, &dds, "rt/first");
        let second = publisher(&mut node, &dds, "rt/second");
        let writers = announced_writers(&context);
        assert!(writers.contains(&first.guid().to_bytes()) && writers.contains(&second.guid().to_bytes()));
        wait_for_discovery(&observer, &writers);

        let dispose = |writer: GUID, number: i64| {
            dispose::of_writer(&writer.to_bytes(), number, &dds, DiscoveryRange::Localhost).send_once();
        };
        let number = dispose_sequence_number(&context, 0, 0);
        dispose(first.guid(), number - 1);
        assert!(!is_lost(&observer, first.guid()), "sample {} has not been written yet", number - 1);
        dispose(first.guid(), number);
        assert!(is_lost(&observer, first.guid()), "sample {number} is not the next one");

        // RustDDS disposes of the first writer by the same number; the next one follows.
        drop(first);
        thread::sleep(SETTLE);
        let number = dispose_sequence_number(&context, 0, 1);
        dispose(second.guid(), number);
        assert!(is_lost(&observer, second.guid()), "sample {number} is not the next one after a dispose");
        drop(second);
    }
}

//! Node: creates publishers, subscriptions and services, and reports the graph.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures::future::join3;
use ros2_client::NodeName;
use rustdds::{DomainParticipant, QosPolicies, Topic, TopicKind};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::defects::late_readers;
use crate::defects::writer_rotation::{RotatedTopic, RotatedTopics, RotationContext, TopicWriters};
use crate::discovery::{self, EndpointCounts, Findings, MatchedSubscriptions, TopicEndpointInfo, node_names};
use crate::environment::DiscoveryRange;
use crate::publisher::Publisher;
use crate::qos::QoSProfile;
use crate::service::{RESPONSE_QOS, Service, request_qos};
use crate::subscription::Subscription;

/// Node of a [`Context`](crate::Context). Clones share it.
#[derive(Clone)]
pub struct Node(Arc<NodeState>);

/// State of a node.
struct NodeState {
    node: Mutex<ros2_client::Node>,
    name: NodeName,
    context: ros2_client::Context,
    participant: DomainParticipant,
    range: DiscoveryRange,
    findings: Findings,
    /// Topics whose writers are rotated.
    rotated: RotatedTopics,
    /// Number of writers that ros2-client does not list: the response writers of services.
    unlisted_writers: AtomicUsize,
}

impl NodeState {
    fn lock(&self) -> MutexGuard<'_, ros2_client::Node> {
        self.node.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Creates a DDS topic without key. Returns the reason of the middleware if it fails.
    fn create_topic(&self, name: String, type_name: String, qos: &QosPolicies) -> Result<Topic, String> {
        self.participant.create_topic(name, type_name, qos, TopicKind::NoKey).map_err(|e| e.to_string())
    }
}

/// Returns the DDS name of a ROS type, with a suffix: `sensor_msgs/msg/JointState` is
/// `sensor_msgs::msg::dds_::JointState_`.
fn dds_type(ros_type: &str, suffix: &str) -> String {
    match ros_type.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}{suffix}_", package.replace('/', "::")),
        None => format!("{ros_type}{suffix}_"),
    }
}

/// Returns the DDS name of the requests of a service.
fn request_topic(service: &str) -> String {
    format!("rq{service}Request")
}

/// Returns the DDS name of a ROS topic.
fn dds_topic(name: &str) -> String {
    format!("rt{name}")
}

impl Node {
    pub(crate) fn new(
        node: ros2_client::Node,
        name: NodeName,
        context: ros2_client::Context,
        range: DiscoveryRange,
    ) -> Self {
        let participant = context.domain_participant();
        Node(Arc::new(NodeState {
            node: Mutex::new(node),
            name,
            context,
            participant,
            range,
            findings: Findings::default(),
            rotated: RotatedTopics::default(),
            unlisted_writers: AtomicUsize::new(0),
        }))
    }

    /// Returns the task that handles discovery and rotates writers; it does not end. The log warns of a second node with
    /// the same name.
    pub fn spin(&self) -> impl Future<Output = ()> + Send + 'static {
        let state = Arc::clone(&self.0);
        let names = node_names::watch(&state.participant, state.name.clone(), state.findings.names.clone());
        async move {
            let NodeState { node, context, participant, range, findings, unlisted_writers, .. } = &*state;
            let participants = &findings.participants;
            let context = RotationContext { node, context, range: *range, participants, unlisted_writers };
            join3(names, discovery::run(participant, *range, findings), state.rotated.run(context)).await;
        }
    }

    /// Creates a publisher on the topic `name`, fully qualified; `type_name` is its ROS type `package/msg/Name`.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn create_publisher<M: Serialize + Send + Sync + 'static>(
        &self,
        name: &str,
        type_name: &str,
        qos: &QoSProfile,
    ) -> Result<Publisher<M>, String> {
        let NodeState { participant, findings, rotated, .. } = &*self.0;
        let topic = self.0.create_topic(dds_topic(name), dds_type(type_name, ""), &qos.of_writer())?;
        let network = self.0.lock().create_publisher(&topic, None).map_err(|e| e.to_string())?;
        let writer = network.guid();
        let writers = TopicWriters::new(network, topic, qos.max_unacknowledged, participant.clone());
        let writers = Arc::new(writers);
        let matched = if qos.is_transient_local {
            let written = Arc::clone(&writers.current().readers.written);
            late_readers::add(dds_topic(name), writer.to_bytes(), qos.depth, written);
            MatchedSubscriptions::always()
        } else {
            rotated.add(Arc::clone(&writers) as Arc<dyn RotatedTopic>);
            findings.matched.add(writer, writers.name())
        };
        Ok(Publisher::new(writers, matched))
    }

    /// Creates a subscription to the topic `name`, fully qualified; `type_name` is its ROS type `package/msg/Name`.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn create_subscription<M: DeserializeOwned + Send + Sync + 'static>(
        &self,
        name: &str,
        type_name: &str,
        qos: &QoSProfile,
    ) -> Result<Subscription<M>, String> {
        let topic = self.0.create_topic(dds_topic(name), dds_type(type_name, ""), &qos.of_reader())?;
        let network = self.0.lock().create_subscription(&topic, None).map_err(|e| e.to_string())?;
        self.0.findings.subscriptions.add(&dds_topic(name));
        Ok(Subscription::new(network))
    }

    /// Creates the service `name`, fully qualified; `type_name` is its ROS type `package/srv/Name`. The middleware keeps
    /// `depth` requests; those of more than 256 KiB are ignored.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn create_service<Q, A>(
        &self,
        name: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<Service<Q, A>, String>
    where
        Q: DeserializeOwned + Send + Sync + 'static,
        A: Serialize + Send + Sync + 'static,
    {
        let mut bounded = self.0.findings.bounded_requests.lock().unwrap_or_else(PoisonError::into_inner);
        bounded.insert(request_topic(name));
        drop(bounded);
        self.create_service_of_long_requests(name, type_name, depth)
    }

    /// Creates a service as [`create_service`](Self::create_service) does, with requests up to 256 MiB.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn create_service_of_long_requests<Q, A>(
        &self,
        name: &str,
        type_name: &str,
        depth: usize,
    ) -> Result<Service<Q, A>, String>
    where
        Q: DeserializeOwned + Send + Sync + 'static,
        A: Serialize + Send + Sync + 'static,
    {
        let NodeState { participant, unlisted_writers, .. } = &*self.0;
        let (read, write) = (request_qos(depth).of_reader(), RESPONSE_QOS.of_reader());
        let requests = self.0.create_topic(request_topic(name), dds_type(type_name, "_Request"), &read)?;
        let responses =
            self.0.create_topic(format!("rr{name}Reply"), dds_type(type_name, "_Response"), &write)?;
        let requests = self.0.lock().create_subscription(&requests, None).map_err(|e| e.to_string())?;
        // The publisher of ros2-client cannot name the request in a response.
        let writer = participant
            .create_publisher(&write)
            .and_then(|publisher| publisher.create_datawriter_no_key_cdr(&responses, None))
            .map_err(|e| e.to_string())?;
        unlisted_writers.fetch_add(1, Ordering::Relaxed);
        Service::new(name, requests, writer, responses, participant.clone())
    }

    /// Returns the discovered publishers of other participants.
    pub fn get_publishers_info(&self) -> Vec<TopicEndpointInfo> {
        self.0.findings.publishers(&self.0.participant)
    }

    /// Returns the counts of the endpoints of other participants.
    pub fn endpoint_counts(&self) -> EndpointCounts {
        self.0.findings.endpoints.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ros_types_have_their_dds_names() {
        assert_eq!(dds_type("sensor_msgs/msg/JointState", ""), "sensor_msgs::msg::dds_::JointState_");
        assert_eq!(dds_type("std_srvs/srv/Trigger", "_Request"), "std_srvs::srv::dds_::Trigger_Request_");
        let goal = dds_type("control_msgs/action/FollowJointTrajectory_SendGoal", "_Response");
        assert_eq!(goal, "control_msgs::action::dds_::FollowJointTrajectory_SendGoal_Response_");
    }
}

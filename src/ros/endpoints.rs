//! Publishers and subscriptions of the node under their resolved names, with their QoS profiles.

use std::collections::HashMap;
use std::future::ready;
use std::sync::Arc;

use futures::{Stream, StreamExt, stream};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{Context, MessageInfo, MessageTypeName, Node, ReadResult};

use rustdds::policy::ResourceLimits;
use rustdds::{DomainParticipant, QosPolicies, QosPolicyBuilder, Topic, TopicKind};

use super::args::RosArgs;
use super::recorder::{Direction, Tap, TopicRecorder};
use super::renewable::{DeliveredSamples, EndpointContext, Renewable};
use super::service_endpoints::Wire;
use crate::interface::{self, TopicQos};
use serde::Serialize;
use serde::de::DeserializeOwned;

use virtual_axes_core::config::{Parameters, QosConfig, TimeMode};
use virtual_axes_io::messages::Recorded;

/// Publisher with its tap for the recording.
pub struct Publisher<M: Serialize> {
    /// Publisher of ros2-client.
    pub network: ros2_client::Publisher<M>,
    /// Tap that records the messages.
    pub tap: Tap<M>,
    /// DDS topic.
    pub topic: Topic,
    /// True if durability is volatile: messages without matched subscriptions need not be built.
    pub is_volatile: bool,
    /// Number of unacknowledged samples at which the middleware blocks.
    pub max_unacknowledged: usize,
}

impl<M: Serialize> Publisher<M> {
    /// Creates a publisher whose messages are not recorded and are always built.
    pub fn unrecorded(network: ros2_client::Publisher<M>, topic: Topic, max_unacknowledged: usize) -> Self {
        Publisher { network, tap: Tap::none(), topic, is_volatile: false, max_unacknowledged }
    }
}

/// Returns the DDS name of a ROS topic.
pub(super) fn dds_topic_name(name: &str) -> String {
    format!("rt{name}")
}

/// Subscription with its tap for the recording.
pub struct Subscription<M: Serialize + DeserializeOwned + 'static> {
    network: Arc<Renewable<ros2_client::Subscription<Wire<M>>>>,
    tap: Tap<M>,
}

impl<M: Recorded + DeserializeOwned + Send + Sync + 'static> Subscription<M> {
    /// Returns the messages in order of reception and records them.
    pub fn async_stream(&self) -> impl Stream<Item = ReadResult<(M, MessageInfo)>> + '_ {
        let received = self.network.items(|network| async move { network.async_take().await });
        let mut delivered = DeliveredSamples::default();
        let received = received.filter_map(move |(reader, received)| {
            let is_new = received.as_ref().map_or(true, |(_, info)| {
                delivered.insert(info.publisher_gid().to_bytes16(), info.sequence_number(), reader)
            });
            ready(is_new.then_some(received))
        });
        in_reception_order(received).then(async |received| {
            let (Wire(message), info) = received?;
            self.tap.record(&message).await;
            Ok((message, info))
        })
    }
}

/// Largest number of waiting messages that are sorted at a time.
const BATCH: usize = 64;

/// Sorts waiting messages by reception time, because RustDDS returns them publisher by publisher.
fn in_reception_order<M>(
    messages: impl Stream<Item = ReadResult<(M, MessageInfo)>>,
) -> impl Stream<Item = ReadResult<(M, MessageInfo)>> {
    messages.ready_chunks(BATCH).flat_map(|mut batch| {
        batch.sort_by_key(|received| received.as_ref().ok().and_then(|(_, info)| info.received_timestamp()));
        stream::iter(batch)
    })
}

/// Failure to create a topic.
#[derive(Debug, thiserror::Error)]
pub enum EndpointError {
    /// The middleware or the schema does not provide the topic.
    #[error("topic {name} cannot be created: {reason}")]
    NotCreated {
        /// Name of the topic.
        name: String,
        /// Reason.
        reason: String,
    },
    /// Two topics of different types are remapped to one name.
    #[error(
        "-r: topics {first} ({carried}) and {name} ({wanted}) would both be named {resolved}; remap one of them"
    )]
    TopicTypeConflict {
        /// Resolved name.
        resolved: String,
        /// Own name of the first topic.
        first: &'static str,
        /// Type of the first topic.
        carried: String,
        /// Own name of the second topic.
        name: &'static str,
        /// Type of the second topic.
        wanted: String,
    },
}

/// Returns the QoS profile of a configured topic.
fn profile(qos: QosConfig) -> QosProfile {
    // Each topic is published by a task of its own, which may wait for slow readers.
    let reliability = if qos.is_reliable {
        Reliability::Reliable { when_full: WhenFull::Block }
    } else {
        Reliability::BestEffort
    };
    let durability = if qos.is_transient_local { Durability::TransientLocal } else { Durability::Volatile };
    QosProfile {
        reliability,
        durability,
        history: History::KeepLast { depth: qos.depth },
        ..QosProfile::publisher_default()
    }
}

/// Number of unacknowledged samples at which a RustDDS writer blocks by default (`DEFAULT_WRITER_MAX_SAMPLES`).
pub const MAX_UNACKNOWLEDGED: usize = 8192;
/// Number of unacknowledged samples at which a writer blocks where the axes wait for subscribers.
///
/// The samples in flight of several topics fit into the receive buffer of a reader (about 200 kB), so that none is
/// lost. Fast DDS may stall permanently after a loss (see [`super::stalled_readers`]).
pub const BLOCKING_WINDOW: usize = 64;

/// Returns the number of unacknowledged samples of a topic for whose readers the axes wait.
fn blocking_window(qos: QosConfig) -> usize {
    BLOCKING_WINDOW.max(if qos.is_transient_local { qos.depth } else { 0 })
}

/// Returns the QoS of a publisher that blocks at `max_unacknowledged` samples.
///
/// The limit includes samples that a transient-local publisher keeps for late joiners.
pub(super) fn with_sample_limit(profile: &QosProfile, max_unacknowledged: usize) -> QosPolicies {
    let limit = i32::try_from(max_unacknowledged).unwrap_or(i32::MAX);
    let limits = ResourceLimits { max_samples: limit, max_instances: 1, max_samples_per_instance: limit };
    QosPolicies::from(profile).modify_by(&QosPolicyBuilder::new().resource_limits(limits).build())
}

/// Creates the DDS topic of a resolved name.
///
/// # Errors
/// Reason of the middleware.
pub(super) fn create_topic(
    participant: &DomainParticipant,
    resolved: &str,
    type_name: &MessageTypeName,
    qos: &QosPolicies,
) -> Result<Topic, String> {
    participant
        .create_topic(dds_topic_name(resolved), type_name.dds_msg_type(), qos, TopicKind::NoKey)
        .map_err(|e| e.to_string())
}

/// Topics created by other modules or by ros2-client, with their types.
const OTHER_TOPICS: [interface::Topic; 2] = [interface::ROSOUT, interface::PARAMETER_EVENTS];

/// Factory for the topics of a node.
pub struct Endpoints<'a> {
    node: &'a mut Node,
    context: &'a EndpointContext,
    args: &'a RosArgs,
    parameters: &'a Parameters,
    recorder: &'a mut TopicRecorder,
    /// True if the axes wait for slow readers.
    is_blocking: bool,
    /// Own name and type of each topic created so far, by resolved name.
    known: HashMap<String, (&'static str, String)>,
}

impl<'a> Endpoints<'a> {
    /// Creates a factory for topics of `node`, which belongs to `context`.
    ///
    /// `args` resolve the names, `parameters` define the QoS, and `recorder` records the messages.
    pub fn new(
        node: &'a mut Node,
        context: &'a EndpointContext,
        args: &'a RosArgs,
        parameters: &'a Parameters,
        recorder: &'a mut TopicRecorder,
    ) -> Self {
        let is_blocking = parameters.node_config().time != TimeMode::Real;
        let known = OTHER_TOPICS.iter().filter_map(|topic| {
            Some((args.resolve_topic(topic.name).ok()?, (topic.name, topic.type_name())))
        });
        Endpoints { node, context, args, parameters, recorder, is_blocking, known: known.collect() }
    }

    fn qos(&self, topic: &interface::Topic) -> Result<QosConfig, EndpointError> {
        let own_name = topic.name.trim_start_matches(['~', '/']);
        let qos = match topic.qos {
            TopicQos::Constant(qos) => Some(qos),
            TopicQos::Parameters => self.parameters.qos(own_name),
        };
        qos.ok_or_else(|| EndpointError::NotCreated {
            name: topic.name.to_owned(),
            reason: "the parameter schema has no QoS for it".to_owned(),
        })
    }

    /// Returns the resolved name of a topic, which can carry one type only.
    fn resolve(&mut self, topic: &interface::Topic) -> Result<String, EndpointError> {
        let name = topic.name;
        let resolved = self.args.resolve_topic(name).map_err(|e| not_created(topic, e.to_string()))?;
        let wanted = topic.type_name();
        let (first, carried) = self.known.entry(resolved.clone()).or_insert_with(|| (name, wanted.clone()));
        if *carried != wanted {
            let carried = carried.clone();
            return Err(EndpointError::TopicTypeConflict { resolved, first, carried, name, wanted });
        }
        Ok(resolved)
    }

    /// Creates a publisher; returns it with its resolved name.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn publisher<M: Recorded>(
        &mut self,
        description: &interface::Topic,
    ) -> Result<(Publisher<M>, String), EndpointError> {
        let failed = |reason| not_created(description, reason);
        let qos = self.qos(description)?;
        let max_unacknowledged = if self.is_blocking { blocking_window(qos) } else { MAX_UNACKNOWLEDGED };
        let resolved = self.resolve(description)?;
        let type_name = MessageTypeName::new(description.package, description.message);
        let limited = with_sample_limit(&profile(qos), max_unacknowledged);
        let participant = self.context.domain_participant();
        let topic = create_topic(&participant, &resolved, &type_name, &limited).map_err(failed)?;
        let network = self.node.create_publisher(&topic, None).map_err(|e| failed(e.to_string()))?;
        let tap = self.recorder.tap(&resolved, qos, Direction::Out);
        let is_volatile = !qos.is_transient_local;
        let publisher = Publisher { network, tap, topic, is_volatile, max_unacknowledged };
        Ok((publisher, resolved))
    }

    /// Creates a subscription; returns it with its resolved name.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription<M: Recorded + DeserializeOwned + Send + Sync + 'static>(
        &mut self,
        description: &interface::Topic,
    ) -> Result<(Subscription<M>, String), EndpointError> {
        let qos = self.qos(description)?;
        let name = self.resolve(description)?;
        let type_name = MessageTypeName::new(description.package, description.message);
        let (resolved, limits) = (name.clone(), QosPolicies::from(&profile(qos)));
        let create = move |node: &mut Node, context: &Context| {
            let topic = create_topic(&context.domain_participant(), &resolved, &type_name, &limits)?;
            node.create_subscription(&topic, None).map_err(|e| e.to_string())
        };
        let network = Renewable::create(self.node, self.context, create)
            .map_err(|reason| not_created(description, reason))?;
        let tap = self.recorder.tap(&name, qos, Direction::In);
        Ok((Subscription { network, tap }, name))
    }
}

fn not_created(topic: &interface::Topic, reason: String) -> EndpointError {
    EndpointError::NotCreated { name: topic.name.to_owned(), reason }
}

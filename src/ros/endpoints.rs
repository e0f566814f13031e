//! Topics of the node under their resolved names, with their QoS profiles.

use std::collections::HashMap;

use futures::{Stream, StreamExt, stream};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{Message, MessageInfo, MessageTypeName, Node, ReadResult};

use rustdds::policy::ResourceLimits;
use rustdds::{DomainParticipant, QosPolicies, QosPolicyBuilder, Topic, TopicKind};

use super::args::RosArgs;
use super::recorder::{Direction, Recorder, Tap};
use serde::Serialize;

use virtual_axes_core::config::{Parameters, QosConfig, TimeMode};
use virtual_axes_io::messages::Recorded;

/// A publisher of a topic that is recorded.
pub struct Publisher<M: Serialize> {
    /// To the network.
    pub network: ros2_client::Publisher<M>,
    /// To the recording.
    pub tap: Tap<M>,
    /// Its topic.
    pub topic: Topic,
    /// Whether readers that come later do not want what was sent before: a message that nobody hears is not made.
    pub volatile: bool,
    /// Samples that the middleware keeps for readers that have not acknowledged them; then it waits.
    pub kept: usize,
}

impl<M: Serialize> Publisher<M> {
    /// One whose messages are not recorded, and are made whoever listens.
    pub fn unrecorded(network: ros2_client::Publisher<M>, topic: Topic, kept: usize) -> Self {
        Publisher { network, tap: Tap::none(), topic, volatile: false, kept }
    }
}

/// A topic's name in DDS.
pub(super) fn topic_of(name: &str) -> String {
    format!("rt{name}")
}

/// A subscription of a topic that is recorded.
pub struct Subscription<M> {
    network: ros2_client::Subscription<M>,
    tap: Tap<M>,
}

impl<M: Message + Recorded + Send + Sync + 'static> Subscription<M> {
    /// The messages in the order in which they came, recorded so.
    pub fn async_stream(&self) -> impl Stream<Item = ReadResult<(M, MessageInfo)>> + '_ {
        in_order_of_arrival(self.network.async_stream()).then(async |received| {
            if let Ok((message, _)) = &received {
                self.tap.record(message).await;
            }
            received
        })
    }
}

/// Messages that wait at a time and are put in order.
const BATCH: usize = 64;

/// What waits, by the time at which it came: RustDDS gives out what waits publisher by publisher.
fn in_order_of_arrival<M>(
    messages: impl Stream<Item = ReadResult<(M, MessageInfo)>>,
) -> impl Stream<Item = ReadResult<(M, MessageInfo)>> {
    messages.ready_chunks(BATCH).flat_map(|mut batch| {
        batch.sort_by_key(|received| received.as_ref().ok().and_then(|(_, info)| info.received_timestamp()));
        stream::iter(batch)
    })
}

/// A topic that could not be created.
#[derive(Debug, thiserror::Error)]
pub enum EndpointError {
    /// The middleware refuses it.
    #[error("topic {name} cannot be created: {reason}")]
    Refused {
        /// Its name.
        name: String,
        /// Why not.
        reason: String,
    },
    /// It is remapped to a topic of another type.
    #[error("-r: topics {first} ({carried}) and {name} ({wanted}) would both be {resolved}")]
    TwoTypes {
        /// The name in the graph.
        resolved: String,
        /// Own name of the topic that has it.
        first: &'static str,
        /// Its type.
        carried: String,
        /// Own name of the other.
        name: &'static str,
        /// Its type.
        wanted: String,
    },
}

/// The profile of a topic as it is configured.
fn profile(qos: QosConfig) -> QosProfile {
    // A task of its own publishes each topic, and may wait for slow readers.
    let reliability = if qos.reliable {
        Reliability::Reliable { when_full: WhenFull::Block }
    } else {
        Reliability::BestEffort
    };
    let durability = if qos.transient_local { Durability::TransientLocal } else { Durability::Volatile };
    QosProfile {
        reliability,
        durability,
        history: History::KeepLast { depth: qos.depth },
        ..QosProfile::publisher_default()
    }
}

/// So many samples that a reader has not acknowledged RustDDS keeps where nothing is said (`DEFAULT_WRITER_MAX_SAMPLES`).
pub const KEPT: usize = 8192;
/// So many are under way where the axes wait for their readers anyway: what several topics send at a time fits into the
/// socket of a reader (some 200 kB), so that nothing is lost. Fast DDS may never get over a loss (see `deaf`).
pub const WINDOW: usize = 64;

/// How many samples may be under way of a topic for whose readers the axes wait.
fn window(qos: QosConfig) -> usize {
    WINDOW.max(if qos.transient_local { qos.depth } else { 0 })
}

/// The profile of a publisher that keeps so many samples for readers that have not acknowledged them, and, if it keeps
/// any for readers that come later, while it has no reader.
pub(super) fn keeping(profile: &QosProfile, kept: usize) -> QosPolicies {
    let most = i32::try_from(kept).unwrap_or(i32::MAX);
    let limits = ResourceLimits { max_samples: most, max_instances: 1, max_samples_per_instance: most };
    QosPolicies::from(profile).modify_by(&QosPolicyBuilder::new().resource_limits(limits).build())
}

/// The topic of a resolved name, or why the middleware refuses it.
pub(super) fn topic(
    participant: &DomainParticipant,
    resolved: &str,
    type_name: &MessageTypeName,
    qos: &QosPolicies,
) -> Result<Topic, String> {
    participant
        .create_topic(topic_of(resolved), type_name.dds_msg_type(), qos, TopicKind::NoKey)
        .map_err(|e| e.to_string())
}

/// Topics that are created elsewhere, with their types.
const OTHER_TOPICS: [(&str, &str); 2] =
    [("/rosout", "rcl_interfaces/msg/Log"), ("/parameter_events", "rcl_interfaces/msg/ParameterEvent")];

/// Creates topics on a node.
pub struct Endpoints<'a> {
    node: &'a mut Node,
    participant: &'a DomainParticipant,
    args: &'a RosArgs,
    parameters: &'a Parameters,
    recorder: &'a mut Recorder,
    /// Whether the axes wait for slow readers.
    waits: bool,
    /// Own name and type of each topic so far, by its resolved name.
    known: HashMap<String, (&'static str, String)>,
}

impl<'a> Endpoints<'a> {
    /// On `node`, which belongs to `participant`; `args` resolve their names, `parameters` say their quality of service,
    /// and `recorder` records their messages.
    pub fn new(
        node: &'a mut Node,
        participant: &'a DomainParticipant,
        args: &'a RosArgs,
        parameters: &'a Parameters,
        recorder: &'a mut Recorder,
    ) -> Self {
        let waits = parameters.node_config().time != TimeMode::Real;
        // Those that are made elsewhere.
        let known = OTHER_TOPICS.iter().filter_map(|&(name, type_name)| {
            Some((args.resolve_topic(name).ok()?, (name, type_name.to_owned())))
        });
        Endpoints { node, participant, args, parameters, recorder, waits, known: known.collect() }
    }

    fn configured(&self, name: &str) -> Result<QosConfig, EndpointError> {
        let own_name = name.trim_start_matches(['~', '/']);
        self.parameters.qos(own_name).ok_or_else(|| EndpointError::Refused {
            name: name.to_owned(),
            reason: "it is not in the schema".to_owned(),
        })
    }

    /// A topic under its resolved name, which can carry one type only.
    fn topic(
        &mut self,
        name: &'static str,
        type_name: &MessageTypeName,
        qos: &QosPolicies,
    ) -> Result<(Topic, String), EndpointError> {
        let failed = |reason: String| EndpointError::Refused { name: name.to_owned(), reason };
        let resolved = self.args.resolve_topic(name).map_err(|e| failed(e.to_string()))?;
        let wanted = format!("{}/msg/{}", type_name.package_name(), type_name.type_name());
        let (first, carried) = self.known.entry(resolved.clone()).or_insert_with(|| (name, wanted.clone()));
        if *carried != wanted {
            let carried = carried.clone();
            return Err(EndpointError::TwoTypes { resolved, first, carried, name, wanted });
        }
        let topic = topic(self.participant, &resolved, type_name, qos).map_err(failed)?;
        Ok((topic, resolved))
    }

    /// A publisher, and the name that it publishes under.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn publisher<M: Recorded>(
        &mut self,
        name: &'static str,
        type_name: MessageTypeName,
    ) -> Result<(Publisher<M>, String), EndpointError> {
        let qos = self.configured(name)?;
        let kept = if self.waits { window(qos) } else { KEPT };
        let (topic, resolved) = self.topic(name, &type_name, &keeping(&profile(qos), kept))?;
        let network = self
            .node
            .create_publisher(&topic, None)
            .map_err(|e| EndpointError::Refused { name: name.to_owned(), reason: e.to_string() })?;
        let tap = self.recorder.tap(&resolved, qos, Direction::Out);
        let volatile = !qos.transient_local;
        let publisher = Publisher { network, tap, topic, volatile, kept };
        Ok((publisher, resolved))
    }

    /// A subscription, and the name that it listens to.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription<M: Message + Recorded + 'static>(
        &mut self,
        name: &'static str,
        type_name: MessageTypeName,
    ) -> Result<(Subscription<M>, String), EndpointError> {
        self.subscription_of(name, type_name, self.configured(name)?)
    }

    /// Likewise, of a quality that is not a parameter.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription_of<M: Message + Recorded + 'static>(
        &mut self,
        name: &'static str,
        type_name: MessageTypeName,
        qos: QosConfig,
    ) -> Result<(Subscription<M>, String), EndpointError> {
        let (topic, resolved) = self.topic(name, &type_name, &QosPolicies::from(&profile(qos)))?;
        let network = self
            .node
            .create_subscription(&topic, None)
            .map_err(|e| EndpointError::Refused { name: name.to_owned(), reason: e.to_string() })?;
        let tap = self.recorder.tap(&resolved, qos, Direction::In);
        Ok((Subscription { network, tap }, resolved))
    }
}

//! Creation of the node's topics from the table in [`crate::ros_interface`]: names, QoS, taps for the recording.

use std::collections::{HashMap, HashSet, VecDeque};
use std::future::ready;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use futures::{Stream, StreamExt, stream};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::task::JoinSet;

use super::output::{Output, OverflowPolicy};
use super::recorder::{Tap, TopicRecorder};
use crate::ros_interface::{self, TOPICS, Topic, TopicDirection, TopicQos};
use crate::validation::args::RosArgs;
use virtual_axes_core::config::{Parameters, QosConfig, TimeMode};
use virtual_axes_dds::{Gid, MessageInfo, Node, Publisher, QoSProfile};
use virtual_axes_io::messages::Recorded;

/// Subscription with its tap for the recording.
pub struct TopicInput<M: DeserializeOwned + 'static> {
    network: virtual_axes_dds::Subscription<M>,
    /// Second subscription, which also receives the last message before the start of the node.
    latched: Option<virtual_axes_dds::Subscription<M>>,
    tap: Tap<M>,
    /// Resolved name of the topic.
    pub name: String,
}

impl<M: Recorded + DeserializeOwned + Send + Sync + 'static> TopicInput<M> {
    /// Creates a subscription of a running node, which is not recorded; `name` is the resolved name.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn create(node: &Node, topic: &Topic, name: String, qos: QosConfig) -> Result<Self, String> {
        let network = node.create_subscription(&name, &topic.type_name(), &profile(qos))?;
        Ok(TopicInput { network, latched: None, tap: Tap::none(), name })
    }

    /// Returns the messages in order of reception and records them.
    pub fn messages(&self) -> impl Stream<Item = Result<(M, MessageInfo), String>> + Send + '_ {
        let latched = stream::iter(&self.latched).flat_map(|latched| latched.messages());
        let mut newest = NewestMessages::default();
        let is_single = self.latched.is_none();
        let received = stream::select(self.network.messages(), latched).filter(move |received| {
            ready(is_single || received.as_ref().map_or(true, |(_, info)| newest.is_new(info)))
        });
        received.then(async |received| {
            let (message, info) = received?;
            self.tap.record(&message).await;
            Ok((message, info))
        })
    }
}

/// Largest number of publishers with a stored sequence number.
const MAX_PUBLISHERS: usize = 64;

/// Sequence numbers of the newest messages of the publishers, the newest publisher last.
#[derive(Default)]
struct NewestMessages(VecDeque<(Gid, i64)>);

impl NewestMessages {
    /// Returns true if no message of the publisher with the same or a later number has been received.
    fn is_new(&mut self, info: &MessageInfo) -> bool {
        let Some((_, newest)) = self.0.iter_mut().find(|(publisher, _)| *publisher == info.publisher_gid)
        else {
            if self.0.len() == MAX_PUBLISHERS {
                self.0.pop_front();
            }
            self.0.push_back((info.publisher_gid, info.sequence_number));
            return true;
        };
        let is_new = info.sequence_number > *newest;
        *newest = info.sequence_number.max(*newest);
        is_new
    }
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

/// Number of unacknowledged samples at which a writer blocks where the axes wait for subscribers.
///
/// The samples in flight of several topics fit into the receive buffer of a reader (about 200 kB), so that none is
/// lost. Fast DDS may stall permanently after a loss (docs/internals/middleware.md).
const BLOCKING_WINDOW: usize = 64;

/// Topics created outside the factory, with their types.
const OTHER_TOPICS: [Topic; 2] = [ros_interface::ROSOUT, ros_interface::PARAMETER_EVENTS];

/// Factory for the topics of a node.
pub struct TopicFactory<'a> {
    /// Node of the topics.
    pub node: &'a Node,
    /// Tasks of the node, to which those of the output queues are added.
    pub tasks: &'a mut JoinSet<()>,
    args: &'a RosArgs,
    parameters: &'a Parameters,
    recorder: &'a mut TopicRecorder,
    dropped: &'a Arc<AtomicU64>,
    /// True if the axes wait for slow readers.
    is_blocking: bool,
    /// Own name and type of each topic created so far, by resolved name.
    known: HashMap<String, (&'static str, String)>,
    /// Topics created so far: direction and own name.
    created: HashSet<(TopicDirection, &'static str)>,
}

impl<'a> TopicFactory<'a> {
    /// Creates a factory for topics of `node`.
    ///
    /// `args` resolve the names, `parameters` define the QoS, `recorder` records the messages, and `dropped` counts those
    /// that are dropped for slow subscribers.
    pub fn new(
        node: &'a Node,
        args: &'a RosArgs,
        parameters: &'a Parameters,
        recorder: &'a mut TopicRecorder,
        dropped: &'a Arc<AtomicU64>,
        tasks: &'a mut JoinSet<()>,
    ) -> Self {
        let is_blocking = parameters.node_config().time != TimeMode::Real;
        let known = OTHER_TOPICS.iter().filter_map(|topic| {
            Some((args.resolve_topic(topic.name).ok()?, (topic.name, topic.type_name())))
        });
        let (known, created) = (known.collect(), HashSet::new());
        TopicFactory { node, tasks, args, parameters, recorder, dropped, is_blocking, known, created }
    }

    /// Returns the resolved names of the created topics of a direction, in the order of the table.
    pub fn names(&self, direction: TopicDirection) -> Vec<String> {
        let is_created =
            |topic: &&Topic| topic.direction == direction && self.created.contains(&(direction, topic.name));
        let created = TOPICS.iter().filter(is_created);
        created.filter_map(|topic| self.args.resolve_topic(topic.name).ok()).collect()
    }

    fn qos(&self, topic: &Topic) -> Result<QosConfig, EndpointError> {
        let own_name = topic.name.trim_start_matches(['~', '/']);
        let qos = match topic.qos {
            TopicQos::Constant(qos) => Some(qos),
            TopicQos::Parameters => self.parameters.qos(own_name),
        };
        qos.ok_or_else(|| not_created(topic.name, "the parameter schema has no QoS for it".to_owned()))
    }

    /// Returns the resolved name of a topic, which can carry one type only.
    fn resolve(&mut self, topic: &Topic) -> Result<String, EndpointError> {
        let name = topic.name;
        let resolved = self.args.resolve_topic(name).map_err(|e| not_created(name, e.to_string()))?;
        let wanted = topic.type_name();
        let (first, carried) = self.known.entry(resolved.clone()).or_insert_with(|| (name, wanted.clone()));
        if *carried != wanted {
            let carried = carried.clone();
            return Err(EndpointError::TopicTypeConflict { resolved, first, carried, name, wanted });
        }
        self.created.insert((topic.direction, name));
        Ok(resolved)
    }

    /// Creates a topic that is published, with its tap and an output queue.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn output<M: Recorded + Clone + Send + Sync + 'static>(
        &mut self,
        topic: &Topic,
        overflow: OverflowPolicy,
    ) -> Result<Output<M>, EndpointError> {
        let qos = self.qos(topic)?;
        let resolved = self.resolve(topic)?;
        let mut profile = profile(qos);
        if self.is_blocking {
            // The limit includes samples that are kept for late joiners.
            profile.max_unacknowledged =
                BLOCKING_WINDOW.max(if qos.is_transient_local { qos.depth } else { 0 });
        }
        let publisher = self.node.create_publisher(&resolved, &topic.type_name(), &profile);
        let publisher = publisher.map_err(|reason| not_created(topic.name, reason))?;
        let tap = self.recorder.tap(&resolved, qos, TopicDirection::Out);
        Ok(self.start(publisher, tap, overflow))
    }

    /// Creates a topic of an action, with an output queue; it is not recorded.
    ///
    /// # Errors
    /// Reason of the middleware.
    pub fn action_output<M: Serialize + Clone + Send + Sync + 'static>(
        &mut self,
        resolved: &str,
        type_name: &str,
        qos: QosConfig,
        overflow: OverflowPolicy,
    ) -> Result<Output<M>, String> {
        let mut profile = profile(qos);
        if qos.is_transient_local {
            profile.max_unacknowledged = BLOCKING_WINDOW;
        }
        let publisher = self.node.create_publisher(resolved, type_name, &profile)?;
        Ok(self.start(publisher, Tap::none(), overflow))
    }

    /// Starts the task that writes queued messages of a topic; it ends when the output is dropped.
    fn start<M: Serialize + Clone + Send + Sync + 'static>(
        &mut self,
        publisher: Publisher<M>,
        tap: Tap<M>,
        overflow: OverflowPolicy,
    ) -> Output<M> {
        let (output, task) = Output::new(publisher, tap, overflow, self.dropped);
        self.tasks.spawn(task);
        output
    }

    /// Creates the tap of a topic that is published without a queue.
    pub fn tap<M: Recorded>(&mut self, resolved: &str, qos: QosConfig) -> Tap<M> {
        self.recorder.tap(resolved, qos, TopicDirection::Out)
    }

    /// Creates a subscription.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription<M: Recorded + DeserializeOwned + Send + Sync + 'static>(
        &mut self,
        topic: &Topic,
    ) -> Result<TopicInput<M>, EndpointError> {
        let qos = self.qos(topic)?;
        let name = self.resolve(topic)?;
        let network = self.subscribe(topic, &name, qos)?;
        let tap = self.recorder.tap(&name, qos, TopicDirection::In);
        Ok(TopicInput { network, latched: None, tap, name })
    }

    /// Creates a subscription that also receives the last message before the start of the node, of a publisher with
    /// transient-local durability.
    ///
    /// A reader with this durability receives nothing of volatile publishers, therefore there are two.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn latched_subscription<M: Recorded + DeserializeOwned + Send + Sync + 'static>(
        &mut self,
        topic: &Topic,
    ) -> Result<TopicInput<M>, EndpointError> {
        let qos = self.qos(topic)?;
        let mut input = self.subscription(topic)?;
        if qos.is_reliable && !qos.is_transient_local {
            let latched = QosConfig { is_transient_local: true, depth: 1, ..qos };
            input.latched = Some(self.subscribe(topic, &input.name, latched)?);
        }
        Ok(input)
    }

    fn subscribe<M: DeserializeOwned + Send + Sync + 'static>(
        &self,
        topic: &Topic,
        name: &str,
        qos: QosConfig,
    ) -> Result<virtual_axes_dds::Subscription<M>, EndpointError> {
        let network = self.node.create_subscription(name, &topic.type_name(), &profile(qos));
        network.map_err(|reason| not_created(topic.name, reason))
    }
}

/// Returns the profile of a configured topic. A write may wait for slow readers: each topic has a task of its own.
fn profile(qos: QosConfig) -> QoSProfile {
    let QosConfig { is_reliable, is_transient_local, depth } = qos;
    QoSProfile { is_reliable, is_transient_local, ..QoSProfile::reliable(depth) }
}

fn not_created(name: &str, reason: String) -> EndpointError {
    EndpointError::NotCreated { name: name.to_owned(), reason }
}

//! Topics of the node under their resolved names, with their QoS profiles.

use futures::{Stream, StreamExt, stream};
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::{Message, MessageInfo, MessageTypeName, Name, Node, ReadResult};

use super::args::RosArgs;
use super::recorder::{Direction, Recorder, Tap};
use serde::Serialize;

use crate::config::{Parameters, QosConfig};
use crate::messages::Recorded;

/// A publisher of a topic that is recorded.
pub struct Publisher<M: Serialize> {
    /// To the network.
    pub network: ros2_client::Publisher<M>,
    /// To the recording.
    pub tap: Tap<M>,
    /// Its name in DDS, unless readers that come later want what was sent before.
    pub volatile: Option<String>,
}

impl<M: Serialize> Publisher<M> {
    /// One whose messages are not recorded.
    pub fn unrecorded(network: ros2_client::Publisher<M>) -> Self {
        Publisher { network, tap: Tap::none(), volatile: None }
    }
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
#[error("topic {name} cannot be created: {reason}")]
pub struct EndpointError {
    /// Its name.
    pub name: String,
    /// Why not.
    pub reason: String,
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

/// Creates topics on a node.
pub struct Endpoints<'a> {
    /// The node that they belong to.
    pub node: &'a mut Node,
    /// What resolves their names.
    pub args: &'a RosArgs,
    /// What configures their quality of service.
    pub parameters: &'a Parameters,
    /// What records their messages.
    pub recorder: &'a mut Recorder,
}

impl Endpoints<'_> {
    fn configured(&self, name: &str) -> Result<QosConfig, EndpointError> {
        let own_name = name.trim_start_matches(['~', '/']);
        self.parameters.qos(own_name).ok_or_else(|| EndpointError {
            name: name.to_owned(),
            reason: "it is not in the schema".to_owned(),
        })
    }

    fn topic(
        &mut self,
        name: &str,
        type_name: MessageTypeName,
        qos: QosConfig,
    ) -> Result<(rustdds::Topic, String), EndpointError> {
        let failed = |reason: String| EndpointError { name: name.to_owned(), reason };
        let resolved = self.args.resolve_topic(name).map_err(|e| failed(e.to_string()))?;
        let ros_name = Name::parse(&resolved).map_err(|e| failed(e.to_string()))?;
        let topic =
            self.node.create_topic(&ros_name, type_name, &profile(qos)).map_err(|e| failed(e.to_string()))?;
        Ok((topic, resolved))
    }

    /// A publisher, and the name that it publishes under.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn publisher<M: Recorded>(
        &mut self,
        name: &str,
        type_name: MessageTypeName,
    ) -> Result<(Publisher<M>, String), EndpointError> {
        let qos = self.configured(name)?;
        let (topic, resolved) = self.topic(name, type_name, qos)?;
        let network = self
            .node
            .create_publisher(&topic, None)
            .map_err(|e| EndpointError { name: name.to_owned(), reason: e.to_string() })?;
        let tap = self.recorder.tap(&resolved, qos, Direction::Out);
        let volatile = (!qos.transient_local).then(|| format!("rt{resolved}"));
        Ok((Publisher { network, tap, volatile }, resolved))
    }

    /// A subscription, and the name that it listens to.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription<M: Message + Recorded + 'static>(
        &mut self,
        name: &str,
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
        name: &str,
        type_name: MessageTypeName,
        qos: QosConfig,
    ) -> Result<(Subscription<M>, String), EndpointError> {
        let (topic, resolved) = self.topic(name, type_name, qos)?;
        let network = self
            .node
            .create_subscription(&topic, None)
            .map_err(|e| EndpointError { name: name.to_owned(), reason: e.to_string() })?;
        let tap = self.recorder.tap(&resolved, qos, Direction::In);
        Ok((Subscription { network, tap }, resolved))
    }
}

//! Topics of the node under their resolved names, with their QoS profiles.

use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{Message, MessageTypeName, Name, Node, Publisher, Subscription};
use serde::Serialize;

use super::args::RosArgs;

/// Samples that an output keeps.
const OUTPUT_DEPTH: usize = 10;
/// Results that a late joiner still gets.
const RESULT_DEPTH: usize = 50;
/// Trajectories that may wait to be taken.
const PSEC_DEPTH: usize = 64;
/// Loads that may wait to be taken.
const LOAD_DEPTH: usize = 10;

/// A topic that could not be created.
#[derive(Debug, thiserror::Error)]
#[error("topic {name} cannot be created: {reason}")]
pub struct EndpointError {
    /// Its name.
    pub name: String,
    /// Why not.
    pub reason: String,
}

/// How a topic is offered or asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Profile {
    /// Outputs: reliable, volatile, keep last 10.
    Output,
    /// Results: reliable, transient local, keep last 50.
    Result,
    /// `psec`: reliable, volatile, keep last 64.
    Psec,
    /// `load`: best effort, so that both kinds of publisher are heard.
    Load,
}

impl Profile {
    fn qos(self) -> QosProfile {
        let keep_last = |depth| History::KeepLast { depth };
        // A task of its own publishes each topic, and may wait for slow readers.
        let reliable = QosProfile::publisher_default().reliability_reliable(WhenFull::Block);
        match self {
            Profile::Output => reliable.history(keep_last(OUTPUT_DEPTH)),
            Profile::Result => {
                reliable.durability(Durability::TransientLocal).history(keep_last(RESULT_DEPTH))
            }
            Profile::Psec => reliable.history(keep_last(PSEC_DEPTH)),
            Profile::Load => QosProfile::subscription_default().history(keep_last(LOAD_DEPTH)),
        }
    }
}

/// Creates topics on a node.
pub struct Endpoints<'a> {
    /// The node that they belong to.
    pub node: &'a mut Node,
    /// What resolves their names.
    pub args: &'a RosArgs,
}

impl Endpoints<'_> {
    fn topic(
        &mut self,
        name: &str,
        type_name: MessageTypeName,
        profile: Profile,
    ) -> Result<(rustdds::Topic, String), EndpointError> {
        let failed = |reason: String| EndpointError { name: name.to_owned(), reason };
        let resolved = self.args.resolve_topic(name).map_err(|e| failed(e.to_string()))?;
        let ros_name = Name::parse(&resolved).map_err(|e| failed(e.to_string()))?;
        let topic = self
            .node
            .create_topic(&ros_name, type_name, &profile.qos())
            .map_err(|e| failed(e.to_string()))?;
        Ok((topic, resolved))
    }

    /// A publisher, and the name that it publishes under.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn publisher<M: Serialize>(
        &mut self,
        name: &str,
        type_name: MessageTypeName,
        profile: Profile,
    ) -> Result<(Publisher<M>, String), EndpointError> {
        let (topic, resolved) = self.topic(name, type_name, profile)?;
        let publisher = self
            .node
            .create_publisher(&topic, None)
            .map_err(|e| EndpointError { name: name.to_owned(), reason: e.to_string() })?;
        Ok((publisher, resolved))
    }

    /// A subscription, and the name that it listens to.
    ///
    /// # Errors
    /// [`EndpointError`] naming the topic.
    pub fn subscription<M: Message + 'static>(
        &mut self,
        name: &str,
        type_name: MessageTypeName,
        profile: Profile,
    ) -> Result<(Subscription<M>, String), EndpointError> {
        let (topic, resolved) = self.topic(name, type_name, profile)?;
        let subscription = self
            .node
            .create_subscription(&topic, None)
            .map_err(|e| EndpointError { name: name.to_owned(), reason: e.to_string() })?;
        Ok((subscription, resolved))
    }
}

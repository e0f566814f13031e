//! Descriptions of topics, services, actions and error codes.

use virtual_axes_core::config::{DEFINITIONS, DefaultValue, ParameterDefinition, Presence, QosConfig};

/// Direction of a topic, as seen by the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TopicDirection {
    /// The node subscribes.
    In,
    /// The node publishes.
    Out,
}

/// QoS profile of a topic.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TopicQos {
    /// Parameters `qos.TOPIC.*`.
    Parameters,
    /// Constant profile.
    Constant(QosConfig),
}

/// Topic of the node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Topic {
    /// Direction.
    pub direction: TopicDirection,
    /// Name before remapping: `x`, `/x` or `~/x`.
    pub name: &'static str,
    /// Package of the message.
    pub package: &'static str,
    /// Name of the message in its package.
    pub message: &'static str,
    /// Content with units.
    pub content: &'static str,
    /// QoS profile.
    pub qos: TopicQos,
    /// Rate of the messages.
    pub rate: &'static str,
    /// Parameters with their values of which one must be set; empty if the topic always exists.
    pub conditions: &'static [(&'static str, &'static str)],
}

impl Topic {
    /// Returns the name of the message with its package: `sensor_msgs/msg/JointState`.
    pub fn type_name(&self) -> String {
        format!("{}/msg/{}", self.package, self.message)
    }

    /// Returns the prefix of the parameters of its QoS, `qos.joint_states`; `None` if the QoS is constant.
    pub fn qos_prefix(&self) -> Option<String> {
        match self.qos {
            TopicQos::Parameters => Some(format!("qos.{}", self.name.trim_start_matches(['~', '/']))),
            TopicQos::Constant(_) => None,
        }
    }

    /// Returns the constant QoS, or the defaults of its parameters; `None` if the schema lacks them.
    pub fn default_qos(&self) -> Option<QosConfig> {
        let prefix = match (self.qos, self.qos_prefix()) {
            (TopicQos::Constant(qos), _) => return Some(qos),
            (TopicQos::Parameters, prefix) => prefix?,
        };
        let default = |policy: &str| {
            let key = format!("{prefix}.{policy}");
            let has_key = |definition: &&ParameterDefinition| definition.key == key;
            match DEFINITIONS.iter().find(has_key)?.presence {
                Presence::Default(value) => Some(value),
                Presence::Required | Presence::Optional => None,
            }
        };
        let DefaultValue::Integer(depth) = default("depth")? else { return None };
        Some(QosConfig {
            is_reliable: default("reliability")? == DefaultValue::Text("reliable"),
            is_transient_local: default("durability")? == DefaultValue::Text("transient_local"),
            depth: usize::try_from(depth).ok()?,
        })
    }
}

/// Service of the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeService {
    /// Name behind `~/`, before remapping.
    pub label: &'static str,
    /// Package of the service type.
    pub package: &'static str,
    /// Name of the service type in its package.
    pub service: &'static str,
    /// Effect or response.
    pub content: &'static str,
}

impl NodeService {
    /// Returns the name before remapping: `~/reset`.
    pub fn name(&self) -> String {
        format!("~/{}", self.label)
    }

    /// Returns the name of the service type with its package: `std_srvs/srv/Trigger`.
    pub fn type_name(&self) -> String {
        format!("{}/srv/{}", self.package, self.service)
    }
}

/// Action of the node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeAction {
    /// Name before remapping.
    pub name: &'static str,
    /// Package of the action type.
    pub package: &'static str,
    /// Name of the action type in its package.
    pub action: &'static str,
    /// Content.
    pub content: &'static str,
    /// Rate of the feedback.
    pub rate: &'static str,
}

impl NodeAction {
    /// Returns the name of the action type with its package.
    pub fn type_name(&self) -> String {
        format!("{}/action/{}", self.package, self.action)
    }
}

/// Error code in the result of the action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ActionErrorCode {
    /// Number.
    pub code: i32,
    /// Name of the constant in the action type.
    pub name: &'static str,
    /// Reason for this code.
    pub meaning: &'static str,
}

//! Parameters of ros2_controllers' joint_trajectory_controller without a counterpart in the schema.
//!
//! A value that describes this node is accepted without effect. Of the others, a parameter file and the command line of the
//! node are accepted with a warning, since the controller starts with them; a request at run time is rejected.

use super::error::{ConfigError, ValueSource};
use super::value::Value;

/// Parameter of the controller, or group of them.
pub(super) struct ControllerParameter {
    /// Key, or the beginning of the keys of a group, with a dot at its end.
    pub key: &'static str,
    describes_node: fn(&Value) -> bool,
    /// Rule for the value, to follow "must".
    allowed: &'static str,
}

/// Parameters of the controller.
const PARAMETERS: &[ControllerParameter] = &[
    ControllerParameter {
        key: "type",
        describes_node: |value| is_text(value, "joint_trajectory_controller/JointTrajectoryController"),
        allowed: "be joint_trajectory_controller/JointTrajectoryController: the node stands in for this type alone",
    },
    ControllerParameter {
        key: "command_joints",
        describes_node: |value| matches!(value, Value::TextList(names) if names.is_empty()),
        allowed: "be omitted: every joint is commanded",
    },
    ControllerParameter {
        key: "command_interfaces",
        describes_node: |value| are_among(value, &["position"]),
        allowed: "be [position]: setpoints are positions",
    },
    ControllerParameter {
        key: "state_interfaces",
        describes_node: |value| are_among(value, &["position", "velocity"]),
        allowed: "be [position] or [position, velocity], the states of the axes",
    },
    ControllerParameter {
        key: "allow_partial_joints_goal",
        describes_node: is_true,
        allowed: "be true: axes that a trajectory does not name continue",
    },
    ControllerParameter {
        key: "interpolate_from_desired_state",
        describes_node: is_true,
        allowed: "be true: trajectories begin at the commanded state",
    },
    ControllerParameter {
        key: "open_loop_control",
        describes_node: is_true,
        allowed: "be true: trajectories begin at the commanded state",
    },
    ControllerParameter {
        key: "allow_integration_in_goal_trajectories",
        describes_node: |value| value.flag() == Some(false),
        allowed: "be false: every point of a trajectory has positions",
    },
    ControllerParameter {
        key: "set_last_command_interface_value_as_state_on_activation",
        describes_node: is_true,
        allowed: "be true: the axes are activated at their setpoints",
    },
    ControllerParameter {
        key: "state_publish_rate",
        describes_node: |_| false,
        allowed: "be omitted: the rate of ~/controller_state is publish_rate",
    },
    ControllerParameter {
        key: "gains.",
        describes_node: |_| false,
        allowed: "be omitted, as all gains of the controller: the drives have loops of their own, see position_loop and \
                  velocity_loop of each joint",
    },
    ControllerParameter {
        key: "speed_scaling.",
        describes_node: |value| is_text(value, "") || [Value::Double(1.0), Value::Integer(1)].contains(value),
        allowed: "be omitted: the feed override begins at 1, and ~/speed_scaling_input sets it",
    },
    ControllerParameter {
        key: "speed_scaling_interface_name",
        describes_node: |value| is_text(value, ""),
        allowed: "be omitted: ~/speed_scaling_input sets the feed override",
    },
    ControllerParameter {
        key: "constraints.decelerate_on_cancel",
        describes_node: is_true,
        allowed: "be true: a canceled trajectory ends in a controlled stop",
    },
    ControllerParameter {
        key: "update_rate",
        describes_node: |value| *value == Value::Integer(0),
        allowed: "be omitted: the axes have the period periods.position_ms",
    },
    ControllerParameter {
        key: "is_async",
        describes_node: |value| value.flag() == Some(false),
        allowed: "be omitted: the axes have a thread of their own",
    },
    ControllerParameter {
        key: "fallback_controllers",
        describes_node: |value| matches!(value, Value::TextList(names) if names.is_empty()),
        allowed: "be omitted: there is no controller manager",
    },
];

/// Parameters of the controller that other nodes have, too.
const COMMON: [&str; 3] = ["type", "update_rate", "is_async"];

/// Returns true if nodes of other kinds have a parameter `key`, too.
pub(super) fn is_common(key: &str) -> bool {
    COMMON.contains(&key)
}

fn is_true(value: &Value) -> bool {
    value.flag() == Some(true)
}

fn is_text(value: &Value, text: &str) -> bool {
    matches!(value, Value::Text(found) if found == text)
}

/// Returns true if `value` is a list of names, each one of `names`.
fn are_among(value: &Value, names: &[&str]) -> bool {
    match value {
        Value::TextList(list) => !list.is_empty() && list.iter().all(|name| names.contains(&name.as_str())),
        _ => false,
    }
}

/// Returns the parameter or group of the controller to which `key` belongs.
pub(super) fn find(key: &str) -> Option<&'static ControllerParameter> {
    PARAMETERS.iter().find(|known| match known.key.ends_with('.') {
        true => key.starts_with(known.key),
        false => key == known.key,
    })
}

impl ControllerParameter {
    /// Returns true if the parameter is one of a group.
    pub fn is_group(&self) -> bool {
        self.key.ends_with('.')
    }

    /// Rejects a value that does not describe this node.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] with the value that does.
    pub fn check(&self, key: &str, value: &Value, at: &ValueSource) -> Result<(), ConfigError> {
        match (self.describes_node)(value) {
            true => Ok(()),
            false => Err(ConfigError::not_allowed(at, key, &value.rounded(), self.allowed)),
        }
    }
}

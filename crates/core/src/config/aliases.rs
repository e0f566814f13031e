//! Parameter names of ros2_controllers' joint_trajectory_controller, accepted beside those of the schema.
//!
//! | alias | parameter |
//! |---|---|
//! | `constraints.JOINT.trajectory`, m or rad | `JOINT.tolerances.path_mm` or `path_deg` |
//! | `constraints.JOINT.goal`, m or rad | `JOINT.tolerances.goal_mm` or `goal_deg` |
//! | `constraints.goal_time`, s | `goal_time_tolerance` |
//! | `constraints.stopped_velocity_tolerance`, m/s or rad/s | `stopped_velocity_tolerance` |
//! | `command_interfaces`, `state_interfaces`, `allow_partial_joints_goal` and others | none: the value must describe this node |

use super::check::Entries;
use super::error::{ConfigError, ValueSource};
use super::machine::AxisKind;
use super::value::Value;
use crate::text::shortened;
use crate::units::{DEGREE, MILLIMETER};

/// First part of the aliases.
const GROUP: &str = "constraints.";

/// Parameter of the controller that this node cannot change: it is accepted with the value that describes this node.
struct FixedParameter {
    key: &'static str,
    describes_node: fn(&Value) -> bool,
    /// Rule for the value, to follow "must".
    allowed: &'static str,
}

/// Fixed parameters of the controller.
const FIXED: &[FixedParameter] = &[
    FixedParameter {
        key: "command_interfaces",
        describes_node: |value| are_among(value, &["position"]),
        allowed: "be [position]: setpoints are positions",
    },
    FixedParameter {
        key: "state_interfaces",
        describes_node: |value| are_among(value, &["position", "velocity"]),
        allowed: "be [position] or [position, velocity], the states of the axes",
    },
    FixedParameter {
        key: "allow_partial_joints_goal",
        describes_node: |value| *value == Value::Bool(true),
        allowed: "be true: axes that a trajectory does not name continue",
    },
    FixedParameter {
        key: "interpolate_from_desired_state",
        describes_node: |value| *value == Value::Bool(true),
        allowed: "be true: trajectories begin at the commanded state",
    },
    FixedParameter {
        key: "allow_integration_in_goal_trajectories",
        describes_node: |value| *value == Value::Bool(false),
        allowed: "be false: every point of a trajectory has positions",
    },
];

/// Returns true if `value` is a list of names, each one of `names`.
fn are_among(value: &Value, names: &[&str]) -> bool {
    match value {
        Value::TextList(list) => !list.is_empty() && list.iter().all(|name| names.contains(&name.as_str())),
        _ => false,
    }
}

/// Parameter that an alias names.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterAlias {
    /// Full key of the parameter.
    pub key: String,
    /// Unit of the alias.
    pub unit: &'static str,
    /// Value of the parameter for an alias of 1.
    pub(super) factor: f64,
}

impl ParameterAlias {
    /// Returns the value of the alias for a value of the parameter.
    pub(super) fn alias_value(&self, value: Value) -> Value {
        match value {
            Value::Double(number) => Value::Double(number / self.factor),
            other => other,
        }
    }

    /// Returns the value of the parameter for a value of the alias.
    pub(super) fn parameter_value(&self, value: Value) -> Value {
        match value {
            Value::Double(number) => Value::Double(number * self.factor),
            Value::Integer(number) => Value::Double(number as f64 * self.factor),
            other => other,
        }
    }
}

/// Returns true if `key` has the form of an alias.
pub(super) fn is_alias(key: &str) -> bool {
    key.starts_with(GROUP)
}

/// Returns true if `key` is a fixed parameter of the controller with a value that describes this node.
///
/// # Errors
///
/// [`ConfigError::NotAllowed`] for another value.
pub(super) fn describes_node(key: &str, value: &Value, at: &ValueSource) -> Result<bool, ConfigError> {
    let Some(fixed) = FIXED.iter().find(|fixed| fixed.key == key) else { return Ok(false) };
    if (fixed.describes_node)(value) {
        return Ok(true);
    }
    Err(ConfigError::NotAllowed {
        at: at.clone(),
        key: key.to_owned(),
        value: value.rounded(),
        allowed: fixed.allowed.to_owned(),
    })
}

/// Returns the parameter that the alias `key` names; `axis` returns the type of the axis of a joint.
pub(super) fn find(key: &str, axis: impl Fn(&str) -> Option<AxisKind>) -> Option<ParameterAlias> {
    let rest = key.strip_prefix(GROUP)?;
    let plain = |key: &str, unit| Some(ParameterAlias { key: key.to_owned(), unit, factor: 1.0 });
    match rest {
        "goal_time" => return plain("goal_time_tolerance", "s"),
        "stopped_velocity_tolerance" => return plain(rest, "m/s or rad/s"),
        _ => {}
    }
    let (joint, quantity) = rest.rsplit_once('.')?;
    let name = match quantity {
        "trajectory" => "path",
        "goal" => "goal",
        _ => return None,
    };
    let (suffix, unit, one) = match axis(joint)? {
        AxisKind::Linear => ("mm", "m", MILLIMETER),
        AxisKind::Rotary => ("deg", "rad", DEGREE),
    };
    Some(ParameterAlias { key: format!("{joint}.tolerances.{name}_{suffix}"), unit, factor: 1.0 / one })
}

/// Returns the parameter and its value for the value of an alias on a machine with the parameters `entries`.
///
/// # Errors
///
/// [`ConfigError::NotApplicable`] for a name that is no alias or contains an unknown joint, [`ConfigError::WrongType`] and
/// [`ConfigError::NotAllowed`] for a value that is no number of at least 0.
pub(super) fn resolve(
    key: &str,
    value: &Value,
    at: &ValueSource,
    entries: &Entries,
) -> Result<(String, Value), ConfigError> {
    let prefix = match entries.get("joint_prefix").map(|entry| &entry.value) {
        Some(Value::Text(prefix)) => prefix.as_str(),
        _ => "",
    };
    let plain = without_prefix(key, prefix);
    let axis = |joint: &str| match &entries.get(&format!("{joint}.type"))?.value {
        Value::Text(kind) if kind == "rotary" => Some(AxisKind::Rotary),
        _ => Some(AxisKind::Linear),
    };
    let Some(alias) = find(&plain, axis) else {
        return Err(ConfigError::NotApplicable {
            at: at.clone(),
            key: shortened(key),
            reason: format!(
                "use {GROUP}goal_time, {GROUP}stopped_velocity_tolerance, or {GROUP}JOINT.trajectory and \
                 {GROUP}JOINT.goal with a joint of this machine"
            ),
        });
    };
    match value {
        Value::Double(number) if !(*number >= 0.0 && number.is_finite()) => {}
        Value::Integer(number) if *number < 0 => {}
        Value::Double(_) | Value::Integer(_) => {
            return Ok((alias.key.clone(), alias.parameter_value(value.clone())));
        }
        other => {
            return Err(ConfigError::WrongType {
                at: at.clone(),
                key: shortened(key),
                found: other.described(),
                wanted: "number".to_owned(),
            });
        }
    }
    Err(ConfigError::NotAllowed {
        at: at.clone(),
        key: shortened(key),
        value: value.rounded(),
        allowed: format!("be 0 (no tolerance) or a positive number of {}", alias.unit),
    })
}

/// Returns the alias `key` with its joint name without `prefix`.
pub(super) fn without_prefix(key: &str, prefix: &str) -> String {
    match key.strip_prefix(GROUP).and_then(|rest| rest.strip_prefix(prefix)) {
        Some(rest) => format!("{GROUP}{rest}"),
        None => key.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use crate::config::{Parameters, Value, ValueSource};

    fn set(parameters: &mut Parameters, text: &str) -> Result<(), String> {
        parameters.set_text(text, &ValueSource::named("-p")).map_err(|error| error.to_string())
    }

    #[test]
    fn an_alias_sets_and_returns_the_parameter_in_si() {
        let mut parameters = Parameters::embedded_default().expect("valid");
        for text in [
            "constraints.x.trajectory:=0.002",
            "constraints.c.goal:=0.5",
            "constraints.goal_time:=2",
            "constraints.stopped_velocity_tolerance:=0.01",
        ] {
            set(&mut parameters, text).expect("valid");
        }
        let number = |key: &str| match parameters.get(key) {
            Some(Value::Double(value)) => value,
            other => panic!("{key} is {other:?}"),
        };
        assert!((number("x.tolerances.path_mm") - 2.0).abs() < 1e-12);
        assert!((number("c.tolerances.goal_deg") - 0.5_f64.to_degrees()).abs() < 1e-12);
        assert_eq!(number("goal_time_tolerance"), 2.0);
        assert!((number("constraints.c.goal") - 0.5).abs() < 1e-15);
        let defaults = parameters.goal_defaults();
        assert!((defaults.path[0].expect("set") - 0.002).abs() < 1e-15);
        assert_eq!(defaults.stopped_velocity, Some(0.01));
        assert!(parameters.definition("constraints.c.goal").is_some_and(|definition| definition.is_live));
    }

    #[test]
    fn the_joint_may_have_its_prefix() {
        let mut parameters = Parameters::embedded_default().expect("valid");
        set(&mut parameters, "joint_prefix:=left_").expect("valid");
        set(&mut parameters, "constraints.left_y.goal:=0.001").expect("valid");
        assert_eq!(parameters.get("y.tolerances.goal_mm"), Some(Value::Double(1.0)));
        assert_eq!(parameters.get("constraints.left_y.goal"), Some(Value::Double(0.001)));
    }

    #[test]
    fn invalid_aliases_are_rejected_with_name_and_value() {
        let mut parameters = Parameters::embedded_default().expect("valid");
        for (text, words) in [
            ("constraints.q.goal:=0.1", "constraints.q.goal"),
            ("constraints.x.velocity:=0.1", "constraints.x.velocity"),
            ("constraints.x.goal:=-1.0", "constraints.x.goal = -1"),
            ("constraints.goal_time:=often", "constraints.goal_time"),
        ] {
            let error = set(&mut parameters, text).expect_err("must be rejected");
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_parameter_file_of_the_controller_is_accepted() {
        let defaults = Parameters::embedded_default().expect("valid");
        let mut parameters = defaults.clone();
        let text = "joint_trajectory_controller:\n  ros__parameters:\n    joints: [x, y, z, a, c]\n    \
                    command_interfaces: [position]\n    state_interfaces: [position, velocity]\n    \
                    allow_partial_joints_goal: true\n    interpolate_from_desired_state: true\n    \
                    allow_integration_in_goal_trajectories: false\n    constraints:\n      x: {goal: 0.002}\n";
        let report = parameters
            .overlay_yaml(text, "jtc.yaml", Some("/joint_trajectory_controller"))
            .expect("describes this node");
        assert!(!report.is_machine_replaced);
        assert_eq!(parameters.get("x.tolerances.goal_mm"), Some(Value::Double(2.0)));
        assert_eq!(parameters.machine_config().expect("valid"), defaults.machine_config().expect("valid"));

        for (text, words) in [
            ("command_interfaces:=[velocity]", "command_interfaces = [velocity]: must be [position]"),
            ("state_interfaces:=[position, effort]", "must be [position] or [position, velocity]"),
            ("state_interfaces:=[]", "state_interfaces"),
            ("allow_partial_joints_goal:=false", "allow_partial_joints_goal = false: must be true"),
            ("interpolate_from_desired_state:=1", "interpolate_from_desired_state = 1: must be true"),
            ("allow_integration_in_goal_trajectories:=true", "must be false"),
        ] {
            let error = set(&mut parameters, text).expect_err(text);
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn joints_without_their_types_must_be_those_of_the_machine() {
        let mut parameters = Parameters::embedded_default().expect("valid");
        let text = "/**:\n  ros__parameters:\n    joints: [x, q]\n    constraints:\n      x: {goal: 0.01}\n";
        let error = parameters.overlay_yaml(text, "jtc.yaml", None).expect_err("q has no type").to_string();
        assert!(error.contains("q.type") && error.contains("must be a complete machine"), "{error}");
    }

    #[test]
    fn a_parameter_file_may_nest_the_aliases() {
        let mut parameters = Parameters::embedded_default().expect("valid");
        let text =
            "/**:\n  ros__parameters:\n    constraints:\n      goal_time: 1.5\n      a: {goal: 0.01}\n";
        parameters.overlay_yaml(text, "jtc.yaml", None).expect("valid");
        assert_eq!(parameters.get("constraints.goal_time"), Some(Value::Double(1.5)));
        assert!(parameters.goal_defaults().goal[3].is_some());
    }
}

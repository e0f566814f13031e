//! Parameter names of ros2_controllers' joint_trajectory_controller, accepted beside those of the schema.
//!
//! | alias | parameter |
//! |---|---|
//! | `constraints.JOINT.trajectory`, m or rad | `JOINT.tolerances.path_mm` or `path_deg` |
//! | `constraints.JOINT.goal`, m or rad | `JOINT.tolerances.goal_mm` or `goal_deg` |
//! | `constraints.goal_time`, s | `goal_time_tolerance` |
//! | `constraints.stopped_velocity_tolerance`, m/s or rad/s | `stopped_velocity_tolerance` |
//!
//! Those without a parameter are in [`controller`](super::controller).

use super::controller;
use super::declaration::Entries;
use super::definition::AxisKind;
use super::error::{ConfigError, ValueSource};
use super::value::Value;
use crate::units::{DEGREE, MILLIMETER};

/// First part of the aliases.
const GROUP: &str = "constraints.";

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
    key.starts_with(GROUP) && controller::find(key).is_none()
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
/// [`ConfigError`] for a name that is no alias or contains an unknown joint, and for a value that is no number of at least 0.
pub(super) fn resolve(
    key: &str,
    value: &Value,
    at: &ValueSource,
    entries: &Entries,
) -> Result<(String, Value), ConfigError> {
    let plain = without_prefix(key, joint_prefix(entries));
    let axis = |joint: &str| match &entries.get(&format!("{joint}.type"))?.value {
        Value::Text(kind) if kind == "rotary" => Some(AxisKind::Rotary),
        _ => Some(AxisKind::Linear),
    };
    let Some(alias) = find(&plain, axis) else {
        let reason = format!(
            "use {GROUP}goal_time, {GROUP}stopped_velocity_tolerance, or {GROUP}JOINT.trajectory and \
             {GROUP}JOINT.goal with a joint of this machine"
        );
        return Err(ConfigError::not_applicable(at, key, &reason));
    };
    match value {
        Value::Double(number) if !(*number >= 0.0 && number.is_finite()) => {}
        Value::Integer(number) if *number < 0 => {}
        Value::Double(_) | Value::Integer(_) => {
            return Ok((alias.key.clone(), alias.parameter_value(value.clone())));
        }
        other => return Err(ConfigError::wrong_type(at, key, &other.described(), "number")),
    }
    let allowed = format!("be 0 (no tolerance) or a positive number of {}", alias.unit);
    Err(ConfigError::not_allowed(at, key, &value.rounded(), &allowed))
}

/// Returns the prefix of joint names in messages.
pub(super) fn joint_prefix(entries: &Entries) -> &str {
    match entries.get("joint_prefix").map(|entry| &entry.value) {
        Some(Value::Text(prefix)) => prefix,
        _ => "",
    }
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
        let defaults = parameters.node_config().goals;
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
        assert!(parameters.node_config().goals.goal[3].is_some());
    }
}

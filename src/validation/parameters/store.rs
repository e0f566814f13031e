//! Parameter store of the node: present values, descriptors, validation of changes at run time.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::types::{ParameterDescriptor, ParameterRange, ParameterType, ParameterValue};
use virtual_axes_core::config::{
    Assignment, GoalDefaults, ParameterDefinition, ParameterKind, Parameters, Value, ValueSource,
};
use virtual_axes_core::machine::MachineParameters;
use virtual_axes_core::text::shortened;

/// Largest number of parameters in one set request. A machine has a few hundred parameters, and each
/// parameter set alone requires a validation of the whole machine.
const MAX_CHANGES: usize = 1000;

/// Rejects a request with too many parameters.
///
/// # Errors
/// Text with the number found and the largest number.
pub fn check_count(found: usize) -> Result<(), String> {
    if found <= MAX_CHANGES {
        return Ok(());
    }
    Err(format!("{found} parameters in one request; at most {MAX_CHANGES} are allowed"))
}

/// Node parameters that can be set at run time and are read by other tasks.
#[derive(Debug, Default)]
pub struct LiveNodeParameters {
    /// Parameter `allow_nonzero_velocity_at_trajectory_end`.
    pub allow_nonzero_end_velocity: AtomicBool,
    goal_defaults: Mutex<Arc<GoalDefaults>>,
}

impl LiveNodeParameters {
    /// Returns the default path and goal tolerances of action goals.
    pub fn goal_defaults(&self) -> Arc<GoalDefaults> {
        Arc::clone(&self.goal_defaults.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Store of the parameter values served by the parameter services.
#[derive(Debug)]
pub struct ParameterStore {
    parameters: Parameters,
    live: Arc<LiveNodeParameters>,
}

impl ParameterStore {
    /// Creates a store of `parameters`; `live` receives the values read by other tasks.
    pub fn new(parameters: Parameters, live: Arc<LiveNodeParameters>) -> Self {
        let store = ParameterStore { parameters, live };
        store.update_live();
        store
    }

    fn update_live(&self) {
        let node = self.parameters.node_config();
        let allow = node.allow_nonzero_velocity_at_trajectory_end;
        self.live.allow_nonzero_end_velocity.store(allow, Ordering::Relaxed);
        *self.live.goal_defaults.lock().unwrap_or_else(PoisonError::into_inner) = Arc::new(node.goals);
    }

    /// Returns the present values.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Returns the names of the parameters with a value, in the order of the schema. The others are not declared until they
    /// are set, so that a dump of the parameters can be loaded.
    pub fn names(&self) -> Vec<String> {
        self.parameters.iter().map(|(name, _)| name).collect()
    }

    /// Returns the present value of a parameter; `None` if it is unknown.
    pub fn get(&self, name: &str) -> Option<ParameterValue> {
        self.parameters.get(name).map(to_ros)
    }

    /// Returns the descriptor of a parameter or an alias; `None` if it is unknown.
    pub fn describe(&self, name: &str) -> Option<ParameterDescriptor> {
        let descriptor = self.parameters.definition(name).map(descriptor)?;
        Some(match self.parameters.alias(name) {
            None => descriptor,
            Some(alias) => ParameterDescriptor {
                description: format!(
                    "Name of {} in joint_trajectory_controller. Unit: {}.",
                    alias.key, alias.unit
                ),
                range: Some(ParameterRange::Double { from: 0.0, to: f64::MAX, step: 0.0 }),
                ..descriptor
            },
        })
    }

    /// Validates `changes` of a running node and returns the changed values and the resulting machine, without
    /// applying them.
    ///
    /// # Errors
    /// Text with name, value and allowed values of the first invalid change, or of a parameter that is not live and would
    /// change.
    pub fn check(
        &self,
        changes: Vec<(String, ParameterValue)>,
    ) -> Result<(Parameters, MachineParameters), String> {
        let is_fixed = |key: &str| self.parameters.definition(key).is_some_and(|d| !d.is_live);
        // The present value is accepted, as in a file of `ros2 param dump`.
        let changed = |(key, value): &&(String, ParameterValue)| self.get(key).as_ref() != Some(value);
        if let Some((key, _)) = changes.iter().filter(changed).find(|(key, _)| is_fixed(key)) {
            return Err(format!(
                "{key} cannot be set while the node runs; set it at the start with -p or --params-file"
            ));
        }
        self.check_all(changes)
    }

    /// Validates `changes` of a node that is not configured, without applying them.
    ///
    /// # Errors
    /// Text with name, value and allowed values of the first invalid change.
    pub fn check_all(
        &self,
        changes: Vec<(String, ParameterValue)>,
    ) -> Result<(Parameters, MachineParameters), String> {
        let source = ValueSource::named("parameter");
        let mut assignments = Vec::with_capacity(changes.len());
        for (key, value) in changes {
            let value = from_ros(value).ok_or_else(|| {
                format!("{}: type is an empty list or byte array; neither is supported", shortened(&key))
            })?;
            // In a file `yes` is a flag; here it is a text.
            let is_flag = self.parameters.definition(&key).is_some_and(|d| d.kind == ParameterKind::Flag);
            if let (true, Value::Text(text)) = (is_flag, &value) {
                return Err(format!("{key}: found text \"{}\", expected true or false", shortened(text)));
            }
            assignments.push(Assignment { key, value, source: source.clone() });
        }
        let mut changed = self.parameters.clone();
        changed.set_all(assignments).map_err(|error| error.to_string())?;
        let config = changed.machine_config().map_err(|error| error.to_string())?;
        let machine = MachineParameters::new(&config).map_err(|error| error.to_string())?;
        Ok((changed, machine))
    }

    /// Replaces the present values by `changed`, a result of [`check`](Self::check).
    pub fn replace(&mut self, changed: Parameters) {
        self.parameters = changed;
        self.update_live();
    }
}

fn to_ros(value: Value) -> ParameterValue {
    match value {
        Value::Bool(v) => ParameterValue::Bool(v),
        Value::Integer(v) => ParameterValue::Integer(v),
        Value::Double(v) => ParameterValue::Double(v),
        Value::Text(v) => ParameterValue::String(v),
        Value::BoolList(v) => ParameterValue::BoolArray(v),
        Value::IntegerList(v) => ParameterValue::IntegerArray(v),
        Value::DoubleList(v) => ParameterValue::DoubleArray(v),
        Value::TextList(v) => ParameterValue::StringArray(v),
    }
}

fn from_ros(value: ParameterValue) -> Option<Value> {
    Some(match value {
        ParameterValue::Bool(v) => Value::Bool(v),
        ParameterValue::Integer(v) => Value::Integer(v),
        ParameterValue::Double(v) => Value::Double(v),
        ParameterValue::String(v) => Value::Text(v),
        ParameterValue::BoolArray(v) => Value::BoolList(v),
        ParameterValue::IntegerArray(v) => Value::IntegerList(v),
        ParameterValue::DoubleArray(v) => Value::DoubleList(v),
        ParameterValue::StringArray(v) => Value::TextList(v),
        ParameterValue::ByteArray(_) => return None,
    })
}

fn descriptor(definition: &ParameterDefinition) -> ParameterDescriptor {
    let (kind, range) = match definition.kind {
        ParameterKind::Number { min, max } => {
            (ParameterType::Double, Some(ParameterRange::Double { from: min, to: max, step: 0.0 }))
        }
        ParameterKind::Integer { min, max } => {
            (ParameterType::Integer, Some(ParameterRange::Integer { from: min, to: max, step: 0 }))
        }
        ParameterKind::Flag => (ParameterType::Bool, None),
        ParameterKind::Text | ParameterKind::Choice(_) => (ParameterType::String, None),
        ParameterKind::TextList => (ParameterType::StringArray, None),
        ParameterKind::NumberList { .. } => (ParameterType::DoubleArray, None),
    };
    let description = if definition.unit.is_empty() {
        definition.description.to_owned()
    } else {
        format!("{} Unit: {}.", definition.description, definition.unit)
    };
    let constraints = match definition.kind {
        ParameterKind::Choice(_) | ParameterKind::NumberList { .. } => {
            format!("must {}", definition.allowed())
        }
        _ => String::new(),
    };
    ParameterDescriptor {
        kind,
        description,
        additional_constraints: constraints,
        read_only: !definition.is_live,
        dynamic_typing: false,
        range,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn store() -> ParameterStore {
        ParameterStore::new(Parameters::embedded_default().expect("default machine"), Arc::default())
    }

    #[test]
    fn a_long_name_is_truncated_in_the_rejection() {
        for value in [ParameterValue::ByteArray(vec![1]), ParameterValue::Integer(1)] {
            let reason = store().check(vec![("k\n".repeat(100_000), value)]).map(|_| ()).unwrap_err();
            assert!(reason.len() < 1000 && !reason.contains('\n'), "{} bytes", reason.len());
        }
    }

    #[test]
    fn a_text_is_no_flag() {
        let set = |value| store().check(vec![("use_sim_time".to_owned(), value)]).map(|_| ());
        let reason = set(ParameterValue::String("yes".to_owned())).unwrap_err();
        assert_eq!(reason, "use_sim_time: found text \"yes\", expected true or false");
        assert_eq!(set(ParameterValue::Bool(true)), Ok(()));
    }

    /// Each parameter requires a validation of the whole machine, which delays other requests.
    #[test]
    fn requests_with_too_many_parameters_are_rejected_before_validation() {
        assert!(store().names().len() < MAX_CHANGES);
        assert_eq!(check_count(MAX_CHANGES), Ok(()));
        assert!(check_count(MAX_CHANGES + 1).unwrap_err().contains("1001"));
    }
}

//! The schema's parameters as the parameter services see them, and what setting them makes.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::types::{Descriptor, ParameterType, ParameterValue, Range};
use virtual_axes_core::config::{
    Assignment, Definition, GoalDefaults, Kind, Parameters, Source, Value, shortened,
};
use virtual_axes_core::machine::MachineParameters;

/// Most parameters of one request to set; a machine has a few hundred, and each set alone is checked with
/// the whole machine.
const MOST_CHANGES: usize = 1000;

/// Refuses a request to set more parameters than there can be.
///
/// # Errors
/// A sentence with the number found and what is allowed.
pub fn check_count(found: usize) -> Result<(), String> {
    if found <= MOST_CHANGES {
        return Ok(());
    }
    Err(format!("{found} parameters in one request; {MOST_CHANGES} are allowed"))
}

/// Node parameters that other tasks read while they can be set.
#[derive(Debug, Default)]
pub struct LiveNodeParameters {
    /// `allow_nonzero_velocity_at_trajectory_end`.
    pub allow_nonzero_end_velocity: AtomicBool,
    goal_defaults: Mutex<Arc<GoalDefaults>>,
}

impl LiveNodeParameters {
    /// Tolerances of action goals that name none themselves.
    pub fn goal_defaults(&self) -> Arc<GoalDefaults> {
        Arc::clone(&self.goal_defaults.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Parameters that can be asked for and set.
#[derive(Debug)]
pub struct Settings {
    parameters: Parameters,
    live: Arc<LiveNodeParameters>,
}

impl Settings {
    /// Those of `parameters`; what other tasks read of them is in `live`.
    pub fn new(parameters: Parameters, live: Arc<LiveNodeParameters>) -> Self {
        let settings = Settings { parameters, live };
        settings.update_live();
        settings
    }

    fn update_live(&self) {
        let allow = self.parameters.node_config().allow_nonzero_velocity_at_trajectory_end;
        self.live.allow_nonzero_end_velocity.store(allow, Ordering::Relaxed);
        let defaults = Arc::new(self.parameters.goal_defaults());
        *self.live.goal_defaults.lock().unwrap_or_else(PoisonError::into_inner) = defaults;
    }

    /// The present values.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// All names, in the order of the schema.
    pub fn names(&self) -> Vec<String> {
        self.parameters.definitions().map(|(name, _)| name).collect()
    }

    /// The present value of a parameter, if there is such a one.
    pub fn get(&self, name: &str) -> Option<ParameterValue> {
        self.parameters.get(name).map(to_ros)
    }

    /// The description of a parameter, if there is such a one.
    pub fn describe(&self, name: &str) -> Option<Descriptor> {
        self.parameters.definition(name).map(descriptor)
    }

    /// The values after all of `changes`, and the machine that they make; nothing is changed here.
    ///
    /// # Errors
    /// Why they cannot be made, in a sentence: name, value, what is allowed.
    pub fn check(
        &self,
        changes: Vec<(String, ParameterValue)>,
    ) -> Result<(Parameters, MachineParameters), String> {
        let source = Source::named("parameter");
        let mut assignments = Vec::with_capacity(changes.len());
        for (key, value) in changes {
            if self.parameters.definition(&key).is_some_and(|d| !d.live) {
                return Err(format!(
                    "{key} cannot be set while the node runs; set it at the start, with -p or --params-file"
                ));
            }
            let value = from_ros(value).ok_or_else(|| {
                format!("{}: empty lists and byte arrays are not parameters here", shortened(&key))
            })?;
            assignments.push(Assignment { key, value, source: source.clone() });
        }
        let mut changed = self.parameters.clone();
        changed.set_all(assignments).map_err(|error| error.to_string())?;
        let config = changed.machine_config().map_err(|error| error.to_string())?;
        let machine = MachineParameters::new(&config).map_err(|error| error.to_string())?;
        Ok((changed, machine))
    }

    /// Makes `changed`, which [`check`](Self::check) has given, the present values.
    pub fn adopt(&mut self, changed: Parameters) {
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

fn descriptor(definition: &Definition) -> Descriptor {
    let (kind, range) = match definition.kind {
        Kind::Number { min, max } => {
            (ParameterType::Double, Some(Range::Double { from: min, to: max, step: 0.0 }))
        }
        Kind::Integer { min, max } => {
            (ParameterType::Integer, Some(Range::Integer { from: min, to: max, step: 0 }))
        }
        Kind::Flag => (ParameterType::Bool, None),
        Kind::Text | Kind::Choice(_) => (ParameterType::String, None),
        Kind::TextList => (ParameterType::StringArray, None),
        Kind::NumberList { .. } => (ParameterType::DoubleArray, None),
    };
    let description = if definition.unit.is_empty() {
        definition.description.to_owned()
    } else {
        format!("{} Unit: {}.", definition.description, definition.unit)
    };
    let constraints = match definition.kind {
        Kind::Choice(_) | Kind::NumberList { .. } => format!("must {}", definition.allowed()),
        _ => String::new(),
    };
    Descriptor {
        kind,
        description,
        additional_constraints: constraints,
        read_only: !definition.live,
        dynamic_typing: false,
        range,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings::new(Parameters::embedded_default().expect("shipped"), Arc::default())
    }

    #[test]
    fn a_name_without_end_does_not_come_back_in_the_refusal() {
        for value in [ParameterValue::ByteArray(vec![1]), ParameterValue::Integer(1)] {
            let reason = settings().check(vec![("k\n".repeat(100_000), value)]).map(|_| ()).unwrap_err();
            assert!(reason.len() < 1000 && !reason.contains('\n'), "{} bytes", reason.len());
        }
    }

    /// Each of them would be checked with the whole machine, and nobody else be answered meanwhile.
    #[test]
    fn more_parameters_in_a_request_than_there_can_be_are_refused_before_they_are_checked() {
        assert!(settings().names().len() < MOST_CHANGES);
        assert_eq!(check_count(MOST_CHANGES), Ok(()));
        assert!(check_count(MOST_CHANGES + 1).unwrap_err().contains("1001"));
    }
}

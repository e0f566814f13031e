//! Machine with its inputs and the phase of the co-simulation.

use std::sync::Arc;

use virtual_axes_core::config::{Assignment, Parameters, Value, ValueSource, parse_assignment};
use virtual_axes_core::machine::{AxisSample, Machine, MachineParameters, check_input};
use virtual_axes_core::units::Rounded;

use crate::signals::SignalReader;
use crate::variables::{Causality, FmuType, FmuVariable, FmuVariables, VariableRole, text_value};

/// Longest step, s.
const LONGEST_STEP_S: f64 = 1000.0;
/// Largest deviation of a step from a multiple of the current cycle, ns: rounding of the importer's time.
const STEP_TOLERANCE_NS: f64 = 1.0;

virtual_axes_core::named_values! {
    /// Phase of a co-simulation in the order of FMI 2.0.
    pub(crate) enum Phase {
        Instantiated = "instantiated",
        Initialization = "initialization mode",
        Stepping = "step complete",
        Terminated = "terminated",
        /// After an error of this library, until a reset or a saved state.
        Broken = "error of the library",
    }
}

impl Phase {
    fn is_before_steps(self) -> bool {
        matches!(self, Phase::Instantiated | Phase::Initialization)
    }
}

/// Machine with its inputs and the phase of the co-simulation.
#[derive(Clone)]
pub(crate) struct Slave {
    pub phase: Phase,
    pub parameters: Parameters,
    pub machine: Machine,
    /// True if the machine still has other parameters or another start position.
    pub is_changed: bool,
    pub psec: Vec<f64>,
    pub loads: Vec<f64>,
    /// Future setpoints, axis by axis.
    pub preview: Vec<f64>,
    pub uses_preview: bool,
    pub start_positions: Vec<f64>,
    pub start_time: f64,
    /// Last time that a step may end at, s; the largest number without one.
    pub stop_time: f64,
}

pub(crate) fn discretized(parameters: &Parameters) -> Result<Arc<MachineParameters>, String> {
    let config = parameters.machine_config().map_err(|error| error.to_string())?;
    MachineParameters::new(&config).map(Arc::new).map_err(|error| error.to_string())
}

impl Slave {
    pub fn new(parameters: Parameters, variables: &FmuVariables) -> Result<Self, String> {
        let machine = Machine::new(discretized(&parameters)?);
        let axes = machine.axis_count();
        Ok(Slave {
            phase: Phase::Instantiated,
            parameters,
            machine,
            is_changed: false,
            psec: vec![0.0; axes],
            loads: vec![0.0; axes],
            preview: vec![0.0; axes * variables.preview_length()],
            uses_preview: false,
            start_positions: vec![0.0; axes],
            start_time: 0.0,
            stop_time: f64::MAX,
        })
    }

    /// Requires one of `phases`.
    pub fn require(&self, phases: &[Phase]) -> Result<(), String> {
        if phases.contains(&self.phase) {
            return Ok(());
        }
        let allowed: Vec<&str> = phases.iter().map(|phase| phase.name()).collect();
        let found = self.phase.name();
        Err(format!("the state of the instance is \"{found}\"; allowed: {}", allowed.join(", ")))
    }

    /// Passes changed parameters to the machine.
    pub fn apply(&mut self) -> Result<(), String> {
        if !self.is_changed {
            return Ok(());
        }
        let parameters = discretized(&self.parameters)?;
        if self.phase.is_before_steps() {
            self.machine = Machine::new(parameters);
            self.machine.reset(&self.start_positions);
        } else {
            self.machine.update_parameters(parameters).map_err(|error| error.to_string())?;
        }
        self.is_changed = false;
        Ok(())
    }

    /// Returns the time that the next step begins at, s.
    pub fn time(&self) -> f64 {
        self.start_time + self.machine.time() as f64 / 1e9
    }

    /// Advances by a step; `point` is its begin, s.
    pub fn step(&mut self, point: f64, step: f64) -> Result<(), String> {
        self.require(&[Phase::Stepping])?;
        let period = self.machine.periods().current as f64;
        let ticks = (step * 1e9 / period).round();
        let deviation = (step * 1e9 - ticks * period).abs();
        // NaN is not allowed either.
        if !(ticks >= 1.0 && deviation <= STEP_TOLERANCE_NS && step <= LONGEST_STEP_S) {
            return Err(format!(
                "communicationStepSize is {step} s; it must be a multiple of the current cycle Tsi, {} s, up to \
                 {LONGEST_STEP_S} s",
                period / 1e9
            ));
        }
        let time = self.time();
        if (time + step - self.stop_time) * 1e9 > 0.5 * period {
            return Err(format!(
                "the step from {} s by {} s ends after stopTime, {} s, of fmi2SetupExperiment; end there by \
                 fmi2Terminate",
                Rounded(time),
                Rounded(step),
                Rounded(self.stop_time)
            ));
        }
        if (point - time).abs() * 1e9 <= 0.5 * period {
            self.apply()?;
            for (axis, &load) in self.loads.iter().enumerate() {
                self.machine.set_load(axis, load);
            }
            let preview: &[f64] = if self.uses_preview { &self.preview } else { &[] };
            self.machine.advance_ticks(ticks as usize, &self.psec, preview);
            Ok(())
        } else {
            Err(format!(
                "currentCommunicationPoint is {point} s; it must be {time} s, the end of the last step"
            ))
        }
    }

    /// Returns an error unless `setting` is allowed for a variable now.
    pub fn check(&self, variable: &FmuVariable, setting: &Value) -> Result<(), String> {
        let kind = match setting {
            Value::Double(_) => FmuType::Real,
            Value::Integer(_) => FmuType::Integer,
            Value::Bool(_) => FmuType::Boolean,
            _ => FmuType::String,
        };
        let name = &variable.name;
        if variable.kind != kind {
            return Err(wrong_type(variable, kind));
        }
        match variable.causality {
            Causality::Output => return Err(format!("{name} is an output; it cannot be set")),
            Causality::FixedParameter if !self.phase.is_before_steps() => {
                return Err(format!(
                    "{name} is a fixed parameter; it can be set until the end of the initialization mode"
                ));
            }
            _ => {}
        }
        match setting {
            // The schema limits parameters.
            &Value::Double(value) if !matches!(variable.role, VariableRole::Parameter(_)) => {
                check_input(value).map_err(|error| format!("{name} is {error}"))
            }
            _ => Ok(()),
        }
    }

    /// Sets checked inputs and parameters; on error no parameter.
    pub fn set(&mut self, settings: &[(&FmuVariable, Value)]) -> Result<(), String> {
        let mut assignments = Vec::new();
        for (variable, setting) in settings {
            if let VariableRole::Parameter(key) = &variable.role {
                let value = parameter_value(key, variable, setting)?;
                if self.parameters.get(key).as_ref() != Some(&value) {
                    assignments.push(Assignment {
                        key: key.clone(),
                        value,
                        source: ValueSource::named("FMU"),
                    });
                }
            }
        }
        if !assignments.is_empty() {
            self.parameters.set_all(assignments).map_err(|error| error.to_string())?;
            self.is_changed = true;
        }
        let length = self.preview.len() / self.psec.len().max(1);
        for (variable, setting) in settings {
            match (&variable.role, setting) {
                (&VariableRole::Setpoint(axis), &Value::Double(value)) => self.psec[axis] = value,
                (&VariableRole::Load(axis), &Value::Double(value)) => self.loads[axis] = value,
                (&VariableRole::Preview { axis, cycle }, &Value::Double(value)) => {
                    self.preview[axis * length + cycle] = value;
                }
                (VariableRole::UsesPreview, &Value::Bool(value)) => self.uses_preview = value,
                (&VariableRole::StartPosition(axis), &Value::Double(value)) => {
                    self.start_positions[axis] = value;
                    self.is_changed = true;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Returns the value of a parameter or an input.
    fn value(&self, variable: &FmuVariable) -> Option<Value> {
        let length = self.preview.len() / self.psec.len().max(1);
        Some(match &variable.role {
            &VariableRole::Setpoint(axis) => Value::Double(self.psec[axis]),
            &VariableRole::Load(axis) => Value::Double(self.loads[axis]),
            &VariableRole::Preview { axis, cycle } => Value::Double(self.preview[axis * length + cycle]),
            VariableRole::UsesPreview => Value::Bool(self.uses_preview),
            &VariableRole::StartPosition(axis) => Value::Double(self.start_positions[axis]),
            VariableRole::Parameter(key) => self.parameters.get(key)?,
            VariableRole::Signal { .. } => return None,
        })
    }

    /// Writes the values of real variables.
    pub fn reals(&mut self, variables: &[&FmuVariable], values: &mut [f64]) -> Result<(), String> {
        self.apply()?;
        let mut last: Option<(usize, AxisSample)> = None;
        for (variable, out) in variables.iter().zip(values) {
            *out = match &variable.role {
                &VariableRole::Signal { axis, signal } => {
                    let sample = match last {
                        Some((known, sample)) if known == axis => sample,
                        _ => self.machine.sample_at_end(axis),
                    };
                    last = Some((axis, sample));
                    match signal.reader {
                        SignalReader::Real(_, read) => read(&sample),
                        SignalReader::Boolean(_) => return Err(wrong_type(variable, FmuType::Real)),
                    }
                }
                _ => match self.value(variable) {
                    Some(Value::Double(value)) => value,
                    _ => return Err(wrong_type(variable, FmuType::Real)),
                },
            };
        }
        Ok(())
    }

    /// Returns the value of an integer variable.
    pub fn integer(&self, variable: &FmuVariable) -> Result<i32, String> {
        match self.value(variable) {
            Some(Value::Integer(value)) => i32::try_from(value)
                .map_err(|_| format!("{} is {value}, beyond the range of fmi2Integer", variable.name)),
            _ => Err(wrong_type(variable, FmuType::Integer)),
        }
    }

    /// Returns the value of a boolean variable.
    pub fn boolean(&mut self, variable: &FmuVariable) -> Result<bool, String> {
        if let &VariableRole::Signal { axis, signal } = &variable.role
            && let SignalReader::Boolean(read) = signal.reader
        {
            self.apply()?;
            return Ok(read(&self.machine.sample_at_end(axis)));
        }
        match self.value(variable) {
            Some(Value::Bool(value)) => Ok(value),
            _ => Err(wrong_type(variable, FmuType::Boolean)),
        }
    }

    /// Returns the value of a text variable.
    pub fn text(&self, variable: &FmuVariable) -> Result<String, String> {
        match self.value(variable) {
            Some(value) if variable.kind == FmuType::String => Ok(text_value(&value)),
            _ => Err(wrong_type(variable, FmuType::String)),
        }
    }
}

fn wrong_type(variable: &FmuVariable, wanted: FmuType) -> String {
    format!("{} is of type {:?}; the call needs a variable of type {wanted:?}", variable.name, variable.kind)
}

fn parameter_value(key: &str, variable: &FmuVariable, setting: &Value) -> Result<Value, String> {
    match (setting, &variable.start) {
        (Value::Text(_), Some(Value::Text(_))) => Ok(setting.clone()),
        (Value::Text(value), _) => {
            let assignment = parse_assignment(&format!("{key}={value}"), &ValueSource::named("FMU"));
            Ok(assignment.map_err(|error| error.to_string())?.value)
        }
        _ => Ok(setting.clone()),
    }
}

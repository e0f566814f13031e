//! Variables of the FMU of a machine.

use std::sync::Arc;

use virtual_axes_core::config::{AxisKind, ParameterDefinition, ParameterKind, Parameters, Scope, Value};
use virtual_axes_core::machine::{Machine, MachineParameters};

use crate::signals::{FmuSignal, SIGNALS, SignalQuantity, SignalReader};

const SETPOINT: &str = "Position setpoint, read at the start of each position cycle.";
const LOAD: &str = "External load, positive towards plus.";
const PREVIEW: &str = "read by predictive controllers if uses_preview is true.";
const START_POSITION: &str = "Position at the start, at rest.";
const USES_PREVIEW: &str = "True if predictive controllers read the inputs preview; otherwise they take the present \
                            setpoint for the future ones.";

/// Type of a variable in FMI 2.0, by its name there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FmuType {
    /// `fmi2Real`.
    Real,
    /// `fmi2Integer`.
    Integer,
    /// `fmi2Boolean`.
    Boolean,
    /// `fmi2String`.
    String,
}

/// Causality of a variable; parameters are distinguished by their variability.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Input, read at each step.
    Input,
    /// Output at the end of a step.
    Output,
    /// Parameter that is set before the end of the initialization.
    FixedParameter,
    /// Parameter that is set at any time.
    TunableParameter,
}

/// Meaning of a variable.
#[derive(Debug, Clone)]
pub enum VariableRole {
    /// Position setpoint of an axis.
    Setpoint(usize),
    /// External load on an axis.
    Load(usize),
    /// Setpoint of an axis in a future position cycle, from 0.
    Preview {
        /// Axis.
        axis: usize,
        /// Position cycle after the next one, from 0.
        cycle: usize,
    },
    /// Boolean that selects the preview inputs.
    UsesPreview,
    /// Position of an axis at the start.
    StartPosition(usize),
    /// Output of an axis.
    Signal {
        /// Axis.
        axis: usize,
        /// Signal.
        signal: &'static FmuSignal,
    },
    /// Parameter of the schema, by its key.
    Parameter(String),
}

/// Variable of the FMU; its index in [`FmuVariables`] is its value reference.
#[derive(Debug, Clone)]
pub struct FmuVariable {
    /// Name: axis and name, or the key of a parameter.
    pub name: String,
    /// Meaning.
    pub role: VariableRole,
    /// Type.
    pub kind: FmuType,
    /// Causality.
    pub causality: Causality,
    /// Unit, empty if dimensionless.
    pub unit: &'static str,
    /// Description, one sentence.
    pub description: String,
    /// Minimum and maximum.
    pub range: Option<(String, String)>,
    /// Value at the start; none for outputs.
    pub start: Option<Value>,
}

/// Variables of the FMU of a machine.
#[derive(Debug, Clone)]
pub struct FmuVariables {
    list: Vec<FmuVariable>,
    /// Number of position cycles of the preview inputs.
    preview_length: usize,
}

impl FmuVariables {
    /// Returns the variables of a machine: inputs, outputs, then parameters, each by axis.
    ///
    /// # Errors
    /// The text of an error of the machine, such as an unstable position controller.
    pub fn new(parameters: &Parameters) -> Result<Self, String> {
        let config = parameters.machine_config().map_err(|error| error.to_string())?;
        let machine = MachineParameters::new(&config).map_err(|error| error.to_string())?;
        let preview_length = Machine::new(Arc::new(machine)).preview_length();
        let axes: Vec<AxisUnits> = config
            .axes()
            .iter()
            .map(|axis| AxisUnits::new(parameters, axis.name(), axis.kind() == AxisKind::Linear))
            .collect();
        let mut list = Vec::new();
        for (index, axis) in axes.iter().enumerate() {
            list.push(axis.input(
                VariableRole::Setpoint(index),
                "setpoint",
                SignalQuantity::Position,
                SETPOINT,
            ));
            list.push(axis.input(VariableRole::Load(index), "load", SignalQuantity::Force, LOAD));
            for cycle in 0..preview_length {
                let (role, name) =
                    (VariableRole::Preview { axis: index, cycle }, format!("preview[{}]", cycle + 1));
                let description =
                    format!("Position setpoint {} position cycles after the next one; {PREVIEW}", cycle + 1);
                list.push(axis.input(role, &name, SignalQuantity::Position, &description));
            }
        }
        for (index, axis) in axes.iter().enumerate() {
            list.extend(SIGNALS.iter().map(|signal| axis.output(index, signal)));
        }
        for (index, axis) in axes.iter().enumerate() {
            let (role, quantity) = (VariableRole::StartPosition(index), SignalQuantity::Position);
            let input = axis.input(role, "start_position", quantity, START_POSITION);
            list.push(FmuVariable { causality: Causality::FixedParameter, ..input });
        }
        if preview_length > 0 {
            list.push(FmuVariable {
                name: "uses_preview".to_owned(),
                role: VariableRole::UsesPreview,
                kind: FmuType::Boolean,
                causality: Causality::FixedParameter,
                unit: "",
                description: USES_PREVIEW.to_owned(),
                range: None,
                start: Some(Value::Bool(false)),
            });
        }
        list.extend(
            parameters.iter().filter_map(|(key, value)| parameter(&key, parameters.definition(&key)?, value)),
        );
        Ok(FmuVariables { list, preview_length })
    }

    /// Returns the variables, in the order of their value references.
    pub fn list(&self) -> &[FmuVariable] {
        &self.list
    }

    /// Returns the number of position cycles of the preview inputs.
    pub fn preview_length(&self) -> usize {
        self.preview_length
    }
}

/// Name and units of an axis.
struct AxisUnits {
    name: String,
    is_linear: bool,
    is_linear_motor: bool,
}

impl AxisUnits {
    fn new(parameters: &Parameters, name: &str, is_linear: bool) -> Self {
        let is_linear_motor = parameters.definition(&format!("{name}.motor.mass_kg")).is_some();
        AxisUnits { name: name.to_owned(), is_linear, is_linear_motor }
    }

    fn unit(&self, quantity: SignalQuantity) -> &'static str {
        match (quantity, self.is_linear, self.is_linear_motor) {
            (SignalQuantity::Position, true, _) => "m",
            (SignalQuantity::Position, false, _) => "rad",
            (SignalQuantity::Velocity, true, _) | (SignalQuantity::MotorSpeed, _, true) => "m/s",
            (SignalQuantity::Velocity, false, _) | (SignalQuantity::MotorSpeed, _, false) => "rad/s",
            (SignalQuantity::Force, true, _) | (SignalQuantity::MotorTorque, _, true) => "N",
            (SignalQuantity::Force, false, _) | (SignalQuantity::MotorTorque, _, false) => "N·m",
            (SignalQuantity::Current, ..) => "A",
            (SignalQuantity::Voltage, ..) => "V",
        }
    }

    fn input(
        &self,
        role: VariableRole,
        name: &str,
        quantity: SignalQuantity,
        description: &str,
    ) -> FmuVariable {
        FmuVariable {
            name: format!("{}.{name}", self.name),
            role,
            kind: FmuType::Real,
            causality: Causality::Input,
            unit: self.unit(quantity),
            description: description.to_owned(),
            range: None,
            start: Some(Value::Double(0.0)),
        }
    }

    fn output(&self, axis: usize, signal: &'static FmuSignal) -> FmuVariable {
        let (kind, unit) = match signal.reader {
            SignalReader::Real(quantity, _) => (FmuType::Real, self.unit(quantity)),
            SignalReader::Boolean(_) => (FmuType::Boolean, ""),
        };
        FmuVariable {
            name: format!("{}.{}", self.name, signal.name),
            role: VariableRole::Signal { axis, signal },
            kind,
            causality: Causality::Output,
            unit,
            description: signal.description.to_owned(),
            range: None,
            start: None,
        }
    }
}

/// Returns the variable of a parameter; none if it has no effect on a machine that is stepped, or defines which parameters
/// there are.
fn parameter(key: &str, definition: &ParameterDefinition, value: Value) -> Option<FmuVariable> {
    let is_used = match definition.scope {
        Scope::Machine => definition.key.starts_with("periods."),
        Scope::Axis => {
            let is_unused = ["limits.", "tolerances."].iter().any(|group| definition.key.starts_with(group));
            !is_unused && !matches!(definition.key, "type" | "transmission.direct")
        }
        Scope::Node => false,
    };
    if !is_used {
        return None;
    }
    let (kind, range) = match definition.kind {
        ParameterKind::Number { min, max } => (FmuType::Real, Some((format!("{min:?}"), format!("{max:?}")))),
        ParameterKind::Integer { min, max } => (FmuType::Integer, Some((min.to_string(), max.to_string()))),
        ParameterKind::Flag => (FmuType::Boolean, None),
        ParameterKind::Text
        | ParameterKind::Choice(_)
        | ParameterKind::TextList
        | ParameterKind::NumberList { .. } => (FmuType::String, None),
    };
    let description = match definition.kind {
        ParameterKind::Number { .. } | ParameterKind::Integer { .. } | ParameterKind::Flag => {
            definition.description.to_owned()
        }
        _ => format!("{} Allowed: {}.", definition.description, definition.range()),
    };
    Some(FmuVariable {
        name: key.to_owned(),
        role: VariableRole::Parameter(key.to_owned()),
        kind,
        causality: if definition.is_live { Causality::TunableParameter } else { Causality::FixedParameter },
        unit: definition.unit,
        description,
        range,
        start: Some(value),
    })
}

/// Returns the value of a text variable: a text, or a list as in YAML with all digits.
pub(crate) fn text_value(value: &Value) -> String {
    match value {
        Value::Text(text) => text.clone(),
        Value::DoubleList(numbers) => {
            let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
            format!("[{}]", numbers.join(", "))
        }
        other => other.to_string(),
    }
}

//! Machines: creation, axes, parameters.

use std::ffi::{CString, c_char};
use std::sync::Arc;

use virtual_axes_core::config::{AxisKind, MachineConfig, Parameters, Value, ValueSource, parse_assignment};
use virtual_axes_core::machine::{Machine, MachineParameters};

use crate::border::{BorderError, VaStatus, guard, reference, reference_mut, text, texts};

/// Machine with its state.
pub struct VaMachine {
    pub(crate) machine: Machine,
    pub(crate) parameters: Parameters,
    pub(crate) preview: Vec<f64>,
    /// True after a panic, until the state is set again.
    pub(crate) is_broken: bool,
    pub(crate) names: Vec<CString>,
    is_rotary: Vec<bool>,
}

impl VaMachine {
    fn new(parameters: Parameters) -> Result<Self, BorderError> {
        let config = parameters.machine_config().map_err(BorderError::invalid)?;
        let names = config.axes().iter().map(|axis| CString::new(axis.name()).unwrap_or_default());
        Ok(VaMachine {
            machine: Machine::new(discretize(&config)?),
            names: names.collect(),
            is_rotary: config.axes().iter().map(|axis| axis.kind() != AxisKind::Linear).collect(),
            parameters,
            preview: Vec::new(),
            is_broken: false,
        })
    }

    pub(crate) fn axis_count(&self) -> usize {
        self.names.len()
    }

    /// Returns true if `config` has the same axes: names, order and types.
    fn has_axes_of(&self, config: &MachineConfig) -> bool {
        let own = self.names.iter().zip(&self.is_rotary);
        let names = || config.axes().iter().map(|axis| (axis.name(), axis.kind() != AxisKind::Linear));
        self.axis_count() == names().count()
            && own
                .zip(names())
                .all(|((name, rotary), other)| (name.to_bytes(), *rotary) == (other.0.as_bytes(), other.1))
    }
}

pub(crate) fn discretize(config: &MachineConfig) -> Result<Arc<MachineParameters>, BorderError> {
    MachineParameters::new(config).map(Arc::new).map_err(BorderError::invalid)
}

/// Writes the new machine to `machine`, which is null after an error.
///
/// # Safety
/// `machine` is null or points to a pointer.
unsafe fn create(
    machine: *mut *mut VaMachine,
    load: impl FnOnce() -> Result<Parameters, BorderError>,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a pointer.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        *machine = std::ptr::null_mut();
        *machine = Box::into_raw(Box::new(VaMachine::new(load()?)?));
        Ok(())
    })
}

/// Creates a machine at rest at home: `name` is that of a built-in machine or the path of a machine file.
///
/// `*machine` is null after an error, which names file, line, parameter, value and what is allowed.
///
/// # Safety
/// `name` is null or a text that ends with a null character, `machine` null or a pointer to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_create(name: *const c_char, machine: *mut *mut VaMachine) -> VaStatus {
    // SAFETY: the caller promises text and pointer.
    unsafe {
        create(machine, || {
            Parameters::load(text(name, "name")?, virtual_axes_builtin::MACHINES)
                .map_err(BorderError::invalid)
        })
    }
}

/// Creates a machine as `va_create` does, with changed parameters: `count` texts such as `x.position_loop.gain=2`, in the
/// names and units of the machine file.
///
/// All of them are set at once, also periods and parameters that need each other. `*machine` is null after an error.
///
/// # Safety
/// `name` is null or a text that ends with a null character, `assignments` null or a pointer to `count` of them, `machine`
/// null or a pointer to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_create_with(
    name: *const c_char,
    assignments: *const *const c_char,
    count: usize,
    machine: *mut *mut VaMachine,
) -> VaStatus {
    // SAFETY: the caller promises texts and pointer.
    unsafe {
        create(machine, || {
            let source = ValueSource::named("assignments");
            let texts = texts(assignments, count, "assignments")?;
            let mut parameters = Parameters::load(text(name, "name")?, virtual_axes_builtin::MACHINES)
                .map_err(BorderError::invalid)?;
            let assignments =
                texts.into_iter().map(|text| parse_assignment(text, &source)).collect::<Result<_, _>>();
            parameters.set_all(assignments.map_err(BorderError::invalid)?).map_err(BorderError::invalid)?;
            Ok(parameters)
        })
    }
}

/// Creates a machine from the text of a machine file; `source` names it in errors.
///
/// # Safety
/// `yaml` and `source` are null or texts that end with a null character, `machine` null or a pointer to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_create_from_text(
    yaml: *const c_char,
    source: *const c_char,
    machine: *mut *mut VaMachine,
) -> VaStatus {
    // SAFETY: the caller promises texts and pointer.
    unsafe {
        create(machine, || {
            Parameters::from_yaml(text(yaml, "yaml")?, text(source, "source")?).map_err(BorderError::invalid)
        })
    }
}

/// Destroys a machine; null is allowed.
///
/// # Safety
/// `machine` is null or a machine of this library, which is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_destroy(machine: *mut VaMachine) {
    if !machine.is_null() {
        // SAFETY: it came from `Box::into_raw`, and the caller gives it up.
        drop(unsafe { Box::from_raw(machine) });
    }
}

/// Returns the version of this library.
#[unsafe(no_mangle)]
pub extern "C" fn va_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Returns the number of axes; 0 for null.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_axis_count(machine: *const VaMachine) -> usize {
    // SAFETY: the caller promises a machine.
    unsafe { machine.as_ref() }.map_or(0, VaMachine::axis_count)
}

/// Returns the name of an axis, valid as long as the machine; null if there is no such axis.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_axis_name(machine: *const VaMachine, axis: usize) -> *const c_char {
    // SAFETY: the caller promises a machine.
    let name = unsafe { machine.as_ref() }.and_then(|machine| machine.names.get(axis));
    name.map_or(std::ptr::null(), |name| name.as_ptr())
}

/// Returns true for a rotary axis, in rad, and false for a linear one, in m, or if there is no such axis.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_axis_is_rotary(machine: *const VaMachine, axis: usize) -> bool {
    // SAFETY: the caller promises a machine.
    let is_rotary = unsafe { machine.as_ref() }.and_then(|machine| machine.is_rotary.get(axis));
    is_rotary.copied().unwrap_or(false)
}

/// Returns the position cycle Tsp, ns: the time between two setpoints; 0 for null.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_position_period_ns(machine: *const VaMachine) -> u64 {
    // SAFETY: the caller promises a machine.
    unsafe { machine.as_ref() }.map_or(0, |machine| machine.machine.periods().position.unsigned_abs())
}

/// Returns the current cycle Tsi, ns: the shortest step; 0 for null.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_current_period_ns(machine: *const VaMachine) -> u64 {
    // SAFETY: the caller promises a machine.
    unsafe { machine.as_ref() }.map_or(0, |machine| machine.machine.periods().current.unsigned_abs())
}

/// Sets a parameter and keeps the state (bumpless transfer); `name` and the unit are those of the machine file, as
/// `x.position_loop.gain`, and `value` is a text in YAML.
///
/// Periods and the axes, their number, order and types, cannot change. Parameters that need each other, as stiffness and
/// load mass of an elastic axis, are given in the machine file: one alone is an error.
///
/// # Safety
/// `machine` is null or a machine of this library, `name` and `value` are null or texts that end with a null character.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_set_parameter(
    machine: *mut VaMachine,
    name: *const c_char,
    value: *const c_char,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine and texts.
        let (machine, name, value) =
            unsafe { (reference_mut(machine, "machine")?, text(name, "name")?, text(value, "value")?) };
        if name.is_empty() || name.contains('=') {
            return Err(BorderError::invalid(format!("parameter {name:?} is unknown")));
        }
        let assignment =
            parse_assignment(&format!("{name}={value}"), &ValueSource::named("va_set_parameter"))
                .map_err(BorderError::invalid)?;
        let mut parameters = machine.parameters.clone();
        parameters.set_all(vec![assignment]).map_err(BorderError::invalid)?;
        let config = parameters.machine_config().map_err(BorderError::invalid)?;
        if !machine.has_axes_of(&config) {
            let reason =
                format!("{name} = {value}: the axes of a machine cannot change; create another machine");
            return Err(BorderError::invalid(reason));
        }
        machine.machine.update_parameters(discretize(&config)?).map_err(BorderError::invalid)?;
        machine.parameters = parameters;
        Ok(())
    })
}

/// Writes the value of a parameter as text to `value`, with at most `size` bytes including the null character at the end.
///
/// A text that is longer is an error.
///
/// # Safety
/// `machine` is null or a machine of this library, `name` null or a text that ends with a null character, `value` null or
/// space for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_parameter(
    machine: *const VaMachine,
    name: *const c_char,
    value: *mut c_char,
    size: usize,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine and a text.
        let (machine, name) = unsafe { (reference(machine, "machine")?, text(name, "name")?) };
        let found = machine
            .parameters
            .get(name)
            .ok_or_else(|| BorderError::invalid(format!("parameter {name:?} is unknown or has no value")))?;
        let found = match found {
            Value::Text(text) => text,
            other => other.to_string(),
        };
        let found = CString::new(found).map_err(BorderError::invalid)?;
        let bytes = found.as_bytes_with_nul();
        if bytes.len() > size {
            let reason = format!("size is {size}; the value of {name} needs {} bytes", bytes.len());
            return Err(BorderError::invalid(reason));
        }
        // SAFETY: the caller promises space for `size` bytes; `reference_mut` rejects null.
        unsafe {
            reference_mut(value, "value")?;
            std::ptr::copy_nonoverlapping(bytes.as_ptr().cast(), value, bytes.len());
        }
        Ok(())
    })
}

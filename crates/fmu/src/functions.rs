//! Functions of life cycle and steps.

use std::ffi::{c_char, c_int, c_uint};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use crate::border::{Fmi2Callbacks, Fmi2Status, reference_mut, send, text};
use crate::instance::{FmuInstance, call, fmi_functions};
use crate::slave::Phase;

/// Returns "default".
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

/// Returns "2.0".
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// Creates an instance; null on error, with the reason in the log.
///
/// # Safety
/// The texts are null or end with a null character; `functions` is null or points to callbacks, which are copied.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    instance_name: *const c_char,
    fmu_type: c_int,
    fmu_guid: *const c_char,
    fmu_resource_location: *const c_char,
    functions: *const Fmi2Callbacks,
    _visible: c_int,
    _logging_on: c_int,
) -> *mut FmuInstance {
    // SAFETY: the caller promises callbacks.
    let Some(callbacks) = (unsafe { functions.as_ref() }) else { return ptr::null_mut() };
    let create = || {
        // SAFETY: the caller promises texts.
        let (name, guid, location) = unsafe {
            (
                text(instance_name, "instanceName")?,
                text(fmu_guid, "fmuGUID")?,
                text(fmu_resource_location, "fmuResourceLocation")?,
            )
        };
        if fmu_type != 1 {
            return Err(format!("fmuType is {fmu_type}; it must be 1, fmi2CoSimulation"));
        }
        FmuInstance::new(name, guid, location, *callbacks)
    };
    match catch_unwind(AssertUnwindSafe(create)) {
        Ok(Ok(instance)) => Box::into_raw(Box::new(instance)),
        Ok(Err(reason)) => {
            send(callbacks, c"fmi2Instantiate", Fmi2Status::Error, &reason);
            ptr::null_mut()
        }
        Err(_) => {
            send(callbacks, c"fmi2Instantiate", Fmi2Status::Fatal, "error of the library");
            ptr::null_mut()
        }
    }
}

/// Destroys an instance with its saved states; null is allowed.
///
/// # Safety
/// `c` is null or an instance of this library, which is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2FreeInstance(c: *mut FmuInstance) {
    if !c.is_null() {
        // SAFETY: it came from `Box::into_raw`, and the caller gives it up.
        drop(unsafe { Box::from_raw(c) });
    }
}

/// Changes from one phase to the next, with the parameters applied.
fn change(instance: &mut FmuInstance, from: Phase, to: Phase) -> Result<(), String> {
    instance.slave.require(&[from])?;
    instance.slave.apply()?;
    instance.slave.phase = to;
    Ok(())
}

/// Returns the error of a function that the model description excludes.
fn unsupported(name: &str, reason: &str) -> Result<(), String> {
    Err(format!("{name} is not supported: {reason}"))
}

fmi_functions! {
    /// Accepts the call without effect, since only errors are logged.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2SetDebugLogging(
        _instance: &mut FmuInstance,
        _logging_on: c_int,
        _category_count: usize,
        _categories: *const *const c_char,
    ) {
        Ok(())
    }

    /// Sets the start time and the stop time, s; no step ends after the stop time.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2SetupExperiment(
        instance: &mut FmuInstance,
        _tolerance_defined: c_int,
        _tolerance: f64,
        start_time: f64,
        stop_time_defined: c_int,
        stop_time: f64,
    ) {
        instance.slave.require(&[Phase::Instantiated])?;
        if !start_time.is_finite() {
            return Err(format!("startTime is {start_time}; it must be finite"));
        }
        let stop_time = if stop_time_defined == 0 { f64::MAX } else { stop_time };
        if !stop_time.is_finite() || stop_time < start_time {
            return Err(format!("stopTime is {stop_time}; it must be finite and not before startTime, {start_time}"));
        }
        instance.slave.start_time = start_time;
        instance.slave.stop_time = stop_time;
        Ok(())
    }

    /// Begins the initialization.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2EnterInitializationMode(instance: &mut FmuInstance) {
        change(instance, Phase::Instantiated, Phase::Initialization)
    }

    /// Ends the initialization; the axes are at rest at their start positions.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2ExitInitializationMode(instance: &mut FmuInstance) {
        change(instance, Phase::Initialization, Phase::Stepping)
    }

    /// Ends the simulation; values can still be read.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2Terminate(instance: &mut FmuInstance) {
        change(instance, Phase::Stepping, Phase::Terminated)
    }

    /// Returns to the state after `fmi2Instantiate`.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2Reset(instance: &mut FmuInstance) {
        instance.reset();
        Ok(())
    }

    /// Advances from the end of the last step by a multiple of the current cycle, s.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2DoStep(
        instance: &mut FmuInstance,
        current_communication_point: f64,
        communication_step_size: f64,
        _no_set_fmu_state_prior: c_int,
    ) {
        instance.slave.step(current_communication_point, communication_step_size)
    }

    /// Rejects the call, which the FMU does not support.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2GetDirectionalDerivative(
        _instance: &mut FmuInstance,
        _unknowns: *const c_uint,
        _unknown_count: usize,
        _knowns: *const c_uint,
        _known_count: usize,
        _known_differences: *const f64,
        _unknown_differences: *mut f64,
    ) {
        unsupported("fmi2GetDirectionalDerivative", "the FMU provides no directional derivatives")
    }

    /// Rejects the call, which the FMU does not support.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2SetRealInputDerivatives(
        _instance: &mut FmuInstance,
        _references: *const c_uint,
        _count: usize,
        _orders: *const c_int,
        _values: *const f64,
    ) {
        unsupported("fmi2SetRealInputDerivatives", "inputs are held as the drives hold them")
    }

    /// Rejects the call, which the FMU does not support.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2GetRealOutputDerivatives(
        _instance: &mut FmuInstance,
        _references: *const c_uint,
        _count: usize,
        _orders: *const c_int,
        _values: *mut f64,
    ) {
        unsupported("fmi2GetRealOutputDerivatives", "maxOutputDerivativeOrder is 0")
    }

    /// Rejects the call, since steps are synchronous.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2CancelStep(_instance: &mut FmuInstance) {
        unsupported("fmi2CancelStep", "steps are synchronous")
    }
}

/// Returns `fmi2Discard`, since steps are synchronous.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetStatus(_c: *mut FmuInstance, _kind: c_int, _value: *mut c_int) -> Fmi2Status {
    Fmi2Status::Discard
}

/// Writes the end of the last step, s, for `fmi2LastSuccessfulTime` (2).
///
/// # Safety
/// `c` is null or an instance of this library, `value` null or a pointer to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetRealStatus(c: *mut FmuInstance, kind: c_int, value: *mut f64) -> Fmi2Status {
    if kind != 2 {
        return Fmi2Status::Discard;
    }
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises a pointer.
        *unsafe { reference_mut(value, "value") }? = instance.slave.time();
        Ok(())
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Returns `fmi2Discard`, since no status is an integer.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetIntegerStatus(_c: *mut FmuInstance, _kind: c_int, _value: *mut c_int) -> Fmi2Status {
    Fmi2Status::Discard
}

/// Writes false for `fmi2Terminated` (3), since the FMU never ends a simulation.
///
/// # Safety
/// `c` is null or an instance of this library, `value` null or a pointer to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBooleanStatus(
    c: *mut FmuInstance,
    kind: c_int,
    value: *mut c_int,
) -> Fmi2Status {
    if kind != 3 {
        return Fmi2Status::Discard;
    }
    let body = |_: &mut FmuInstance| {
        // SAFETY: the caller promises a pointer.
        *unsafe { reference_mut(value, "value") }? = 0;
        Ok(())
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Returns `fmi2Discard`, since steps are synchronous.
#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetStringStatus(
    _c: *mut FmuInstance,
    _kind: c_int,
    _value: *mut *const c_char,
) -> Fmi2Status {
    Fmi2Status::Discard
}

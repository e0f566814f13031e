//! Functions that get and set values.

use std::ffi::{CString, c_char, c_int, c_uint};

use crate::border::{Fmi2Status, call, text, values, values_mut};
use crate::instance::{FmuInstance, find};
use crate::slave::{Phase, VariableSetting};

/// Phases in which inputs and parameters can be set.
const SETTABLE: [Phase; 3] = [Phase::Instantiated, Phase::Initialization, Phase::Stepping];

impl FmuInstance {
    /// Sets variables; nothing is changed on error.
    fn set<'a, T>(
        &mut self,
        references: &[u32],
        values: &[T],
        setting: impl Fn(&T) -> Result<VariableSetting<'a>, String>,
    ) -> Result<(), String> {
        self.require_usable()?;
        self.slave.require(&SETTABLE)?;
        let found = find(&self.variables, references)?;
        let mut settings = Vec::with_capacity(found.len());
        for (variable, value) in found.into_iter().zip(values) {
            let setting = setting(value)?;
            self.slave.check(variable, setting)?;
            settings.push((variable, setting));
        }
        self.slave.set(&settings)
    }
}

/// Writes values of real variables.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *mut f64,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, out) = unsafe { (values(vr, nvr, "vr")?, values_mut(value, nvr, "value")?) };
        instance.require_usable()?;
        instance.slave.reals(&find(&instance.variables, references)?, out)
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Writes values of integer variables.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetInteger(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *mut c_int,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, out) = unsafe { (values(vr, nvr, "vr")?, values_mut(value, nvr, "value")?) };
        instance.require_usable()?;
        for (variable, out) in find(&instance.variables, references)?.into_iter().zip(out) {
            *out = instance.slave.integer(variable)?;
        }
        Ok(())
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Writes values of boolean variables.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetBoolean(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *mut c_int,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, out) = unsafe { (values(vr, nvr, "vr")?, values_mut(value, nvr, "value")?) };
        instance.require_usable()?;
        for (variable, out) in find(&instance.variables, references)?.into_iter().zip(out) {
            *out = c_int::from(instance.slave.boolean(variable)?);
        }
        Ok(())
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Writes values of text variables, valid until the next call of this function.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetString(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *mut *const c_char,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, out) = unsafe { (values(vr, nvr, "vr")?, values_mut(value, nvr, "value")?) };
        instance.require_usable()?;
        let mut texts = Vec::with_capacity(nvr);
        for variable in find(&instance.variables, references)? {
            let text = instance.slave.text(variable)?;
            texts.push(CString::new(text).map_err(|error| format!("{}: {error}", variable.name))?);
        }
        instance.texts = texts;
        for (text, out) in instance.texts.iter().zip(out) {
            *out = text.as_ptr();
        }
        Ok(())
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Sets real inputs and parameters.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *const f64,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, found) = unsafe { (values(vr, nvr, "vr")?, values(value, nvr, "value")?) };
        instance.set(references, found, |value| Ok(VariableSetting::Real(*value)))
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Sets integer parameters.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetInteger(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *const c_int,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, found) = unsafe { (values(vr, nvr, "vr")?, values(value, nvr, "value")?) };
        instance.set(references, found, |value| Ok(VariableSetting::Integer(*value)))
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Sets boolean parameters; every number but 0 is true.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetBoolean(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *const c_int,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, found) = unsafe { (values(vr, nvr, "vr")?, values(value, nvr, "value")?) };
        instance.set(references, found, |value| Ok(VariableSetting::Boolean(*value != 0)))
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

/// Sets text parameters.
///
/// # Safety
/// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements; the texts are null or end
/// with a null character.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetString(
    c: *mut FmuInstance,
    vr: *const c_uint,
    nvr: usize,
    value: *const *const c_char,
) -> Fmi2Status {
    let body = |instance: &mut FmuInstance| {
        // SAFETY: the caller promises these lengths.
        let (references, found) = unsafe { (values(vr, nvr, "vr")?, values(value, nvr, "value")?) };
        // SAFETY: the caller promises texts.
        instance
            .set(references, found, |value| Ok(VariableSetting::String(unsafe { text(*value, "value") }?)))
    };
    // SAFETY: the caller promises an instance.
    unsafe { call(c, body) }
}

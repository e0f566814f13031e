//! Functions that get and set values.

use std::ffi::{CString, c_char, c_int, c_uint};

use virtual_axes_core::config::Value;

use crate::border::{Fmi2Status, text, values, values_mut};
use crate::instance::{FmuInstance, call, find};
use crate::slave::{Phase, Slave};
use crate::variables::FmuVariable;

/// Phases in which inputs and parameters can be set.
const SETTABLE: [Phase; 3] = [Phase::Instantiated, Phase::Initialization, Phase::Stepping];

/// Writes values of variables, each with its variable.
///
/// # Safety
/// `vr` and `value` are null or have `nvr` elements.
unsafe fn get<T>(
    instance: &mut FmuInstance,
    (vr, nvr, value): (*const c_uint, usize, *mut T),
    write: impl FnOnce(&mut Slave, &[&FmuVariable], &mut [T]) -> Result<(), String>,
) -> Result<(), String> {
    // SAFETY: the caller promises these lengths.
    let (references, out) = unsafe { (values(vr, nvr, "vr")?, values_mut(value, nvr, "value")?) };
    instance.require_usable()?;
    write(&mut instance.slave, &find(&instance.variables, references)?, out)
}

/// Returns the writer of values that are read one by one.
fn one_by_one<T>(
    read: impl Fn(&mut Slave, &FmuVariable) -> Result<T, String>,
) -> impl FnOnce(&mut Slave, &[&FmuVariable], &mut [T]) -> Result<(), String> {
    move |slave, variables, out| {
        for (variable, out) in variables.iter().zip(out) {
            *out = read(slave, variable)?;
        }
        Ok(())
    }
}

/// Writes texts, which the instance keeps until the next call.
///
/// # Safety
/// `vr` and `value` are null or have `nvr` elements.
unsafe fn get_texts(
    instance: &mut FmuInstance,
    values: (*const c_uint, usize, *mut *const c_char),
) -> Result<(), String> {
    let mut texts = Vec::new();
    let write = |slave: &mut Slave, variables: &[&FmuVariable], out: &mut [*const c_char]| {
        for variable in variables {
            let text = CString::new(slave.text(variable)?);
            texts.push(text.map_err(|error| format!("{}: {error}", variable.name))?);
        }
        // The texts do not move with their list.
        out.iter_mut().zip(&texts).for_each(|(out, text)| *out = text.as_ptr());
        Ok(())
    };
    // SAFETY: the caller promises these lengths.
    unsafe { get(instance, values, write) }?;
    instance.texts = texts;
    Ok(())
}

/// Sets variables; nothing is changed on error.
///
/// # Safety
/// `vr` and `value` are null or have `nvr` elements.
unsafe fn set<T>(
    instance: &mut FmuInstance,
    (vr, nvr, value): (*const c_uint, usize, *const T),
    setting: impl Fn(&T) -> Result<Value, String>,
) -> Result<(), String> {
    // SAFETY: the caller promises these lengths.
    let (references, found) = unsafe { (values(vr, nvr, "vr")?, values(value, nvr, "value")?) };
    instance.require_usable()?;
    instance.slave.require(&SETTABLE)?;
    let mut settings = Vec::with_capacity(nvr);
    for (variable, value) in find(&instance.variables, references)?.into_iter().zip(found) {
        let setting = setting(value)?;
        instance.slave.check(variable, &setting)?;
        settings.push((variable, setting));
    }
    instance.slave.set(&settings)
}

/// Defines functions that get or set `nvr` values of the variables `vr`, each by a function of this module.
macro_rules! value_functions {
    ($($(#[$meta:meta])* fn $name:ident($value:ty) = $call:ident($($convert:expr)?);)*) => {$(
        $(#[$meta])*
        ///
        /// # Safety
        /// `c` is null or an instance of this library, `vr` and `value` are null or have `nvr` elements. Texts to set are
        /// null or end with a null character.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            c: *mut FmuInstance,
            vr: *const c_uint,
            nvr: usize,
            value: $value,
        ) -> Fmi2Status {
            // SAFETY: the caller promises an instance, these lengths and texts.
            unsafe { call(c, |instance| $call(instance, (vr, nvr, value) $(, $convert)?)) }
        }
    )*};
}

value_functions! {
    /// Writes values of real variables.
    fn fmi2GetReal(*mut f64) = get(Slave::reals);
    /// Writes values of integer variables.
    fn fmi2GetInteger(*mut c_int) = get(one_by_one(|slave, variable| slave.integer(variable)));
    /// Writes values of boolean variables.
    fn fmi2GetBoolean(*mut c_int) = get(one_by_one(|slave, variable| slave.boolean(variable).map(c_int::from)));
    /// Writes values of text variables, valid until the next call of this function.
    fn fmi2GetString(*mut *const c_char) = get_texts();
    /// Sets real inputs and parameters.
    fn fmi2SetReal(*const f64) = set(|value| Ok(Value::Double(*value)));
    /// Sets integer parameters.
    fn fmi2SetInteger(*const c_int) = set(|value| Ok(Value::Integer((*value).into())));
    /// Sets boolean parameters; every number but 0 is true.
    fn fmi2SetBoolean(*const c_int) = set(|value| Ok(Value::Bool(*value != 0)));
    /// Sets text parameters.
    fn fmi2SetString(*const *const c_char) = set(|value| Ok(Value::Text(text(*value, "value")?.to_owned())));
}

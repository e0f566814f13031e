//! Saved states.

use std::ffi::CString;

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::Machine;

use crate::border::{BorderError, VaStatus, guard, reference, reference_mut};
use crate::machine::VaMachine;

/// State of a machine with its parameters, to return to.
pub struct VaState {
    pub(crate) names: Vec<CString>,
    pub(crate) machine: Machine,
    pub(crate) parameters: Parameters,
    pub(crate) preview: Vec<f64>,
}

/// Saves the state of a machine; `*state` is null after an error.
///
/// # Safety
/// `machine` is null or a machine of this library, `state` null or a pointer to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_save(machine: *const VaMachine, state: *mut *mut VaState) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a pointer.
        let state = unsafe { reference_mut(state, "state") }?;
        *state = std::ptr::null_mut();
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference(machine, "machine") }?;
        if machine.is_broken {
            let reason = "a step failed before: call va_reset or va_restore first".to_owned();
            return Err(BorderError { status: VaStatus::VaPanic, reason });
        }
        *state = Box::into_raw(Box::new(VaState {
            names: machine.names.clone(),
            machine: machine.machine.clone(),
            parameters: machine.parameters.clone(),
            preview: machine.preview.clone(),
        }));
        Ok(())
    })
}

/// Returns to a saved state, with the parameters, loads and preview of that time; the state can be used again.
///
/// # Safety
/// `machine` is null or a machine of this library, `state` null or a state of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_restore(machine: *mut VaMachine, state: *const VaState) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        // SAFETY: the caller promises a state.
        let state = unsafe { reference(state, "state") }?;
        if state.names != machine.names || state.machine.periods() != machine.machine.periods() {
            let reason = "the state is that of a machine with other axes or periods";
            return Err(BorderError::invalid(reason));
        }
        machine.machine.clone_from(&state.machine);
        machine.parameters.clone_from(&state.parameters);
        machine.preview.clone_from(&state.preview);
        machine.is_broken = false;
        Ok(())
    })
}

/// Destroys a state; null is allowed.
///
/// # Safety
/// `state` is null or a state of this library, which is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_destroy_state(state: *mut VaState) {
    if !state.is_null() {
        // SAFETY: it came from `Box::into_raw`, and the caller gives it up.
        drop(unsafe { Box::from_raw(state) });
    }
}

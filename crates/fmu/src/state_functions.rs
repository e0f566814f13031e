//! Functions that save and restore states.
//!
//! A state at the importer is a number of the instance in place of a pointer: an unknown one is an error.

use std::ffi::c_void;
use std::ptr;

use crate::border::{Fmi2Status, reference_mut, values, values_mut};
use crate::instance::{FmuInstance, call, fmi_functions};
use crate::slave::Slave;

/// Keeps a state under the number in `*state`, or under a new one.
fn keep(instance: &mut FmuInstance, state: &mut *mut c_void, saved: Slave) {
    if state.is_null() {
        *state = ptr::without_provenance_mut(instance.next_state);
        instance.next_state += 1;
    }
    instance.states.insert(state.addr(), saved);
}

/// Returns a saved state of the instance.
fn saved(instance: &FmuInstance, state: *mut c_void) -> Result<&Slave, String> {
    instance
        .states
        .get(&state.addr())
        .ok_or_else(|| "FMUstate is no state of this instance; fmi2GetFMUstate saves one".to_owned())
}

fmi_functions! {
    /// Saves the state; a state in `*state` is replaced.
    ///
    /// # Safety
    /// `c` is null or an instance of this library, `state` null or a pointer to a state.
    fn fmi2GetFMUstate(instance: &mut FmuInstance, state: *mut *mut c_void) {
        // SAFETY: the caller promises a pointer.
        let state = unsafe { reference_mut(state, "FMUstate") }?;
        instance.require_usable()?;
        if !state.is_null() {
            saved(instance, *state)?;
        }
        let saved = instance.slave.clone();
        keep(instance, state, saved);
        Ok(())
    }

    /// Returns to a saved state, which can be used again.
    ///
    /// # Safety
    /// `c` is null or an instance of this library.
    fn fmi2SetFMUstate(instance: &mut FmuInstance, state: *mut c_void) {
        instance.slave = saved(instance, state)?.clone();
        Ok(())
    }

    /// Destroys a saved state; null is allowed.
    ///
    /// # Safety
    /// `c` is null or an instance of this library, `state` null or a pointer to a state.
    fn fmi2FreeFMUstate(instance: &mut FmuInstance, state: *mut *mut c_void) {
        // SAFETY: the caller promises null or a pointer.
        let Some(state) = (unsafe { state.as_mut() }) else { return Ok(()) };
        if !state.is_null() {
            saved(instance, *state)?;
            instance.states.remove(&state.addr());
            *state = ptr::null_mut();
        }
        Ok(())
    }

    /// Writes the number of bytes of a state.
    ///
    /// # Safety
    /// `c` is null or an instance of this library, `size` null or a pointer to a number.
    fn fmi2SerializedFMUstateSize(instance: &mut FmuInstance, state: *mut c_void, size: *mut usize) {
        // SAFETY: the caller promises a pointer.
        *unsafe { reference_mut(size, "size") }? = saved(instance, state)?.to_bytes()?.len();
        Ok(())
    }

    /// Writes a state as bytes, for a file or another process.
    ///
    /// # Safety
    /// `c` is null or an instance of this library, `bytes` null or space for `size` bytes.
    fn fmi2SerializeFMUstate(instance: &mut FmuInstance, state: *mut c_void, bytes: *mut u8, size: usize) {
        let written = saved(instance, state)?.to_bytes()?;
        if size != written.len() {
            let wanted = written.len();
            return Err(format!("size is {size}; it must be {wanted}, that of fmi2SerializedFMUstateSize"));
        }
        // SAFETY: the caller promises space for this number of bytes.
        unsafe { values_mut(bytes, size, "serializedState") }?.copy_from_slice(&written);
        Ok(())
    }

    /// Reads a state that any instance of the same FMU has written.
    ///
    /// # Safety
    /// `c` is null or an instance of this library, `bytes` null or a pointer to `size` bytes, `state` null or a pointer to a
    /// state.
    fn fmi2DeSerializeFMUstate(
        instance: &mut FmuInstance,
        bytes: *const u8,
        size: usize,
        state: *mut *mut c_void,
    ) {
        // SAFETY: the caller promises a pointer, and this number of bytes.
        let (state, bytes) =
            unsafe { (reference_mut(state, "FMUstate")?, values(bytes, size, "serializedState")?) };
        if !state.is_null() {
            saved(instance, *state)?;
        }
        let read = Slave::from_bytes(&instance.slave, bytes)?;
        keep(instance, state, read);
        Ok(())
    }
}

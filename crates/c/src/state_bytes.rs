//! Saved states as bytes.

use virtual_axes_core::config::Parameters;
use virtual_axes_core::machine::{Machine, check_input};
use virtual_axes_core::state_codec::{SealedBytes, seal};

use crate::border::{BorderError, VaStatus, guard, reference, reference_mut};
use crate::machine::{VaMachine, discretize};
use crate::state::VaState;

/// First bytes of a state with its parameters; the last two are the version of the format.
const HEAD: [u8; 8] = *b"vastcp01";

impl VaState {
    /// Returns head, machine file, preview and state of the machine, then the checksum of these.
    fn to_bytes(&self) -> Vec<u8> {
        let yaml = self.parameters.to_yaml("", |_| None);
        let mut bytes = Vec::from(HEAD);
        bytes.extend((yaml.len() as u64).to_le_bytes());
        bytes.extend(yaml.as_bytes());
        bytes.extend((self.preview.len() as u64).to_le_bytes());
        bytes.extend(self.preview.iter().flat_map(|setpoint| setpoint.to_le_bytes()));
        bytes.extend(self.machine.state_bytes());
        seal(&mut bytes);
        bytes
    }

    fn from_bytes(machine: &VaMachine, bytes: &[u8]) -> Result<Self, BorderError> {
        let size = bytes.len();
        let damaged = || BorderError::invalid(format!("the state of {size} bytes is truncated or damaged"));
        if !bytes.starts_with(&HEAD) {
            let reason = format!(
                "the {size} bytes are no state of this version; va_state_read reads what va_state_write of the same \
                 version has written"
            );
            return Err(BorderError::invalid(reason));
        }
        let mut reader = SealedBytes::open(bytes, &HEAD).ok_or_else(damaged)?;
        let yaml = reader.counted(1).and_then(|text| std::str::from_utf8(text).ok()).ok_or_else(damaged)?;
        let preview = reader.counted(size_of::<f64>()).ok_or_else(damaged)?;
        let preview = preview.chunks_exact(size_of::<f64>()).filter_map(|setpoint| setpoint.try_into().ok());
        let preview: Vec<f64> = preview.map(f64::from_le_bytes).collect();
        let parameters = Parameters::from_yaml(yaml, "state").map_err(BorderError::invalid)?;
        let config = parameters.machine_config().map_err(BorderError::invalid)?;
        let names = config.axes().iter().map(|axis| axis.name().as_bytes());
        if !names.eq(machine.names.iter().map(|name| name.as_bytes()))
            || config.periods() != machine.machine.periods()
        {
            return Err(BorderError::invalid("the state is that of a machine with other axes or periods"));
        }
        if preview.iter().any(|&setpoint| check_input(setpoint).is_err()) {
            return Err(damaged());
        }
        Ok(VaState {
            names: machine.names.clone(),
            machine: Machine::from_state_bytes(discretize(&config)?, reader.rest())
                .map_err(BorderError::invalid)?,
            parameters,
            preview,
        })
    }
}

/// Writes the number of bytes of a state to `size`.
///
/// # Safety
/// `state` is null or a state of this library, `size` null or a pointer to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_state_size(state: *const VaState, size: *mut usize) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a state and a pointer.
        let (state, size) = unsafe { (reference(state, "state")?, reference_mut(size, "size")?) };
        *size = state.to_bytes().len();
        Ok(())
    })
}

/// Writes a state with the parameters of its machine to `bytes`, to store it or to read it in another process.
///
/// `size` must be that of `va_state_size`.
///
/// # Safety
/// `state` is null or a state of this library, `bytes` null or space for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_state_write(state: *const VaState, bytes: *mut u8, size: usize) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a state.
        let written = unsafe { reference(state, "state") }?.to_bytes();
        if size != written.len() {
            let reason = format!("size is {size}; it must be {}, that of va_state_size", written.len());
            return Err(BorderError::invalid(reason));
        }
        // SAFETY: the caller promises space for `size` bytes; `reference_mut` rejects null.
        unsafe {
            reference_mut(bytes, "bytes")?;
            std::ptr::copy_nonoverlapping(written.as_ptr(), bytes, size);
        }
        Ok(())
    })
}

/// Reads a state that `va_state_write` has written; `*state` is null after an error.
///
/// `va_restore` returns `machine` to it, with the parameters of that time, and it goes on with the same bits. The axes and
/// periods of the machine must be those of the state. Bytes that are truncated, damaged, or written by another version are
/// an error.
///
/// # Safety
/// `machine` is null or a machine of this library, `bytes` null or a pointer to `size` bytes, `state` null or a pointer to a
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_state_read(
    machine: *const VaMachine,
    bytes: *const u8,
    size: usize,
    state: *mut *mut VaState,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a pointer.
        let state = unsafe { reference_mut(state, "state") }?;
        *state = std::ptr::null_mut();
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference(machine, "machine") }?;
        // SAFETY: the caller promises a byte at least, unless the size is 0.
        unsafe { reference(bytes, "bytes") }?;
        if isize::try_from(size).is_err() {
            return Err(BorderError::invalid(format!("size is {size}; it must be that of va_state_size")));
        }
        // SAFETY: it is not null, and the caller promises this number of bytes.
        let bytes = unsafe { std::slice::from_raw_parts(bytes, size) };
        *state = Box::into_raw(Box::new(VaState::from_bytes(machine, bytes)?));
        Ok(())
    })
}

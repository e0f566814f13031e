//! Steps: position cycles, parts of them, loads, preview.

use virtual_axes_core::machine::DriveMode;

use crate::border::{BorderError, VaStatus, guard, inputs, reference_mut};
use crate::machine::VaMachine;

/// Mode of a drive.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VaDriveMode {
    /// Position control: the axis follows the setpoints `psec`.
    VaPosition = 0,
    /// Velocity control: the axis follows the velocities of `va_set_velocities`; 0 is a controlled stop.
    VaVelocity = 1,
    /// Drive off with short-circuited windings: the motor brakes by its back-EMF; the current is not limited.
    VaShortCircuit = 2,
    /// Drive off, coasting: the motor current is 0.
    VaCoast = 3,
}

/// Longest step, ns: 1000 s.
const LONGEST_STEP_NS: u64 = 1_000_000_000_000;

impl VaMachine {
    /// Advances by `ticks` current cycles.
    fn advance(&mut self, ticks: usize, psec: &[f64]) -> Result<(), BorderError> {
        if self.is_broken {
            let reason = "a step failed before: call va_reset or va_restore first".to_owned();
            return Err(BorderError { status: VaStatus::VaPanic, reason });
        }
        self.is_broken = true;
        self.machine.advance_ticks(ticks, psec, &self.preview);
        self.is_broken = false;
        Ok(())
    }
}

/// Advances by one position cycle with the setpoints `psec`, m or rad, one per axis.
///
/// Within a position cycle, after `va_step_for_ns`, it advances by the same time.
///
/// # Safety
/// `machine` is null or a machine of this library, `psec` null or a pointer to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_step(machine: *mut VaMachine, psec: *const f64, count: usize) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        // SAFETY: the caller promises this number of values.
        let psec = unsafe { inputs(psec, count, machine.axis_count(), "psec") }?;
        machine.advance(machine.machine.ticks_per_period(), psec)
    })
}

/// Advances by a time, ns: any multiple of the current cycle Tsi up to 1000 s.
///
/// The drives read the setpoints `psec`, m or rad, at the start of each position cycle Tsp and hold them in between.
/// Loads that `va_set_loads` sets act from the start of the step.
///
/// # Safety
/// `machine` is null or a machine of this library, `psec` null or a pointer to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_step_for_ns(
    machine: *mut VaMachine,
    duration_ns: u64,
    psec: *const f64,
    count: usize,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        // SAFETY: the caller promises this number of values.
        let psec = unsafe { inputs(psec, count, machine.axis_count(), "psec") }?;
        let period = machine.machine.periods().current.unsigned_abs();
        if duration_ns == 0 || !duration_ns.is_multiple_of(period) || duration_ns > LONGEST_STEP_NS {
            let reason = format!(
                "duration_ns is {duration_ns}; it must be a multiple of the current cycle Tsi, {period} ns, \
                 up to {LONGEST_STEP_NS} ns"
            );
            return Err(BorderError::invalid(reason));
        }
        machine.advance((duration_ns / period) as usize, psec)
    })
}

/// Sets the external loads, N or N·m within ±10⁶, one per axis, positive towards plus; they act from the next step on.
///
/// # Safety
/// `machine` is null or a machine of this library, `loads` null or a pointer to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_set_loads(machine: *mut VaMachine, loads: *const f64, count: usize) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        // SAFETY: the caller promises this number of values.
        let loads = unsafe { inputs(loads, count, machine.axis_count(), "loads") }?;
        loads.iter().enumerate().for_each(|(axis, &load)| machine.machine.set_load(axis, load));
        Ok(())
    })
}

/// Sets the mode of the drive of an axis, a `VaDriveMode`, from the next position cycle on; `va_reset` returns to
/// `VA_POSITION`.
///
/// A drive that is off has no holding brake: a vertical axis falls or sinks. When it is switched on, the integrals of its
/// controllers start from 0. The caller lets `psec` follow the position before it switches to `VA_POSITION`.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_set_drive_mode(machine: *mut VaMachine, axis: usize, mode: u32) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        let count = machine.axis_count();
        if axis >= count {
            return Err(BorderError::invalid(format!("axis is {axis}; it must be below {count}")));
        }
        let mode = DriveMode::ALL.get(mode as usize).ok_or_else(|| {
            let most = DriveMode::ALL.len() - 1;
            BorderError::invalid(format!("mode is {mode}; it must be a VaDriveMode, 0 to {most}"))
        })?;
        machine.machine.set_drive_mode(axis, *mode);
        Ok(())
    })
}

/// Sets the velocities, m/s or rad/s within ±10⁶, one per axis, from the next position cycle on: the setpoints of axes in
/// `VA_VELOCITY`; of axes in `VA_POSITION` they are added to the output of the position controller. `va_reset` sets 0.
///
/// # Safety
/// `machine` is null or a machine of this library, `velocities` null or a pointer to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_set_velocities(
    machine: *mut VaMachine,
    velocities: *const f64,
    count: usize,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        // SAFETY: the caller promises this number of values.
        let velocities = unsafe { inputs(velocities, count, machine.axis_count(), "velocities") }?;
        velocities
            .iter()
            .enumerate()
            .for_each(|(axis, &velocity)| machine.machine.set_velocity(axis, velocity));
        Ok(())
    })
}

/// Returns the number of future setpoints that the controllers read, the largest of all axes; 0 for null.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_preview_length(machine: *const VaMachine) -> usize {
    // SAFETY: the caller promises a machine.
    unsafe { machine.as_ref() }.map_or(0, |machine| machine.machine.preview_length())
}

/// Sets the setpoints of the `cycles` position cycles after the next one, m or rad, axis by axis, which predictive
/// controllers read; 0 cycles remove them.
///
/// The preview is read at the start of each position cycle until it is set again: the caller sets it before each. Beyond
/// it, controllers read its last setpoint, without a preview the present one.
///
/// # Safety
/// `machine` is null or a machine of this library, `preview` null or a pointer to `cycles` numbers for each axis.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_set_preview(
    machine: *mut VaMachine,
    preview: *const f64,
    cycles: usize,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        machine.preview.clear();
        let most = machine.machine.preview_length();
        if cycles > 0 {
            let count = cycles.checked_mul(machine.axis_count());
            let count = count.filter(|_| cycles <= 100_000).ok_or_else(|| {
                BorderError::invalid(format!(
                    "cycles is {cycles}; the controllers read {most}, 100000 are allowed"
                ))
            })?;
            // SAFETY: the caller promises this number of values.
            machine.preview.extend_from_slice(unsafe { inputs(preview, count, count, "preview") }?);
        }
        Ok(())
    })
}

/// Puts the axes at rest at `positions`, m or rad, one per axis, or at home if it is null, at time 0.
///
/// Loads and preview are removed, parameters kept.
///
/// # Safety
/// `machine` is null or a machine of this library, `positions` null or a pointer to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_reset(machine: *mut VaMachine, positions: *const f64, count: usize) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference_mut(machine, "machine") }?;
        let axes = machine.axis_count();
        let positions = if positions.is_null() {
            vec![0.0; axes]
        } else {
            // SAFETY: the caller promises this number of values.
            unsafe { inputs(positions, count, axes, "positions") }?.to_vec()
        };
        machine.machine.reset(&positions);
        machine.preview.clear();
        machine.is_broken = false;
        Ok(())
    })
}

/// Returns the simulated time since the start or the last reset, ns; 0 for null.
///
/// # Safety
/// `machine` is null or a machine of this library.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_time_ns(machine: *const VaMachine) -> u64 {
    // SAFETY: the caller promises a machine.
    unsafe { machine.as_ref() }.map_or(0, |machine| machine.machine.time().unsigned_abs())
}

//! Signals after a step.

use crate::border::{BorderError, VaStatus, guard, numbers_mut, reference, reference_mut};
use crate::machine::VaMachine;

/// Signals of one axis after a step (Prévost fig. 3).
///
/// Position, velocity and current are those at the end of the step. Controller outputs are those of the last current cycle
/// Tsi, friction, gravity and load act over it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct VaSignals {
    /// PSEC of the present position cycle, m or rad.
    pub psec: f64,
    /// PSEC delayed by α, at the input of the position controller, m or rad.
    pub delayed_psec: f64,
    /// Position, m or rad.
    pub position: f64,
    /// Velocity, m/s or rad/s.
    pub velocity: f64,
    /// Motor current, A.
    pub current: f64,
    /// Setpoint of the current loop after its limit, A.
    pub current_setpoint: f64,
    /// Voltage after its limit, V.
    pub voltage: f64,
    /// Ω*, output of the position controller after its limit, rad/s of the motor.
    pub velocity_setpoint: f64,
    /// VFFWS, velocity feedforward, rad/s of the motor.
    pub velocity_feedforward: f64,
    /// TFFWS, torque feedforward, and friction compensation, N·m at the motor.
    pub torque_feedforward: f64,
    /// Friction as motor current, A.
    pub friction_current: f64,
    /// Gravity as motor current, A.
    pub gravity_current: f64,
    /// External load as motor current, A; positive against motion towards plus, as friction and gravity.
    pub load_current: f64,
    /// Force or torque of the motor at the axis, N or N·m.
    pub effort: f64,
    /// Following error at the end of the step, `psec − position`, m or rad; it contains the delay α.
    pub following_error: f64,
    /// Following error with the delayed setpoint, m or rad.
    pub delay_compensated_following_error: f64,
    /// Wind-up of an elastic transmission, position of the motor at the axis minus `position`, m or rad.
    pub wind_up: f64,
    /// True if a setpoint is at its limit.
    pub is_saturated: bool,
    /// True if the friction law is extrapolated beyond its fitted range.
    pub is_friction_extrapolated: bool,
}

/// Writes one signal of each axis.
///
/// # Safety
/// `machine` is null or a machine of this library, `values` null or space for `count` numbers.
unsafe fn write(
    machine: *const VaMachine,
    values: *mut f64,
    count: usize,
    name: &str,
    index: usize,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference(machine, "machine") }?;
        // SAFETY: the caller promises space for this number of values.
        let values = unsafe { numbers_mut(values, count, machine.axis_count(), name) }?;
        for (axis, value) in values.iter_mut().enumerate() {
            *value = machine.machine.motion_at_end(axis)[index];
        }
        Ok(())
    })
}

/// Writes the positions at the end of the last step, m or rad, one per axis.
///
/// # Safety
/// `machine` is null or a machine of this library, `positions` null or space for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_positions(
    machine: *const VaMachine,
    positions: *mut f64,
    count: usize,
) -> VaStatus {
    // SAFETY: the caller promises machine and space.
    unsafe { write(machine, positions, count, "positions", 0) }
}

/// Writes the velocities at the end of the last step, m/s or rad/s, one per axis.
///
/// # Safety
/// `machine` is null or a machine of this library, `velocities` null or space for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_velocities(
    machine: *const VaMachine,
    velocities: *mut f64,
    count: usize,
) -> VaStatus {
    // SAFETY: the caller promises machine and space.
    unsafe { write(machine, velocities, count, "velocities", 1) }
}

/// Writes the motor currents at the end of the last step, A, one per axis.
///
/// # Safety
/// `machine` is null or a machine of this library, `currents` null or space for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_currents(
    machine: *const VaMachine,
    currents: *mut f64,
    count: usize,
) -> VaStatus {
    // SAFETY: the caller promises machine and space.
    unsafe { write(machine, currents, count, "currents", 2) }
}

/// Writes all signals of an axis after the last step.
///
/// # Safety
/// `machine` is null or a machine of this library, `signals` null or a pointer to a `VaSignals`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn va_signals(
    machine: *const VaMachine,
    axis: usize,
    signals: *mut VaSignals,
) -> VaStatus {
    guard(|| {
        // SAFETY: the caller promises a machine.
        let machine = unsafe { reference(machine, "machine") }?;
        // SAFETY: the caller promises space for the signals.
        let signals = unsafe { reference_mut(signals, "signals") }?;
        let count = machine.axis_count();
        if axis >= count {
            return Err(BorderError::invalid(format!("axis is {axis}; it must be below {count}")));
        }
        let sample = machine.machine.sample_at_end(axis);
        *signals = VaSignals {
            psec: sample.psec,
            delayed_psec: sample.delayed_psec,
            position: sample.position,
            velocity: sample.velocity,
            current: sample.current,
            current_setpoint: sample.current_setpoint,
            voltage: sample.voltage,
            velocity_setpoint: sample.velocity_setpoint,
            velocity_feedforward: sample.velocity_feedforward,
            torque_feedforward: sample.torque_feedforward,
            friction_current: sample.friction_current,
            gravity_current: sample.gravity_current,
            load_current: sample.load_current,
            effort: sample.effort,
            following_error: sample.following_error(),
            delay_compensated_following_error: sample.delay_compensated_following_error(),
            wind_up: sample.wind_up,
            is_saturated: sample.saturated,
            is_friction_extrapolated: sample.friction_extrapolated,
        };
        Ok(())
    })
}

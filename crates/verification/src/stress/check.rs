//! Invariants that every trajectory must satisfy, and their violations.

use std::fmt;

use virtual_axes_core::trajectory::RejectionCode;

/// Invariant of a simulated trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// Every signal is a finite number.
    Finite,
    /// Ω*, i* and u are within their limits.
    Limits,
    /// A tick is reported as saturated if and only if a setpoint is at its limit.
    Reported,
    /// The figures of a position cycle agree with its ticks.
    Counted,
    /// The speed of the position setpoint is within the limit of the axis.
    SetpointSpeed,
    /// Friction has the sign of the speed at the end of the tick: it does not reverse the axis.
    FrictionSign,
    /// Friction follows its law, or is less where it stops the axis.
    FrictionLaw,
    /// Friction dissipates energy, except for the return of a torque held over a tick with a standstill.
    FrictionWork,
    /// The position is the integral of the speed.
    Position,
    /// The change of the stored energy equals the supplied energy.
    Energy,
    /// The delay-compensated following error is within the bound of the impulse responses.
    Bound,
    /// The delay-compensated following error equals the superposition of the impulse responses.
    Superposition,
    /// Each accepted trajectory ends exactly once.
    Ended,
    /// A trajectory within all limits is accepted; contains the code of the rejection.
    Accepted(RejectionCode),
}

/// Violation of an invariant by a trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// Violated invariant.
    pub check: Check,
    /// Number of the trajectory.
    pub number: u64,
    /// Name of the axis; empty if it concerns the whole trajectory.
    pub axis: String,
    /// Tick since the start of the trajectory.
    pub tick: usize,
    /// Value found, SI units.
    pub value: f64,
    /// Value allowed, SI units.
    pub allowed: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Violation { check, number, axis, tick, value, allowed } = self;
        write!(f, "trajectory {number}, {axis}, tick {tick}: {check:?}: {value:e}, allowed {allowed:e}")
    }
}

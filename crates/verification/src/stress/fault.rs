//! What a trajectory must not do.

use std::fmt;

use virtual_axes_core::trajectory::Code;

/// What is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Check {
    /// Every signal is a finite number.
    Finite,
    /// Ω*, i* and u are within their limits.
    Limits,
    /// A tick at a limit is said to be at one, and no other.
    Reported,
    /// The figures of a position period are those of its ticks.
    Counted,
    /// Setpoints go no faster than the axis may.
    SetpointSpeed,
    /// Friction has the sign of the speed at the end of the tick: it stops, it does not reverse.
    FrictionSign,
    /// Friction is what its law says, or less where it stops the axis.
    FrictionLaw,
    /// Friction takes energy, but for what a torque held over the tick of a standstill gives back.
    FrictionWork,
    /// The position follows from the speed.
    Position,
    /// The energy changes by what goes in.
    Energy,
    /// The synchronized tracking error is within what the impulse responses bound it to.
    Bound,
    /// The synchronized tracking error is what the impulse responses make of setpoints and torques.
    Superposition,
    /// Each accepted trajectory ends once.
    Ended,
    /// What is within all limits is taken.
    Taken(Code),
}

impl Check {
    /// What it says when it is broken.
    pub fn text(self) -> &'static str {
        match self {
            Check::Finite => "a signal is not finite",
            Check::Limits => "a setpoint is beyond its limit",
            Check::Reported => "a limit is not reported, or reported where there is none",
            Check::Counted => "the figures of a period are not those of its ticks",
            Check::SetpointSpeed => "the setpoint goes faster than the axis may",
            Check::FrictionSign => "friction drives the axis",
            Check::FrictionLaw => "friction is not what its law says",
            Check::FrictionWork => "friction gives energy",
            Check::Position => "the position does not follow from the speed",
            Check::Energy => "energy comes from nowhere, or goes nowhere",
            Check::Bound => "the tracking error is beyond its bound",
            Check::Superposition => "the tracking error is not that of the linear loop",
            Check::Ended => "a trajectory did not end once",
            Check::Taken(_) => "what is within all limits is refused",
        }
    }
}

/// A check that a trajectory did not pass.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Which check.
    pub check: Check,
    /// Number of the trajectory.
    pub number: u64,
    /// The axis; empty if it is none in particular.
    pub axis: String,
    /// Tick since the trajectory began.
    pub tick: usize,
    /// What was found, in SI units.
    pub value: f64,
    /// What is allowed.
    pub allowed: f64,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Fault { check, number, axis, tick, value, allowed } = self;
        write!(
            f,
            "trajectory {number}, {axis}, tick {tick}: {}: {value:e}, allowed {allowed:e}",
            check.text()
        )?;
        if let Check::Taken(code) = check { write!(f, ", {}", code.name()) } else { Ok(()) }
    }
}

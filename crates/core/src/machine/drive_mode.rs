//! Modes of a drive: position control, velocity control, and the two ways in which a drive is off.

use super::inner_loops::{InnerLoopState, InnerLoops};
use crate::control::PiState;

/// Mode of a drive, in effect from the next position cycle on.
///
/// A drive that is off has no holding brake: a vertical axis falls or sinks. When it is switched on again, the integrals of
/// its controllers start from 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum DriveMode {
    /// Position control: the axis follows the setpoints.
    #[default]
    Position,
    /// Velocity control: the velocity offset alone is the velocity setpoint Ω*, without feedforward; 0 is a controlled stop
    /// within the current limit, then standstill.
    Velocity,
    /// Drive off with the windings short-circuited: the voltage is 0 and the motor brakes by its back-EMF. The current is
    /// not limited.
    ShortCircuit,
    /// Drive off, coasting: the current loop controls the motor current to 0.
    Coast,
}

impl DriveMode {
    /// All modes, in the order of their numbers.
    pub const ALL: [DriveMode; 4] =
        [DriveMode::Position, DriveMode::Velocity, DriveMode::ShortCircuit, DriveMode::Coast];

    /// Returns true if no controller drives the motor.
    pub fn is_off(self) -> bool {
        matches!(self, DriveMode::ShortCircuit | DriveMode::Coast)
    }

    /// Returns inner loops as they are in this mode.
    pub(super) fn loops(self, mut loops: InnerLoops) -> InnerLoops {
        if self.is_off() {
            loops.velocity = loops.velocity.with_limit(0.0);
        }
        if self == DriveMode::ShortCircuit {
            loops.current = loops.current.with_limit(0.0);
        }
        loops
    }

    /// Sets the state of the controllers at the end of this mode.
    pub(super) fn leave(self, loops: &InnerLoops, state: &mut InnerLoopState) {
        if self.is_off() {
            state.velocity = PiState::default();
            state.filters = loops.filters.at_rest(0.0);
        }
        if self == DriveMode::ShortCircuit {
            state.current = PiState::default();
        }
    }
}

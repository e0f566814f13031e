//! The transition from one position controller to another.

/// How a controller takes over from another while the axis moves.
///
/// If the first Ω* differs from what the velocity loop was asked for by more than `step`, the excess fades
/// out over `periods`: from Ω* itself, or, where the controller integrates, from the error that it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transfer {
    /// Largest change of what the velocity loop is asked for that is left to happen at once, rad/s.
    pub step: f64,
    /// Position periods until nothing is left of the controller before.
    pub periods: u32,
}

/// What is left of the controller before.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TransferState {
    /// A controller has just changed.
    pub(super) pending: bool,
    /// Added to Ω*, rad/s, before it fades.
    command: f64,
    /// Taken from θ*, rad, before it fades.
    setpoint: f64,
    /// Position periods since the change.
    age: u32,
}

impl TransferState {
    /// Nothing is left to be handed over.
    pub(super) fn end(&mut self) {
        *self = TransferState::default();
    }

    /// Begins to fade `command` (rad/s) out of Ω* and `setpoint` (rad) out of θ*.
    pub(super) fn begin(&mut self, command: f64, setpoint: f64) {
        *self = TransferState { pending: false, command, setpoint, age: 0 };
    }

    /// What is to be added to Ω* and to be taken from θ* at this position instant.
    #[inline]
    pub(super) fn next(&mut self, transfer: &Transfer) -> (f64, f64) {
        if self.command == 0.0 && self.setpoint == 0.0 {
            return (0.0, 0.0);
        }
        if self.age >= transfer.periods {
            self.end();
            return (0.0, 0.0);
        }
        let left = fade(f64::from(self.age) / f64::from(transfer.periods));
        self.age += 1;
        (self.command * left, self.setpoint * left)
    }
}

/// From 1 to 0 over 0 … 1, at rest in velocity and acceleration at both ends.
fn fade(x: f64) -> f64 {
    1.0 - x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

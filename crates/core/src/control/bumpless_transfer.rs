//! Bumpless transfer from one position controller to another.

/// Bumpless transfer to another position controller while the axis moves.
///
/// If the first Ω* + VFFWS of the new controller differs from the last one by more than `max_step`, the excess fades
/// out over `cycles`: as an offset of Ω*, or as an offset of θ* for a controller with integral action.
///
/// ```text
/// offset(x) = offset(0) (1 − 10 x³ + 15 x⁴ − 6 x⁵)          x = age / cycles
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumplessTransfer {
    /// Largest immediate change of Ω* + VFFWS, rad/s.
    pub max_step: f64,
    /// Duration, position cycles.
    pub cycles: u32,
}

/// State of a bumpless transfer.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BumplessTransferState {
    /// True if the controller has changed since the last position cycle.
    pub(super) is_pending: bool,
    /// Initial offset added to Ω*, rad/s.
    command: f64,
    /// Initial offset subtracted from θ*, rad.
    setpoint: f64,
    /// Position cycles since the change.
    age: u32,
}

impl BumplessTransferState {
    /// Ends the transfer.
    pub(super) fn end(&mut self) {
        *self = BumplessTransferState::default();
    }

    /// Begins a transfer with offsets `command` of Ω* (rad/s) and `setpoint` of θ* (rad).
    pub(super) fn begin(&mut self, command: f64, setpoint: f64) {
        *self = BumplessTransferState { is_pending: false, command, setpoint, age: 0 };
    }

    /// Returns the offsets of this position cycle: to be added to Ω* (rad/s), to be subtracted from θ* (rad).
    #[inline]
    pub(super) fn advance(&mut self, transfer: &BumplessTransfer) -> (f64, f64) {
        if self.command == 0.0 && self.setpoint == 0.0 {
            return (0.0, 0.0);
        }
        if self.age >= transfer.cycles {
            self.end();
            return (0.0, 0.0);
        }
        let remaining = fade(f64::from(self.age) / f64::from(transfer.cycles));
        self.age += 1;
        (self.command * remaining, self.setpoint * remaining)
    }
}

/// Returns the quintic from 1 at x = 0 to 0 at x = 1 with zero first and second derivatives at both ends.
fn fade(x: f64) -> f64 {
    1.0 - x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

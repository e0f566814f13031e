//! Bumpless transfer from one position controller to another.

use crate::state_codec::StateCodec;

/// Bumpless transfer to another position controller while the axis moves.
///
/// If the first Ω* + VFFWS of the new controller differs from the last one by more than `max_step`, the excess fades
/// out over `cycles`: as an offset of Ω*, or as an offset of θ* for a controller with integral action.
///
/// ```text
/// offset(x) = offset(0) (1 − 10 x³ + 15 x⁴ − 6 x⁵)          x = elapsed_cycles / cycles
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
    command_offset: f64,
    /// Initial offset subtracted from θ*, rad.
    setpoint_offset: f64,
    /// Position cycles since the change.
    elapsed_cycles: u32,
}

impl BumplessTransferState {
    /// Writes or replaces the state.
    pub(super) fn code(&mut self, codec: &mut StateCodec<'_>) {
        codec.flag(&mut self.is_pending);
        codec.numbers([&mut self.command_offset, &mut self.setpoint_offset]);
        codec.cycles(&mut self.elapsed_cycles);
    }

    /// Ends the transfer.
    pub(super) fn end(&mut self) {
        *self = BumplessTransferState::default();
    }

    /// Begins a transfer with offsets of Ω* (rad/s) and θ* (rad).
    pub(super) fn begin(&mut self, command_offset: f64, setpoint_offset: f64) {
        *self =
            BumplessTransferState { is_pending: false, command_offset, setpoint_offset, elapsed_cycles: 0 };
    }

    /// Returns the offsets of this position cycle: to be added to Ω* (rad/s), to be subtracted from θ* (rad).
    #[inline]
    pub(super) fn advance(&mut self, transfer: &BumplessTransfer) -> (f64, f64) {
        if self.command_offset == 0.0 && self.setpoint_offset == 0.0 {
            return (0.0, 0.0);
        }
        if self.elapsed_cycles >= transfer.cycles {
            self.end();
            return (0.0, 0.0);
        }
        let remaining = quintic_blend(f64::from(self.elapsed_cycles) / f64::from(transfer.cycles));
        self.elapsed_cycles += 1;
        (self.command_offset * remaining, self.setpoint_offset * remaining)
    }
}

/// Returns the quintic from 1 at x = 0 to 0 at x = 1 with zero first and second derivatives at both ends.
fn quintic_blend(x: f64) -> f64 {
    1.0 - x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

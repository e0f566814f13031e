//! Position controllers: proportional or RST, with fallback controller and bumpless transfer.

use super::bumpless_transfer::{BumplessTransfer, BumplessTransferState};
use super::rst::{MAX_COEFFICIENTS, Rst};
use crate::state_codec::StateCodec;

/// Largest movement per position cycle of an axis at standstill, relative to the standstill tolerance.
const CREEP_TOLERANCE: f64 = 1e-3;

/// Position controller with fallback controller and bumpless transfer, in motor units (rad, rad/s).
#[derive(Debug, Clone, PartialEq)]
pub struct PositionController {
    law: ControlLaw,
    fallback: Option<FallbackController>,
    transfer: BumplessTransfer,
}

#[derive(Debug, Clone, PartialEq)]
enum ControlLaw {
    /// `Ω* = Kp (θ* − θ)`.
    Proportional { gain: f64 },
    /// `S Ω* = −R θ + T θ*` (Prévost eq. 9).
    Rst(Rst),
}

/// Fallback controller: proportional control with velocity feedforward that replaces an RST controller with integral
/// action at standstill and during current saturation.
///
/// - Standstill: the setpoint has been constant over the whole preview and lookback for more than
///   `standstill_cycles`. Two integrals, of the RST controller and of the velocity loop, cause a limit cycle (hunting)
///   with Coulomb friction; under proportional control the axis creeps to its setpoint and friction stops it.
/// - Current saturation: the motor current has been at its limit within the last preview of the controller. A linear
///   controller that is faster than the saturated motor oscillates about its setpoint.
///
/// ```text
/// Ω* = Kp (θ*(k) − θ(k)) + (θ*(k+1) − θ*(k)) / Tsp
/// Ω* = 0  if θ*(k+1) = θ*(k), |θ*(k) − θ(k)| ≤ standstill_tolerance, and friction has stopped the axis
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FallbackController {
    /// Kp, s⁻¹.
    pub gain: f64,
    /// Tsp, s.
    pub period: f64,
    /// Position cycles of constant setpoint before the fallback controller is active.
    pub standstill_cycles: u32,
    /// Following error that is not corrected at standstill, rad: correcting it would break the axis away from static
    /// friction.
    pub standstill_tolerance: f64,
}

/// State of a position controller: past positions and commands.
///
/// It is recorded for every control law, so that a new controller starts from the actual past (bumpless transfer).
#[derive(Debug, Clone, PartialEq)]
pub struct PositionState {
    /// θ(k), θ(k − 1), …
    angles: SignalHistory,
    /// Ω*(k − 1) + VFFWS(k − 1), Ω*(k − 2) + VFFWS(k − 2), …, after the limit of Ω*.
    commands: SignalHistory,
    /// Position cycles for which the setpoint has been constant over preview and lookback of the controller.
    standstill_cycles: u32,
    /// Position cycles since the motor current was at its limit.
    cycles_since_saturation: u32,
    transfer: BumplessTransferState,
}

impl PositionState {
    /// Creates the state of an axis at rest at `angle`, rad.
    pub fn at_rest(angle: f64) -> Self {
        PositionState {
            angles: SignalHistory::new(angle),
            commands: SignalHistory::new(0.0),
            standstill_cycles: u32::MAX,
            cycles_since_saturation: u32::MAX,
            transfer: BumplessTransferState::default(),
        }
    }

    /// Records the setpoint of the velocity loop for this position cycle, rad/s of the motor: limited Ω* plus VFFWS.
    ///
    /// Anti-windup of the RST recursion: it continues from the limited value; with the unlimited value a saturated
    /// controller diverges.
    #[inline]
    pub fn record(&mut self, command: f64) {
        self.commands.push(command);
    }

    /// Replaces the last command by the reached `speed`, rad/s, after current saturation.
    ///
    /// Anti-windup of the RST recursion: it continues from the speed that the saturated motor reached.
    #[inline]
    pub fn record_saturated(&mut self, speed: f64) {
        self.commands.replace_newest(speed);
        self.cycles_since_saturation = 0;
    }

    /// Writes or replaces the state.
    pub(crate) fn code(&mut self, codec: &mut StateCodec<'_>) {
        for history in [&mut self.angles, &mut self.commands] {
            codec.numbers(&mut history.ring);
            history.newest = codec.integer(history.newest as u64, MAX_COEFFICIENTS as u64 - 1) as usize;
        }
        codec.cycles(&mut self.standstill_cycles);
        codec.cycles(&mut self.cycles_since_saturation);
        self.transfer.code(codec);
    }

    /// Starts a bumpless transfer to another controller at the next position cycle.
    pub fn begin_transfer(&mut self) {
        self.transfer.is_pending = true;
        self.standstill_cycles = 0;
    }
}

/// Last [`MAX_COEFFICIENTS`] values of a signal.
#[derive(Debug, Clone, PartialEq)]
struct SignalHistory {
    ring: [f64; MAX_COEFFICIENTS],
    newest: usize,
}

impl SignalHistory {
    /// Creates the history of a constant signal.
    fn new(value: f64) -> Self {
        SignalHistory { ring: [value; MAX_COEFFICIENTS], newest: 0 }
    }

    #[inline]
    fn push(&mut self, value: f64) {
        self.newest = (self.newest + 1) % MAX_COEFFICIENTS;
        self.replace_newest(value);
    }

    /// Replaces the newest value.
    #[inline]
    fn replace_newest(&mut self, value: f64) {
        self.ring[self.newest] = value;
    }

    /// Returns the value `lag` cycles before the newest one.
    #[inline]
    fn lagged(&self, lag: usize) -> f64 {
        self.ring[(self.newest + MAX_COEFFICIENTS - lag) % MAX_COEFFICIENTS]
    }
}

impl PositionController {
    /// Creates the proportional controller `Ω* = Kp (θ* − θ)` with `gain` Kp, s⁻¹.
    pub fn proportional(gain: f64, transfer: BumplessTransfer) -> Self {
        PositionController { law: ControlLaw::Proportional { gain }, fallback: None, transfer }
    }

    /// Creates the controller `S Ω* = −R θ + T θ*` (Prévost eq. 9); `fallback` is used with integral action only, other
    /// controllers neither hunt nor wind up.
    pub fn rst(rst: Rst, fallback: FallbackController, transfer: BumplessTransfer) -> Self {
        let fallback = rst.has_integral_action().then_some(fallback);
        PositionController { law: ControlLaw::Rst(rst), fallback, transfer }
    }

    /// Returns the preview: furthest setpoint that the controller reads, position cycles ahead of the delayed one.
    pub fn preview(&self) -> i64 {
        match &self.law {
            ControlLaw::Proportional { .. } => 0,
            // The fallback controller reads one.
            ControlLaw::Rst(rst) => rst.preview().max(i64::from(self.fallback.is_some())),
        }
    }

    /// Returns the lookback: oldest setpoint that the controller reads, position cycles behind the delayed one.
    pub fn lookback(&self) -> i64 {
        match &self.law {
            ControlLaw::Proportional { .. } => 0,
            ControlLaw::Rst(rst) => rst.lookback(),
        }
    }

    /// Steps the controller by one position cycle; returns Ω* before the limit of the motor speed, rad/s.
    ///
    /// `setpoint(j)` returns θ*(k + j) in rad, `angle` is θ(k) in rad, `feedforward` is VFFWS in rad/s.
    ///
    /// ```text
    /// Ω*(k) = Kp (θ*(k) − θ(k))                                                  proportional (Prévost fig. 3)
    /// Ω*(k) = Σ tⱼ θ*(k + j) − Σ rᵢ θ(k − i) − Σ sᵢ (Ω* + VFFWS)(k − i), i ≥ 1 in S     RST (Prévost eq. 9)
    /// ```
    #[inline]
    pub fn update(
        &self,
        s: &mut PositionState,
        setpoint: impl Fn(i64) -> f64,
        angle: f64,
        feedforward: f64,
    ) -> f64 {
        s.angles.push(angle);
        s.cycles_since_saturation = s.cycles_since_saturation.saturating_add(1);
        if self.fallback.is_some() {
            let is_constant = (-self.lookback()..=self.preview()).all(|j| setpoint(j) == setpoint(0));
            s.standstill_cycles = if is_constant { s.standstill_cycles.saturating_add(1) } else { 0 };
        }
        if s.transfer.is_pending {
            let excess = self.output(s, &setpoint, angle) + feedforward - s.commands.lagged(0);
            let excess = excess - excess.clamp(-self.transfer.max_step, self.transfer.max_step);
            match &self.fallback {
                _ if excess == 0.0 => s.transfer.end(),
                Some(_) => s.transfer.begin(0.0, setpoint(0) - angle),
                None => s.transfer.begin(-excess, 0.0),
            }
        }
        let (command, error) = s.transfer.advance(&self.transfer);
        self.output(s, |j| setpoint(j) - error, angle) + command
    }

    #[inline]
    fn output(&self, s: &PositionState, setpoint: impl Fn(i64) -> f64, angle: f64) -> f64 {
        match (&self.law, &self.fallback) {
            (ControlLaw::Proportional { gain }, _) => gain * (setpoint(0) - angle),
            (ControlLaw::Rst(_), Some(fallback)) if self.is_fallback_active(s, fallback) => {
                let error = setpoint(0) - angle;
                let increment = setpoint(1) - setpoint(0);
                let creep = (angle - s.angles.lagged(1)).abs();
                let tolerance = fallback.standstill_tolerance;
                if increment == 0.0 && error.abs() <= tolerance && creep <= CREEP_TOLERANCE * tolerance {
                    return 0.0;
                }
                fallback.gain * error + increment / fallback.period
            }
            (ControlLaw::Rst(rst), _) => {
                let t = weighted_sum(rst.t(), |i| setpoint(rst.t_first() + i as i64));
                let r = weighted_sum(rst.r(), |i| s.angles.lagged(i));
                let s = weighted_sum(&rst.s()[1..], |i| s.commands.lagged(i));
                t - r - s
            }
        }
    }

    fn is_fallback_active(&self, s: &PositionState, fallback: &FallbackController) -> bool {
        // Preview of the controller, and the cycle that detected the saturation.
        let recovery_cycles = self.preview() + 1;
        s.standstill_cycles > fallback.standstill_cycles
            || i64::from(s.cycles_since_saturation) <= recovery_cycles
    }
}

#[inline]
fn weighted_sum(weights: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    weights.iter().enumerate().map(|(i, weight)| weight * value(i)).sum()
}

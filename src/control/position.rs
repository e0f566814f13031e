//! Position controllers: set-points and position in, velocity set-point out.

use super::rst::{MAX_COEFFICIENTS, Rst};

/// A position controller; works in motor units (rad, rad/s).
#[derive(Debug, Clone, PartialEq)]
pub enum PositionController {
    /// `Ω* = Kp (θ* − θ)`.
    Proportional {
        /// Kp, s⁻¹.
        gain: f64,
    },
    /// `S Ω* = −R θ + T θ*` (Prévost eq. 9).
    Rst {
        /// The polynomials.
        rst: Rst,
        /// Kp of the law that holds the axis while the set-point stands still, s⁻¹; none where the
        /// controller comes to rest by itself, since it has no integral action.
        hold: Option<f64>,
    },
}

/// What a position controller remembers: what it has seen and what it has asked for.
///
/// It is kept whatever the law is, so that one takes over from another without a bump.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionState {
    /// θ(k), θ(k − 1), …
    angles: [f64; MAX_COEFFICIENTS],
    /// Ω*(k − 1), Ω*(k − 2), …: as limited, with the velocity feedforward.
    commands: [f64; MAX_COEFFICIENTS],
    /// Whether the axis is held at rest.
    holding: bool,
}

impl PositionState {
    /// At rest at `angle`, rad.
    pub fn at_rest(angle: f64) -> Self {
        PositionState { angles: [angle; MAX_COEFFICIENTS], commands: [0.0; MAX_COEFFICIENTS], holding: true }
    }

    /// Takes down what the velocity loop is asked for until the next position instant, rad/s of the
    /// motor: the limited Ω* and the velocity feedforward together.
    ///
    /// The recursion goes on from what was really asked for: with the unlimited value a saturated
    /// controller diverges.
    #[inline]
    pub fn record(&mut self, command: f64) {
        shift_in(&mut self.commands, command);
    }
}

fn shift_in(values: &mut [f64; MAX_COEFFICIENTS], newest: f64) {
    values.copy_within(..MAX_COEFFICIENTS - 1, 1);
    values[0] = newest;
}

impl PositionController {
    /// The furthest set-point that the controller reads, position periods ahead of the delayed one.
    pub fn preview(&self) -> i64 {
        match self {
            PositionController::Proportional { .. } => 0,
            PositionController::Rst { rst, .. } => rst.preview(),
        }
    }

    /// The oldest set-point that the controller reads, position periods behind the delayed one.
    pub fn lookback(&self) -> i64 {
        match self {
            PositionController::Proportional { .. } => 0,
            PositionController::Rst { rst, .. } => rst.lookback(),
        }
    }

    /// Ω* before the limit of the motor's speed, rad/s; `setpoint(j)` is θ*(k + j), rad, and `angle` θ(k).
    #[inline]
    pub fn update(&self, s: &mut PositionState, setpoint: impl Fn(i64) -> f64, angle: f64) -> f64 {
        shift_in(&mut s.angles, angle);
        match self {
            PositionController::Proportional { gain } => gain * (setpoint(0) - angle),
            PositionController::Rst { rst, hold } => {
                let still = || (1..=rst.preview()).all(|j| setpoint(j) == setpoint(0));
                match hold {
                    Some(gain) if still() => {
                        s.holding = true;
                        gain * (setpoint(0) - angle)
                    }
                    _ => {
                        s.holding = false;
                        let asked = weighted(rst.t(), |i| setpoint(rst.t_first() + i as i64));
                        let seen = weighted(rst.r(), |i| s.angles[i]);
                        let done = weighted(&rst.s()[1..], |i| s.commands[i]);
                        asked - seen - done
                    }
                }
            }
        }
    }
}

#[inline]
fn weighted(weights: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    weights.iter().enumerate().map(|(i, weight)| weight * value(i)).sum()
}

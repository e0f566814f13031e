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
        /// The law that holds the axis at rest; none where the controller comes to rest by itself, since
        /// it has no integral action.
        hold: Option<Hold>,
    },
}

/// The proportional law that takes over where the set-point has stood still for a while, over the whole
/// horizon of the controller, until motion comes into its preview.
///
/// Integral action on top of that of the velocity loop hunts against Coulomb friction for ever; the
/// proportional law lets the axis creep to where it should be, and friction keeps it there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// Kp, s⁻¹.
    pub gain: f64,
    /// Position periods of standstill that the controller itself is given to finish a move.
    pub after: u32,
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
    /// Position instants since which the set-point has stood still over the whole horizon.
    still: u32,
}

impl PositionState {
    /// At rest at `angle`, rad.
    pub fn at_rest(angle: f64) -> Self {
        PositionState {
            angles: [angle; MAX_COEFFICIENTS],
            commands: [0.0; MAX_COEFFICIENTS],
            still: u32::MAX,
        }
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
                let now = setpoint(0);
                let is_still = (1..=rst.preview()).all(|j| setpoint(j) == now);
                s.still = if is_still { s.still.saturating_add(1) } else { 0 };
                if let Some(hold) = hold
                    && s.still > hold.after
                {
                    return hold.gain * (now - angle);
                }
                let asked = weighted(rst.t(), |i| setpoint(rst.t_first() + i as i64));
                let seen = weighted(rst.r(), |i| s.angles[i]);
                let done = weighted(&rst.s()[1..], |i| s.commands[i]);
                asked - seen - done
            }
        }
    }
}

#[inline]
fn weighted(weights: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    weights.iter().enumerate().map(|(i, weight)| weight * value(i)).sum()
}

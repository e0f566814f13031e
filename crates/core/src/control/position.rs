//! Position controllers: setpoints and position in, velocity setpoint out.

use super::rst::{MAX_COEFFICIENTS, Rst};
use super::transfer::{Transfer, TransferState};

/// How far an axis may creep in a position period to count as stopped, relative to the error with which it
/// may rest.
const STOPPED: f64 = 1e-3;

/// A position controller; works in motor units (rad, rad/s).
#[derive(Debug, Clone, PartialEq)]
pub struct PositionController {
    law: Law,
    guard: Option<Guard>,
    transfer: Transfer,
}

#[derive(Debug, Clone, PartialEq)]
enum Law {
    /// `Ω* = Kp (θ* − θ)`.
    Proportional { gain: f64 },
    /// `S Ω* = −R θ + T θ*` (Prévost eq. 9).
    Rst(Rst),
}

/// The proportional law with velocity feedforward that takes over from an RST controller
///
/// - where the setpoint has stood still for a while over the whole horizon, until motion comes into it:
///   integral action on top of that of the velocity loop hunts against Coulomb friction for ever, while a
///   proportional law lets the axis creep to where it should be, and friction keeps it there;
/// - where the motor's current has been at its limit, until it has not been there for a while: a linear law
///   that is faster than the motor can accelerate swings about its setpoint for ever.
///
/// ```text
/// Ω* = Kp (θ*(k) − θ(k)) + (θ*(k+1) − θ*(k)) / Tsp      0 where friction has stopped the axis close enough
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guard {
    /// Kp, s⁻¹.
    pub gain: f64,
    /// Tsp, s.
    pub period: f64,
    /// Position periods of standstill that the controller is given to finish a move by itself.
    pub rest_after: u32,
    /// Error with which an axis that friction has stopped may rest, rad: the integral of the velocity loop
    /// would tear it loose for less than is worth it.
    pub rest_error: f64,
}

/// What a position controller remembers: what it has seen and what has been asked for.
///
/// It is kept whatever the law is, so that one takes over from another with the past as it was.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionState {
    /// θ(k), θ(k − 1), …
    angles: Past,
    /// Ω*(k − 1), Ω*(k − 2), …: as limited, with the velocity feedforward.
    commands: Past,
    /// Position instants since which the setpoint has stood still over the whole horizon of this controller.
    still: u32,
    /// Position instants since the motor's current was at its limit.
    unlimited: u32,
    transfer: TransferState,
}

impl PositionState {
    /// At rest at `angle`, rad.
    pub fn at_rest(angle: f64) -> Self {
        PositionState {
            angles: Past::of(angle),
            commands: Past::of(0.0),
            still: u32::MAX,
            unlimited: u32::MAX,
            transfer: TransferState::default(),
        }
    }

    /// Takes down what the velocity loop is asked for until the next position instant, rad/s of the
    /// motor: the limited Ω* and the velocity feedforward together.
    ///
    /// The recursion goes on from what was really asked for: with the unlimited value a saturated
    /// controller diverges.
    #[inline]
    pub fn record(&mut self, command: f64) {
        self.commands.push(command);
    }

    /// Takes down that the axis reached `speed` instead, rad/s: the motor's current was at its limit, and
    /// a recursion that went on from what was asked for would wind up.
    #[inline]
    pub fn correct(&mut self, speed: f64) {
        self.commands.correct(speed);
        self.unlimited = 0;
    }

    /// Another controller takes over at the next position instant.
    pub fn hand_over(&mut self) {
        self.transfer.pending = true;
        self.still = 0;
    }
}

/// The last values of a signal, as many as any controller reads.
#[derive(Debug, Clone, PartialEq)]
struct Past {
    ring: [f64; MAX_COEFFICIENTS],
    newest: usize,
}

impl Past {
    /// A signal that always was `value`.
    fn of(value: f64) -> Self {
        Past { ring: [value; MAX_COEFFICIENTS], newest: 0 }
    }

    #[inline]
    fn push(&mut self, value: f64) {
        self.newest = (self.newest + 1) % MAX_COEFFICIENTS;
        self.correct(value);
    }

    /// Puts another value in the place of the newest.
    #[inline]
    fn correct(&mut self, value: f64) {
        self.ring[self.newest] = value;
    }

    /// The value `back` instants before the newest.
    #[inline]
    fn before(&self, back: usize) -> f64 {
        self.ring[(self.newest + MAX_COEFFICIENTS - back) % MAX_COEFFICIENTS]
    }
}

impl PositionController {
    /// `Ω* = Kp (θ* − θ)` with `gain` Kp, s⁻¹.
    pub fn proportional(gain: f64, transfer: Transfer) -> Self {
        PositionController { law: Law::Proportional { gain }, guard: None, transfer }
    }

    /// `S Ω* = −R θ + T θ*` (Prévost eq. 9); `guard` is for controllers with integral action, the others
    /// neither hunt nor wind up.
    pub fn rst(rst: Rst, guard: Guard, transfer: Transfer) -> Self {
        let guard = rst.has_integral_action().then_some(guard);
        PositionController { law: Law::Rst(rst), guard, transfer }
    }

    /// The furthest setpoint that the controller reads, position periods ahead of the delayed one.
    pub fn preview(&self) -> i64 {
        match &self.law {
            Law::Proportional { .. } => 0,
            // The guard reads one.
            Law::Rst(rst) => rst.preview().max(i64::from(self.guard.is_some())),
        }
    }

    /// The oldest setpoint that the controller reads, position periods behind the delayed one.
    pub fn lookback(&self) -> i64 {
        match &self.law {
            Law::Proportional { .. } => 0,
            Law::Rst(rst) => rst.lookback(),
        }
    }

    /// Ω* before the limit of the motor's speed, rad/s; `setpoint(j)` is θ*(k + j), rad, `angle` θ(k), and
    /// `feedforward` what the velocity loop will be asked for on top, rad/s.
    #[inline]
    pub fn update(
        &self,
        s: &mut PositionState,
        setpoint: impl Fn(i64) -> f64,
        angle: f64,
        feedforward: f64,
    ) -> f64 {
        s.angles.push(angle);
        s.unlimited = s.unlimited.saturating_add(1);
        if self.guard.is_some() {
            let is_still = (-self.lookback()..=self.preview()).all(|j| setpoint(j) == setpoint(0));
            s.still = if is_still { s.still.saturating_add(1) } else { 0 };
        }
        if s.transfer.pending {
            let excess = self.output(s, &setpoint, angle) + feedforward - s.commands.before(0);
            let excess = excess - excess.clamp(-self.transfer.step, self.transfer.step);
            match &self.guard {
                _ if excess == 0.0 => s.transfer.end(),
                Some(_) => s.transfer.begin(0.0, setpoint(0) - angle),
                None => s.transfer.begin(-excess, 0.0),
            }
        }
        let (command, error) = s.transfer.next(&self.transfer);
        self.output(s, |j| setpoint(j) - error, angle) + command
    }

    #[inline]
    fn output(&self, s: &PositionState, setpoint: impl Fn(i64) -> f64, angle: f64) -> f64 {
        match (&self.law, &self.guard) {
            (Law::Proportional { gain }, _) => gain * (setpoint(0) - angle),
            (Law::Rst(_), Some(guard)) if self.is_guarded(s, guard) => {
                let error = setpoint(0) - angle;
                let asked = setpoint(1) - setpoint(0);
                let crept = (angle - s.angles.before(1)).abs();
                if asked == 0.0 && error.abs() <= guard.rest_error && crept <= STOPPED * guard.rest_error {
                    return 0.0;
                }
                guard.gain * error + asked / guard.period
            }
            (Law::Rst(rst), _) => {
                let asked = weighted(rst.t(), |i| setpoint(rst.t_first() + i as i64));
                let seen = weighted(rst.r(), |i| s.angles.before(i));
                let done = weighted(&rst.s()[1..], |i| s.commands.before(i));
                asked - seen - done
            }
        }
    }

    fn is_guarded(&self, s: &PositionState, guard: &Guard) -> bool {
        // As long as the controller's own horizon, and the instant that the limit was seen at.
        let recovered_after = self.preview() + 1;
        s.still > guard.rest_after || i64::from(s.unlimited) <= recovered_after
    }
}

#[inline]
fn weighted(weights: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    weights.iter().enumerate().map(|(i, weight)| weight * value(i)).sum()
}

//! Knowledge of a user about a hidden axis.

use virtual_axes_core::config::{
    AxisConfig, BacklashCompensationConfig, DelaysConfig, FeedforwardConfig, FrictionConfig, GravityConfig,
    MachineConfig, MotorConfig, Periods, PiConfig, PositionControllerConfig, PositionFeedback,
    PositionLoopConfig,
};
use virtual_axes_core::units::{MICROSECOND_NS, MILLISECOND_NS, Nanoseconds, POSITION_GAIN};

use super::drawn::EMF_RATIO;
use super::hidden_axis::HiddenAxis;
use crate::random::{RandomSource, stream};

/// Largest relative error of inertia and torque constant.
const ERROR: f64 = 0.4;
/// Position-loop gain of the default machine, (m/min)/mm.
const DEFAULT_GAIN: f64 = 1.5;
/// Delays α, β, γ of the default machine.
const DEFAULT_DELAY: Nanoseconds = 9 * MILLISECOND_NS;
/// Periods of the default machine.
const DEFAULT_PERIODS: Periods =
    Periods { position: 6 * MILLISECOND_NS, velocity: 250 * MICROSECOND_NS, current: 125 * MICROSECOND_NS };
/// Ratio of velocity-loop gain to Jeq of the X axis of the default machine, s⁻¹.
const VELOCITY_BANDWIDTH: f64 = 5.0 / 0.028;
/// Ratio of current-loop gain to inductance of the X axis of the default machine, s⁻¹.
const CURRENT_BANDWIDTH: f64 = 13.0 / 8.5e-3;

/// Knowledge of a user about a hidden axis before identification.
///
/// Jeq and Kt are wrong by up to ±40 % each, independently, with Ke = Kt / 3, TFFW = Jeq and a velocity-loop gain
/// in proportion to Jeq. α, β and γ are 9 ms, friction and weight 0. Known are VFFW = 1, lead, limits, winding and the
/// limits of motor and drive. A motion shows the ratio Kt / Jeq only, not both values.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisGuess {
    /// Guessed parameters, SI units.
    pub config: AxisConfig,
    /// Guessed periods.
    pub periods: Periods,
    /// True if the position-loop gain is that of the hidden axis; otherwise it is 1.5 (m/min)/mm.
    pub is_gain_known: bool,
    /// True if the periods are those of the hidden axis; otherwise they are 6 ms, 250 µs, 125 µs.
    pub is_period_known: bool,
}

impl AxisGuess {
    /// Returns a machine with the guessed axis only.
    pub fn machine(&self) -> MachineConfig {
        MachineConfig::from_axis(self.config.clone(), self.periods)
    }
}

impl HiddenAxis {
    /// Draws a guess of the parameters. Axes of one machine with equal `seed` have equal knowledge of the periods.
    pub fn guess(&self, seed: u64) -> AxisGuess {
        let is_period_known = RandomSource::new(seed, stream::PERIOD_KNOWLEDGE).chance(0.5);
        let mut random = RandomSource::new(seed, stream::GUESS + self.joint as u64);
        let is_gain_known = random.chance(0.5);
        let hidden = &self.config;
        let inertia = hidden.motor.inertia * random.between(1.0 - ERROR, 1.0 + ERROR);
        let torque_constant = hidden.motor.torque_constant * random.between(1.0 - ERROR, 1.0 + ERROR);
        let config = AxisConfig {
            motor: MotorConfig {
                inertia,
                torque_constant,
                emf_constant: torque_constant * EMF_RATIO,
                ..hidden.motor
            },
            friction: FrictionConfig { a: 0.0, b: 0.01965, c: 0.0, d: -0.2801, i0: 0.0 },
            gravity: GravityConfig { weight: 0.0, tilt: 0.0, phase: 0.0 },
            position_loop: PositionLoopConfig {
                feedback: PositionFeedback::Motor,
                gain: if is_gain_known { hidden.position_loop.gain } else { DEFAULT_GAIN * POSITION_GAIN },
                controller: PositionControllerConfig::Cascade,
                backlash_compensation: BacklashCompensationConfig::default(),
                allow_unstable: false,
            },
            velocity_loop: PiConfig { gain: VELOCITY_BANDWIDTH * inertia, integral_time: 4e-3 },
            current_loop: PiConfig { gain: CURRENT_BANDWIDTH * hidden.motor.inductance, integral_time: 2e-3 },
            feedforward: FeedforwardConfig { velocity: 1.0, torque: inertia, friction: 0.0 },
            delays: DelaysConfig {
                alpha: DEFAULT_DELAY,
                beta: DEFAULT_DELAY,
                gamma: DEFAULT_DELAY,
                friction: 0,
            },
            ..hidden.clone()
        };
        let periods = if is_period_known { self.periods } else { DEFAULT_PERIODS };
        AxisGuess { config, periods, is_gain_known, is_period_known }
    }
}

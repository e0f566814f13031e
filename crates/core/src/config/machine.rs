//! A machine as typed values in SI units.
//!
//! The values come out of [`Parameters`](super::Parameters) only, which has checked each against
//! the schema: a `MachineConfig` that exists is valid.

use crate::units::Nanoseconds;

/// How far an axis may overshoot its stroke before that is said, m or rad.
const OVERSHOOT: f64 = 1e-3;

/// One machine: its axes and its sampling periods.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineConfig {
    pub(crate) name: String,
    pub(crate) periods: Periods,
    pub(crate) kinematics: KinematicsConfig,
    pub(crate) axes: Vec<AxisConfig>,
}

/// Sampling periods of the three loops; each is an integer multiple of the next (Prévost Appendix 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Periods {
    /// Tsp, position loop, ns.
    pub position: Nanoseconds,
    /// Tsv, velocity loop, ns.
    pub velocity: Nanoseconds,
    /// Tsi, current loop, ns: one tick of the simulation.
    pub current: Nanoseconds,
}

impl Periods {
    /// Ticks of the current loop in a position period.
    pub fn ticks_per_position(&self) -> u64 {
        (self.position / self.current) as u64
    }

    /// Ticks of the current loop in a velocity period.
    pub fn ticks_per_velocity(&self) -> u64 {
        (self.velocity / self.current) as u64
    }
}

/// Where the parts of the chain workpiece–C–A–X/Y/Z–tool stand: coordinates in m of the machine frame
/// with every axis at home.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KinematicsConfig {
    /// From the point that X, Y and Z move, which is in the origin at home, down to the tool tip.
    pub tool_length: f64,
    /// (Y, Z) of the line, parallel to X, about which A turns.
    pub pivot_a: [f64; 2],
    /// (X, Y) of the line, parallel to Z while A is at 0, about which C turns.
    pub pivot_c: [f64; 2],
    /// (X, Y, Z) of the workpiece frame's origin.
    pub workpiece: [f64; 3],
}

/// Whether an axis counts in meters or in radians.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisKind {
    /// Position in m.
    Linear,
    /// Position in rad.
    Rotary,
}

/// One axis, SI units; "motor" quantities are in rad and N·m, or in m and N for a linear motor.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisConfig {
    /// Name of the joint, without prefix.
    pub name: String,
    /// Linear or rotary.
    pub kind: AxisKind,
    /// r: m or rad of the axis per rad (or m) of the motor.
    pub transmission_ratio: f64,
    /// Motor.
    pub motor: MotorConfig,
    /// Friction law.
    pub friction: FrictionConfig,
    /// Gravity.
    pub gravity: GravityConfig,
    /// Position controller.
    pub position_loop: PositionLoopConfig,
    /// Velocity controller.
    pub velocity_loop: PiConfig,
    /// Current controller.
    pub current_loop: PiConfig,
    /// Feedforward weights.
    pub feedforward: FeedforwardConfig,
    /// Setpoint delays.
    pub delays: DelaysConfig,
    /// Plant deviation from the model that the controllers are designed for.
    pub deviation: DeviationConfig,
    /// Limits for trajectories.
    pub limits: LimitsConfig,
}

/// A direct-current motor equivalent to the servo motor (Prévost eq. 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorConfig {
    /// Jeq, kg·m² at the motor (kg for a linear motor).
    pub inertia: f64,
    /// Kt, N·m/A (N/A).
    pub torque_constant: f64,
    /// Ke, V·s/rad (V·s/m).
    pub emf_constant: f64,
    /// R, Ω.
    pub resistance: f64,
    /// L, H.
    pub inductance: f64,
    /// Limit of the current setpoint, A.
    pub max_current: f64,
    /// Limit of the voltage, V.
    pub max_voltage: f64,
    /// Limit of the velocity setpoint, rad/s (m/s).
    pub max_speed: f64,
}

/// Double-exponential friction law (Prévost eq. 3); V is in m/min or rev/min of the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionConfig {
    /// a, A.
    pub a: f64,
    /// b, min/m or min/rev.
    pub b: f64,
    /// c, A.
    pub c: f64,
    /// d, min/m or min/rev.
    pub d: f64,
    /// i0, breakaway current, A.
    pub i0: f64,
}

/// C_gravity = r (weight + tilt sin(position + phase)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GravityConfig {
    /// W, N (N·m on a rotary axis).
    pub weight: f64,
    /// k, N·m.
    pub tilt: f64,
    /// φ, rad.
    pub phase: f64,
}

/// Position controller.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionLoopConfig {
    /// Kp of the proportional law, s⁻¹: the cascade's, and that which holds the axis at rest.
    pub gain: f64,
    /// Which controller.
    pub controller: PositionControllerConfig,
    /// Whether an unstable closed loop is accepted.
    pub allow_unstable: bool,
}

/// The position controllers that there are.
#[derive(Debug, Clone, PartialEq)]
pub enum PositionControllerConfig {
    /// Proportional, with velocity and torque feedforward (Prévost fig. 3).
    Cascade,
    /// Generalized predictive control in RST form (Prévost section 5).
    Gpc(GpcConfig),
    /// Any linear controller, by its polynomials (Prévost eq. 9).
    Rst(RstConfig),
}

/// Tuning of a generalized predictive controller (Prévost table 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpcConfig {
    /// N1, first period of the prediction horizon.
    pub n1: usize,
    /// N2, last period of the prediction horizon.
    pub n2: usize,
    /// Nu, periods of the control horizon.
    pub nu: usize,
    /// λ / trace(GᵀG); not used where `lambda` is given.
    pub lambda_rel: f64,
    /// λ, weight of the control increments.
    pub lambda: Option<f64>,
}

/// Polynomials of a linear position controller (Prévost eq. 9), motor units.
#[derive(Debug, Clone, PartialEq)]
pub struct RstConfig {
    /// R, rising powers of q⁻¹, s⁻¹.
    pub r: Vec<f64>,
    /// S, rising powers of q⁻¹.
    pub s: Vec<f64>,
    /// T, rising powers of q from `t_first` on, s⁻¹.
    pub t: Vec<f64>,
    /// Exponent of q of the first coefficient of T.
    pub t_first: i64,
}

/// Gain and integral time of a PI controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiConfig {
    /// Kv, N·m/(rad/s), or Ki, V/A.
    pub gain: f64,
    /// Tv or Ti, s.
    pub integral_time: f64,
}

/// Weights of the feedforward (Prévost eqs. 6 and 7); zero is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedforwardConfig {
    /// VFFW, 1; the cascade's only.
    pub velocity: f64,
    /// TFFW, kg·m² at the motor (kg); the cascade's only.
    pub torque: f64,
    /// Weight of the friction compensation, 1; of every controller.
    pub friction: f64,
}

/// Delays of the setpoint, ns, before rounding to a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DelaysConfig {
    /// α, before the position comparator.
    pub alpha: Nanoseconds,
    /// β, behind the velocity feedforward.
    pub beta: Nanoseconds,
    /// γ, behind the torque feedforward.
    pub gamma: Nanoseconds,
    /// Shift of the friction compensation.
    pub friction: Nanoseconds,
}

/// What the plant has that the controllers are not designed for, as factors; 1 is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviationConfig {
    /// Of the inertia.
    pub inertia: f64,
    /// Of the friction torque.
    pub friction: f64,
    /// Of the torque constant.
    pub torque_constant: f64,
}

/// What trajectories may ask of an axis; m or rad, and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitsConfig {
    /// Vmax, m/s or rad/s.
    pub velocity: f64,
    /// Amax, m/s² or rad/s².
    pub acceleration: f64,
    /// Jmax, m/s³ or rad/s³.
    pub jerk: f64,
    /// Lower end of the stroke, m or rad; −∞ where there is none.
    pub travel_min: f64,
    /// Upper end of the stroke, m or rad; +∞ where there is none.
    pub travel_max: f64,
}

impl LimitsConfig {
    /// Whether an axis at `position`, m or rad, has left its travel limits by more than it may overshoot: 1 mm or 1 mrad.
    pub fn is_left_by(&self, position: f64) -> bool {
        !(self.travel_min - OVERSHOOT..=self.travel_max + OVERSHOOT).contains(&position)
    }
}

impl MachineConfig {
    /// Returns an unnamed machine with a single axis and default kinematics. The values are not checked against the
    /// schema: a changed copy of a checked [`AxisConfig`] can be simulated.
    pub fn from_axis(axis: AxisConfig, periods: Periods) -> Self {
        MachineConfig {
            name: String::new(),
            periods,
            kinematics: KinematicsConfig::default(),
            axes: vec![axis],
        }
    }

    /// Name of the machine.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Sampling periods.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Pivots, tool length and workpiece frame.
    pub fn kinematics(&self) -> &KinematicsConfig {
        &self.kinematics
    }

    /// Axes, in the order of `joints`.
    pub fn axes(&self) -> &[AxisConfig] {
        &self.axes
    }
}

impl AxisConfig {
    /// Name of the joint, without prefix.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Linear or rotary.
    pub fn kind(&self) -> AxisKind {
        self.kind
    }

    /// α, the delay of the setpoint before the position comparator, ns (Prévost fig. 3).
    pub fn alpha(&self) -> Nanoseconds {
        self.delays.alpha
    }

    /// The most that the motor exerts at the axis, Kt·imax/r, N or N·m.
    pub fn largest_effort(&self) -> f64 {
        self.motor.torque_constant * self.motor.max_current / self.transmission_ratio
    }

    /// Limits for trajectories.
    pub fn limits(&self) -> &LimitsConfig {
        &self.limits
    }
}

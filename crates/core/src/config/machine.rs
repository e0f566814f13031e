//! Machine configuration in SI units.
//!
//! [`Parameters::machine_config`](super::Parameters::machine_config) returns it, after the parameters were checked against
//! the schema.

use super::coupling::{GantryConfig, WorkpieceConfig};
use super::plant::{
    FrictionConfig, GravityConfig, MotorConfig, PreslidingConfig, StribeckConfig, TransmissionConfig,
};
use crate::units::Nanoseconds;

/// Tolerance on the travel limits in warnings, m or rad.
const OVERSHOOT_TOLERANCE: f64 = 1e-3;

/// Machine: axes, kinematics and sampling periods.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineConfig {
    pub(crate) name: String,
    pub(crate) periods: Periods,
    pub(crate) kinematics: KinematicsConfig,
    pub(crate) axes: Vec<AxisConfig>,
    /// Gain of cross-coupled control, 1/s; 0 without it.
    pub(crate) contour_gain: f64,
    /// Workpiece that couples A and C; `None` without one.
    pub(crate) workpiece: Option<WorkpieceConfig>,
    /// Beam that couples two linear axes; `None` without one.
    pub(crate) gantry: Option<GantryConfig>,
}

/// Sampling periods of the three loops, each an integer multiple of the next (Prévost Appendix 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Periods {
    /// Tsp, period of the position cycle, ns.
    pub position: Nanoseconds,
    /// Tsv, period of the velocity cycle, ns.
    pub velocity: Nanoseconds,
    /// Tsi, period of the current cycle, ns.
    pub current: Nanoseconds,
}

impl Periods {
    /// Returns the number of current cycles per position cycle.
    pub fn ticks_per_position(&self) -> u64 {
        (self.position / self.current) as u64
    }

    /// Returns the number of current cycles per velocity cycle.
    pub fn ticks_per_velocity(&self) -> u64 {
        (self.velocity / self.current) as u64
    }
}

/// Geometry of the kinematic chain workpiece–C–A–X/Y/Z–tool: coordinates in the machine frame with every axis at home, m.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KinematicsConfig {
    /// Tool length along −Z, m, from the point moved by X, Y and Z, which is the origin at home.
    pub tool_length: f64,
    /// (Y, Z) of the rotation axis of A, which is parallel to X, m.
    pub pivot_a: [f64; 2],
    /// (X, Y) of the rotation axis of C, which is parallel to Z while A is at 0, m.
    pub pivot_c: [f64; 2],
    /// Origin of the workpiece frame, m.
    pub workpiece: [f64; 3],
}

/// Type of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisKind {
    /// Linear axis, position in m.
    Linear,
    /// Rotary axis, position in rad.
    Rotary,
}

/// Axis in SI units. Motor quantities are in rad and N·m, or in m and N for a linear motor.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisConfig {
    /// Joint name, without prefix.
    pub name: String,
    /// Axis type.
    pub kind: AxisKind,
    /// Transmission ratio r: axis travel (m or rad) per motor travel (rad or m).
    pub transmission_ratio: f64,
    /// Elastic transmission; `None` for a rigid axis.
    pub transmission: Option<TransmissionConfig>,
    /// Motor parameters.
    pub motor: MotorConfig,
    /// Friction law.
    pub friction: FrictionConfig,
    /// Terms that are added to the friction law.
    pub stribeck: StribeckConfig,
    /// Presliding of the friction; `None` for friction without memory.
    pub presliding: Option<PreslidingConfig>,
    /// Gravity load.
    pub gravity: GravityConfig,
    /// Position controller.
    pub position_loop: PositionLoopConfig,
    /// Velocity controller.
    pub velocity_loop: PiConfig,
    /// Filters of the current setpoint, in series; `None` is no filter.
    pub current_filters: [Option<CurrentFilterConfig>; 2],
    /// Current controller.
    pub current_loop: PiConfig,
    /// Feedforward weights.
    pub feedforward: FeedforwardConfig,
    /// Setpoint delays.
    pub delays: DelaysConfig,
    /// Deviation of the plant from the model used in controller design.
    pub deviation: DeviationConfig,
    /// Trajectory limits.
    pub limits: LimitsConfig,
}

/// Position loop.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionLoopConfig {
    /// Proportional gain Kp of the cascade and of the fallback controller at rest, s⁻¹.
    pub gain: f64,
    /// Position controller.
    pub controller: PositionControllerConfig,
    /// Encoder of the position controller.
    pub feedback: PositionFeedback,
    /// Compensation of the backlash.
    pub backlash_compensation: BacklashCompensationConfig,
    /// True if an unstable closed loop is accepted.
    pub allow_unstable: bool,
}

/// Compensation of the backlash: an offset of the motor that changes its sign at each reversal of the setpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BacklashCompensationConfig {
    /// Width of the compensated gap, m or rad of the axis; 0: no compensation.
    pub width: f64,
    /// Largest velocity of the offset, m/s or rad/s of the axis.
    pub velocity: f64,
}

/// Encoder that a position controller reads. The velocity controller reads the motor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PositionFeedback {
    /// Encoder of the motor (semi-closed loop).
    #[default]
    Motor,
    /// Scale at the load (closed loop).
    Load,
}

/// Type and parameters of a position controller.
#[derive(Debug, Clone, PartialEq)]
pub enum PositionControllerConfig {
    /// Proportional controller with velocity and torque feedforward (Prévost fig. 3).
    Cascade,
    /// Generalized predictive control in RST form (Prévost section 5).
    Gpc(GpcConfig),
    /// Linear controller given by its polynomials R, S and T (Prévost eq. 9).
    Rst(RstConfig),
}

/// Tuning of a generalized predictive controller (Prévost table 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GpcConfig {
    /// First period N1 of the prediction horizon.
    pub n1: usize,
    /// Last period N2 of the prediction horizon.
    pub n2: usize,
    /// Length Nu of the control horizon, position cycles.
    pub nu: usize,
    /// Relative control weight λ / trace(GᵀG); unused if `lambda` is set.
    pub lambda_rel: f64,
    /// Weight λ of the control increments, s².
    pub lambda: Option<f64>,
}

/// Polynomials of an RST position controller in motor units (Prévost eq. 9).
#[derive(Debug, Clone, PartialEq)]
pub struct RstConfig {
    /// R in ascending powers of q⁻¹, s⁻¹.
    pub r: Vec<f64>,
    /// S in ascending powers of q⁻¹.
    pub s: Vec<f64>,
    /// T in ascending powers of q, beginning with `t_first`, s⁻¹.
    pub t: Vec<f64>,
    /// Exponent of q of the first coefficient of T.
    pub t_first: i64,
}

/// Gain and integral time of a PI controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiConfig {
    /// Proportional gain: Kv, N·m/(rad/s), or Ki, V/A.
    pub gain: f64,
    /// Integral time Tv or Ti, s.
    pub integral_time: f64,
}

/// Filter of the current setpoint between velocity controller and current limit, with gain 1 at frequency 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CurrentFilterConfig {
    /// Low-pass filter ω²/(s² + 2 D ω s + ω²).
    LowPass {
        /// Natural frequency ω/2π, Hz.
        frequency: f64,
        /// Damping ratio D.
        damping: f64,
    },
    /// Notch filter (s² + 2 D g ω s + ω²)/(s² + 2 D ω s + ω²) with D = bandwidth/(2 frequency).
    Notch {
        /// Center frequency ω/2π, Hz.
        frequency: f64,
        /// Bandwidth between the frequencies of −3 dB of a notch with gain 0, Hz.
        bandwidth: f64,
        /// Gain g at the center frequency, 0 to 1.
        gain: f64,
    },
}

impl CurrentFilterConfig {
    /// Returns the natural or center frequency, Hz.
    pub fn frequency(&self) -> f64 {
        match *self {
            CurrentFilterConfig::LowPass { frequency, .. } | CurrentFilterConfig::Notch { frequency, .. } => {
                frequency
            }
        }
    }
}

/// Feedforward weights (Prévost eqs. 6 and 7); 0 disables a term.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedforwardConfig {
    /// Velocity feedforward weight VFFW of the cascade.
    pub velocity: f64,
    /// Torque feedforward weight TFFW of the cascade, kg·m² at the motor (kg for a linear motor).
    pub torque: f64,
    /// Weight of the friction compensation, for all position controllers.
    pub friction: f64,
}

/// Setpoint delays, before rounding to a multiple of the current period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DelaysConfig {
    /// Delay α of the setpoint before the position comparator, ns.
    pub alpha: Nanoseconds,
    /// Delay β of the velocity feedforward, ns.
    pub beta: Nanoseconds,
    /// Delay γ of the torque feedforward, ns.
    pub gamma: Nanoseconds,
    /// Delay of the friction compensation, ns.
    pub friction: Nanoseconds,
}

/// Factors on the plant parameters that controller design and compensation do not include; 1 is no deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DeviationConfig {
    /// Factor on the inertia.
    pub inertia: f64,
    /// Factor on the friction torque.
    pub friction: f64,
    /// Factor on the torque constant.
    pub torque_constant: f64,
}

/// Limits for trajectories of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitsConfig {
    /// Velocity limit Vmax, m/s or rad/s.
    pub velocity: f64,
    /// Acceleration limit Amax, m/s² or rad/s².
    pub acceleration: f64,
    /// Jerk limit Jmax, m/s³ or rad/s³.
    pub jerk: f64,
    /// Lower travel limit, m or rad; −∞ if unlimited.
    pub travel_min: f64,
    /// Upper travel limit, m or rad; +∞ if unlimited.
    pub travel_max: f64,
}

impl LimitsConfig {
    /// Returns true if `position` (m or rad) is more than 1 mm or 1 mrad outside the travel limits.
    #[inline]
    pub fn is_outside_travel(&self, position: f64) -> bool {
        !(self.travel_min - OVERSHOOT_TOLERANCE..=self.travel_max + OVERSHOOT_TOLERANCE).contains(&position)
    }
}

impl MachineConfig {
    /// Creates an unnamed machine with a single axis and default kinematics, without checking the values against the
    /// schema: a changed copy of a checked [`AxisConfig`] can be simulated.
    pub fn from_axis(axis: AxisConfig, periods: Periods) -> Self {
        MachineConfig {
            name: String::new(),
            periods,
            kinematics: KinematicsConfig::default(),
            axes: vec![axis],
            contour_gain: 0.0,
            workpiece: None,
            gantry: None,
        }
    }

    /// Returns the gain of cross-coupled control, 1/s; 0 without it.
    pub fn contour_gain(&self) -> f64 {
        self.contour_gain
    }

    /// Returns the workpiece that couples the tables of A and C; `None` without one.
    pub fn workpiece(&self) -> Option<&WorkpieceConfig> {
        self.workpiece.as_ref()
    }

    /// Returns the beam that couples the two linear axes of a gantry; `None` without one.
    pub fn gantry(&self) -> Option<&GantryConfig> {
        self.gantry.as_ref()
    }

    /// Returns true if axes are coupled mechanically, by a workpiece or the beam of a gantry.
    pub fn has_coupled_axes(&self) -> bool {
        self.workpiece.is_some() || self.gantry.is_some()
    }

    /// Returns the machine without velocity and travel limits of trajectories, for setpoints that may exceed them.
    #[must_use]
    pub fn without_trajectory_limits(&self) -> Self {
        let mut machine = self.clone();
        for axis in &mut machine.axes {
            axis.limits.velocity = f64::INFINITY;
            (axis.limits.travel_min, axis.limits.travel_max) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        machine
    }

    /// Returns the name of the machine.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the sampling periods.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Returns pivots, tool length and workpiece frame.
    pub fn kinematics(&self) -> &KinematicsConfig {
        &self.kinematics
    }

    /// Returns the axes in the order of `joints`.
    pub fn axes(&self) -> &[AxisConfig] {
        &self.axes
    }
}

impl AxisConfig {
    /// Returns the joint name, without prefix.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the axis type.
    pub fn kind(&self) -> AxisKind {
        self.kind
    }

    /// Returns the delay α of the setpoint before the position comparator, ns (Prévost fig. 3).
    pub fn alpha(&self) -> Nanoseconds {
        self.delays.alpha
    }

    /// Returns the maximum motor force or torque at the axis, Kt·imax/r, N or N·m.
    pub fn max_effort(&self) -> f64 {
        self.motor.torque_constant * self.motor.max_current / self.transmission_ratio
    }

    /// Returns the trajectory limits.
    pub fn limits(&self) -> &LimitsConfig {
        &self.limits
    }
}

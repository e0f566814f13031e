//! Axis in SI units: its plant, controllers and limits.

use std::slice;

use super::declaration::{
    CheckedValues, Definitions, Field, ParameterGroup, choice_of, numbers_of, parameters,
};
use super::definition::AxisKind::{Linear, Rotary};
use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::MotorKind::{Linear as LinearMotor, Rotary as RotaryMotor};
use super::definition::{AxisKind, ParameterDefinition, choice, flag, integer, number, numbers};
use super::plant::{
    FrictionConfig, GearConfig, GravityConfig, MotorConfig, PreslidingConfig, StribeckConfig,
    TransmissionConfig, transmission_ratio,
};
use crate::units::{
    DEGREE, METER_PER_MINUTE, MICROMETER, MILLIMETER, MILLISECOND, MILLISECOND_NS, Nanoseconds,
    POSITION_GAIN, REVOLUTION, RPM,
};

/// Maximum horizon of predictive control and maximum preview of T, position cycles.
pub const MAX_HORIZON: i64 = 200;
/// Maximum number of coefficients of R and of S; controllers of the order of the drive have fewer than ten.
pub const MAX_RST_TERMS: usize = 32;
/// Maximum loop gain, in its unit.
pub(super) const MAX_GAIN: f64 = 1e9;
/// Tolerance on the travel limits in warnings, m or rad.
const OVERSHOOT_TOLERANCE: f64 = 1e-3;

/// Defines a loop gain.
const fn gain(key: &'static str, unit: &'static str) -> ParameterDefinition {
    number(key, unit, 0.0, MAX_GAIN).live()
}

/// Defines an integral time; 0 would cause a division by zero.
const fn integral_time(key: &'static str) -> ParameterDefinition {
    number(key, "ms", 1e-3, 1e6).live().si(MILLISECOND)
}

/// Defines the type of a filter of the current setpoint.
const fn filter_type(key: &'static str) -> ParameterDefinition {
    choice(key, &["none", "low_pass", "notch"]).default(Text("none")).live()
}

/// Defines a frequency or bandwidth of a filter, at most half the rate of the shortest velocity period.
const fn filter_frequency(key: &'static str, default: f64) -> ParameterDefinition {
    number(key, "Hz", 1.0, 500e3).default(Number(default)).live()
}

/// Defines the damping ratio of a low-pass filter.
const fn filter_damping(key: &'static str) -> ParameterDefinition {
    number(key, "", 0.05, 10.0).default(Number(0.7)).live()
}

/// Defines the depth of a notch filter.
const fn filter_depth(key: &'static str) -> ParameterDefinition {
    number(key, "dB", 0.0, 100.0).default(Number(40.0)).live()
}

/// Defines a polynomial of an RST controller.
const fn polynomial(key: &'static str, unit: &'static str, max_len: usize) -> ParameterDefinition {
    numbers(key, unit, max_len).optional().live()
}

/// Defines a weight of the feedforward.
const fn weight(key: &'static str, unit: &'static str, max: f64) -> ParameterDefinition {
    number(key, unit, 0.0, max).zero().live()
}

/// Defines a setpoint delay.
const fn delay(key: &'static str) -> ParameterDefinition {
    number(key, "ms", 0.0, 100.0).zero().live().si(MILLISECOND_NS as f64)
}

/// Defines a horizon of predictive control.
const fn horizon(key: &'static str, default: i64) -> ParameterDefinition {
    integer(key, "", 1, MAX_HORIZON).default(Integer(default)).live()
}

/// Defines a plant deviation factor.
const fn deviation(key: &'static str) -> ParameterDefinition {
    number(key, "", 0.1, 10.0).default(Number(1.0)).live()
}

/// Defines a default tolerance of action goals.
const fn tolerance(key: &'static str, unit: &'static str) -> ParameterDefinition {
    number(key, unit, 0.0, 1e6).zero().live()
}

parameters! {
    /// Axis in SI units. Motor quantities are in rad and N·m, or in m and N for a linear motor.
    #[derive(Debug, Clone, PartialEq)]
    pub struct AxisConfig of Axis {
        /// Joint name, without prefix.
        pub name: String => |values: &CheckedValues<'_>, _| Some(values.joint?.name.clone());
        /// Type of the axis: linear in meters or rotary in radians.
        pub kind: AxisKind = choice("type", AxisKind::NAMES) => choice_of;
        /// Transmission ratio r: axis travel (m or rad) per motor travel (rad or m).
        pub transmission_ratio: f64 => transmission_ratio;
        use GearConfig;
        /// Elastic transmission; `None` for a rigid axis.
        pub transmission: Option<TransmissionConfig>;
        /// Motor parameters.
        pub motor: MotorConfig;
        /// Friction law.
        pub friction: FrictionConfig;
        /// Terms that are added to the friction law.
        pub stribeck: StribeckConfig;
        /// Presliding of the friction; `None` for friction without memory.
        pub presliding: Option<PreslidingConfig>
            => |values, _| Some(PreslidingConfig::read(values).filter(|presliding| presliding.stiffness > 0.0));
        use PreslidingConfig;
        /// Gravity load.
        pub gravity: GravityConfig;
        /// Position controller.
        pub position_loop: PositionLoopConfig;
        /// Kv, proportional gain of the velocity loop (Prévost Appendix 2).
        pub velocity_loop: PiConfig = gain("velocity_loop.gain", "N·m/(rad/s)").driven_by(RotaryMotor),
            /// Kv, proportional gain of the velocity loop (Prévost Appendix 2).
            = gain("velocity_loop.gain", "N/(m/s)").driven_by(LinearMotor),
            /// Tv, integral time of the velocity loop (Prévost Appendix 2).
            = integral_time("velocity_loop.integral_time_ms")
            => pi;
        /// Type of the first filter of the current setpoint.
        pub current_filters: [Option<CurrentFilterConfig>; 2] = filter_type("current_filter_1.type"),
            /// Natural frequency of the low-pass, center frequency of the notch, below half the rate of the velocity
            /// cycles.
            = filter_frequency("current_filter_1.frequency_hz", 200.0),
            /// Damping ratio D of the low-pass.
            = filter_damping("current_filter_1.damping"),
            /// Bandwidth of the notch, between its frequencies of -3 dB at infinite depth.
            = filter_frequency("current_filter_1.bandwidth_hz", 100.0),
            /// Attenuation of the notch at its center frequency.
            = filter_depth("current_filter_1.depth_db"),
            /// Type of the second filter of the current setpoint, after the first.
            = filter_type("current_filter_2.type"),
            /// Natural frequency of the low-pass, center frequency of the notch, below half the rate of the velocity
            /// cycles.
            = filter_frequency("current_filter_2.frequency_hz", 200.0),
            /// Damping ratio D of the low-pass.
            = filter_damping("current_filter_2.damping"),
            /// Bandwidth of the notch, between its frequencies of -3 dB at infinite depth.
            = filter_frequency("current_filter_2.bandwidth_hz", 100.0),
            /// Attenuation of the notch at its center frequency.
            = filter_depth("current_filter_2.depth_db")
            => current_filters;
        /// Ki, proportional gain of the current loop (Prévost Appendix 2).
        pub current_loop: PiConfig = gain("current_loop.gain", "V/A"),
            /// Ti, integral time of the current loop (Prévost Appendix 2).
            = integral_time("current_loop.integral_time_ms")
            => pi;
        /// Feedforward weights.
        pub feedforward: FeedforwardConfig;
        /// Setpoint delays.
        pub delays: DelaysConfig;
        /// Deviation of the plant from the model used in controller design.
        pub deviation: DeviationConfig;
        /// Trajectory limits.
        pub limits: LimitsConfig;
        use ToleranceConfig;
    }
}

parameters! {
    /// Position loop.
    #[derive(Debug, Clone, PartialEq)]
    pub struct PositionLoopConfig of Axis {
        /// Position controller: cascade with feedforward (Prévost fig. 3), generalized predictive control (GPC), or RST
        /// polynomials.
        pub controller: PositionControllerConfig =
            choice("position_loop.controller", ControllerName::NAMES).default(Text(ControllerName::Cascade.name())).live()
            => position_controller;
        /// Kp, position-loop gain; 1 (m/min)/mm is 16.667 s⁻¹ (Prévost Appendix 2).
        pub gain: f64 = gain("position_loop.gain", "(m/min)/mm").on(Linear).si(POSITION_GAIN),
            /// Kp, position-loop gain; 1 (1000 °/min)/° is 16.667 s⁻¹ (Prévost Appendix 2).
            = gain("position_loop.gain", "(1000 °/min)/°").on(Rotary).si(POSITION_GAIN);
        use GpcConfig;
        /// Encoder of the position controller: at the motor (semi-closed loop), or at the load of an elastic
        /// transmission (closed loop).
        pub feedback: PositionFeedback =
            choice("position_loop.feedback", PositionFeedback::NAMES).default(Text(PositionFeedback::Motor.name()))
            => choice_of;
        /// Compensation of the backlash.
        pub backlash_compensation: BacklashCompensationConfig;
        /// Accept a position controller whose closed loop is unstable.
        pub allow_unstable: bool = flag("position_loop.allow_unstable").default(Flag(false)).live();
        use RstConfig;
    }
}

parameters! {
    /// Compensation of the backlash: an offset of the motor that changes its sign at each reversal of the setpoint.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct BacklashCompensationConfig of Axis {
        /// Step of the motor at a reversal of the setpoint that compensates a backlash of this width; 0: no
        /// compensation.
        pub width: f64 = number("backlash_compensation.width_um", "µm", 0.0, 1e4).on(Linear).zero().live().si(MICROMETER),
            /// Step of the motor at a reversal of the setpoint that compensates a backlash of this width, at the axis;
            /// 0: no compensation.
            = number("backlash_compensation.width_deg", "°", 0.0, 10.0).on(Rotary).zero().live().si(DEGREE);
        /// Largest velocity of the backlash compensation along the axis.
        pub velocity: f64 =
            number("backlash_compensation.velocity_m_min", "m/min", 1e-6, 1e3).on(Linear).default(Number(0.1)).live().si(METER_PER_MINUTE),
            /// Largest velocity of the backlash compensation, of the axis.
            = number("backlash_compensation.velocity_rpm", "rpm", 1e-6, 1e3).on(Rotary).default(Number(0.1)).live().si(RPM);
    }
}

crate::named_values! {
    /// Encoder that a position controller reads. The velocity controller reads the motor.
    #[derive(Default)]
    pub enum PositionFeedback {
        /// Encoder of the motor (semi-closed loop).
        #[default]
        Motor = "motor",
        /// Scale at the load (closed loop).
        Load = "load",
    }
}

crate::named_values! {
    /// Name of a position controller.
    pub enum ControllerName {
        /// Proportional controller with feedforward.
        Cascade = "cascade",
        /// Generalized predictive controller.
        Gpc = "gpc",
        /// RST controller.
        Rst = "rst",
    }
}

impl ControllerName {
    /// Name of the cascade without feedforward, a variant of the same controller.
    pub const CASCADE_WITHOUT_FEEDFORWARD: &'static str = "cascade-noff";
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

impl PositionControllerConfig {
    /// Returns the name of the controller.
    pub fn name(&self) -> &'static str {
        match self {
            PositionControllerConfig::Cascade => ControllerName::Cascade.name(),
            PositionControllerConfig::Gpc(_) => ControllerName::Gpc.name(),
            PositionControllerConfig::Rst(_) => ControllerName::Rst.name(),
        }
    }
}

fn position_controller(values: &CheckedValues<'_>, rows: Definitions) -> Option<PositionControllerConfig> {
    Some(match choice_of(values, rows)? {
        ControllerName::Cascade => PositionControllerConfig::Cascade,
        ControllerName::Gpc => PositionControllerConfig::Gpc(GpcConfig::read(values)?),
        ControllerName::Rst => PositionControllerConfig::Rst(RstConfig::read(values)?),
    })
}

parameters! {
    /// Tuning of a generalized predictive controller (Prévost table 1).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct GpcConfig of Axis {
        /// N1, first position cycle of the prediction horizon, at most n2 (Prévost table 1).
        pub n1: usize = horizon("position_loop.gpc.n1", 1);
        /// N2, last position cycle of the prediction horizon (Prévost table 1).
        pub n2: usize = horizon("position_loop.gpc.n2", 14);
        /// Nu, position cycles of the control horizon, at most n2 (Prévost table 1).
        pub nu: usize = horizon("position_loop.gpc.nu", 12);
        /// λ / trace(GᵀG), relative weight of the control increments; unused if lambda is set.
        pub lambda_rel: f64 = number("position_loop.gpc.lambda_rel", "", 0.0, MAX_GAIN).default(Number(0.005)).live();
        /// λ, weight of the control increments (Prévost table 1).
        pub lambda: Option<f64> = number("position_loop.gpc.lambda", "s²", 0.0, MAX_GAIN).optional().live();
    }
}

parameters! {
    /// Polynomials of an RST position controller in motor units (Prévost eq. 9).
    #[derive(Debug, Clone, PartialEq)]
    pub struct RstConfig of Axis {
        /// R of an RST controller, in ascending powers of q⁻¹ from q⁰ (Prévost eq. 9).
        pub r: Vec<f64> = polynomial("position_loop.rst.r", "s⁻¹", MAX_RST_TERMS);
        /// S of an RST controller, in ascending powers of q⁻¹ from q⁰ (Prévost eq. 9).
        pub s: Vec<f64> = polynomial("position_loop.rst.s", "", MAX_RST_TERMS);
        /// T of an RST controller, in ascending powers of q, beginning with position_loop.rst.t_first (Prévost eq. 9).
        pub t: Vec<f64> = polynomial("position_loop.rst.t", "s⁻¹", 2 * MAX_HORIZON as usize + 1);
        /// Power of q of the first term of T: 1 is one position cycle of preview.
        pub t_first: i64 = integer("position_loop.rst.t_first", "", -MAX_HORIZON, MAX_HORIZON).default(Integer(0)).live();
    }
}

/// Gain and integral time of a PI controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PiConfig {
    /// Proportional gain: Kv, N·m/(rad/s), or Ki, V/A.
    pub gain: f64,
    /// Integral time Tv or Ti, s.
    pub integral_time: f64,
}

fn pi(values: &CheckedValues<'_>, rows: Definitions) -> Option<PiConfig> {
    let (integral_time, gain) = rows.split_last()?;
    let integral_time = f64::read(values, slice::from_ref(integral_time))?;
    Some(PiConfig { gain: f64::read(values, gain)?, integral_time })
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

fn current_filters(
    values: &CheckedValues<'_>,
    rows: Definitions,
) -> Option<[Option<CurrentFilterConfig>; 2]> {
    let filter = |rows: Definitions| {
        let (kind, numbers) = rows.split_at_checked(1)?;
        let [frequency, damping, bandwidth, depth] = numbers_of(values, numbers)?;
        Some(match String::read(values, kind)?.as_str() {
            "low_pass" => Some(CurrentFilterConfig::LowPass { frequency, damping }),
            "notch" => {
                Some(CurrentFilterConfig::Notch { frequency, bandwidth, gain: 10_f64.powf(-depth / 20.0) })
            }
            _ => None,
        })
    };
    let (first, second) = rows.split_at_checked(5)?;
    Some([filter(first)?, filter(second)?])
}

parameters! {
    /// Feedforward weights (Prévost eqs. 6 and 7); velocity and torque are those of the cascade.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct FeedforwardConfig of Axis {
        /// VFFW, weight of the velocity feedforward; 0 disables it (Prévost eq. 6).
        pub velocity: f64 = weight("feedforward.velocity", "", 2.0);
        /// TFFW, weight of the torque feedforward at the motor; 0 disables it (Prévost eq. 7).
        pub torque: f64 = weight("feedforward.torque_kg_m2", "kg·m²", 1e3).driven_by(RotaryMotor),
            /// TFFW, weight of the force feedforward; 0 disables it (Prévost eq. 7).
            = weight("feedforward.torque_kg", "kg", 1e6).driven_by(LinearMotor);
        /// Weight of the friction compensation by the friction torque at the setpoint velocity; 0 disables it.
        pub friction: f64 = weight("feedforward.friction", "", 2.0);
    }
}

parameters! {
    /// Setpoint delays, ns, before rounding to a multiple of the current period.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct DelaysConfig of Axis {
        /// α, delay of the setpoint before the position comparator (Prévost fig. 3).
        pub alpha: Nanoseconds = delay("delays.alpha_ms");
        /// β, delay of the velocity feedforward (Prévost fig. 3).
        pub beta: Nanoseconds = delay("delays.beta_ms");
        /// γ, delay of the torque feedforward (Prévost fig. 3).
        pub gamma: Nanoseconds = delay("delays.gamma_ms");
        /// Delay of the friction compensation after the setpoint.
        pub friction: Nanoseconds = delay("delays.friction_ms");
    }
}

parameters! {
    /// Factors on the plant parameters that controller design and compensation do not include; 1 is no deviation.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct DeviationConfig of Axis {
        /// Factor on the plant inertia, relative to controller design.
        pub inertia: f64 = deviation("deviation.inertia");
        /// Factor on the plant friction, relative to friction compensation.
        pub friction: f64 = deviation("deviation.friction");
        /// Factor on the plant torque constant, relative to the drive parameters.
        pub torque_constant: f64 = deviation("deviation.torque_constant");
    }
}

parameters! {
    /// Limits for trajectories of an axis.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct LimitsConfig of Axis {
        /// Vmax, velocity limit of trajectories.
        pub velocity: f64 = number("limits.velocity_m_min", "m/min", 1e-6, 1e5).on(Linear).si(METER_PER_MINUTE),
            /// Vmax, velocity limit of trajectories, of the axis.
            = number("limits.velocity_rpm", "rpm", 1e-6, 1e6).on(Rotary).si(RPM);
        /// Amax, acceleration of a controlled stop; setpoints are not checked against it.
        pub acceleration: f64 = number("limits.acceleration_m_s2", "m/s²", 1e-6, 1e5).on(Linear),
            /// Amax, acceleration of a controlled stop; setpoints are not checked against it.
            = number("limits.acceleration_rev_s2", "rev/s²", 1e-6, 1e5).on(Rotary).si(REVOLUTION);
        /// Jmax, jerk of a controlled stop; setpoints are not checked against it.
        pub jerk: f64 = number("limits.jerk_m_s3", "m/s³", 1e-6, 1e7).on(Linear),
            /// Jmax, jerk of a controlled stop; setpoints are not checked against it.
            = number("limits.jerk_rev_s3", "rev/s³", 1e-6, 1e7).on(Rotary).si(REVOLUTION);
        /// Lower travel limit; unlimited if omitted. Home is 0.
        pub travel_min: f64 = number("limits.travel_min_mm", "mm", -1e6, 0.0).on(Linear).optional().si(MILLIMETER),
            /// Lower travel limit; unlimited if omitted. Home is 0.
            = number("limits.travel_min_deg", "°", -1e6, 0.0).on(Rotary).optional().si(DEGREE)
            => |values, rows| Some(f64::read(values, rows).unwrap_or(f64::NEG_INFINITY));
        /// Upper travel limit; unlimited if omitted. Home is 0.
        pub travel_max: f64 = number("limits.travel_max_mm", "mm", 0.0, 1e6).on(Linear).optional().si(MILLIMETER),
            /// Upper travel limit; unlimited if omitted. Home is 0.
            = number("limits.travel_max_deg", "°", 0.0, 1e6).on(Rotary).optional().si(DEGREE)
            => |values, rows| Some(f64::read(values, rows).unwrap_or(f64::INFINITY));
    }
}

parameters! {
    /// Default tolerances of action goals of an axis, on the delay-compensated following error.
    #[derive(Debug, Clone, Copy)]
    pub(super) struct ToleranceConfig of Axis {
        /// Default path tolerance of action goals; 0 disables it.
        pub path: Option<f64> = tolerance("tolerances.path_mm", "mm").on(Linear).si(MILLIMETER),
            /// Default path tolerance of action goals; 0 disables it.
            = tolerance("tolerances.path_deg", "°").on(Rotary).si(DEGREE);
        /// Default goal tolerance of action goals; 0 disables it.
        pub goal: Option<f64> = tolerance("tolerances.goal_mm", "mm").on(Linear).si(MILLIMETER),
            /// Default goal tolerance of action goals; 0 disables it.
            = tolerance("tolerances.goal_deg", "°").on(Rotary).si(DEGREE);
    }
}

impl LimitsConfig {
    /// Returns true if `position` (m or rad) is more than 1 mm or 1 mrad outside the travel limits.
    #[inline]
    pub fn is_outside_travel(&self, position: f64) -> bool {
        !(self.travel_min - OVERSHOOT_TOLERANCE..=self.travel_max + OVERSHOOT_TOLERANCE).contains(&position)
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

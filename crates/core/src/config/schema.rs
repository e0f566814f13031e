//! Parameter schema: the single table for validation, typed configuration, ROS descriptors and the reference.
//!
//! Equation numbers refer to Prévost, Lavernhe, Lartigue, Dumur: *Feed drive modelling for the simulation of tool path
//! tracking in multi-axis High Speed Machining*.

use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::MotorKind::{Linear as LinearMotor, Rotary as RotaryMotor};
use super::definition::{ParameterDefinition, ParameterKind};
use super::machine::AxisKind::{Linear, Rotary};
use super::node_schema::NODE;
use super::plant_schema::PLANT;

/// Range of sampling periods, ms; the resolution of the pacing in the node is 1 µs.
const PERIOD_MS: (f64, f64) = (1e-3, 50.0);
/// Range of sampling periods, µs.
const PERIOD_US: (f64, f64) = (1.0, 50e3);
/// Maximum setpoint delay, ms.
const MAX_DELAY_MS: f64 = 100.0;
/// Maximum distance in a machine, mm; the largest gantries have some tens of meters.
const MAX_DISTANCE_MM: f64 = 1e5;
/// Maximum mass of a workpiece, kg.
const MAX_WORKPIECE_KG: f64 = 5e4;
/// Maximum moment of inertia of a workpiece, kg·m².
const MAX_MOMENT: f64 = 1e6;
/// Maximum stiffness of a gantry, N/µm, and damping, N/(m/s).
const MAX_GANTRY: (f64, f64) = (1e6, 1e9);
/// Maximum horizon of predictive control and maximum preview of T, position cycles.
pub const MAX_HORIZON: i64 = 200;
/// Range of the plant deviation factors.
const DEVIATION: (f64, f64) = (0.1, 10.0);
/// Maximum frequency of a filter, Hz: half the rate of the shortest velocity period.
const MAX_FILTER_FREQUENCY_HZ: f64 = 500e3;
/// Maximum loop gain, in its unit.
const MAX_GAIN: f64 = 1e9;
/// Maximum default tolerance of an action goal of a linear axis, mm.
const MAX_TOLERANCE_MM: f64 = 1e6;
/// Maximum default tolerance of an action goal of a rotary axis, °.
const MAX_TOLERANCE_DEG: f64 = 1e6;
/// Range of integral times, ms; 0 would cause a division by zero.
const INTEGRAL_TIME_MS: (f64, f64) = (1e-3, 1e6);
/// Maximum number of coefficients of R and of S; controllers of the order of the drive have fewer than ten.
pub const MAX_RST_TERMS: usize = 32;

/// Defines a loop gain, settable at run time.
const fn gain(key: &'static str, unit: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, unit, 0.0, MAX_GAIN).of_axis().live()
}

/// Defines an integral time, settable at run time.
const fn integral_time(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "ms", INTEGRAL_TIME_MS.0, INTEGRAL_TIME_MS.1).of_axis().live()
}

/// Defines the type of a filter of the current setpoint, settable at run time.
const fn filter_type(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::new(key, "", ParameterKind::Choice(&["none", "low_pass", "notch"]))
        .of_axis()
        .default(Text("none"))
        .live()
}

/// Defines a frequency or bandwidth of a filter, settable at run time.
const fn filter_frequency(key: &'static str, default: f64) -> ParameterDefinition {
    ParameterDefinition::number(key, "Hz", 1.0, MAX_FILTER_FREQUENCY_HZ)
        .of_axis()
        .default(Number(default))
        .live()
}

/// Defines the damping ratio of a low-pass filter, settable at run time.
const fn filter_damping(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "", 0.05, 10.0).of_axis().default(Number(0.7)).live()
}

/// Defines the depth of a notch filter, settable at run time.
const fn filter_depth(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "dB", 0.0, 100.0).of_axis().default(Number(40.0)).live()
}

/// Defines a polynomial of an RST controller, settable at run time.
const fn polynomial(key: &'static str, unit: &'static str, max_len: usize) -> ParameterDefinition {
    ParameterDefinition::new(key, unit, ParameterKind::NumberList { min_len: 1, max_len })
        .of_axis()
        .optional()
        .live()
}

/// Defines a setpoint delay, settable at run time.
const fn delay(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "ms", 0.0, MAX_DELAY_MS).of_axis().default(Number(0.0)).live()
}

/// Defines a horizon of predictive control, settable at run time.
const fn horizon(key: &'static str, default: i64) -> ParameterDefinition {
    ParameterDefinition::new(key, "", ParameterKind::Integer { min: 1, max: MAX_HORIZON })
        .of_axis()
        .default(Integer(default))
        .live()
}

/// Defines a plant deviation factor, settable at run time.
const fn deviation(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "", DEVIATION.0, DEVIATION.1).of_axis().default(Number(1.0)).live()
}

/// Defines a default tolerance of action goals, settable at run time.
const fn tolerance(key: &'static str, unit: &'static str, max: f64) -> ParameterDefinition {
    ParameterDefinition::number(key, unit, 0.0, max).default(Number(0.0)).live()
}

/// Defines a principal moment of inertia of the workpiece.
const fn moment(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "kg·m²", 0.0, MAX_MOMENT).default(Number(0.0))
}

/// Defines a coordinate in the machine frame, whose origin is the home position.
const fn coordinate(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "mm", -MAX_DISTANCE_MM, MAX_DISTANCE_MM).default(Number(0.0))
}

/// Definitions of all parameters. A key has two definitions if its unit depends on the type of axis or motor.
pub static DEFINITIONS: &[ParameterDefinition] = &concatenate::<
    { MACHINE.len() + PLANT.len() + CONTROL.len() + NODE.len() },
>([MACHINE, PLANT, CONTROL, NODE]);

const fn concatenate<const N: usize>(parts: [&[ParameterDefinition]; 4]) -> [ParameterDefinition; N] {
    let mut all = [MACHINE[0]; N];
    let (mut part, mut index, mut count) = (0, 0, 0);
    while count < N {
        if index < parts[part].len() {
            all[count] = parts[part][index];
            index += 1;
            count += 1;
        } else {
            part += 1;
            index = 0;
        }
    }
    all
}

/// Parameters of the machine.
const MACHINE: &[ParameterDefinition] = &[
    // Machine.
    ParameterDefinition::new("machine", "", ParameterKind::Text).describe("Name of the machine."),
    ParameterDefinition::new("joints", "", ParameterKind::TextList)
        .describe("Names of the axes, in the order of messages and tables."),
    ParameterDefinition::number("periods.position_ms", "ms", PERIOD_MS.0, PERIOD_MS.1)
        .describe("Tsp, period of the position cycle, a multiple of periods.velocity_us."),
    ParameterDefinition::number("periods.velocity_us", "µs", PERIOD_US.0, PERIOD_US.1)
        .describe("Tsv, period of the velocity cycle, a multiple of periods.current_us."),
    ParameterDefinition::number("periods.current_us", "µs", PERIOD_US.0, PERIOD_US.1)
        .describe("Tsi, period of the current cycle."),
    // Kinematic chain workpiece-C-A-X/Y/Z-tool; coordinates in the machine frame with every axis at home.
    ParameterDefinition::number("kinematics.tool_length_mm", "mm", 0.0, MAX_DISTANCE_MM)
        .default(Number(0.0))
        .describe(
            "Tool length along -Z, from the point moved by X, Y and Z (the origin at home) to the tool tip.",
        ),
    coordinate("kinematics.pivot_a_y_mm").describe("Y of the rotation axis of A, which is parallel to X."),
    coordinate("kinematics.pivot_a_z_mm").describe("Z of the rotation axis of A, which is parallel to X."),
    coordinate("kinematics.pivot_c_x_mm")
        .describe("X of the rotation axis of C, which is parallel to Z while A is at 0."),
    coordinate("kinematics.pivot_c_y_mm")
        .describe("Y of the rotation axis of C, which is parallel to Z while A is at 0."),
    coordinate("kinematics.workpiece_x_mm").describe("X of the origin of the workpiece frame."),
    coordinate("kinematics.workpiece_y_mm").describe("Y of the origin of the workpiece frame."),
    coordinate("kinematics.workpiece_z_mm").describe("Z of the origin of the workpiece frame."),
    ParameterDefinition::number("contour_control.gain", "(m/min)/mm", 0.0, MAX_GAIN)
        .default(Number(0.0))
        .live()
        .describe(
            "Gain of cross-coupled control of X, Y and Z, feedback of the contour error; 0 disables it.",
        ),
    // Couplings between axes.
    ParameterDefinition::number("workpiece.mass_kg", "kg", 0.0, MAX_WORKPIECE_KG)
        .default(Number(0.0))
        .describe("Mass of the workpiece on the tables of A and C, in addition to the inertias of the axes; 0 is no workpiece."),
    coordinate("workpiece.center_of_mass_x_mm").describe("X of the center of mass of the workpiece, in the workpiece frame."),
    coordinate("workpiece.center_of_mass_y_mm").describe("Y of the center of mass of the workpiece, in the workpiece frame."),
    coordinate("workpiece.center_of_mass_z_mm").describe("Z of the center of mass of the workpiece, in the workpiece frame."),
    moment("workpiece.inertia_x_kg_m2").describe("Principal moment of inertia about the center of mass, parallel to X of the workpiece frame."),
    moment("workpiece.inertia_y_kg_m2").describe("Principal moment of inertia about the center of mass, parallel to Y of the workpiece frame."),
    moment("workpiece.inertia_z_kg_m2").describe("Principal moment of inertia about the center of mass, parallel to Z of the workpiece frame."),
    ParameterDefinition::new("gantry.axes", "", ParameterKind::TextList)
        .optional()
        .describe("Names of the two linear axes of a gantry, which a beam couples."),
    ParameterDefinition::number("gantry.stiffness_n_um", "N/µm", 0.0, MAX_GANTRY.0)
        .default(Number(0.0))
        .describe("Stiffness of the beam between the positions of both axes of the gantry."),
    ParameterDefinition::number("gantry.damping_n_s_m", "N/(m/s)", 0.0, MAX_GANTRY.1)
        .default(Number(0.0))
        .describe("Damping of the beam between the velocities of both axes of the gantry."),
];

/// Parameters of the controllers and limits of an axis.
const CONTROL: &[ParameterDefinition] = &[
    // Control.
    ParameterDefinition::new("position_loop.controller", "", ParameterKind::Choice(&["cascade", "gpc", "rst"]))
        .of_axis()
        .default(Text("cascade"))
        .live()
        .describe("Position controller: cascade with feedforward (Prévost fig. 3), generalized predictive control (GPC), or RST polynomials."),
    gain("position_loop.gain", "(m/min)/mm")
        .on(Linear)
        .describe("Kp, position-loop gain; 1 (m/min)/mm is 16.667 s⁻¹ (Prévost Appendix 2)."),
    gain("position_loop.gain", "(1000 °/min)/°")
        .on(Rotary)
        .describe("Kp, position-loop gain; 1 (1000 °/min)/° is 16.667 s⁻¹ (Prévost Appendix 2)."),
    horizon("position_loop.gpc.n1", 1)
        .describe("N1, first position cycle of the prediction horizon, at most n2 (Prévost table 1)."),
    horizon("position_loop.gpc.n2", 14).describe("N2, last position cycle of the prediction horizon (Prévost table 1)."),
    horizon("position_loop.gpc.nu", 12)
        .describe("Nu, position cycles of the control horizon, at most n2 (Prévost table 1)."),
    ParameterDefinition::number("position_loop.gpc.lambda_rel", "", 0.0, MAX_GAIN)
        .of_axis()
        .default(Number(0.005))
        .live()
        .describe("λ / trace(GᵀG), relative weight of the control increments; unused if lambda is set."),
    ParameterDefinition::number("position_loop.gpc.lambda", "s²", 0.0, MAX_GAIN)
        .of_axis()
        .optional()
        .live()
        .describe("λ, weight of the control increments (Prévost table 1)."),
    ParameterDefinition::new("position_loop.feedback", "", ParameterKind::Choice(&["motor", "load"]))
        .of_axis()
        .default(Text("motor"))
        .describe("Encoder of the position controller: at the motor (semi-closed loop), or at the load of an elastic transmission (closed loop)."),
    ParameterDefinition::number("backlash_compensation.width_um", "µm", 0.0, 1e4)
        .on(Linear)
        .default(Number(0.0))
        .live()
        .describe("Step of the motor at a reversal of the setpoint that compensates a backlash of this width; 0: no compensation."),
    ParameterDefinition::number("backlash_compensation.width_deg", "°", 0.0, 10.0)
        .on(Rotary)
        .default(Number(0.0))
        .live()
        .describe("Step of the motor at a reversal of the setpoint that compensates a backlash of this width, at the axis; 0: no compensation."),
    ParameterDefinition::number("backlash_compensation.velocity_m_min", "m/min", 1e-6, 1e3)
        .on(Linear)
        .default(Number(0.1))
        .live()
        .describe("Largest velocity of the backlash compensation along the axis."),
    ParameterDefinition::number("backlash_compensation.velocity_rpm", "rpm", 1e-6, 1e3)
        .on(Rotary)
        .default(Number(0.1))
        .live()
        .describe("Largest velocity of the backlash compensation, of the axis."),
    ParameterDefinition::new("position_loop.allow_unstable", "", ParameterKind::Flag)
        .of_axis()
        .default(Flag(false))
        .live()
        .describe("Accept a position controller whose closed loop is unstable."),
    polynomial("position_loop.rst.r", "s⁻¹", MAX_RST_TERMS)
        .describe("R of an RST controller, in ascending powers of q⁻¹ from q⁰ (Prévost eq. 9)."),
    polynomial("position_loop.rst.s", "", MAX_RST_TERMS)
        .describe("S of an RST controller, in ascending powers of q⁻¹ from q⁰ (Prévost eq. 9)."),
    polynomial("position_loop.rst.t", "s⁻¹", 2 * MAX_HORIZON as usize + 1)
        .describe("T of an RST controller, in ascending powers of q, beginning with position_loop.rst.t_first (Prévost eq. 9)."),
    ParameterDefinition::new("position_loop.rst.t_first", "", ParameterKind::Integer { min: -MAX_HORIZON, max: MAX_HORIZON })
        .of_axis()
        .default(Integer(0))
        .live()
        .describe("Power of q of the first term of T: 1 is one position cycle of preview."),
    gain("velocity_loop.gain", "N·m/(rad/s)")
        .driven_by(RotaryMotor)
        .describe("Kv, proportional gain of the velocity loop (Prévost Appendix 2)."),
    gain("velocity_loop.gain", "N/(m/s)")
        .driven_by(LinearMotor)
        .describe("Kv, proportional gain of the velocity loop (Prévost Appendix 2)."),
    integral_time("velocity_loop.integral_time_ms")
        .describe("Tv, integral time of the velocity loop (Prévost Appendix 2)."),
    filter_type("current_filter_1.type").describe("Type of the first filter of the current setpoint."),
    filter_frequency("current_filter_1.frequency_hz", 200.0)
        .describe("Natural frequency of the low-pass, center frequency of the notch, below half the rate of the velocity cycles."),
    filter_damping("current_filter_1.damping").describe("Damping ratio D of the low-pass."),
    filter_frequency("current_filter_1.bandwidth_hz", 100.0)
        .describe("Bandwidth of the notch, between its frequencies of -3 dB at infinite depth."),
    filter_depth("current_filter_1.depth_db").describe("Attenuation of the notch at its center frequency."),
    filter_type("current_filter_2.type").describe("Type of the second filter of the current setpoint, after the first."),
    filter_frequency("current_filter_2.frequency_hz", 200.0)
        .describe("Natural frequency of the low-pass, center frequency of the notch, below half the rate of the velocity cycles."),
    filter_damping("current_filter_2.damping").describe("Damping ratio D of the low-pass."),
    filter_frequency("current_filter_2.bandwidth_hz", 100.0)
        .describe("Bandwidth of the notch, between its frequencies of -3 dB at infinite depth."),
    filter_depth("current_filter_2.depth_db").describe("Attenuation of the notch at its center frequency."),
    gain("current_loop.gain", "V/A")
        .describe("Ki, proportional gain of the current loop (Prévost Appendix 2)."),
    integral_time("current_loop.integral_time_ms")
        .describe("Ti, integral time of the current loop (Prévost Appendix 2)."),
    ParameterDefinition::number("feedforward.velocity", "", 0.0, 2.0)
        .of_axis()
        .default(Number(0.0))
        .live()
        .describe("VFFW, weight of the velocity feedforward; 0 disables it (Prévost eq. 6)."),
    ParameterDefinition::number("feedforward.torque_kg_m2", "kg·m²", 0.0, 1e3)
        .driven_by(RotaryMotor)
        .default(Number(0.0))
        .live()
        .describe("TFFW, weight of the torque feedforward at the motor; 0 disables it (Prévost eq. 7)."),
    ParameterDefinition::number("feedforward.torque_kg", "kg", 0.0, 1e6)
        .driven_by(LinearMotor)
        .default(Number(0.0))
        .live()
        .describe("TFFW, weight of the force feedforward; 0 disables it (Prévost eq. 7)."),
    ParameterDefinition::number("feedforward.friction", "", 0.0, 2.0)
        .of_axis()
        .default(Number(0.0))
        .live()
        .describe("Weight of the friction compensation by the friction torque at the setpoint velocity; 0 disables it."),
    delay("delays.alpha_ms").describe("α, delay of the setpoint before the position comparator (Prévost fig. 3)."),
    delay("delays.beta_ms").describe("β, delay of the velocity feedforward (Prévost fig. 3)."),
    delay("delays.gamma_ms").describe("γ, delay of the torque feedforward (Prévost fig. 3)."),
    delay("delays.friction_ms").describe("Delay of the friction compensation after the setpoint."),
    // Deviation of the plant from the model of the controllers.
    deviation("deviation.inertia").describe("Factor on the plant inertia, relative to controller design."),
    deviation("deviation.friction").describe("Factor on the plant friction, relative to friction compensation."),
    deviation("deviation.torque_constant").describe("Factor on the plant torque constant, relative to the drive parameters."),
    // Limits.
    ParameterDefinition::number("limits.velocity_m_min", "m/min", 1e-6, 1e5)
        .on(Linear)
        .describe("Vmax, velocity limit of trajectories."),
    ParameterDefinition::number("limits.velocity_rpm", "rpm", 1e-6, 1e6)
        .on(Rotary)
        .describe("Vmax, velocity limit of trajectories, of the axis."),
    ParameterDefinition::number("limits.acceleration_m_s2", "m/s²", 1e-6, 1e5)
        .on(Linear)
        .describe("Amax, acceleration of a controlled stop; setpoints are not checked against it."),
    ParameterDefinition::number("limits.acceleration_rev_s2", "rev/s²", 1e-6, 1e5)
        .on(Rotary)
        .describe("Amax, acceleration of a controlled stop; setpoints are not checked against it."),
    ParameterDefinition::number("limits.jerk_m_s3", "m/s³", 1e-6, 1e7)
        .on(Linear)
        .describe("Jmax, jerk of a controlled stop; setpoints are not checked against it."),
    ParameterDefinition::number("limits.jerk_rev_s3", "rev/s³", 1e-6, 1e7)
        .on(Rotary)
        .describe("Jmax, jerk of a controlled stop; setpoints are not checked against it."),
    ParameterDefinition::number("limits.travel_min_mm", "mm", -1e6, 0.0)
        .on(Linear)
        .optional()
        .describe("Lower travel limit; unlimited if omitted. Home is 0."),
    ParameterDefinition::number("limits.travel_max_mm", "mm", 0.0, 1e6)
        .on(Linear)
        .optional()
        .describe("Upper travel limit; unlimited if omitted. Home is 0."),
    ParameterDefinition::number("limits.travel_min_deg", "°", -1e6, 0.0)
        .on(Rotary)
        .optional()
        .describe("Lower travel limit; unlimited if omitted. Home is 0."),
    ParameterDefinition::number("limits.travel_max_deg", "°", 0.0, 1e6)
        .on(Rotary)
        .optional()
        .describe("Upper travel limit; unlimited if omitted. Home is 0."),
    // Default tolerances of action goals, on the delay-compensated following error.
    tolerance("tolerances.path_mm", "mm", MAX_TOLERANCE_MM)
        .on(Linear)
        .describe("Default path tolerance of action goals; 0 disables it."),
    tolerance("tolerances.path_deg", "°", MAX_TOLERANCE_DEG)
        .on(Rotary)
        .describe("Default path tolerance of action goals; 0 disables it."),
    tolerance("tolerances.goal_mm", "mm", MAX_TOLERANCE_MM)
        .on(Linear)
        .describe("Default goal tolerance of action goals; 0 disables it."),
    tolerance("tolerances.goal_deg", "°", MAX_TOLERANCE_DEG)
        .on(Rotary)
        .describe("Default goal tolerance of action goals; 0 disables it."),
];

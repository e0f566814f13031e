//! The schema: one table of parameters from which the check of files, the typed configuration,
//! the ROS descriptors and the table of the README are derived.
//!
//! Equation numbers are those of Prévost (Prévost, Lavernhe, Lartigue, Dumur: *Feed drive modelling
//! for the simulation of tool path tracking in multi-axis High Speed Machining*).

use super::definition::DefaultValue::{Flag, Integer, Number, Text};
use super::definition::MotorKind::{Linear as LinearMotor, Rotating as RotatingMotor};
use super::definition::{Definition, Kind};
use super::machine::AxisKind::{Linear, Rotary};
use super::node_schema::NODE;

/// Shortest and longest sampling period, ms; the node's pacing knows nothing below 1 µs.
const PERIOD_MS: (f64, f64) = (1e-3, 50.0);
/// The same range in µs.
const PERIOD_US: (f64, f64) = (1.0, 50e3);
/// Longest delay of a setpoint, ms.
const DELAY_MS: f64 = 100.0;
/// Largest distance between two points of a machine, mm; the largest gantries have some tens of meters.
const DISTANCE_MM: f64 = 1e5;
/// Largest current, A, of a motor and of its friction.
const CURRENT: f64 = 1e4;
/// Exponents of the friction law, min/m or min/rev: the fall after breakaway can be steep, a rise
/// steeper than e^V has no bearing that makes it.
const FRICTION_EXPONENT: (f64, f64) = (-100.0, 1.0);
/// Longest horizon of predictive control, and furthest setpoint that T may read, position periods.
pub const MAX_HORIZON: i64 = 200;
/// Smallest and largest factor of a plant that deviates.
const DEVIATION: (f64, f64) = (0.1, 10.0);
/// Smallest value of what is divided by, or what has no sense at zero.
const POSITIVE: f64 = 1e-9;
/// Largest gain of a loop, in its unit.
const GAIN: f64 = 1e9;
/// Largest default tolerance of an action goal: any error is smaller.
const TOLERANCE_MM: f64 = 1e6;
/// Likewise.
const TOLERANCE_DEG: f64 = 1e6;
/// Shortest and longest integral time, ms; zero would divide by zero.
const INTEGRAL_TIME_MS: (f64, f64) = (1e-3, 1e6);
/// Most coefficients of R and of S; a design on a model of the drive's order has fewer than ten.
pub const RST_TERMS: usize = 32;

/// A coefficient of the friction law, A.
const fn friction_current(key: &'static str) -> Definition {
    Definition::number(key, "A", -CURRENT, CURRENT).of_axis()
}

/// An exponent of the friction law.
const fn friction_exponent(key: &'static str, unit: &'static str) -> Definition {
    Definition::number(key, unit, FRICTION_EXPONENT.0, FRICTION_EXPONENT.1)
}

/// A gain, live.
const fn gain(key: &'static str, unit: &'static str) -> Definition {
    Definition::number(key, unit, 0.0, GAIN).of_axis().live()
}

/// An integral time, live.
const fn integral_time(key: &'static str) -> Definition {
    Definition::number(key, "ms", INTEGRAL_TIME_MS.0, INTEGRAL_TIME_MS.1).of_axis().live()
}

/// A polynomial of an RST controller, live.
const fn polynomial(key: &'static str, unit: &'static str, max_len: usize) -> Definition {
    Definition::new(key, unit, Kind::NumberList { min_len: 1, max_len }).of_axis().optional().live()
}

/// A delay of the setpoint, live.
const fn delay(key: &'static str) -> Definition {
    Definition::number(key, "ms", 0.0, DELAY_MS).of_axis().default(Number(0.0)).live()
}

/// A horizon of predictive control, live.
const fn horizon(key: &'static str, default: i64) -> Definition {
    Definition::new(key, "", Kind::Integer { min: 1, max: MAX_HORIZON })
        .of_axis()
        .default(Integer(default))
        .live()
}

/// A factor of the plant, live.
const fn deviation(key: &'static str) -> Definition {
    Definition::number(key, "", DEVIATION.0, DEVIATION.1).of_axis().default(Number(1.0)).live()
}

/// The largest error of an axis that goals of the action are held to, live.
const fn tolerance(key: &'static str, unit: &'static str, max: f64) -> Definition {
    Definition::number(key, unit, 0.0, max).default(Number(0.0)).live()
}

/// A coordinate of a point of the machine, home in the origin.
const fn coordinate(key: &'static str) -> Definition {
    Definition::number(key, "mm", -DISTANCE_MM, DISTANCE_MM).default(Number(0.0))
}

/// Every parameter there is. A key stands twice where its unit depends on the axis or the motor.
pub static DEFINITIONS: &[Definition] = &joined::<{ MACHINE.len() + NODE.len() }>(MACHINE, NODE);

const fn joined<const N: usize>(first: &[Definition], second: &[Definition]) -> [Definition; N] {
    let mut all = [second[0]; N];
    let mut place = 0;
    while place < N {
        all[place] = if place < first.len() { first[place] } else { second[place - first.len()] };
        place += 1;
    }
    all
}

/// Parameters of the machine and its axes.
const MACHINE: &[Definition] = &[
    // Machine.
    Definition::new("machine", "", Kind::Text).is("Name of the machine."),
    Definition::new("joints", "", Kind::TextList)
        .is("Names of the axes, in the order of messages and tables."),
    Definition::number("periods.position_ms", "ms", PERIOD_MS.0, PERIOD_MS.1)
        .is("Tsp, sampling period of the position loop, a multiple of periods.velocity_us."),
    Definition::number("periods.velocity_us", "µs", PERIOD_US.0, PERIOD_US.1)
        .is("Tsv, sampling period of the velocity loop, a multiple of periods.current_us."),
    Definition::number("periods.current_us", "µs", PERIOD_US.0, PERIOD_US.1)
        .is("Tsi, sampling period of the current loop: one tick of the simulation."),
    // Kinematics, chain workpiece-C-A-X/Y/Z-tool; coordinates of the machine with every axis at home.
    Definition::number("kinematics.tool_length_mm", "mm", 0.0, DISTANCE_MM)
        .default(Number(0.0))
        .is("Tool length, from the point that X, Y and Z move (the origin at home) down to the tool tip."),
    coordinate("kinematics.pivot_a_y_mm").is("Y of the line about which A turns, which is parallel to X."),
    coordinate("kinematics.pivot_a_z_mm").is("Z of the line about which A turns, which is parallel to X."),
    coordinate("kinematics.pivot_c_x_mm").is("X of the line about which C turns, parallel to Z while A is at 0."),
    coordinate("kinematics.pivot_c_y_mm").is("Y of the line about which C turns, parallel to Z while A is at 0."),
    coordinate("kinematics.workpiece_x_mm").is("X of the workpiece frame's origin."),
    coordinate("kinematics.workpiece_y_mm").is("Y of the workpiece frame's origin."),
    coordinate("kinematics.workpiece_z_mm").is("Z of the workpiece frame's origin."),
    // Axis and transmission.
    Definition::new("type", "", Kind::Choice(&["linear", "rotary"]))
        .of_axis()
        .is("Whether the axis counts in meters or in radians."),
    Definition::number("transmission.screw_lead_mm", "mm", 1e-3, 1e3)
        .on(Linear)
        .optional()
        .is("Lead of the ball screw, axis travel per motor revolution."),
    Definition::number("transmission.gear_ratio", "", 1e-3, 1e6)
        .on(Rotary)
        .optional()
        .is("Gear ratio, motor revolutions per axis revolution."),
    Definition::new("transmission.direct", "", Kind::Flag)
        .of_axis()
        .optional()
        .is("Direct drive: a torque motor on a rotary axis, a linear motor on a linear one."),
    // Motor.
    Definition::number("motor.inertia_kg_m2", "kg·m²", POSITIVE, 1e3)
        .driven_by(RotatingMotor)
        .is("Jeq, equivalent inertia at the motor shaft (Prévost eqs. 1 and 5)."),
    Definition::number("motor.mass_kg", "kg", 1e-6, 1e6)
        .driven_by(LinearMotor)
        .is("Moving mass, in the place of Jeq (Prévost eq. 1)."),
    Definition::number("motor.torque_constant_nm_a", "N·m/A", POSITIVE, 1e4)
        .driven_by(RotatingMotor)
        .is("Kt, torque constant (Prévost eq. 1)."),
    Definition::number("motor.force_constant_n_a", "N/A", POSITIVE, 1e5)
        .driven_by(LinearMotor)
        .is("Force constant, in the place of Kt (Prévost eq. 1)."),
    Definition::number("motor.emf_constant_v_s_rad", "V·s/rad", 0.0, 1e4)
        .driven_by(RotatingMotor)
        .is("Ke, back-EMF constant (Prévost eq. 1)."),
    Definition::number("motor.emf_constant_v_s_m", "V·s/m", 0.0, 1e5)
        .driven_by(LinearMotor)
        .is("Ke, back-EMF constant (Prévost eq. 1)."),
    Definition::number("motor.resistance_ohm", "Ω", 0.0, 1e4)
        .of_axis()
        .is("R, winding resistance (Prévost eq. 1)."),
    Definition::number("motor.inductance_mh", "mH", 1e-6, 1e5)
        .of_axis()
        .is("L, winding inductance (Prévost eq. 1)."),
    Definition::number("motor.max_current_a", "A", POSITIVE, CURRENT)
        .of_axis()
        .is("imax, limit of the current setpoint."),
    Definition::number("motor.max_voltage_v", "V", POSITIVE, 1e5)
        .of_axis()
        .is("umax, limit of the motor voltage."),
    Definition::number("motor.max_speed_rpm", "rpm", 1e-6, 1e6)
        .driven_by(RotatingMotor)
        .is("Maximum motor speed, limit of what the position controller asks for; velocity feedforward is added behind it."),
    Definition::number("motor.max_speed_m_min", "m/min", 1e-6, 1e5)
        .driven_by(LinearMotor)
        .is("Maximum motor speed, limit of what the position controller asks for; velocity feedforward is added behind it."),
    // Friction.
    friction_current("friction.a")
        .is("Amplitude a of the friction law a·exp(b·V) + c·exp(d·V) (Prévost eq. 3)."),
    friction_exponent("friction.b", "min/m")
        .on(Linear)
        .is("Exponent b of the friction law, V in m/min (Prévost eq. 3)."),
    friction_exponent("friction.b", "min/rev")
        .on(Rotary)
        .is("Exponent b of the friction law, V in rev/min of the axis (Prévost eq. 3)."),
    friction_current("friction.c")
        .is("Amplitude c of the friction law; a + c, its value towards standstill, is not negative (Prévost eq. 3)."),
    friction_exponent("friction.d", "min/m")
        .on(Linear)
        .is("Exponent d of the friction law, V in m/min (Prévost eq. 3)."),
    friction_exponent("friction.d", "min/rev")
        .on(Rotary)
        .is("Exponent d of the friction law, V in rev/min of the axis (Prévost eq. 3)."),
    Definition::number("friction.i0", "A", 0.0, CURRENT)
        .of_axis()
        .is("Breakaway current i0, bound of static friction (Prévost eq. 3)."),
    // Gravity.
    Definition::number("gravity.weight_n", "N", -1e6, 1e6)
        .on(Linear)
        .default(Number(0.0))
        .is("Net weight of a vertical axis, what its counterbalance leaves; positive resists motion towards plus."),
    Definition::number("gravity.tilt_nm", "N·m", -1e6, 1e6)
        .on(Rotary)
        .default(Number(0.0))
        .is("Gravity torque amplitude k of a tilting axis, k·sin(position + phase)."),
    Definition::number("gravity.tilt_phase_deg", "°", -360.0, 360.0)
        .on(Rotary)
        .default(Number(0.0))
        .is("Phase of the gravity torque of a tilting axis."),
    // Control.
    Definition::new("position_loop.controller", "", Kind::Choice(&["cascade", "gpc", "rst"]))
        .of_axis()
        .default(Text("cascade"))
        .live()
        .is("Position controller: proportional with feedforward (Prévost fig. 3), predictive, or by its polynomials."),
    gain("position_loop.gain", "(m/min)/mm")
        .on(Linear)
        .is("Kp, position-loop gain; 1 (m/min)/mm is 16.667 s⁻¹ (Prévost Appendix 2)."),
    gain("position_loop.gain", "(1000 °/min)/°")
        .on(Rotary)
        .is("Kp, position-loop gain; 1 (1000 °/min)/° is 16.667 s⁻¹ (Prévost Appendix 2)."),
    horizon("position_loop.gpc.n1", 1)
        .is("N1, first position period of the prediction horizon, at most n2 (Prévost table 1)."),
    horizon("position_loop.gpc.n2", 14).is("N2, last position period of the prediction horizon (Prévost table 1)."),
    horizon("position_loop.gpc.nu", 12)
        .is("Nu, position periods of the control horizon, at most n2 (Prévost table 1)."),
    Definition::number("position_loop.gpc.lambda_rel", "", 0.0, GAIN)
        .of_axis()
        .default(Number(0.005))
        .live()
        .is("λ / trace(GᵀG), weight of the control increments; not used where lambda is given."),
    Definition::number("position_loop.gpc.lambda", "s²", 0.0, GAIN)
        .of_axis()
        .optional()
        .live()
        .is("λ, weight of the control increments (Prévost table 1)."),
    Definition::new("position_loop.allow_unstable", "", Kind::Flag)
        .of_axis()
        .default(Flag(false))
        .live()
        .is("Accept a position controller whose closed loop is unstable."),
    polynomial("position_loop.rst.r", "s⁻¹", RST_TERMS)
        .is("R of an RST controller, in rising powers of q⁻¹ from q⁰ on (Prévost eq. 9)."),
    polynomial("position_loop.rst.s", "", RST_TERMS)
        .is("S of an RST controller, in rising powers of q⁻¹ from q⁰ on (Prévost eq. 9)."),
    polynomial("position_loop.rst.t", "s⁻¹", 2 * MAX_HORIZON as usize + 1)
        .is("T of an RST controller, in rising powers of q from position_loop.rst.t_first on (Prévost eq. 9)."),
    Definition::new("position_loop.rst.t_first", "", Kind::Integer { min: -MAX_HORIZON, max: MAX_HORIZON })
        .of_axis()
        .default(Integer(0))
        .live()
        .is("Power of q of T's first term: 1 begins one position period ahead."),
    gain("velocity_loop.gain", "N·m/(rad/s)")
        .driven_by(RotatingMotor)
        .is("Kv, proportional gain of the velocity loop (Prévost Appendix 2)."),
    gain("velocity_loop.gain", "N/(m/s)")
        .driven_by(LinearMotor)
        .is("Kv, proportional gain of the velocity loop (Prévost Appendix 2)."),
    integral_time("velocity_loop.integral_time_ms")
        .is("Tv, integral time of the velocity loop (Prévost Appendix 2)."),
    gain("current_loop.gain", "V/A")
        .is("Ki, proportional gain of the current loop (Prévost Appendix 2)."),
    integral_time("current_loop.integral_time_ms")
        .is("Ti, integral time of the current loop (Prévost Appendix 2)."),
    Definition::number("feedforward.velocity", "", 0.0, 2.0)
        .of_axis()
        .default(Number(0.0))
        .live()
        .is("VFFW, weight of the velocity feedforward; 0 is off (Prévost eq. 6)."),
    Definition::number("feedforward.torque_kg_m2", "kg·m²", 0.0, 1e3)
        .driven_by(RotatingMotor)
        .default(Number(0.0))
        .live()
        .is("TFFW, weight of the torque feedforward at the motor; 0 is off (Prévost eq. 7)."),
    Definition::number("feedforward.torque_kg", "kg", 0.0, 1e6)
        .driven_by(LinearMotor)
        .default(Number(0.0))
        .live()
        .is("TFFW, weight of the force feedforward; 0 is off (Prévost eq. 7)."),
    Definition::number("feedforward.friction", "", 0.0, 2.0)
        .of_axis()
        .default(Number(0.0))
        .live()
        .is("Weight of the friction compensation: the friction torque at the setpoint's velocity; 0 is off."),
    delay("delays.alpha_ms").is("α, delay of the setpoint before the position comparator (Prévost fig. 3)."),
    delay("delays.beta_ms").is("β, delay of the velocity feedforward (Prévost fig. 3)."),
    delay("delays.gamma_ms").is("γ, delay of the torque feedforward (Prévost fig. 3)."),
    delay("delays.friction_ms").is("Shift of the friction compensation behind the setpoint."),
    // What the controllers do not know.
    deviation("deviation.inertia").is("Inertia of the plant, relative to the one that controllers are designed for."),
    deviation("deviation.friction").is("Friction of the plant, relative to the one that is compensated."),
    deviation("deviation.torque_constant").is("Torque constant of the plant, relative to the one that the drive reckons with."),
    // Limits.
    Definition::number("limits.velocity_m_min", "m/min", 1e-6, 1e5)
        .on(Linear)
        .is("Vmax, largest velocity that a trajectory may ask for."),
    Definition::number("limits.velocity_rpm", "rpm", 1e-6, 1e6)
        .on(Rotary)
        .is("Vmax, largest velocity of the axis that a trajectory may ask for."),
    Definition::number("limits.acceleration_m_s2", "m/s²", 1e-6, 1e5)
        .on(Linear)
        .is("Amax, acceleration of a controlled stop; setpoints are not checked against it."),
    Definition::number("limits.acceleration_rev_s2", "rev/s²", 1e-6, 1e5)
        .on(Rotary)
        .is("Amax, acceleration of a controlled stop; setpoints are not checked against it."),
    Definition::number("limits.jerk_m_s3", "m/s³", 1e-6, 1e7)
        .on(Linear)
        .is("Jmax, jerk of a controlled stop; setpoints are not checked against it."),
    Definition::number("limits.jerk_rev_s3", "rev/s³", 1e-6, 1e7)
        .on(Rotary)
        .is("Jmax, jerk of a controlled stop; setpoints are not checked against it."),
    Definition::number("limits.travel_min_mm", "mm", -1e6, 0.0)
        .on(Linear)
        .optional()
        .is("Lower travel limit; unlimited if omitted. Home is 0."),
    Definition::number("limits.travel_max_mm", "mm", 0.0, 1e6)
        .on(Linear)
        .optional()
        .is("Upper travel limit; unlimited if omitted. Home is 0."),
    Definition::number("limits.travel_min_deg", "°", -1e6, 0.0)
        .on(Rotary)
        .optional()
        .is("Lower travel limit; unlimited if omitted. Home is 0."),
    Definition::number("limits.travel_max_deg", "°", 0.0, 1e6)
        .on(Rotary)
        .optional()
        .is("Upper travel limit; unlimited if omitted. Home is 0."),
    // Default tolerances of action goals, on the synchronized tracking error.
    tolerance("tolerances.path_mm", "mm", TOLERANCE_MM)
        .on(Linear)
        .is("Largest error on the way of an action goal that names none; 0 is any."),
    tolerance("tolerances.path_deg", "°", TOLERANCE_DEG)
        .on(Rotary)
        .is("Largest error on the way of an action goal that names none; 0 is any."),
    tolerance("tolerances.goal_mm", "mm", TOLERANCE_MM)
        .on(Linear)
        .is("Largest error at the end of an action goal that names none; 0 is any."),
    tolerance("tolerances.goal_deg", "°", TOLERANCE_DEG)
        .on(Rotary)
        .is("Largest error at the end of an action goal that names none; 0 is any."),
];

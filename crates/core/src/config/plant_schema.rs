//! Schema of the plant parameters: transmission, motor, friction and gravity of an axis.

use super::definition::DefaultValue::{Integer, Number};
use super::definition::MotorKind::{Linear as LinearMotor, Rotary as RotaryMotor};
use super::definition::{ParameterDefinition, ParameterKind};
use super::machine::AxisKind::{Linear, Rotary};

/// Maximum current of a motor and of its friction, A.
const MAX_CURRENT: f64 = 1e4;
/// Minimum of divisors and of other positive quantities.
const POSITIVE: f64 = 1e-9;
/// Range of the exponents of the friction law, min/m or min/rev. The decrease after breakaway can be steep; a rise
/// steeper than e^V does not occur in bearings.
const FRICTION_EXPONENT: (f64, f64) = (-100.0, 1.0);

/// Defines an amplitude of the friction law.
const fn friction_current(key: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, "A", -MAX_CURRENT, MAX_CURRENT).of_axis()
}

/// Defines an exponent of the friction law.
const fn friction_exponent(key: &'static str, unit: &'static str) -> ParameterDefinition {
    ParameterDefinition::number(key, unit, FRICTION_EXPONENT.0, FRICTION_EXPONENT.1)
}

/// Parameters of the plant of an axis.
pub(super) const PLANT: &[ParameterDefinition] = &[
    // Axis and transmission.
    ParameterDefinition::new("type", "", ParameterKind::Choice(&["linear", "rotary"]))
        .of_axis()
        .describe("Type of the axis: linear in meters or rotary in radians."),
    ParameterDefinition::number("transmission.screw_lead_mm", "mm", 1e-3, 1e3)
        .on(Linear)
        .optional()
        .describe("Lead of the ball screw, axis travel per motor revolution."),
    ParameterDefinition::number("transmission.gear_ratio", "", 1e-3, 1e6)
        .on(Rotary)
        .optional()
        .describe("Gear ratio, motor revolutions per axis revolution."),
    ParameterDefinition::new("transmission.direct", "", ParameterKind::Flag)
        .of_axis()
        .optional()
        .describe("Direct drive: a torque motor on a rotary axis, a linear motor on a linear axis."),
    // Elastic transmission.
    ParameterDefinition::number("transmission.stiffness_n_um", "N/µm", 1e-3, 1e6)
        .on(Linear)
        .optional()
        .describe("Stiffness between motor and load along the axis; rigid if omitted."),
    ParameterDefinition::number("transmission.stiffness_nm_rad", "N·m/rad", 1e-3, 1e12)
        .on(Rotary)
        .optional()
        .describe("Torsional stiffness between motor and load at the axis; rigid if omitted."),
    ParameterDefinition::number("transmission.damping_n_s_m", "N/(m/s)", 0.0, 1e9)
        .on(Linear)
        .default(Number(0.0))
        .describe("Damping between motor and load along the axis; needs a stiffness."),
    ParameterDefinition::number("transmission.damping_nm_s_rad", "N·m/(rad/s)", 0.0, 1e9)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Torsional damping between motor and load at the axis; needs a stiffness."),
    ParameterDefinition::number("transmission.load_mass_kg", "kg", 1e-6, 1e6)
        .on(Linear)
        .optional()
        .describe("Mass of the load behind the stiffness; at the motor it is a part of the inertia Jeq."),
    ParameterDefinition::number("transmission.load_inertia_kg_m2", "kg·m²", 1e-9, 1e6)
        .on(Rotary)
        .optional()
        .describe("Inertia of the load about the axis behind the stiffness; at the motor it is a part of the inertia Jeq."),
    ParameterDefinition::number("transmission.backlash_um", "µm", 0.0, 1e4)
        .on(Linear)
        .default(Number(0.0))
        .describe("Width of the gap between motor and load along the axis; needs a stiffness."),
    ParameterDefinition::number("transmission.backlash_deg", "°", 0.0, 10.0)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Width of the gap between motor and load at the axis; needs a stiffness."),
    ParameterDefinition::number("transmission.load_friction", "", 0.0, 1.0)
        .of_axis()
        .default(Number(0.0))
        .describe("Share of the friction that acts at the load, as guideways do; the rest acts at the motor; needs a stiffness."),
    ParameterDefinition::number("structure.mass_kg", "kg", 1e-3, 1e9)
        .on(Linear)
        .optional()
        .describe("Modal mass of the structure that carries the axis and vibrates along it; needs a frequency and a stiffness of the transmission."),
    ParameterDefinition::number("structure.inertia_kg_m2", "kg·m²", 1e-6, 1e9)
        .on(Rotary)
        .optional()
        .describe("Modal inertia of the structure that carries the axis and vibrates about it; needs a frequency and a stiffness of the transmission."),
    ParameterDefinition::number("structure.frequency_hz", "Hz", 0.1, 1e4)
        .of_axis()
        .optional()
        .describe("Natural frequency of the structure with the axis removed; the structure is rigid if omitted."),
    ParameterDefinition::number("structure.damping_ratio", "", 0.0, 1.0)
        .of_axis()
        .default(Number(0.02))
        .describe("Damping ratio of the structure with the axis removed."),
    // Motor.
    ParameterDefinition::number("motor.inertia_kg_m2", "kg·m²", POSITIVE, 1e3)
        .driven_by(RotaryMotor)
        .describe("Jeq, equivalent inertia at the motor shaft (Prévost eqs. 1 and 5)."),
    ParameterDefinition::number("motor.mass_kg", "kg", 1e-6, 1e6)
        .driven_by(LinearMotor)
        .describe("Moving mass, in place of Jeq (Prévost eq. 1)."),
    ParameterDefinition::number("motor.torque_constant_nm_a", "N·m/A", POSITIVE, 1e4)
        .driven_by(RotaryMotor)
        .describe("Kt, torque constant (Prévost eq. 1)."),
    ParameterDefinition::number("motor.force_constant_n_a", "N/A", POSITIVE, 1e5)
        .driven_by(LinearMotor)
        .describe("Force constant, in place of Kt (Prévost eq. 1)."),
    ParameterDefinition::number("motor.emf_constant_v_s_rad", "V·s/rad", 0.0, 1e4)
        .driven_by(RotaryMotor)
        .describe("Ke, back-EMF constant (Prévost eq. 1)."),
    ParameterDefinition::number("motor.emf_constant_v_s_m", "V·s/m", 0.0, 1e5)
        .driven_by(LinearMotor)
        .describe("Ke, back-EMF constant (Prévost eq. 1)."),
    ParameterDefinition::number("motor.resistance_ohm", "Ω", 0.0, 1e4)
        .of_axis()
        .describe("R, winding resistance (Prévost eq. 1)."),
    ParameterDefinition::number("motor.inductance_mh", "mH", 1e-6, 1e5)
        .of_axis()
        .describe("L, winding inductance (Prévost eq. 1)."),
    ParameterDefinition::number("motor.max_current_a", "A", POSITIVE, MAX_CURRENT)
        .of_axis()
        .describe("imax, current setpoint limit."),
    ParameterDefinition::number("motor.max_voltage_v", "V", POSITIVE, 1e5)
        .of_axis()
        .describe("umax, motor voltage limit."),
    ParameterDefinition::number("motor.max_speed_rpm", "rpm", 1e-6, 1e6)
        .driven_by(RotaryMotor)
        .describe("Maximum motor speed, limit of the position controller output; velocity feedforward is added after the limit."),
    ParameterDefinition::number("motor.max_speed_m_min", "m/min", 1e-6, 1e5)
        .driven_by(LinearMotor)
        .describe("Maximum motor speed, limit of the position controller output; velocity feedforward is added after the limit."),
    // Friction.
    friction_current("friction.a")
        .describe("Amplitude a of the friction law a·exp(b·V) + c·exp(d·V) (Prévost eq. 3)."),
    friction_exponent("friction.b", "min/m")
        .on(Linear)
        .describe("Exponent b of the friction law, V in m/min (Prévost eq. 3)."),
    friction_exponent("friction.b", "min/rev")
        .on(Rotary)
        .describe("Exponent b of the friction law, V in rev/min of the axis (Prévost eq. 3)."),
    friction_current("friction.c")
        .describe("Amplitude c of the friction law; a + c, the friction at standstill, must not be negative (Prévost eq. 3)."),
    friction_exponent("friction.d", "min/m")
        .on(Linear)
        .describe("Exponent d of the friction law, V in m/min (Prévost eq. 3)."),
    friction_exponent("friction.d", "min/rev")
        .on(Rotary)
        .describe("Exponent d of the friction law, V in rev/min of the axis (Prévost eq. 3)."),
    ParameterDefinition::number("friction.i0", "A", 0.0, MAX_CURRENT)
        .of_axis()
        .describe("Breakaway current i0, bound of the static friction (Prévost eq. 3)."),
    ParameterDefinition::number("friction.stribeck", "A", 0.0, MAX_CURRENT)
        .of_axis()
        .default(Number(0.0))
        .describe("Amplitude s of the Stribeck term s·exp(−(V/Vs)²), which is added to the friction law."),
    ParameterDefinition::number("friction.stribeck_velocity_m_min", "m/min", 1e-6, 1e3)
        .on(Linear)
        .default(Number(0.1))
        .describe("Velocity Vs of the Stribeck term."),
    ParameterDefinition::number("friction.stribeck_velocity_rpm", "rpm", 1e-6, 1e3)
        .on(Rotary)
        .default(Number(0.1))
        .describe("Velocity Vs of the Stribeck term, of the axis."),
    ParameterDefinition::number("friction.viscous", "A/(m/min)", 0.0, MAX_CURRENT)
        .on(Linear)
        .default(Number(0.0))
        .describe("Viscous friction v·V, which is added to the friction law."),
    ParameterDefinition::number("friction.viscous", "A/rpm", 0.0, MAX_CURRENT)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Viscous friction v·V, which is added to the friction law, V in rev/min of the axis."),
    ParameterDefinition::number("friction.presliding_stiffness_n_um", "N/µm", 0.0, 1e6)
        .on(Linear)
        .default(Number(0.0))
        .describe("Stiffness σ0 of the friction before the axis slides (LuGre model), along the axis; 0: friction without presliding."),
    ParameterDefinition::number("friction.presliding_stiffness_nm_rad", "N·m/rad", 0.0, 1e12)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Stiffness σ0 of the friction before the axis slides (LuGre model), at the axis; 0: friction without presliding."),
    ParameterDefinition::number("friction.presliding_damping_n_s_m", "N/(m/s)", 0.0, 1e9)
        .on(Linear)
        .default(Number(0.0))
        .describe("Damping σ1 of the friction before the axis slides (LuGre model), along the axis; needs a presliding stiffness."),
    ParameterDefinition::number("friction.presliding_damping_nm_s_rad", "N·m/(rad/s)", 0.0, 1e9)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Damping σ1 of the friction before the axis slides (LuGre model), at the axis; needs a presliding stiffness."),
    ParameterDefinition::new("friction.presliding_elements", "", ParameterKind::Integer { min: 0, max: 10 })
        .of_axis()
        .default(Integer(0))
        .describe("Number of elements of the friction before the axis slides (generalized Maxwell-slip model), which follow the LuGre model after a reversal; 0: LuGre model; needs a presliding stiffness."),
    ParameterDefinition::number("friction.presliding_attraction_n_s", "N/s", 0.0, 1e12)
        .on(Linear)
        .default(Number(0.0))
        .describe("Attraction C, rate at which the friction of a sliding axis follows its law after a change of speed, along the axis; 0: at once; needs presliding elements."),
    ParameterDefinition::number("friction.presliding_attraction_nm_s", "N·m/s", 0.0, 1e12)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Attraction C, rate at which the friction of a sliding axis follows its law after a change of speed, at the axis; 0: at once; needs presliding elements."),
    // Gravity.
    ParameterDefinition::number("gravity.weight_n", "N", -1e6, 1e6)
        .on(Linear)
        .default(Number(0.0))
        .describe("Net weight of a vertical axis after counterbalance; positive values oppose motion in the positive direction."),
    ParameterDefinition::number("gravity.tilt_nm", "N·m", -1e6, 1e6)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Gravity torque amplitude k of a tilting axis, k·sin(position + phase)."),
    ParameterDefinition::number("gravity.tilt_phase_deg", "°", -360.0, 360.0)
        .on(Rotary)
        .default(Number(0.0))
        .describe("Phase of the gravity torque of a tilting axis."),
];

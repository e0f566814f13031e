//! Plant of an axis: transmission, motor, friction and gravity, in SI units.

use std::f64::consts::TAU;

use super::declaration::{CheckedValues, Definitions, Field, ParameterGroup, parameters};
use super::definition::AxisKind::{Linear, Rotary};
use super::definition::DefaultValue::{Integer, Number};
use super::definition::MotorKind::{Linear as LinearMotor, Rotary as RotaryMotor};
use super::definition::{ParameterDefinition, flag, integer, number};
use crate::units::{
    DEGREE, METER_PER_MINUTE, MICROMETER, MILLIHENRY, MILLIMETER, NEWTON_PER_MICROMETER, RPM,
};

/// Maximum current of a motor and of its friction, A.
const MAX_CURRENT: f64 = 1e4;
/// Minimum of divisors and of other positive quantities.
const POSITIVE: f64 = 1e-9;

/// Defines an amplitude of the friction law.
const fn friction_current(key: &'static str) -> ParameterDefinition {
    number(key, "A", -MAX_CURRENT, MAX_CURRENT)
}

/// Defines an exponent of the friction law, min/m or min/rev. The decrease after breakaway can be steep; a rise steeper
/// than e^V does not occur in bearings.
const fn friction_exponent(key: &'static str, unit: &'static str) -> ParameterDefinition {
    number(key, unit, -100.0, 1.0)
}

parameters! {
    /// Gear of an axis.
    #[derive(Debug, Clone, Copy)]
    pub(super) struct GearConfig of Axis {
        /// Lead of the ball screw, axis travel per motor revolution.
        screw_lead: Option<f64> = number("transmission.screw_lead_mm", "mm", 1e-3, 1e3).on(Linear).optional().si(MILLIMETER);
        /// Gear ratio, motor revolutions per axis revolution.
        gear_ratio: Option<f64> = number("transmission.gear_ratio", "", 1e-3, 1e6).on(Rotary).optional();
        /// Direct drive: a torque motor on a rotary axis, a linear motor on a linear axis.
        is_direct: Option<bool> = flag("transmission.direct").optional();
    }
}

impl GearConfig {
    /// Returns the transmission ratio r: axis travel (m or rad) per motor travel (rad or m).
    pub(super) fn ratio(&self) -> Option<f64> {
        match self.is_direct {
            Some(true) => Some(1.0),
            _ => self.screw_lead.map(|lead| lead / TAU).or(self.gear_ratio.map(|ratio| 1.0 / ratio)),
        }
    }
}

/// Returns the transmission ratio of an axis.
pub(super) fn transmission_ratio(values: &CheckedValues<'_>, _: Definitions) -> Option<f64> {
    GearConfig::read(values)?.ratio()
}

/// Returns a stiffness, damping or inertia in units of the motor.
fn at_motor(values: &CheckedValues<'_>, rows: Definitions) -> Option<f64> {
    let ratio = transmission_ratio(values, rows)?;
    Some(f64::read(values, rows)? * ratio * ratio)
}

parameters! {
    /// Elastic transmission between motor and load, in units of the motor.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct TransmissionConfig of Axis {
        /// Stiffness between motor and load along the axis; rigid if omitted.
        pub stiffness: f64 = number("transmission.stiffness_n_um", "N/µm", 1e-3, 1e6).on(Linear).optional().si(NEWTON_PER_MICROMETER),
            /// Torsional stiffness between motor and load at the axis; rigid if omitted.
            = number("transmission.stiffness_nm_rad", "N·m/rad", 1e-3, 1e12).on(Rotary).optional()
            => at_motor;
        /// Damping between motor and load along the axis; needs a stiffness.
        pub damping: f64 = number("transmission.damping_n_s_m", "N/(m/s)", 0.0, 1e9).on(Linear).zero(),
            /// Torsional damping between motor and load at the axis; needs a stiffness.
            = number("transmission.damping_nm_s_rad", "N·m/(rad/s)", 0.0, 1e9).on(Rotary).zero()
            => at_motor;
        /// Mass of the load behind the stiffness; at the motor it is a part of the inertia Jeq.
        pub load_inertia: f64 = number("transmission.load_mass_kg", "kg", 1e-6, 1e6).on(Linear).optional(),
            /// Inertia of the load about the axis behind the stiffness; at the motor it is a part of the inertia Jeq.
            = number("transmission.load_inertia_kg_m2", "kg·m²", 1e-9, 1e6).on(Rotary).optional()
            => at_motor;
        /// Width of the gap between motor and load along the axis; needs a stiffness.
        pub backlash: f64 = number("transmission.backlash_um", "µm", 0.0, 1e4).on(Linear).zero().si(MICROMETER),
            /// Width of the gap between motor and load at the axis; needs a stiffness.
            = number("transmission.backlash_deg", "°", 0.0, 10.0).on(Rotary).zero().si(DEGREE)
            => |values, rows| Some(f64::read(values, rows)? / transmission_ratio(values, rows)?);
        /// Share of the friction that acts at the load, as guideways do; the rest acts at the motor; needs a stiffness.
        pub load_friction: f64 = number("transmission.load_friction", "", 0.0, 1.0).zero();
        /// Structure that carries the axis; `None` for a rigid one.
        pub structure: Option<StructureConfig>;
    }
}

parameters! {
    /// Structure that carries an axis and vibrates along it, in units of the motor.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct StructureConfig of Axis {
        /// Modal mass of the structure that carries the axis and vibrates along it; needs a frequency and a stiffness
        /// of the transmission.
        pub inertia: f64 = number("structure.mass_kg", "kg", 1e-3, 1e9).on(Linear).optional(),
            /// Modal inertia of the structure that carries the axis and vibrates about it; needs a frequency and a
            /// stiffness of the transmission.
            = number("structure.inertia_kg_m2", "kg·m²", 1e-6, 1e9).on(Rotary).optional()
            => at_motor;
        /// Natural frequency of the structure with the axis removed; the structure is rigid if omitted.
        pub frequency: f64 = number("structure.frequency_hz", "Hz", 0.1, 1e4).optional().si(TAU);
        /// Damping ratio of the structure with the axis removed.
        pub damping_ratio: f64 = number("structure.damping_ratio", "", 0.0, 1.0).default(Number(0.02));
        /// True if the moving part of the motor pushes against the structure, as in a direct drive.
        pub carries_motor: bool => |values, _| Some(GearConfig::read(values)?.is_direct == Some(true));
    }
}

parameters! {
    /// Equivalent DC motor of the servo motor (Prévost eq. 1).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct MotorConfig of Axis {
        /// Jeq, equivalent inertia at the motor shaft (Prévost eqs. 1 and 5).
        pub inertia: f64 = number("motor.inertia_kg_m2", "kg·m²", POSITIVE, 1e3).driven_by(RotaryMotor),
            /// Moving mass, in place of Jeq (Prévost eq. 1).
            = number("motor.mass_kg", "kg", 1e-6, 1e6).driven_by(LinearMotor);
        /// Kt, torque constant (Prévost eq. 1).
        pub torque_constant: f64 = number("motor.torque_constant_nm_a", "N·m/A", POSITIVE, 1e4).driven_by(RotaryMotor),
            /// Force constant, in place of Kt (Prévost eq. 1).
            = number("motor.force_constant_n_a", "N/A", POSITIVE, 1e5).driven_by(LinearMotor);
        /// Ke, back-EMF constant (Prévost eq. 1).
        pub emf_constant: f64 = number("motor.emf_constant_v_s_rad", "V·s/rad", 0.0, 1e4).driven_by(RotaryMotor),
            /// Ke, back-EMF constant (Prévost eq. 1).
            = number("motor.emf_constant_v_s_m", "V·s/m", 0.0, 1e5).driven_by(LinearMotor);
        /// R, winding resistance (Prévost eq. 1).
        pub resistance: f64 = number("motor.resistance_ohm", "Ω", 0.0, 1e4);
        /// L, winding inductance (Prévost eq. 1).
        pub inductance: f64 = number("motor.inductance_mh", "mH", 1e-6, 1e5).si(MILLIHENRY);
        /// imax, current setpoint limit.
        pub max_current: f64 = number("motor.max_current_a", "A", POSITIVE, MAX_CURRENT);
        /// umax, motor voltage limit.
        pub max_voltage: f64 = number("motor.max_voltage_v", "V", POSITIVE, 1e5);
        /// Maximum motor speed, limit of the position controller output; velocity feedforward is added after the limit.
        pub max_speed: f64 = number("motor.max_speed_rpm", "rpm", 1e-6, 1e6).driven_by(RotaryMotor).si(RPM),
            /// Maximum motor speed, limit of the position controller output; velocity feedforward is added after the
            /// limit.
            = number("motor.max_speed_m_min", "m/min", 1e-6, 1e5).driven_by(LinearMotor).si(METER_PER_MINUTE);
    }
}

parameters! {
    /// Double-exponential friction law a·exp(b·V) + c·exp(d·V) with V in m/min or rev/min of the axis (Prévost eq. 3).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct FrictionConfig of Axis {
        /// Amplitude a of the friction law a·exp(b·V) + c·exp(d·V) (Prévost eq. 3).
        pub a: f64 = friction_current("friction.a");
        /// Exponent b of the friction law, V in m/min (Prévost eq. 3).
        pub b: f64 = friction_exponent("friction.b", "min/m").on(Linear),
            /// Exponent b of the friction law, V in rev/min of the axis (Prévost eq. 3).
            = friction_exponent("friction.b", "min/rev").on(Rotary);
        /// Amplitude c of the friction law; a + c, the friction at standstill, must not be negative (Prévost eq. 3).
        pub c: f64 = friction_current("friction.c");
        /// Exponent d of the friction law, V in m/min (Prévost eq. 3).
        pub d: f64 = friction_exponent("friction.d", "min/m").on(Linear),
            /// Exponent d of the friction law, V in rev/min of the axis (Prévost eq. 3).
            = friction_exponent("friction.d", "min/rev").on(Rotary);
        /// Breakaway current i0, bound of the static friction (Prévost eq. 3).
        pub i0: f64 = number("friction.i0", "A", 0.0, MAX_CURRENT);
    }
}

parameters! {
    /// Terms that are added to the double-exponential friction law: s·exp(−(V/Vs)²) + v·V with V in m/min or rev/min of the
    /// axis (Stribeck curve and viscous friction; Armstrong-Hélouvry et al., Automatica 30, 1994).
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct StribeckConfig of Axis {
        /// Amplitude s of the Stribeck term s·exp(−(V/Vs)²), which is added to the friction law.
        pub current: f64 = number("friction.stribeck", "A", 0.0, MAX_CURRENT).zero();
        /// Velocity Vs of the Stribeck term.
        pub velocity: f64 = number("friction.stribeck_velocity_m_min", "m/min", 1e-6, 1e3).on(Linear).default(Number(0.1)),
            /// Velocity Vs of the Stribeck term, of the axis.
            = number("friction.stribeck_velocity_rpm", "rpm", 1e-6, 1e3).on(Rotary).default(Number(0.1));
        /// Viscous friction v·V, which is added to the friction law.
        pub viscous: f64 = number("friction.viscous", "A/(m/min)", 0.0, MAX_CURRENT).on(Linear).zero(),
            /// Viscous friction v·V, which is added to the friction law, V in rev/min of the axis.
            = number("friction.viscous", "A/rpm", 0.0, MAX_CURRENT).on(Rotary).zero();
    }
}

parameters! {
    /// Presliding of the friction (LuGre or generalized Maxwell-slip model), in units of the motor.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct PreslidingConfig of Axis {
        /// Stiffness σ0 of the friction before the axis slides (LuGre model), along the axis; 0: friction without
        /// presliding.
        pub stiffness: f64 = number("friction.presliding_stiffness_n_um", "N/µm", 0.0, 1e6).on(Linear).zero().si(NEWTON_PER_MICROMETER),
            /// Stiffness σ0 of the friction before the axis slides (LuGre model), at the axis; 0: friction without
            /// presliding.
            = number("friction.presliding_stiffness_nm_rad", "N·m/rad", 0.0, 1e12).on(Rotary).zero()
            => at_motor;
        /// Damping σ1 of the friction before the axis slides (LuGre model), along the axis; needs a presliding
        /// stiffness.
        pub damping: f64 = number("friction.presliding_damping_n_s_m", "N/(m/s)", 0.0, 1e9).on(Linear).zero(),
            /// Damping σ1 of the friction before the axis slides (LuGre model), at the axis; needs a presliding
            /// stiffness.
            = number("friction.presliding_damping_nm_s_rad", "N·m/(rad/s)", 0.0, 1e9).on(Rotary).zero()
            => at_motor;
        /// Number of elements of the friction before the axis slides (generalized Maxwell-slip model), which follow the
        /// LuGre model after a reversal; 0: LuGre model; needs a presliding stiffness.
        pub elements: usize = integer("friction.presliding_elements", "", 0, 10).default(Integer(0));
        /// Attraction C, rate at which the friction of a sliding axis follows its law after a change of speed, along
        /// the axis; 0: at once; needs presliding elements.
        pub attraction: Option<f64> = number("friction.presliding_attraction_n_s", "N/s", 0.0, 1e12).on(Linear).zero(),
            /// Attraction C, rate at which the friction of a sliding axis follows its law after a change of speed, at
            /// the axis; 0: at once; needs presliding elements.
            = number("friction.presliding_attraction_nm_s", "N·m/s", 0.0, 1e12).on(Rotary).zero()
            => |values, rows| Some(<Option<f64>>::read(values, rows)?.zip(transmission_ratio(values, rows)).map(|(c, r)| c * r));
    }
}

impl PreslidingConfig {
    /// LuGre model with a stiffness and a damping of 0.
    pub const NONE: PreslidingConfig =
        PreslidingConfig { stiffness: 0.0, damping: 0.0, elements: 0, attraction: None };
}

parameters! {
    /// Gravity torque at the motor, r·(weight + tilt·sin(position + phase)).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct GravityConfig of Axis {
        /// Net weight of a vertical axis after counterbalance; positive values oppose motion in the positive direction.
        pub weight: f64 = number("gravity.weight_n", "N", -1e6, 1e6).on(Linear).zero();
        /// Gravity torque amplitude k of a tilting axis, k·sin(position + phase).
        pub tilt: f64 = number("gravity.tilt_nm", "N·m", -1e6, 1e6).on(Rotary).zero();
        /// Phase of the gravity torque of a tilting axis.
        pub phase: f64 = number("gravity.tilt_phase_deg", "°", -360.0, 360.0).on(Rotary).zero().si(DEGREE);
    }
}

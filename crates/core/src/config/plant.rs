//! Typed configuration of the plant of an axis: transmission, motor, friction and gravity.

/// Elastic transmission between motor and load, in units of the motor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TransmissionConfig {
    /// Stiffness, N·m/rad (N/m for a linear motor).
    pub stiffness: f64,
    /// Damping, N·m·s/rad (N·s/m for a linear motor).
    pub damping: f64,
    /// Inertia of the load, kg·m² (kg for a linear motor); a part of [`MotorConfig::inertia`].
    pub load_inertia: f64,
    /// Width of the gap between motor and load, rad (m for a linear motor).
    pub backlash: f64,
    /// Share of the friction that acts at the load, 0 … 1.
    pub load_friction: f64,
    /// Structure that carries the axis; `None` for a rigid one.
    pub structure: Option<StructureConfig>,
}

/// Structure that carries an axis and vibrates along it, in units of the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StructureConfig {
    /// Modal inertia, kg·m² (kg for a linear motor).
    pub inertia: f64,
    /// Natural angular frequency with the axis removed, rad/s.
    pub frequency: f64,
    /// Damping ratio with the axis removed.
    pub damping_ratio: f64,
    /// True if the moving part of the motor pushes against the structure, as in a direct drive.
    pub carries_motor: bool,
}

/// Equivalent DC motor of the servo motor (Prévost eq. 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorConfig {
    /// Equivalent inertia Jeq at the motor, kg·m² (kg for a linear motor).
    pub inertia: f64,
    /// Torque constant Kt, N·m/A (N/A for a linear motor).
    pub torque_constant: f64,
    /// Back-EMF constant Ke, V·s/rad (V·s/m for a linear motor).
    pub emf_constant: f64,
    /// Winding resistance R, Ω.
    pub resistance: f64,
    /// Winding inductance L, H.
    pub inductance: f64,
    /// Current setpoint limit, A.
    pub max_current: f64,
    /// Voltage limit, V.
    pub max_voltage: f64,
    /// Velocity setpoint limit, rad/s (m/s for a linear motor).
    pub max_speed: f64,
}

/// Double-exponential friction law a·exp(b·V) + c·exp(d·V) with V in m/min or rev/min of the axis (Prévost eq. 3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionConfig {
    /// Amplitude a, A.
    pub a: f64,
    /// Exponent b, min/m or min/rev.
    pub b: f64,
    /// Amplitude c, A.
    pub c: f64,
    /// Exponent d, min/m or min/rev.
    pub d: f64,
    /// Breakaway current i0, A.
    pub i0: f64,
}

/// Terms that are added to the double-exponential friction law: s·exp(−(V/Vs)²) + v·V (Stribeck curve and viscous
/// friction; Armstrong-Hélouvry et al., Automatica 30, 1994).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StribeckConfig {
    /// Amplitude s, A.
    pub current: f64,
    /// Stribeck velocity Vs, m/min or rev/min of the axis.
    pub velocity: f64,
    /// Viscous friction v, A/(m/min) or A/(rev/min) of the axis.
    pub viscous: f64,
}

/// Presliding of the friction (LuGre or generalized Maxwell-slip model), in units of the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PreslidingConfig {
    /// Stiffness σ0, N·m/rad (N/m for a linear motor).
    pub stiffness: f64,
    /// Damping σ1 of the bristles of the LuGre model, N·m·s/rad (N·s/m for a linear motor).
    pub damping: f64,
    /// Number of elements of the generalized Maxwell-slip model; 0 for the LuGre model.
    pub elements: usize,
    /// Attraction C of slipping elements, N·m/s (N/s for a linear motor); `None` if they follow the friction law at
    /// once.
    pub attraction: Option<f64>,
}

impl PreslidingConfig {
    /// LuGre model with a stiffness and a damping of 0.
    pub const NONE: PreslidingConfig =
        PreslidingConfig { stiffness: 0.0, damping: 0.0, elements: 0, attraction: None };
}

/// Gravity torque at the motor, r·(weight + tilt·sin(position + phase)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GravityConfig {
    /// Net weight W, N.
    pub weight: f64,
    /// Torque amplitude k of a tilting axis, N·m.
    pub tilt: f64,
    /// Phase φ of a tilting axis, rad.
    pub phase: f64,
}

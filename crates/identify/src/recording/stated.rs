//! Values of a machine file that the user has stated.

use virtual_axes_core::config::{Parameters, ValueSource};

/// Values of an axis that the user has stated, against which recordings and results are checked. All other values are those
/// of a template or of a built-in machine, from which a real machine may differ by any factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatedValues {
    /// Travel limits.
    pub travel: bool,
    /// Vmax.
    pub velocity: bool,
    /// Current limit of the motor.
    pub current: bool,
    /// Speed limit of the motor, and the transmission.
    pub motor_speed: bool,
    /// Jeq or mass, and the torque or force constant.
    pub inertia: bool,
    /// Screw lead, gear ratio or direct drive.
    pub transmission: bool,
    /// Torque or force constant.
    pub torque_constant: bool,
    /// Gain of the position loop.
    pub gain: bool,
    /// Delays α, β, γ.
    pub delays: bool,
}

impl StatedValues {
    /// All values are stated.
    pub const ALL: StatedValues = StatedValues {
        travel: true,
        velocity: true,
        current: true,
        motor_speed: true,
        inertia: true,
        transmission: true,
        torque_constant: true,
        gain: true,
        delays: true,
    };

    /// Returns the stated values of `axis`; `is_stated` returns true for a source that is the user.
    pub fn new(parameters: &Parameters, axis: &str, is_stated: impl Fn(&ValueSource) -> bool) -> Self {
        let any = |keys: &[&str]| {
            keys.iter().any(|key| parameters.source(&format!("{axis}.{key}")).is_some_and(&is_stated))
        };
        let transmission =
            any(&["transmission.screw_lead_mm", "transmission.gear_ratio", "transmission.direct"]);
        let torque_constant = any(&["motor.torque_constant_nm_a", "motor.force_constant_n_a"]);
        StatedValues {
            travel: any(&[
                "limits.travel_min_mm",
                "limits.travel_max_mm",
                "limits.travel_min_deg",
                "limits.travel_max_deg",
            ]),
            velocity: any(&["limits.velocity_m_min", "limits.velocity_rpm"]),
            current: any(&["motor.max_current_a"]),
            motor_speed: any(&["motor.max_speed_rpm", "motor.max_speed_m_min"]) && transmission,
            inertia: any(&["motor.inertia_kg_m2", "motor.mass_kg"]) && torque_constant,
            transmission,
            torque_constant,
            gain: any(&["position_loop.gain"]),
            delays: any(&["delays.alpha_ms", "delays.beta_ms", "delays.gamma_ms"]),
        }
    }
}

impl Default for StatedValues {
    /// Returns all values as stated.
    fn default() -> Self {
        StatedValues::ALL
    }
}

//! The motor between two ticks, stepped without discretisation error.

use nalgebra::SMatrix;

use super::DriveError;
use crate::config::MotorConfig;

/// State of a motor: what the differential equation integrates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MotorState {
    /// i, A.
    pub current: f64,
    /// ω, rad/s (m/s for a linear motor).
    pub speed: f64,
    /// θ, rad (m for a linear motor).
    pub angle: f64,
}

/// Zero-order-hold discretisation of Prévost eq. 1 over one tick.
///
/// With voltage u and torque τ (everything but Kt·i) held,
///
/// ```text
/// [i ω]ₙ₊₁ = Φ [i ω]ₙ + Γu u + Γτ τ
///   θₙ₊₁   = θₙ + φ [i ω]ₙ + γu u + γτ τ
/// ```
///
/// where Φ, Γ are blocks of the exponential of the augmented system matrix times the tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Motor {
    current: Row,
    speed: Row,
    angle: Row,
}

/// One row of the discretised system: the weights of i, ω, u and τ.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    current: f64,
    speed: f64,
    voltage: f64,
    torque: f64,
}

impl Row {
    #[inline]
    fn apply(&self, s: &MotorState, voltage: f64, torque: f64) -> f64 {
        self.current * s.current + self.speed * s.speed + self.voltage * voltage + self.torque * torque
    }
}

impl Motor {
    /// Discretises the motor over `period` seconds.
    ///
    /// # Errors
    /// [`DriveError::Discretisation`] if the step is not finite, or so long that a torque would turn
    /// the motor against its own direction within it (friction could not be resolved then).
    pub fn new(motor: &MotorConfig, period: f64) -> Result<Self, DriveError> {
        let m = motor;
        // States i, ω, θ, then the held inputs u and τ.
        let mut a = SMatrix::<f64, 5, 5>::zeros();
        a[(0, 0)] = -m.resistance / m.inductance;
        a[(0, 1)] = -m.emf_constant / m.inductance;
        a[(0, 3)] = 1.0 / m.inductance;
        a[(1, 0)] = m.torque_constant / m.inertia;
        a[(1, 4)] = 1.0 / m.inertia;
        a[(2, 1)] = 1.0;
        let e = (a * period).exp();
        let row =
            |k: usize| Row { current: e[(k, 0)], speed: e[(k, 1)], voltage: e[(k, 3)], torque: e[(k, 4)] };
        let discretised = Motor { current: row(0), speed: row(1), angle: row(2) };
        let speed_per_torque = discretised.speed.torque;
        let sound = e.iter().all(|v| v.is_finite()) && speed_per_torque > 0.0;
        if !sound {
            return Err(DriveError::Discretisation { period_s: period, speed_per_torque });
        }
        Ok(discretised)
    }

    /// ω at the end of the tick.
    #[inline]
    pub fn speed_after(&self, s: &MotorState, voltage: f64, torque: f64) -> f64 {
        self.speed.apply(s, voltage, torque)
    }

    /// Change of ω over one tick per unit of held torque, (rad/s)/(N·m); positive.
    #[inline]
    pub fn speed_per_torque(&self) -> f64 {
        self.speed.torque
    }

    /// State at the end of the tick.
    #[inline]
    pub fn step(&self, s: &MotorState, voltage: f64, torque: f64) -> MotorState {
        MotorState {
            current: self.current.apply(s, voltage, torque),
            speed: self.speed.apply(s, voltage, torque),
            angle: s.angle + self.angle.apply(s, voltage, torque),
        }
    }
}

//! The motor between two ticks, stepped without discretisation error.

use nalgebra::SMatrix;

use super::DriveError;
use crate::config::MotorConfig;
use crate::lanes::{lanes, limited};

lanes! {
    /// State of a motor: what the differential equation integrates.
    #[derive(Debug, Clone, Copy, Default, PartialEq)]
    pub struct MotorState as MotorStateLanes {
        /// i, A.
        pub current: f64,
        /// ω, rad/s (m/s for a linear motor).
        pub speed: f64,
        /// θ, rad (m for a linear motor).
        pub angle: f64,
    }
}

lanes! {
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
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Motor as MotorLanes {
        current: Row,
        speed: Row,
        angle: Row,
        /// Torque per change of ω over one tick, (N·m)/(rad/s).
        torque_per_speed: f64,
        /// What a torque that changes ω by 1 rad/s over one tick changes i and θ by, A and rad.
        current_per_speed: f64,
        angle_per_speed: f64,
    }
}

lanes! {
    /// One row of the discretised system: the weights of i, ω, u and τ.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub(super) struct Row as RowLanes {
        current: f64,
        speed: f64,
        voltage: f64,
        torque: f64,
    }
}

impl Row {
    #[inline(always)]
    fn apply(&self, s: &MotorState, voltage: f64, torque: f64) -> f64 {
        // The voltage is known last.
        let rest = self.current.mul_add(s.current, self.speed.mul_add(s.speed, self.torque * torque));
        self.voltage.mul_add(voltage, rest)
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
        let speed = row(1);
        let torque_per_speed = 1.0 / speed.torque;
        let sound = e.iter().all(|v| v.is_finite()) && speed.torque > 0.0 && torque_per_speed.is_finite();
        if !sound {
            return Err(DriveError::Discretisation { period_s: period, speed_per_torque: speed.torque });
        }
        let (current, angle) = (row(0), row(2));
        Ok(Motor {
            current,
            speed,
            angle,
            torque_per_speed,
            current_per_speed: current.torque * torque_per_speed,
            angle_per_speed: angle.torque * torque_per_speed,
        })
    }

    /// State at the end of the tick under `voltage` and a held `torque`.
    #[inline(always)]
    pub fn step(&self, s: &MotorState, voltage: f64, torque: f64) -> MotorState {
        MotorState {
            current: self.current.apply(s, voltage, torque),
            speed: self.speed.apply(s, voltage, torque),
            angle: s.angle + self.angle.apply(s, voltage, torque),
        }
    }

    /// State at the end of the tick, and the friction torque over it: the one that ends the tick at
    /// standstill, limited to what changes ω by `slowing` (rad/s, not negative) over a tick. Where it is not
    /// limited ω is 0.0 exactly, and rounding never turns ω round: what friction takes away is never more
    /// than there is.
    #[inline(always)]
    pub(super) fn step_with_friction(
        &self,
        s: &MotorState,
        voltage: f64,
        external: f64,
        slowing: f64,
    ) -> (MotorState, f64) {
        let free = self.step(s, voltage, external);
        let taken = limited(free.speed, slowing);
        let state = MotorState {
            current: taken.mul_add(-self.current_per_speed, free.current),
            speed: free.speed - taken,
            angle: taken.mul_add(-self.angle_per_speed, free.angle),
        };
        (state, taken * self.torque_per_speed)
    }

    /// Change of ω over a tick per torque that acts over it, (rad/s)/(N·m).
    pub(super) fn speed_per_torque(&self) -> f64 {
        self.speed.torque
    }
}

//! Motor, friction, gravity and load together.

use super::{DriveError, Friction, Gravity, Motor, MotorState};
use crate::config::{AxisConfig, MotorConfig};

/// Torques that acted over a tick, N·m at the motor (N for a linear motor).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Torques {
    /// Friction, positive against motion towards plus.
    pub friction: f64,
    /// Gravity, positive against motion towards plus.
    pub gravity: f64,
    /// External load, positive towards plus.
    pub load: f64,
}

/// One axis without its controllers.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    motor: Motor,
    friction: Friction,
    gravity: Gravity,
    ratio: f64,
    torque_constant: f64,
}

impl Plant {
    /// The plant of `axis`, with what it deviates by, stepped by `period` seconds.
    ///
    /// # Errors
    /// [`DriveError`] if the motor cannot be discretised over the period.
    pub fn new(axis: &AxisConfig, period: f64) -> Result<Self, DriveError> {
        let (r, deviation) = (axis.transmission_ratio, &axis.deviation);
        let motor = Self::motor(axis);
        // The law gives amperes of the motor as it is reckoned with: its torque does not follow Kt.
        let friction_constant = axis.motor.torque_constant * deviation.friction;
        Ok(Plant {
            friction: Friction::new(axis.friction, axis.kind, r, friction_constant),
            gravity: Gravity::new(&axis.gravity, r),
            ratio: r,
            torque_constant: motor.torque_constant,
            motor: Motor::new(&motor, period)?,
        })
    }

    /// The motor of `axis` as it is: with what its inertia and Kt deviate by.
    pub fn motor(axis: &AxisConfig) -> MotorConfig {
        MotorConfig {
            inertia: axis.motor.inertia * axis.deviation.inertia,
            torque_constant: axis.motor.torque_constant * axis.deviation.torque_constant,
            ..axis.motor
        }
    }

    /// Kt as it is, N·m/A.
    #[inline]
    pub fn torque_constant(&self) -> f64 {
        self.torque_constant
    }

    /// Axis position of a motor state, m or rad.
    #[inline]
    pub fn position(&self, s: &MotorState) -> f64 {
        s.angle * self.ratio
    }

    /// Axis velocity of a motor state, m/s or rad/s.
    #[inline]
    pub fn velocity(&self, s: &MotorState) -> f64 {
        s.speed * self.ratio
    }

    /// Gravity torque where the axis stands, N·m at the motor.
    #[inline]
    pub fn gravity(&self, s: &MotorState) -> f64 {
        self.gravity.torque(self.position(s))
    }

    /// Whether the friction law is extrapolated at this state.
    #[inline]
    pub fn friction_is_extrapolated(&self, s: &MotorState) -> bool {
        self.friction.is_extrapolated(s.speed)
    }

    /// Moves the plant by one tick under `voltage` (V) and an external `load` (N or N·m at the axis).
    ///
    /// Friction is the torque that ends the tick at standstill, limited to its bound: it stops the
    /// axis and never reverses it, `C_friction · ω_end ≥ 0`, and an axis that it stops has ω = 0.0.
    #[inline]
    pub fn step(&self, s: &mut MotorState, voltage: f64, load: f64) -> Torques {
        let gravity = self.gravity(s);
        let load = self.ratio * load;
        let external = load - gravity;
        let free_speed = self.motor.speed_after(s, voltage, external);
        let (friction, stops) = self.friction.over_tick(s.speed, free_speed, self.motor.speed_per_torque());
        *s = self.motor.step(s, voltage, external - friction);
        if stops {
            s.speed = 0.0;
        }
        Torques { friction, gravity, load }
    }
}

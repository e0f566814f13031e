//! Motor, friction, gravity and load together.

use super::{DriveError, Friction, Gravity, Incline, Motor, MotorState};
use crate::config::{AxisConfig, MotorConfig};
use crate::simd::{Number, numbers};

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

numbers! {
    /// One axis without its controllers.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Plant {
        pub(crate) motor: Motor<N>,
        /// Friction in the change of ω that it makes over a tick, rad/s.
        pub(crate) slowing: Friction<N>,
        pub(crate) gravity: Gravity<N>,
        ratio: N,
        torque_constant: N,
    }
}

impl Plant {
    /// The plant of `axis`, with what it deviates by, stepped by `period` seconds.
    ///
    /// # Errors
    /// [`DriveError`] if the motor cannot be discretized over the period.
    pub fn new(axis: &AxisConfig, period: f64) -> Result<Self, DriveError> {
        let (r, deviation) = (axis.transmission_ratio, &axis.deviation);
        let motor = Self::motor(axis);
        // The law gives amperes of the motor as it is reckoned with: its torque does not follow Kt.
        let friction_constant = axis.motor.torque_constant * deviation.friction;
        let stepped = Motor::new(&motor, period)?;
        let slowing = friction_constant * stepped.speed_per_torque();
        Ok(Plant {
            slowing: Friction::new(axis.friction, axis.kind, r, slowing),
            gravity: Gravity::new(&axis.gravity, r),
            ratio: r,
            torque_constant: motor.torque_constant,
            motor: stepped,
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

    /// Whether the friction law is extrapolated at a motor speed ω (rad/s).
    #[inline]
    pub fn friction_is_extrapolated(&self, speed: f64) -> bool {
        self.slowing.is_extrapolated(speed)
    }

    /// Moves the plant by one tick under `voltage` (V) and an external `load` (N or N·m at the axis).
    ///
    /// Friction is the torque that ends the tick at standstill, limited to its bound: it stops the
    /// axis and never reverses it, `C_friction · ω_end ≥ 0`, and an axis that it stops has ω = 0.0.
    pub fn step(&self, s: &mut MotorState, voltage: f64, load: f64) -> Torques {
        let (gravity, load) = (self.gravity_at(s.angle), self.load_torque(load));
        let taken = self.step_under(s, voltage, load - gravity, self.slowing.bound(s.speed));
        let friction = self.friction_taking(taken);
        Torques { friction, gravity, load }
    }
}

impl<N: Number> Plant<N> {
    /// Kt as it is, N·m/A.
    #[inline(always)]
    pub fn torque_constant(&self) -> N {
        self.torque_constant
    }

    /// Axis position at a motor angle θ (rad), m or rad.
    #[inline(always)]
    pub fn position(&self, angle: N) -> N {
        angle * self.ratio
    }

    /// Axis velocity at a motor speed ω (rad/s), m/s or rad/s.
    #[inline(always)]
    pub fn velocity(&self, speed: N) -> N {
        speed * self.ratio
    }

    /// Gravity torque at a motor angle θ (rad), N·m at the motor.
    #[inline(always)]
    pub fn gravity_at(&self, angle: N) -> N {
        self.gravity.torque(self.position(angle))
    }

    /// Gravity torque at a motor angle θ (rad) by the polynomial at hand, which follows it, N·m at the motor.
    #[inline(always)]
    pub(crate) fn gravity_near(&self, near: &mut Incline<N>, angle: N) -> N {
        self.gravity.torque_near(near, angle)
    }

    /// Gravity torque where it does not depend on the position, N·m at the motor.
    #[inline(always)]
    pub(crate) fn weight(&self) -> N {
        self.gravity.weight()
    }

    /// What an external `load` (N or N·m at the axis) is at the motor, N·m.
    #[inline(always)]
    pub fn load_torque(&self, load: N) -> N {
        self.ratio * load
    }

    /// Moves the plant by one tick with what is known already: gravity and load together as `external` torque
    /// (N·m at the motor), and the bound of `slowing`. What friction takes from ω comes back, rad/s.
    #[inline(always)]
    pub(crate) fn step_under(&self, s: &mut MotorState<N>, voltage: N, external: N, slowing: N) -> N {
        let (state, taken) = self.motor.step_with_friction(s, voltage, external, slowing);
        *s = state;
        taken
    }

    /// The friction torque that takes `taken` from ω over a tick (rad/s), N·m.
    #[inline(always)]
    pub(crate) fn friction_taking(&self, taken: N) -> N {
        self.motor.torque_taking(taken)
    }
}

//! Plant of one axis: motor, friction, gravity and load.

use super::{
    DriveError, Friction, Gravity, GravityExpansion, LoadState, MaxwellSlip, MaxwellSlipState, Motor,
    MotorState, Presliding, Transmission,
};
use crate::config::{AxisConfig, MotorConfig, PreslidingConfig, TransmissionConfig};
use crate::simd::{SimdReal, clamp_abs, soa_struct};

/// Torques over one tick, N·m at the motor (N for a linear motor).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Torques {
    /// Friction; positive opposes motion in the positive direction.
    pub friction: f64,
    /// Gravity; positive opposes motion in the positive direction.
    pub gravity: f64,
    /// External load; positive acts in the positive direction.
    pub load: f64,
}

soa_struct! {
    /// Plant of one axis, stepped by ticks (Prévost eq. 1).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Plant {
        pub(crate) motor: Motor<N>,
        /// Friction law scaled to the speed change per tick, rad/s.
        pub(crate) friction_speed_drop: Friction<N>,
        pub(crate) presliding: Presliding<N>,
        pub(crate) gravity: Gravity<N>,
        pub(crate) transmission: Transmission<N>,
        transmission_ratio: N,
        /// Kt of the plant with its deviation, N·m/A.
        torque_constant: N,
    }
}

impl Plant {
    /// Discretizes the plant of `axis` with its deviation over `period` seconds.
    ///
    /// # Errors
    /// [`DriveError`] if the motor cannot be discretized over the period.
    pub fn new(axis: &AxisConfig, period: f64) -> Result<Self, DriveError> {
        let (r, deviation) = (axis.transmission_ratio, &axis.deviation);
        let motor = Self::deviating_motor(axis);
        // The friction law is in amperes of the nominal motor: its torque does not change with the deviation of Kt.
        let friction_constant = axis.motor.torque_constant * deviation.friction;
        let (discretized, transmission) = match Self::deviating_transmission(axis) {
            Some(elastic) => Transmission::new(&motor, &elastic, period)?,
            None => (Motor::new(&motor, period)?, Transmission::rigid()),
        };
        let speed_per_torque = discretized.speed_per_torque();
        let friction = Friction::of_axis(axis, friction_constant * speed_per_torque);
        let (friction_speed_drop, presliding) = match &axis.presliding {
            Some(presliding) => {
                let (law, viscosity) = friction.of_presliding();
                let per_torque = discretized.angle_per_torque();
                let scaled = PreslidingConfig {
                    stiffness: presliding.stiffness * deviation.friction,
                    damping: presliding.damping * deviation.friction,
                    ..*presliding
                };
                (law, Presliding::new(&scaled, viscosity / speed_per_torque, period, per_torque))
            }
            None => (friction, Presliding::none()),
        };
        Ok(Plant {
            friction_speed_drop,
            presliding,
            gravity: Gravity::new(&axis.gravity, r),
            transmission,
            transmission_ratio: r,
            torque_constant: motor.torque_constant,
            motor: discretized,
        })
    }

    /// Returns the motor of `axis` with the deviations of inertia and Kt.
    pub fn deviating_motor(axis: &AxisConfig) -> MotorConfig {
        MotorConfig {
            inertia: axis.motor.inertia * axis.deviation.inertia,
            torque_constant: axis.motor.torque_constant * axis.deviation.torque_constant,
            ..axis.motor
        }
    }

    /// Returns the elastic transmission of `axis` with the deviation of inertia.
    pub fn deviating_transmission(axis: &AxisConfig) -> Option<TransmissionConfig> {
        let deviating = |t: TransmissionConfig| TransmissionConfig {
            load_inertia: t.load_inertia * axis.deviation.inertia,
            ..t
        };
        axis.transmission.map(deviating)
    }

    /// Returns true if the friction law is extrapolated at a motor speed ω (rad/s).
    #[inline]
    pub fn is_friction_extrapolated(&self, speed: f64) -> bool {
        self.friction_speed_drop.is_extrapolated(speed)
    }

    /// Steps any plant by one tick, as [`step`](Self::step) a rigid one without presliding: friction acts at the motor,
    /// gravity and `load` at the load. `deflection` is that of the bristles, rad at the motor; 0 without presliding.
    pub fn step_with_load(
        &self,
        s: &mut MotorState,
        load_state: &mut LoadState,
        deflection: &mut f64,
        voltage: f64,
        load: f64,
    ) -> Torques {
        let deflection = self.presliding.is_present().then_some(deflection);
        self.step_with_memory(s, load_state, deflection, [voltage, load], |_, lugre| lugre)
    }

    /// Steps the plant of an axis with the elements `friction` by one tick; see
    /// [`step_with_load`](Self::step_with_load).
    pub fn step_with_maxwell_slip(
        &self,
        s: &mut MotorState,
        load_state: &mut LoadState,
        (friction, state): (&MaxwellSlip, &mut MaxwellSlipState),
        voltage: f64,
        load: f64,
    ) -> Torques {
        let speed = s.speed;
        let memory = |[displacement, law]: [f64; 2], _| (friction.step(displacement, law, speed, state), 0.0);
        self.step_with_memory(s, load_state, Some(&mut 0.0), [voltage, load], memory)
    }

    /// Steps the plant by one tick under a voltage and a load; see [`step_rigid`](Self::step_rigid).
    fn step_with_memory(
        &self,
        s: &mut MotorState,
        load_state: &mut LoadState,
        deflection: Option<&mut f64>,
        [voltage, load]: [f64; 2],
        memory: impl FnOnce([f64; 2], (f64, f64)) -> (f64, f64),
    ) -> Torques {
        let gravity = self.gravity_torque(s.angle - load_state.wind_up);
        let load = self.load_torque(load);
        let inputs = [voltage, load - gravity, self.friction_speed_drop.bound(s.speed)];
        let speed_drop = match self.transmission.is_elastic() {
            true => self.step_elastic(s, load_state, deflection, inputs, memory),
            false => self.step_rigid(s, deflection, inputs, memory),
        };
        Torques { friction: self.torque_from_speed_drop(speed_drop), gravity, load }
    }

    /// Returns the change of θ over one tick per torque at the motor, rad/(N·m).
    pub fn angle_per_torque(&self) -> f64 {
        self.motor.angle_per_torque()
    }

    /// Returns position, velocity (m, m/s or rad, rad/s) and current (A) of the axis: those of the load with an elastic
    /// transmission.
    #[inline]
    pub fn motion(&self, motor: &MotorState, load: &LoadState) -> [f64; 3] {
        let speed = if self.transmission.is_elastic() { load.speed } else { motor.speed };
        [self.position(motor.angle - load.wind_up), self.velocity(speed), motor.current]
    }

    /// Steps a rigid plant by one tick under `voltage` (V) and an external `load` (N or N·m at the axis); returns the
    /// torques over the tick.
    ///
    /// Friction is the torque that gives standstill at the end of the tick, limited to its bound. It stops the axis
    /// and never reverses it: `C_friction · ω_end ≥ 0`, and an axis stopped by friction has ω = 0.0.
    pub fn step(&self, s: &mut MotorState, voltage: f64, load: f64) -> Torques {
        let (gravity, load) = (self.gravity_torque(s.angle), self.load_torque(load));
        let speed_drop =
            self.step_with_torques(s, voltage, load - gravity, self.friction_speed_drop.bound(s.speed));
        let friction = self.torque_from_speed_drop(speed_drop);
        Torques { friction, gravity, load }
    }
}

impl<N: SimdReal> Plant<N> {
    /// Returns Kt with its deviation, N·m/A.
    #[inline(always)]
    pub fn torque_constant(&self) -> N {
        self.torque_constant
    }

    /// Returns the axis position at a motor angle θ (rad), m or rad.
    #[inline(always)]
    pub fn position(&self, angle: N) -> N {
        angle * self.transmission_ratio
    }

    /// Returns the axis velocity at a motor speed ω (rad/s), m/s or rad/s.
    #[inline(always)]
    pub fn velocity(&self, speed: N) -> N {
        speed * self.transmission_ratio
    }

    /// Returns the gravity torque at an angle θ of the load (rad), N·m at the motor.
    #[inline(always)]
    pub fn gravity_torque(&self, angle: N) -> N {
        self.gravity.torque(self.position(angle))
    }

    /// Returns the gravity torque at a motor angle θ (rad) from an expansion that follows the angle, N·m at the motor.
    #[inline(always)]
    pub(crate) fn gravity_torque_with_expansion(&self, expansion: &mut GravityExpansion<N>, angle: N) -> N {
        self.gravity.torque_with_expansion(expansion, angle)
    }

    /// Returns the gravity torque of an axis that does not tilt, N·m at the motor.
    #[inline(always)]
    pub(crate) fn weight_torque(&self) -> N {
        self.gravity.weight_torque()
    }

    /// Converts an external `load` (N or N·m at the axis) to N·m at the motor.
    #[inline(always)]
    pub fn load_torque(&self, load: N) -> N {
        self.transmission_ratio * load
    }

    /// Steps the plant by one tick with known torques; returns the speed drop by friction, rad/s.
    ///
    /// `external` is load minus gravity, N·m at the motor; `max_speed_drop` is the bound of friction, rad/s.
    #[inline(always)]
    pub(crate) fn step_with_torques(
        &self,
        s: &mut MotorState<N>,
        voltage: N,
        external: N,
        max_speed_drop: N,
    ) -> N {
        let (state, speed_drop) = self.motor.step_with_friction(s, voltage, external, max_speed_drop);
        *s = state;
        speed_drop
    }

    /// Steps a rigid plant by one tick under a voltage, a torque and a bound of friction, as
    /// [`step_with_torques`](Self::step_with_torques), with presliding if there is a `deflection`.
    ///
    /// `memory` returns the displacement by friction and the deflection at the end of the tick, from the displacement
    /// without friction, that by the friction law (rad), and the result of the bristles; it replaces the latter in
    /// the lanes with another model.
    #[inline(always)]
    pub(crate) fn step_rigid(
        &self,
        s: &mut MotorState<N>,
        deflection: Option<&mut N>,
        [voltage, external, max_speed_drop]: [N; 3],
        memory: impl FnOnce([N; 2], (N, N)) -> (N, N),
    ) -> N {
        let free = self.motor.step(s, voltage, external);
        let stopping = clamp_abs(free.speed, max_speed_drop);
        let speed_drop = match deflection {
            None => stopping,
            Some(deflection) => {
                let displacement = self.motor.displacement(s, voltage, external);
                self.sliding([displacement, max_speed_drop], deflection, stopping, memory)
            }
        };
        *s = self.motor.brake(&free, speed_drop);
        speed_drop
    }

    /// Steps motor and load by one tick, the load in place of the motor under the torque; see
    /// [`step_rigid`](Self::step_rigid).
    #[inline(always)]
    pub(crate) fn step_elastic(
        &self,
        s: &mut MotorState<N>,
        load: &mut LoadState<N>,
        deflection: Option<&mut N>,
        [voltage, external, max_speed_drop]: [N; 3],
        memory: impl FnOnce([N; 2], (N, N)) -> (N, N),
    ) -> N {
        let presliding = match deflection {
            Some(_) => self.presliding.stiffness,
            None => voltage.splat(0.0),
        };
        let friction = |free: &MotorState<N>| {
            let stopping = clamp_abs(free.speed, max_speed_drop);
            match deflection {
                None => stopping,
                Some(deflection) => self.sliding([free.angle, max_speed_drop], deflection, stopping, memory),
            }
        };
        let inputs = [voltage, external, presliding];
        self.transmission.step_with_friction(&self.motor, s, load, inputs, friction)
    }

    /// Returns the speed drop by friction with presliding over a tick (rad/s) from the displacement without friction
    /// (rad), and changes the deflection; the speed drop is `stopping` in the lanes without presliding. See
    /// [`step_rigid`](Self::step_rigid).
    #[inline(always)]
    fn sliding(
        &self,
        [displacement, max_speed_drop]: [N; 2],
        deflection: &mut N,
        stopping: N,
        memory: impl FnOnce([N; 2], (N, N)) -> (N, N),
    ) -> N {
        let law = self.motor.displacement_by_speed_drop(max_speed_drop);
        let bristles = self.presliding.step(displacement, law, *deflection);
        let (by_friction, next) = memory([displacement, law], bristles);
        let is_present = law.splat(0.0).simd_lt(self.presliding.stiffness);
        *deflection = next.select(is_present, *deflection);
        self.motor.speed_drop_by_displacement(by_friction).select(is_present, stopping)
    }

    /// Returns the friction torque for a speed drop over one tick (rad/s), N·m.
    #[inline(always)]
    pub(crate) fn torque_from_speed_drop(&self, speed_drop: N) -> N {
        self.motor.torque_from_speed_drop(speed_drop)
    }
}

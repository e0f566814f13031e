//! One axis: a plant, its cascade, and the state of both.

use crate::config::{AxisConfig, Periods};
use crate::control::{
    Delays, Feedforward, Pi, PiState, PositionController, PositionState, Reach, SetpointHistory,
};
use crate::drive::{MotorState, Plant, Torques};
use crate::units::seconds;

use super::compensation::FrictionCompensation;
use super::controller::{feedforward, position_controller};
use super::{AxisError, AxisSample};

/// Everything immutable about one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisParameters {
    plant: Plant,
    position: PositionController,
    controller: &'static str,
    velocity: Pi,
    current: Pi,
    feedforward: Feedforward,
    compensation: Option<FrictionCompensation>,
    delays: Delays,
    ratio: f64,
    /// Kt that the drive reckons with.
    torque_constant: f64,
    max_current: f64,
    resistance: f64,
    max_speed: f64,
    ticks_per_position: u64,
    ticks_per_velocity: u64,
}

impl AxisParameters {
    /// The longest delay of a set-point, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.delays.longest()
    }

    /// Set-points ahead of the present one that the position controller reads.
    pub fn horizon(&self) -> usize {
        self.reach().ahead
    }

    fn reach(&self) -> Reach {
        let delay = self.delays.position.div_ceil(self.ticks_per_position) as i64;
        let compensated = self.compensation.as_ref().map_or(0, FrictionCompensation::preview);
        Reach {
            delay: self.delays.longest(),
            lookback: self.position.lookback() as usize,
            ahead: (self.position.preview() - delay).max(compensated).max(0) as usize,
        }
    }

    /// Discretises an axis and designs its position controller.
    ///
    /// # Errors
    /// [`AxisError`].
    pub fn new(axis: &AxisConfig, periods: &Periods) -> Result<Self, AxisError> {
        let motor = &axis.motor;
        let tick = seconds(periods.current);
        let (position, controller) = position_controller(axis, periods)?;
        let delays = Delays::new(&axis.delays, periods.current);
        let compensation = FrictionCompensation::new(axis, periods, delays.friction);
        // A shift of nothing delays nothing.
        let delays = Delays { friction: if compensation.is_some() { delays.friction } else { 0 }, ..delays };
        Ok(AxisParameters {
            plant: Plant::new(axis, tick)?,
            position,
            controller,
            velocity: Pi::new(
                &axis.velocity_loop,
                seconds(periods.velocity),
                motor.torque_constant,
                motor.max_current,
            ),
            current: Pi::new(&axis.current_loop, tick, 1.0, motor.max_voltage),
            feedforward: Feedforward::new(
                &feedforward(axis),
                seconds(periods.position),
                axis.transmission_ratio,
            ),
            compensation,
            delays,
            ratio: axis.transmission_ratio,
            torque_constant: motor.torque_constant,
            max_current: motor.max_current,
            resistance: motor.resistance,
            max_speed: motor.max_speed,
            ticks_per_position: periods.ticks_per_position(),
            ticks_per_velocity: periods.ticks_per_velocity(),
        })
    }
}

/// State of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    motor: MotorState,
    torques: Torques,
    load: f64,
    psec: SetpointHistory,
    position: PositionState,
    velocity_pi: PiState,
    current_pi: PiState,
    speed_limited: bool,
    /// Whether the current set-point was limited since the last position instant.
    current_limited: bool,
    sample: AxisSample,
}

impl Axis {
    /// At rest at `position` (m or rad), held against gravity.
    pub fn at_rest(p: &AxisParameters, position: f64) -> Self {
        let motor = MotorState { current: 0.0, speed: 0.0, angle: position / p.ratio };
        let gravity = p.plant.gravity(&motor);
        let current = gravity / p.plant.torque_constant();
        // What the drive takes that current for.
        let torque = gravity * (p.torque_constant / p.plant.torque_constant());
        let voltage = p.resistance * current;
        let mut axis = Axis {
            motor: MotorState { current, ..motor },
            torques: Torques { friction: 0.0, gravity, load: 0.0 },
            load: 0.0,
            psec: SetpointHistory::new(position, p.ticks_per_position, p.reach()),
            position: PositionState::at_rest(motor.angle),
            velocity_pi: PiState { integral: torque, limited: false },
            current_pi: PiState { integral: voltage, limited: false },
            speed_limited: false,
            current_limited: false,
            sample: AxisSample {
                psec: position,
                delayed_psec: position,
                current_setpoint: current,
                voltage,
                ..AxisSample::default()
            },
        };
        axis.observe(p);
        axis
    }

    /// Takes over changed parameters in the place of `old`; the state goes on.
    ///
    /// The velocity loop's integral takes over what TFFWS gives up.
    pub(super) fn adopt(&mut self, old: &AxisParameters, p: &AxisParameters, tick: u64) {
        let torque = |p: &AxisParameters| {
            p.feedforward.torque(&self.psec, self.psec.index(tick.saturating_sub(1), p.delays.torque))
        };
        let limit = p.torque_constant * p.max_current;
        let integral = self.velocity_pi.integral + (torque(old) - torque(p)).clamp(-limit, limit);
        self.velocity_pi.integral = integral;
        self.psec.adopt(p.reach());
        if (&old.position, &old.feedforward) != (&p.position, &p.feedforward) {
            self.position.hand_over();
        }
        self.sample.controller = p.controller;
    }

    /// The set-point of the position period that begins, and those behind it as far as they are known.
    pub(super) fn begin_period(&mut self, psec: f64, ahead: &[f64]) {
        self.psec.push(psec);
        self.psec.foresee(ahead);
        self.sample.psec = psec;
    }

    pub(super) fn set_load(&mut self, load: f64) {
        self.load = load;
    }

    /// The loops that are due at `tick`: position, then velocity, then current.
    #[inline]
    pub(super) fn control(&mut self, p: &AxisParameters, tick: u64, tick_in_period: u64) {
        if tick_in_period == 0 {
            self.control_position(p, tick);
        }
        if tick_in_period.is_multiple_of(p.ticks_per_velocity) {
            self.control_velocity(p, tick);
        }
        let error = self.sample.current_setpoint - self.motor.current;
        self.sample.voltage = p.current.update(&mut self.current_pi, error, 0.0);
        self.observe(p);
    }

    fn control_position(&mut self, p: &AxisParameters, tick: u64) {
        let k = self.psec.index(tick, p.delays.position);
        self.sample.delayed_psec = self.psec.at(k);
        if std::mem::take(&mut self.current_limited) {
            self.position.correct(self.motor.speed);
        }
        let psec = &self.psec;
        let feedforward = p.feedforward.velocity(psec, psec.index(tick, p.delays.velocity));
        let setpoint = |j| psec.at(k + j) / p.ratio;
        let wanted = p.position.update(&mut self.position, setpoint, self.motor.angle, feedforward);
        // Coefficients that are forced can make it overflow: an axis that is asked for nothing stops.
        let asked = if wanted.is_finite() { wanted } else { 0.0 };
        self.sample.velocity_setpoint = asked.clamp(-p.max_speed, p.max_speed);
        self.speed_limited = wanted != self.sample.velocity_setpoint;
        self.position.record(self.sample.velocity_setpoint + feedforward);
    }

    fn control_velocity(&mut self, p: &AxisParameters, tick: u64) {
        let s = &mut self.sample;
        let velocity_index = self.psec.index(tick, p.delays.velocity);
        let torque_index = self.psec.index(tick, p.delays.torque);
        s.velocity_feedforward = p.feedforward.velocity(&self.psec, velocity_index);
        s.torque_feedforward = p.feedforward.torque(&self.psec, torque_index);
        if let Some(compensation) = &p.compensation {
            s.torque_feedforward += compensation.torque(&self.psec, tick);
        }
        let error = s.velocity_setpoint + s.velocity_feedforward - self.motor.speed;
        s.current_setpoint = p.velocity.update(&mut self.velocity_pi, error, s.torque_feedforward);
        self.current_limited |= self.velocity_pi.limited;
    }

    /// Moves the plant by one tick.
    #[inline]
    pub(super) fn step(&mut self, p: &AxisParameters) {
        self.torques = p.plant.step(&mut self.motor, self.sample.voltage, self.load);
    }

    /// Copies the plant's state into the sample.
    #[inline]
    fn observe(&mut self, p: &AxisParameters) {
        let s = &mut self.sample;
        s.position = p.plant.position(&self.motor);
        s.velocity = p.plant.velocity(&self.motor);
        s.current = self.motor.current;
        let torque_constant = p.plant.torque_constant();
        s.friction_current = self.torques.friction / torque_constant;
        s.gravity_current = self.torques.gravity / torque_constant;
        s.load_current = -self.torques.load / torque_constant;
        s.effort = torque_constant * self.motor.current / p.ratio;
        s.saturated = self.speed_limited || self.velocity_pi.limited || self.current_pi.limited;
        s.controller = p.controller;
        s.friction_extrapolated = p.plant.friction_is_extrapolated(&self.motor);
    }

    /// The signals of the tick that the controllers have last acted on.
    pub fn sample(&self) -> &AxisSample {
        &self.sample
    }
}

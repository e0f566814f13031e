//! One axis: a plant, its cascade, and what of their state does not go on from tick to tick.

use crate::config::{AxisConfig, Periods};
use crate::control::{
    Delays, Feedforward, Pi, PiState, PositionController, PositionState, Reach, SetpointHistory, Shift,
};
use crate::drive::{MotorState, Plant};
use crate::units::seconds;

use super::block::{Demand, Done, Loops, LoopsState, Stair};
use super::compensation::FrictionCompensation;
use super::controller::{feedforward, position_controller};
use super::{AxisError, AxisSample};

/// Everything immutable about one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisParameters {
    pub(super) loops: Loops,
    position: PositionController,
    controller: &'static str,
    feedforward: Feedforward,
    pub(super) compensation: Option<FrictionCompensation>,
    delays: Delays,
    position_shift: Shift,
    velocity_shift: Shift,
    torque_shift: Shift,
    ratio: f64,
    inverse_ratio: f64,
    /// Kt that the drive reckons with.
    torque_constant: f64,
    max_current: f64,
    resistance: f64,
    max_speed: f64,
    ticks_per_position: u64,
    ticks_per_velocity: u64,
}

impl AxisParameters {
    /// The longest delay of a setpoint, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.delays.longest()
    }

    /// Setpoints ahead of the present one that the position controller reads.
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

    /// Discretizes an axis and designs its position controller.
    ///
    /// # Errors
    /// [`AxisError`].
    pub fn new(axis: &AxisConfig, periods: &Periods) -> Result<Self, AxisError> {
        let motor = &axis.motor;
        let (tick, ticks) = (seconds(periods.current), periods.ticks_per_position());
        let (position, controller) = position_controller(axis, periods)?;
        let delays = Delays::new(&axis.delays, periods.current);
        let compensation = FrictionCompensation::new(axis, periods, delays.friction);
        // A shift of nothing delays nothing.
        let delays = Delays { friction: if compensation.is_some() { delays.friction } else { 0 }, ..delays };
        let velocity_scale = 1.0 / motor.torque_constant;
        Ok(AxisParameters {
            loops: Loops {
                plant: Plant::new(axis, tick)?,
                velocity: Pi::new(
                    &axis.velocity_loop,
                    seconds(periods.velocity),
                    velocity_scale,
                    motor.max_current,
                ),
                current: Pi::new(&axis.current_loop, tick, 1.0, motor.max_voltage),
            },
            position,
            controller,
            feedforward: Feedforward::new(
                &feedforward(axis),
                seconds(periods.position),
                axis.transmission_ratio,
            ),
            compensation,
            position_shift: Shift::new(delays.position, ticks),
            velocity_shift: Shift::new(delays.velocity, ticks),
            torque_shift: Shift::new(delays.torque, ticks),
            delays,
            ratio: axis.transmission_ratio,
            inverse_ratio: 1.0 / axis.transmission_ratio,
            torque_constant: motor.torque_constant,
            max_current: motor.max_current,
            resistance: motor.resistance,
            max_speed: motor.max_speed,
            ticks_per_position: ticks,
            ticks_per_velocity: periods.ticks_per_velocity(),
        })
    }

    /// A feedforward over a position period, from its values before and behind its step.
    fn stair(&self, shift: Shift, before: f64, behind: f64) -> Stair {
        Stair { before, behind, step: shift.step().div_ceil(self.ticks_per_velocity) as f64 }
    }
}

/// State of one axis, but for what goes on from tick to tick.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// N or N·m.
    load: f64,
    psec: SetpointHistory,
    position: PositionState,
    /// What the axis was asked for in this position period.
    demand: Demand,
    /// Load torque over the tick before the position instant, N·m at the motor.
    load_before: f64,
    sample: AxisSample,
}

impl Axis {
    /// At rest at `position` (m or rad), held against gravity.
    pub(super) fn at_rest(p: &AxisParameters, position: f64) -> (Self, LoopsState) {
        let angle = position / p.ratio;
        let plant = &p.loops.plant;
        let gravity = plant.gravity_at(angle);
        let current = gravity / plant.torque_constant();
        // What the drive takes that current for.
        let torque = gravity * (p.torque_constant / plant.torque_constant());
        let voltage = p.resistance * current;
        let state = LoopsState {
            motor: MotorState { current, speed: 0.0, angle },
            velocity: PiState { integral: torque, excess: 0.0 },
            current: PiState { integral: voltage, excess: 0.0 },
            current_setpoint: current,
            gravity,
            ..LoopsState::default()
        };
        let mut axis = Axis {
            load: 0.0,
            psec: SetpointHistory::new(position, p.ticks_per_position, p.reach()),
            position: PositionState::at_rest(angle),
            demand: Demand::default(),
            load_before: 0.0,
            sample: AxisSample { psec: position, delayed_psec: position, ..AxisSample::default() },
        };
        let done = Done { current_setpoint: current, voltage, gravity, ..Done::default() };
        axis.observe(p, 0, &state.motor, &done);
        (axis, state)
    }

    /// Takes over changed parameters in the place of `old`; the state goes on.
    ///
    /// The velocity loop's integral takes over what TFFWS gives up.
    pub(super) fn adopt(&mut self, old: &AxisParameters, p: &AxisParameters, state: &mut LoopsState) {
        // At the last tick of the period.
        let torque =
            |p: &AxisParameters| p.feedforward.torque(&self.psec, p.torque_shift.index(self.psec.present()));
        let limit = p.torque_constant * p.max_current;
        state.velocity.integral += (torque(old) - torque(p)).clamp(-limit, limit);
        self.psec.adopt(p.reach());
        if (&old.position, &old.feedforward) != (&p.position, &p.feedforward) {
            self.position.hand_over();
        }
        self.sample.controller = p.controller;
    }

    pub(super) fn set_load(&mut self, load: f64) {
        self.load = load;
    }

    /// The position instant: takes the setpoint of the period that begins, and those behind it as far as
    /// they are known, and says what is asked of the inner loops until the next one.
    pub(super) fn control_position(
        &mut self,
        p: &AxisParameters,
        state: &LoopsState,
        psec: f64,
        ahead: &[f64],
    ) -> Demand {
        self.psec.push(psec);
        self.psec.foresee(ahead);
        let present = self.psec.present();
        let (history, motor) = (&self.psec, &state.motor);
        let k = p.position_shift.index_at_instant(present);
        self.sample.psec = psec;
        self.sample.delayed_psec = history.at(k);
        if state.current_excess > 0.0 {
            self.position.correct(motor.speed);
        }
        let staircase = |shift: Shift, value: &dyn Fn(i64) -> f64| {
            let behind = shift.index(present);
            p.stair(shift, value(behind - 1), value(behind))
        };
        let velocity = staircase(p.velocity_shift, &|k| p.feedforward.velocity(history, k));
        let torque = staircase(p.torque_shift, &|k| p.feedforward.torque(history, k));
        let feedforward = velocity.at(0.0);
        let setpoint = |j| history.at(k + j) * p.inverse_ratio;
        let wanted = p.position.update(&mut self.position, setpoint, motor.angle, feedforward);
        // Coefficients that are forced can make it overflow: an axis that is asked for nothing stops.
        let asked = if wanted.is_finite() { wanted } else { 0.0 };
        let velocity_setpoint = asked.clamp(-p.max_speed, p.max_speed);
        self.position.record(velocity_setpoint + feedforward);
        self.load_before = self.demand.load;
        self.demand = Demand {
            velocity_setpoint,
            velocity_excess: if wanted.is_finite() { wanted - velocity_setpoint } else { f64::INFINITY },
            velocity,
            torque,
            load: p.loops.plant.load_torque(self.load),
        };
        self.demand
    }

    /// The torque with which friction is compensated at an instant of the velocity loop, N·m.
    pub(super) fn compensation(&self, of: &FrictionCompensation, p: &AxisParameters, instant: usize) -> f64 {
        // Before the first setpoint there is nothing to compensate.
        let Ok(period) = u64::try_from(self.psec.present()) else { return 0.0 };
        of.torque(&self.psec, period * p.ticks_per_position + instant as u64 * p.ticks_per_velocity)
    }

    /// Makes the sample of a tick of this position period.
    pub(super) fn observe(&mut self, p: &AxisParameters, tick: usize, motor: &MotorState, done: &Done) {
        let plant = &p.loops.plant;
        let torque_constant = plant.torque_constant();
        let instant = tick / p.ticks_per_velocity as usize;
        let compensation = p.compensation.as_ref().map_or(0.0, |of| self.compensation(of, p, instant));
        let load = if tick == 0 { self.load_before } else { self.demand.load };
        self.sample = AxisSample {
            position: plant.position(motor.angle),
            velocity: plant.velocity(motor.speed),
            current: motor.current,
            current_setpoint: done.current_setpoint,
            voltage: done.voltage,
            velocity_setpoint: self.demand.velocity_setpoint,
            velocity_feedforward: self.demand.velocity.at(instant as f64),
            torque_feedforward: self.demand.torque.at(instant as f64) + compensation,
            friction_current: done.friction / torque_constant,
            gravity_current: done.gravity / torque_constant,
            load_current: -load / torque_constant,
            effort: torque_constant * motor.current * p.inverse_ratio,
            controller: p.controller,
            saturated: done.saturated > 0.0,
            friction_extrapolated: plant.friction_is_extrapolated(motor.speed),
            ..self.sample
        };
    }

    /// The signals of the position instant of the period that was computed last, or of the tick that is
    /// being shown.
    pub fn sample(&self) -> &AxisSample {
        &self.sample
    }
}

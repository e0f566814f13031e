//! Samples of an axis from its state and the records of the inner loops.

use super::super::inner_loops::{DriveState, InnerLoopState, TickRecord};
use super::{Axis, AxisParameters, AxisSample};

impl Axis {
    /// Sets the sample to a tick of the present position cycle.
    pub(in crate::machine) fn update_sample(
        &mut self,
        p: &AxisParameters,
        tick: usize,
        state: &DriveState,
        record: &TickRecord,
    ) {
        let load = if tick == 0 { self.previous_load } else { self.inputs.load };
        let load = self.with_coupling(load, tick);
        self.sample = self.sample_with(p, tick, state, record, load);
    }

    /// Returns `load` and the torque of the coupling over the tick before `tick`, N·m at the motor.
    fn with_coupling(&self, load: f64, tick: usize) -> f64 {
        self.coupling_torques.before(tick).map_or(load, |torque| load + torque)
    }

    /// Returns the signals with the controller outputs of a tick; `load` is that over the tick before the state, N·m at
    /// the motor.
    fn sample_with(
        &self,
        p: &AxisParameters,
        tick: usize,
        (motor, load_state): &DriveState,
        record: &TickRecord,
        load: f64,
    ) -> AxisSample {
        let plant = &p.loops.plant;
        let [position, velocity, current] = plant.motion(motor, load_state);
        let torque_constant = plant.torque_constant();
        let velocity_cycle = tick / p.ticks_per_velocity as usize;
        let compensation = p
            .compensation
            .as_ref()
            .map_or(0.0, |compensation| self.compensation_torque(compensation, p, velocity_cycle));
        AxisSample {
            position,
            wind_up: plant.position(load_state.wind_up),
            velocity,
            current,
            current_setpoint: record.current_setpoint,
            voltage: record.voltage,
            velocity_setpoint: self.inputs.velocity_setpoint,
            velocity_feedforward: self.inputs.velocity.at(velocity_cycle as f64),
            torque_feedforward: self.inputs.torque.at(velocity_cycle as f64) + compensation,
            friction_current: record.friction / torque_constant,
            gravity_current: record.gravity / torque_constant,
            load_current: -load / torque_constant,
            effort: torque_constant * motor.current * p.inverse_ratio,
            controller: p.controller,
            saturated: record.saturated > 0.0 && !self.mode.is_off(),
            friction_extrapolated: plant.is_friction_extrapolated(motor.speed),
            ..self.sample
        }
    }

    /// Returns the signals after a tick of the present position cycle, with the controller outputs of this tick.
    pub(in crate::machine) fn sample_after(
        &self,
        p: &AxisParameters,
        tick: usize,
        state: &InnerLoopState,
        record: &TickRecord,
    ) -> AxisSample {
        let record = TickRecord { friction: state.friction, gravity: state.gravity, ..*record };
        let load = self.with_coupling(self.inputs.load, tick + 1);
        self.sample_with(p, tick, &(state.motor, state.load), &record, load)
    }
}

//! One axis of a machine: parameters, position controller, feedforward and samples.
//!
//! [`inner_loops`](super::inner_loops) runs the inner loops and the plant.

mod samples;

use std::sync::Arc;

use crate::config::{AxisConfig, Periods, PositionFeedback};
use crate::control::{
    BacklashCompensation, BacklashOffset, CONTOUR_LOOKBACK, CurrentFilters, Delays, Feedforward, Pi, PiState,
    PositionController, PositionState, SetpointHistory, SetpointWindow, TickDelay,
};
use crate::drive::{
    ContactState, EventDrivenTransmission, LoadState, MaxwellSlip, MotorEnergy, MotorState, Plant,
};
use crate::state_codec::StateCodec;
use crate::units::seconds;

use super::compensation::FrictionCompensation;
use super::controller::{create_position_controller, feedforward_config};
use super::coupling::CouplingTorques;
use super::drive_mode::DriveMode;
use super::error::AxisError;
use super::inner_loops::{
    DriveFeedback, InnerLoopInputs, InnerLoopState, InnerLoops, TickRecord, ZeroOrderHold,
};
use super::sample::AxisSample;

/// Immutable parameters of one axis: plant, controllers and delays.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisParameters {
    pub(super) loops: InnerLoops,
    /// Transmission with backlash, friction at the load or a structure.
    pub(super) event_driven: Option<Arc<EventDrivenTransmission>>,
    /// Elements of the friction (generalized Maxwell-slip model).
    pub(super) elements: Option<Arc<MaxwellSlip>>,
    position: PositionController,
    controller: &'static str,
    feedforward: Feedforward,
    pub(super) compensation: Option<FrictionCompensation>,
    /// True if the axis is one of those of cross-coupled control.
    pub(super) has_contour_control: bool,
    /// True if the axis is one of those of a mechanical coupling.
    pub(super) is_coupled: bool,
    delays: Delays,
    backlash_compensation: BacklashCompensation,
    /// Weight of the wind-up in the angle that the position controller reads: 1 with an encoder at the load, else 0.
    wind_up_feedback: f64,
    /// Number of future setpoints that the controllers read.
    preview: usize,
    position_delay: TickDelay,
    velocity_delay: FeedforwardDelay,
    torque_delay: FeedforwardDelay,
    /// Energy balance of the motor.
    pub(super) energy: MotorEnergy,
    transmission_ratio: f64,
    inverse_ratio: f64,
    /// Kt that the drive assumes, without the deviation of the plant, N·m/A.
    torque_constant: f64,
    max_current: f64,
    resistance: f64,
    max_speed: f64,
    ticks_per_position: u64,
    ticks_per_velocity: u64,
}

/// Delay of a feedforward.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FeedforwardDelay {
    delay: TickDelay,
    /// Velocity cycle of a position cycle from which on the feedforward of the next setpoint is in effect.
    switch: f64,
}

impl FeedforwardDelay {
    /// Creates a delay of `ticks`.
    fn new(ticks: u64, periods: &Periods) -> Self {
        let delay = TickDelay::new(ticks, periods.ticks_per_position());
        FeedforwardDelay { delay, switch: delay.switch_tick().div_ceil(periods.ticks_per_velocity()) as f64 }
    }

    /// Returns the feedforward over position cycle `k`; `values` returns those of a setpoint and of the one before.
    #[inline]
    fn hold(&self, k: i64, values: impl Fn(i64) -> [f64; 2]) -> ZeroOrderHold {
        let [before, after] = values(self.delay.index_after_switch(k));
        ZeroOrderHold { before, after, step: self.switch }
    }
}

impl AxisParameters {
    /// Returns the longest delay of a setpoint, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.delays.longest()
    }

    /// Returns the preview: number of future setpoints that the controllers read.
    pub fn preview_length(&self) -> usize {
        self.preview
    }

    fn setpoint_window(&self) -> SetpointWindow {
        SetpointWindow {
            delay: self.delays.longest(),
            lookback: (self.position.lookback() as usize).max(if self.has_contour_control {
                CONTOUR_LOOKBACK + 2
            } else {
                0
            }),
            preview: self.preview,
        }
    }

    /// Discretizes an axis and designs its position controller.
    ///
    /// # Errors
    /// [`AxisError`] if the motor cannot be discretized or the position controller cannot be designed.
    pub fn new(axis: &AxisConfig, periods: &Periods) -> Result<Self, AxisError> {
        let motor = &axis.motor;
        let (tick, ticks) = (seconds(periods.current), periods.ticks_per_position());
        let position = create_position_controller(axis, periods)?;
        let delays = Delays::new(&axis.delays, periods.current);
        let compensation = FrictionCompensation::new(axis, periods, delays.friction);
        // Without friction compensation its delay does not count.
        let delays = Delays { friction: if compensation.is_some() { delays.friction } else { 0 }, ..delays };
        let velocity_scale = 1.0 / motor.torque_constant;
        let plant = Plant::new(axis, tick)?;
        let position_delay = TickDelay::new(delays.position, ticks);
        let delay = -position_delay.index_at_cycle_start(0);
        let of_compensation = compensation.as_ref().map_or(0, FrictionCompensation::preview);
        Ok(AxisParameters {
            loops: InnerLoops {
                plant,
                velocity: Pi::new(
                    &axis.velocity_loop,
                    seconds(periods.velocity),
                    velocity_scale,
                    motor.max_current,
                ),
                filters: CurrentFilters::new(&axis.current_filters, seconds(periods.velocity)),
                current: Pi::new(&axis.current_loop, tick, 1.0, motor.max_voltage),
            },
            event_driven: EventDrivenTransmission::new(axis, tick)?.map(Arc::new),
            elements: MaxwellSlip::of_axis(axis, plant.angle_per_torque(), tick).map(Arc::new),
            backlash_compensation: BacklashCompensation::new(axis, seconds(periods.position)),
            controller: axis.position_loop.controller.name(),
            feedforward: Feedforward::new(
                &feedforward_config(axis),
                seconds(periods.position),
                axis.transmission_ratio,
            ),
            compensation,
            has_contour_control: false,
            is_coupled: false,
            preview: (position.preview() - delay).max(of_compensation).max(0) as usize,
            position_delay,
            velocity_delay: FeedforwardDelay::new(delays.velocity, periods),
            torque_delay: FeedforwardDelay::new(delays.torque, periods),
            position,
            delays,
            wind_up_feedback: f64::from(u8::from(axis.position_loop.feedback == PositionFeedback::Load)),
            energy: MotorEnergy::new(&Plant::deviating_motor(axis), tick),
            transmission_ratio: axis.transmission_ratio,
            inverse_ratio: 1.0 / axis.transmission_ratio,
            torque_constant: motor.torque_constant,
            max_current: motor.max_current,
            resistance: motor.resistance,
            max_speed: motor.max_speed,
            ticks_per_position: ticks,
            ticks_per_velocity: periods.ticks_per_velocity(),
        })
    }
}

/// State of one axis outside the inner loops, and its last sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// External load at the axis, N or N·m.
    load: f64,
    /// Offset that is added to the output of the position controller, rad/s of the motor.
    velocity_offset: f64,
    /// Mode from the next position cycle on.
    next_mode: DriveMode,
    /// Mode in the present position cycle.
    mode: DriveMode,
    /// Part of cross-coupled control in the output of the position controller, rad/s of the motor; 0 between two
    /// position cycles.
    contour_offset: f64,
    /// Offset of the backlash compensation.
    backlash_offset: BacklashOffset,
    psec: SetpointHistory,
    position: PositionState,
    /// Inputs to the inner loops in the present position cycle.
    inputs: InnerLoopInputs,
    /// Load torque over the last tick of the previous position cycle, N·m at the motor.
    previous_load: f64,
    pub(super) coupling_torques: CouplingTorques,
    sample: AxisSample,
}

impl Axis {
    /// Creates an axis at rest with the encoder of the position controller at `position` (m or rad), and with the motor
    /// current that holds it against gravity and `coupling_torque`, N·m at the motor towards plus. With an encoder at the motor, gravity displaces an elastic load.
    pub(super) fn at_rest(p: &AxisParameters, position: f64, coupling_torque: f64) -> (Self, InnerLoopState) {
        let angle = position / p.transmission_ratio;
        let plant = &p.loops.plant;
        let gravity = plant.gravity_torque(angle);
        let holding = gravity - coupling_torque;
        let (wind_up, contact) = match &p.event_driven {
            Some(transmission) => transmission.at_rest(holding),
            None => (plant.transmission.wind_up_at_rest(holding), ContactState::default()),
        };
        let current = holding / plant.torque_constant();
        // The drive assumes its own Kt.
        let torque = holding * (p.torque_constant / plant.torque_constant());
        let voltage = p.resistance * current;
        let state = InnerLoopState {
            motor: MotorState {
                current,
                speed: 0.0,
                angle: angle + p.wind_up_feedback * (wind_up + contact.structure),
            },
            load: LoadState { wind_up, speed: 0.0 },
            contact,
            velocity: PiState { integral: torque, excess: 0.0 },
            filters: p.loops.filters.at_rest(current),
            current: PiState { integral: voltage, excess: 0.0 },
            current_setpoint: current,
            gravity,
            ..InnerLoopState::default()
        };
        let mut axis = Axis {
            load: 0.0,
            velocity_offset: 0.0,
            next_mode: DriveMode::Position,
            mode: DriveMode::Position,
            contour_offset: 0.0,
            backlash_offset: BacklashOffset::default(),
            psec: SetpointHistory::new(position, p.ticks_per_position, p.setpoint_window()),
            position: PositionState::at_rest(angle),
            inputs: InnerLoopInputs::default(),
            previous_load: 0.0,
            coupling_torques: CouplingTorques::new(p.is_coupled, p.ticks_per_position, coupling_torque),
            sample: AxisSample { psec: position, delayed_psec: position, ..AxisSample::default() },
        };
        let record = TickRecord { current_setpoint: current, voltage, gravity, ..TickRecord::default() };
        axis.update_sample(p, 0, &(state.motor, state.load), &record);
        (axis, state)
    }

    /// Replaces the parameters `old` by `p` and keeps the state (bumpless transfer).
    ///
    /// The integral of the velocity loop changes by the difference of TFFWS, so that the torque does not jump. A new
    /// position controller or feedforward starts a transfer of Ω*. New filters start at rest at i*.
    pub(super) fn update_parameters(
        &mut self,
        old: &AxisParameters,
        p: &AxisParameters,
        state: &mut InnerLoopState,
    ) {
        // TFFWS at the last tick of the position cycle.
        let torque = |p: &AxisParameters| {
            p.torque_delay.hold(self.psec.present_index(), |k| p.feedforward.torques(&self.psec, k)).after
        };
        let limit = p.torque_constant * p.max_current;
        if self.mode == DriveMode::Position {
            state.velocity.integral += (torque(old) - torque(p)).clamp(-limit, limit);
        }
        // New filters start at rest at the present current setpoint.
        if old.loops.filters != p.loops.filters {
            state.filters = p.loops.filters.at_rest(state.current_setpoint);
        }
        self.psec.set_window(p.setpoint_window());
        if old.is_coupled != p.is_coupled {
            self.coupling_torques = CouplingTorques::new(p.is_coupled, p.ticks_per_position, 0.0);
        }
        if (&old.position, &old.feedforward) != (&p.position, &p.feedforward) {
            self.position.begin_transfer();
        }
        self.sample.controller = p.controller;
    }

    /// Writes or replaces the state.
    pub(super) fn code(&mut self, codec: &mut StateCodec<'_>) {
        codec.numbers([&mut self.load, &mut self.velocity_offset, &mut self.previous_load]);
        for mode in [&mut self.next_mode, &mut self.mode] {
            *mode = DriveMode::ALL[codec.integer(*mode as u64, DriveMode::ALL.len() as u64 - 1) as usize];
        }
        self.backlash_offset.code(codec);
        codec.numbers(self.coupling_torques.values_mut());
        self.psec.code(codec);
        self.position.code(codec);
        self.inputs = self.inputs.map(&mut |value| codec.number(*value));
        self.sample.code(codec);
    }

    /// Returns the torque of the external load, N·m at the motor.
    pub(super) fn external_torque(&self) -> f64 {
        self.inputs.load
    }

    pub(super) fn set_load(&mut self, load: f64) {
        self.load = load;
    }

    pub(super) fn set_velocity_offset(&mut self, offset: f64) {
        self.velocity_offset = offset;
    }

    /// Sets the velocity offset in units of the axis, m/s or rad/s.
    pub(super) fn set_velocity(&mut self, p: &AxisParameters, velocity: f64) {
        self.velocity_offset = velocity * p.inverse_ratio;
    }

    pub(super) fn set_mode(&mut self, mode: DriveMode) {
        self.next_mode = mode;
    }

    /// Returns the mode of the drive in the present position cycle.
    pub fn mode(&self) -> DriveMode {
        self.mode
    }

    /// Returns true if the mode changes at the start of the next position cycle.
    pub(super) fn has_new_mode(&self) -> bool {
        self.next_mode != self.mode
    }

    /// Changes the mode at the start of a position cycle; the position controller takes over without a jump of Ω*.
    pub(super) fn change_mode(&mut self, p: &AxisParameters, state: &mut InnerLoopState) {
        self.mode.leave(&p.loops, state);
        self.mode = self.next_mode;
        if self.mode == DriveMode::Position {
            self.position.begin_transfer();
        }
    }

    /// Lets the load act from now on, within a position cycle; returns its torque, N·m at the motor.
    pub(super) fn apply_load(&mut self, p: &AxisParameters) -> f64 {
        self.inputs.load = p.loops.plant.load_torque(self.load);
        self.inputs.load
    }

    /// Sets the setpoint of the position cycle that begins, and the known setpoints after it.
    pub(super) fn set_setpoint(&mut self, psec: f64, preview: &[f64]) {
        self.psec.push(psec);
        self.psec.set_preview(preview);
    }

    /// Returns the setpoint `offset` position cycles after that delayed by α, m or rad.
    pub(super) fn delayed_setpoint(&self, p: &AxisParameters, offset: i64) -> f64 {
        self.psec.at(p.position_delay.index_at_cycle_start(self.psec.present_index()) + offset)
    }

    /// Returns the position that the position controller reads, m or rad.
    pub(super) fn measured_position(&self, p: &AxisParameters, feedback: &DriveFeedback) -> f64 {
        p.loops.plant.position(self.measured_angle(p, feedback))
    }

    /// Returns the angle that the position controller reads, rad of the motor.
    fn measured_angle(&self, p: &AxisParameters, feedback: &DriveFeedback) -> f64 {
        // A scale at the load does not see the motion of the structure.
        let wind_up = p.wind_up_feedback * feedback.wind_up;
        feedback.angle - wind_up - self.backlash_offset.angle()
    }

    /// Sets the velocity that cross-coupled control adds in the present position cycle, m/s.
    pub(super) fn set_contour_offset(&mut self, p: &AxisParameters, velocity: f64) {
        self.contour_offset = velocity * p.inverse_ratio;
    }

    /// Executes the position loop at the start of a position cycle: returns the inputs to the inner loops.
    ///
    /// ```text
    /// Ω* = clamp(position controller(PSEC delayed by α / r, θ) + offset, ±Ωmax)    (Prévost fig. 3, eq. 9)
    /// VFFWS from PSEC delayed by β, TFFWS from PSEC delayed by γ, zero-order hold  (Prévost eqs. 6 to 8)
    /// ```
    pub(super) fn execute_position_loop(
        &mut self,
        p: &AxisParameters,
        feedback: &DriveFeedback,
    ) -> InnerLoopInputs {
        let present = self.psec.present_index();
        let history = &self.psec;
        let k = p.position_delay.index_at_cycle_start(present);
        self.sample.psec = history.at(present);
        self.sample.delayed_psec = history.at(k);
        if feedback.max_current_excess > 0.0 || self.mode.is_off() {
            self.position.record_saturated(feedback.speed);
        }
        let (velocity, torque) = match self.mode {
            DriveMode::Position => (
                p.velocity_delay.hold(present, |k| p.feedforward.velocities(history, k)),
                p.torque_delay.hold(present, |k| p.feedforward.torques(history, k)),
            ),
            _ => Default::default(),
        };
        let velocity_feedforward = velocity.at(0.0);
        let setpoint = |j| history.at(k + j) * p.inverse_ratio;
        self.backlash_offset.update(&p.backlash_compensation, setpoint(0) - setpoint(-1));
        let angle = self.measured_angle(p, feedback);
        let mut unlimited = p.position.update(&mut self.position, setpoint, angle, velocity_feedforward);
        let offset = self.velocity_offset + std::mem::take(&mut self.contour_offset);
        match self.mode {
            // Adding 0 would change the sign of -0.
            DriveMode::Position if offset == 0.0 => (),
            DriveMode::Position => unlimited += offset,
            DriveMode::Velocity => unlimited = self.velocity_offset,
            DriveMode::ShortCircuit | DriveMode::Coast => unlimited = 0.0,
        }
        // An unstable RST controller (allow_unstable) can overflow: the axis stops then.
        let finite = if unlimited.is_finite() { unlimited } else { 0.0 };
        let velocity_setpoint = finite.clamp(-p.max_speed, p.max_speed);
        self.position.record(velocity_setpoint + velocity_feedforward);
        self.previous_load = self.inputs.load;
        self.coupling_torques.begin_cycle();
        self.inputs = InnerLoopInputs {
            velocity_setpoint,
            velocity_excess: if unlimited.is_finite() {
                unlimited - velocity_setpoint
            } else {
                f64::INFINITY
            },
            velocity,
            torque,
            load: p.loops.plant.load_torque(self.load),
        };
        self.inputs
    }

    /// Returns the torque of the friction compensation in a velocity cycle, N·m at the motor.
    pub(super) fn compensation_torque(
        &self,
        compensation: &FrictionCompensation,
        p: &AxisParameters,
        velocity_cycle: usize,
    ) -> f64 {
        if self.mode != DriveMode::Position {
            return 0.0;
        }
        // No compensation before the first setpoint.
        let Ok(period) = u64::try_from(self.psec.present_index()) else { return 0.0 };
        let tick = period * p.ticks_per_position + velocity_cycle as u64 * p.ticks_per_velocity;
        compensation.torque(&self.psec, tick)
    }

    /// Returns the signals at the start of the last position cycle, or at the tick that
    /// [`Machine::advance_with`](super::Machine::advance_with) reports.
    pub fn sample(&self) -> &AxisSample {
        &self.sample
    }
}

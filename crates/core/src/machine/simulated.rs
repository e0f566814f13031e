//! Simulated machine: axes with common periods, stepped by position cycles.

use std::sync::Arc;

use super::axis::{Axis, AxisParameters};
use super::bank::{AxisBank, SimdWidth};
use super::coupling::CouplingStep;
use super::drive_mode::DriveMode;
use super::error::MachineError;
use super::inner_loops::TickSpan;
use super::parameters::MachineParameters;
use super::sample::AxisSample;
use crate::config::Periods;
use crate::units::Nanoseconds;

/// Statistics of one axis over the ticks of one position cycle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Activity {
    /// Largest |i|, A.
    pub peak_current: f64,
    /// Ticks with speed, current or voltage setpoint at its limit.
    pub saturated_ticks: u64,
    /// True if the friction law was extrapolated beyond its fitted range.
    pub friction_extrapolated: bool,
}

/// Simulated machine: axes with common periods.
///
/// ```
/// use virtual_axes_core::{config::Parameters, machine::{Machine, MachineParameters}};
///
/// let config = Parameters::embedded_default()?.machine_config()?;
/// let mut machine = Machine::new(MachineParameters::new(&config)?.into());
/// // A step of 1 mm in X, simulated for 1 s: the axis arrives up to the position error held by friction.
/// for _ in 0..167 {
///     machine.advance(&[0.001, 0.0, 0.0, 0.0, 0.0], &[]);
/// }
/// let x = machine.axis(0).sample();
/// assert!((x.position - 0.001).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    pub(super) parameters: Arc<MachineParameters>,
    pub(super) axes: Vec<Axis>,
    pub(super) bank: AxisBank,
    pub(super) tick: u64,
    /// True if the records of all ticks are kept.
    pub(super) records_every_tick: bool,
    /// Forces of the couplings within a tick; empty between two ticks.
    pub(super) coupling_steps: Vec<CouplingStep>,
}

impl Machine {
    /// Creates a machine at rest at home (0 on every axis).
    pub fn new(parameters: Arc<MachineParameters>) -> Self {
        let at_home = |(index, p): (usize, &AxisParameters)| {
            Axis::at_rest(p, 0.0, parameters.coupling_torque_at_rest(index, |_| 0.0))
        };
        let (axes, states): (Vec<_>, Vec<_>) = parameters.axes.iter().enumerate().map(at_home).unzip();
        let mut bank = parameters.bank();
        for (axis, state) in states.iter().enumerate() {
            bank.set_state(axis, state);
        }
        Machine { axes, bank, parameters, tick: 0, records_every_tick: false, coupling_steps: Vec::new() }
    }

    /// Resets the machine to rest at `positions` (m or rad, one per axis) and tick 0.
    pub fn reset(&mut self, positions: &[f64]) {
        for (index, &position) in positions.iter().enumerate() {
            self.reset_one(index, position, |axis| positions.get(axis).copied());
        }
        self.tick = 0;
    }

    /// Resets one axis to rest at `position`, m or rad; the tick and the other axes go on.
    pub fn reset_axis(&mut self, index: usize, position: f64) {
        self.reset_one(index, position, |axis| (axis == index).then_some(position));
    }

    /// Resets one axis; `next` returns the next positions of the axes that are reset, m or rad.
    fn reset_one(&mut self, index: usize, position: f64, next: impl Fn(usize) -> Option<f64>) {
        let at = |axis| next(axis).unwrap_or_else(|| self.motion_at_end(axis)[0]);
        let coupling_torque = self.parameters.coupling_torque_at_rest(index, at);
        let (Some(axis), Some(p)) = (self.axes.get_mut(index), self.parameters.axes.get(index)) else {
            return;
        };
        if axis.mode() != DriveMode::Position {
            self.bank.set_loops(index, &p.loops);
        }
        let (at_rest, state) = Axis::at_rest(p, position, coupling_torque);
        *axis = at_rest;
        self.bank.set_state(index, &state);
        self.bank.reset_elements(index);
    }

    /// Sets the SIMD width of the following position cycles; the results are bit-identical.
    pub fn set_simd_width(&mut self, width: SimdWidth) {
        self.bank.set_simd_width(width);
    }

    /// Applies other gains, weights, delays or plant parameters between two position cycles and keeps the states (bumpless
    /// transfer).
    ///
    /// Allocates only if the longest delay or the preview changes the length of the setpoint history.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if the number of axes or the periods differ; nothing is changed then.
    pub fn update_parameters(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        let is_same =
            parameters.axes.len() == self.axes.len() && parameters.periods == self.parameters.periods;
        if !is_same {
            return Err(MachineError::AnotherMachine);
        }
        let changed = self.parameters.axes.iter().zip(&parameters.axes);
        for (index, (axis, (old, p))) in self.axes.iter_mut().zip(changed).enumerate() {
            let mut state = self.bank.state(index);
            axis.update_parameters(old, p, &mut state);
            self.bank.set_state(index, &state);
            self.bank.set_loops(index, &axis.mode().loops(p.loops));
            self.bank.set_event_driven(index, p.event_driven.clone());
            self.bank.set_elements(index, p.elements.clone());
            if old.compensation.is_some() {
                self.bank.set_compensation(index, |_| 0.0);
            }
        }
        self.parameters = parameters;
        Ok(())
    }

    /// Returns the number of axes.
    pub fn axis_count(&self) -> usize {
        self.axes.len()
    }

    /// Returns an axis by its index in `joints`.
    ///
    /// # Panics
    /// Panics if the index is out of range.
    pub fn axis(&self, index: usize) -> &Axis {
        &self.axes[index]
    }

    /// Returns all axes, in the order of `joints`.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Returns the number of ticks since the start.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Returns the simulated time since the start, ns.
    pub fn time(&self) -> Nanoseconds {
        self.tick as Nanoseconds * self.parameters.periods.current
    }

    /// Returns the periods of the control loops.
    pub fn periods(&self) -> Periods {
        self.parameters.periods
    }

    /// Returns the longest delay of a setpoint on any axis, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.parameters.axes.iter().map(AxisParameters::longest_delay).max().unwrap_or(0)
    }

    /// Returns the preview: number of future setpoints that the controllers read, the largest of all axes.
    pub fn preview_length(&self) -> usize {
        self.parameters.axes.iter().map(AxisParameters::preview_length).max().unwrap_or(0)
    }

    /// Sets the external load of one axis (N or N·m, positive towards plus) from the next position cycle on.
    pub fn set_load(&mut self, axis: usize, load: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_load(load);
        }
    }

    /// Sets an offset that is added to the output of the position controller of one axis (rad/s of the motor, m/s of a
    /// linear motor) from the next position cycle on; 0 after a reset.
    ///
    /// The controllers see the sum, within the speed limit, as the velocity setpoint Ω* that they have put out.
    pub fn set_velocity_offset(&mut self, axis: usize, offset: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_velocity_offset(offset);
        }
    }

    /// Sets the velocity offset of one axis in its units, m/s or rad/s; see
    /// [`set_velocity_offset`](Self::set_velocity_offset).
    pub fn set_velocity(&mut self, axis: usize, velocity: f64) {
        if let (Some(axis), Some(p)) = (self.axes.get_mut(axis), self.parameters.axes.get(axis)) {
            axis.set_velocity(p, velocity);
        }
    }

    /// Sets the mode of the drive of one axis from the next position cycle on; a reset returns to position control.
    pub fn set_drive_mode(&mut self, axis: usize, mode: DriveMode) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_mode(mode);
        }
    }

    /// Advances by one position cycle with the setpoints `psec` (m or rad, one per axis).
    ///
    /// `preview` contains the setpoints of the next position cycles, an equal number per axis, axis by axis. Beyond
    /// them, up to the [`preview_length`](Self::preview_length), the controllers read the last one; with an empty
    /// preview they read the present setpoint.
    ///
    /// Afterwards the samples of the axes are those at the start of the position cycle;
    /// [`position`](Self::position) and [`activity`](Self::activity) return data of all ticks.
    pub fn advance(&mut self, psec: &[f64], preview: &[f64]) {
        if !self.is_at_cycle_start() {
            return self.advance_ticks(self.ticks_per_period(), psec, preview);
        }
        self.execute_position_loops(psec, preview);
        self.run(TickSpan::whole(self.bank.ticks(), self.records_every_tick));
        self.update_samples(0);
        self.tick += self.bank.ticks().position as u64;
    }

    /// Advances by one position cycle like [`advance`](Self::advance) and calls `observe` at each tick.
    ///
    /// During a call the samples of the axes are those of the tick: state before the plant moves, controller outputs
    /// of the tick. Afterwards they are those at the start of the position cycle.
    pub fn advance_with(&mut self, psec: &[f64], preview: &[f64], mut observe: impl FnMut(&Machine)) {
        self.execute_position_loops(psec, preview);
        self.run(TickSpan::whole(self.bank.ticks(), true));
        for tick in 0..self.bank.ticks().position as u64 {
            self.update_samples(tick as usize);
            observe(self);
            self.tick += 1;
        }
        self.update_samples(0);
    }

    /// Advances by `count` ticks, for forces that change within a position cycle.
    ///
    /// Setpoints and preview are those of [`advance`](Self::advance). They are read at the start of each position cycle
    /// among the ticks and not within one. Loads act from the first of the ticks. Any split of a position cycle has the
    /// results of the whole, bit by bit. Afterwards [`sample_at_end`](Self::sample_at_end) has the state after the last
    /// tick; [`position`](Self::position) and [`activity`](Self::activity) have the ticks of the position cycle so far.
    pub fn advance_ticks(&mut self, count: usize, psec: &[f64], preview: &[f64]) {
        let period = self.ticks_per_period();
        let mut left = count;
        while left > 0 {
            let first = (self.tick % period as u64) as usize;
            if first == 0 {
                self.execute_position_loops(psec, preview);
            } else {
                for (index, (axis, p)) in self.axes.iter_mut().zip(&self.parameters.axes).enumerate() {
                    self.bank.set_load_torque(index, axis.apply_load(p));
                }
            }
            let end = period.min(first + left);
            self.run(TickSpan { first, end, record_all: true });
            self.tick += (end - first) as u64;
            left -= end - first;
        }
        self.update_samples(0);
    }

    /// Returns the signals of an axis after the last tick: state of the motor, controller outputs of the last tick, and
    /// friction, gravity and load over it.
    ///
    /// After [`advance`](Self::advance), which records one tick only, the controller outputs are those of the first tick.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn sample_at_end(&self, axis: usize) -> AxisSample {
        if self.tick == 0 {
            return *self.axes[axis].sample();
        }
        let period = self.ticks_per_period() as u64;
        let tick = ((self.tick - 1) % period) as usize;
        self.axes[axis].sample_after(
            &self.parameters.axes[axis],
            tick,
            &self.bank.state(axis),
            &self.bank.record(axis, tick),
        )
    }

    /// Executes the position loops of all axes and sets the inputs to their inner loops.
    fn execute_position_loops(&mut self, psec: &[f64], preview: &[f64]) {
        let known = preview.len() / self.axes.len().max(1);
        let parameters = &*self.parameters;
        for (index, (axis, &setpoint)) in self.axes.iter_mut().zip(psec).enumerate() {
            axis.set_setpoint(setpoint, &preview[index * known..][..known]);
            if axis.has_new_mode() {
                let (p, mut state) = (&parameters.axes[index], self.bank.state(index));
                axis.change_mode(p, &mut state);
                self.bank.set_loops(index, &axis.mode().loops(p.loops));
                self.bank.set_state(index, &state);
            }
        }
        for contour_control in &parameters.contour_controls {
            contour_control.execute(&mut self.axes, &parameters.axes, &self.bank);
        }
        for (index, (axis, p)) in self.axes.iter_mut().zip(&parameters.axes).take(psec.len()).enumerate() {
            let feedback = self.bank.feedback(index);
            let inputs = axis.execute_position_loop(p, &feedback);
            self.bank.set_inputs(index, &inputs);
            if let Some(compensation) = &p.compensation {
                let torque = |velocity_cycle| axis.compensation_torque(compensation, p, velocity_cycle);
                self.bank.set_compensation(index, torque);
            }
        }
    }

    /// Returns true between two position cycles, false within one.
    pub fn is_at_cycle_start(&self) -> bool {
        self.tick.is_multiple_of(self.bank.ticks().position as u64)
    }

    /// Returns the number of ticks per position cycle.
    pub fn ticks_per_period(&self) -> usize {
        self.bank.ticks().position
    }

    /// Sets the samples of all axes to a tick of the last position cycle.
    fn update_samples(&mut self, tick: usize) {
        for (index, (axis, p)) in self.axes.iter_mut().zip(&self.parameters.axes).enumerate() {
            axis.update_sample(p, tick, &self.bank.drive(index, tick), &self.bank.record(index, tick));
        }
    }

    /// Returns the position of an axis at a tick of the last position cycle, m or rad.
    ///
    /// # Panics
    /// Panics if the axis or the tick is out of range.
    #[inline]
    pub fn position(&self, axis: usize, tick: usize) -> f64 {
        self.motion_at(axis, tick)[0]
    }

    /// Returns position, velocity (m, m/s or rad, rad/s) and current (A) of an axis at a tick of the last position
    /// cycle.
    ///
    /// # Panics
    /// Panics if the axis or the tick is out of range.
    #[inline]
    pub fn motion_at(&self, axis: usize, tick: usize) -> [f64; 3] {
        let (motor, load) = self.bank.drive(axis, tick);
        self.parameters.axes[axis].loops.plant.motion(&motor, &load)
    }

    /// Returns position, velocity (m, m/s or rad, rad/s) and current (A) of an axis at the end of the last position cycle,
    /// the instant of the next setpoint.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn motion_at_end(&self, axis: usize) -> [f64; 3] {
        let state = self.bank.state(axis);
        self.parameters.axes[axis].loops.plant.motion(&state.motor, &state.load)
    }

    /// Writes the positions of an axis at the ticks of the last position cycle to `positions`, m or rad, up to its
    /// length.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    #[inline]
    pub fn positions(&self, axis: usize, positions: &mut [f64]) {
        let ratio = self.parameters.axes[axis].loops.plant.position(1.0);
        self.bank.positions(axis, ratio, positions);
    }

    /// Returns the current of an axis, with its sign, at the tick of the last position cycle with the largest |i|, A.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn signed_peak_current(&self, axis: usize) -> f64 {
        let currents = (0..self.ticks_per_period()).map(|tick| self.bank.current(axis, tick));
        currents
            .fold(0.0, |largest: f64, current| if current.abs() > largest.abs() { current } else { largest })
    }

    /// Returns the statistics of an axis over the last position cycle.
    ///
    /// # Panics
    /// Panics if the axis is out of range.
    pub fn activity(&self, axis: usize) -> Activity {
        let statistics = self.bank.statistics(axis);
        let plant = &self.parameters.axes[axis].loops.plant;
        Activity {
            peak_current: statistics.peak_current,
            saturated_ticks: statistics.saturated_ticks as u64,
            friction_extrapolated: plant.is_friction_extrapolated(statistics.peak_speed),
        }
    }
}

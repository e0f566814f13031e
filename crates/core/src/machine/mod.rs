//! Plants and controllers joined into axes, and axes into a machine.
//!
//! The same [`Machine`] runs in the node, in the offline command and in the benchmarks. Time is an
//! integer count of ticks of the current loop; nothing here knows the wall clock.

mod axis;
mod bank;
mod block;
mod compensation;
mod controller;
mod prediction;
mod sample;

pub use axis::{Axis, AxisParameters};
pub use bank::Width;
pub use controller::REST_AFTER;
pub use controller::designed;
pub use prediction::{deviating_model, prediction_model};
pub use sample::AxisSample;

use std::sync::Arc;

use crate::config::{AxisConfig, MachineConfig, Periods};
use crate::design::DesignError;
use crate::drive::DriveError;
use crate::units::Nanoseconds;

use bank::Bank;
use block::{Loops, Timing};

/// Why a machine cannot be built or changed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// An axis cannot be built.
    #[error("axis {axis}: {source}")]
    Axis {
        /// Name of the axis.
        axis: String,
        /// What is wrong with it.
        source: AxisError,
    },
    /// Parameters of another machine cannot be taken over while running.
    #[error("the new parameters have other joints or periods than the machine that runs")]
    AnotherMachine,
}

/// Why an axis cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AxisError {
    /// Its motor cannot be stepped over the current period.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// It has no such position controller.
    #[error("position_loop: {0}")]
    Design(#[from] DesignError),
}

/// Everything immutable about a machine, discretized and ready to run.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineParameters {
    periods: Periods,
    axes: Vec<AxisParameters>,
}

impl MachineParameters {
    /// Discretizes every axis of `config`.
    ///
    /// # Errors
    /// [`MachineError::Axis`] naming the axis that cannot be built.
    pub fn new(config: &MachineConfig) -> Result<Self, MachineError> {
        Self::of_axes(config, &Vec::from_iter(0..config.axes.len()))
    }

    /// Discretizes the axes of `config` at `places` only; places that there are not are left out.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_axes(config: &MachineConfig, places: &[usize]) -> Result<Self, MachineError> {
        let axis = |axis: &AxisConfig| {
            AxisParameters::new(axis, &config.periods)
                .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })
        };
        let axes = places.iter().filter_map(|&place| config.axes.get(place));
        Ok(MachineParameters { periods: config.periods, axes: axes.map(axis).collect::<Result<_, _>>()? })
    }

    /// Sampling periods.
    pub fn periods(&self) -> Periods {
        self.periods
    }

    /// Several machines as one: their axes one behind the other. None if there is none, or their periods
    /// differ.
    pub fn together(machines: &[Arc<MachineParameters>]) -> Option<Self> {
        let periods = machines.first()?.periods;
        let same = machines.iter().all(|machine| machine.periods == periods);
        let axes = machines.iter().flat_map(|machine| machine.axes.iter().cloned());
        same.then(|| MachineParameters { periods, axes: axes.collect() })
    }

    fn timing(&self) -> Timing {
        Timing {
            ticks_per_position: self.periods.ticks_per_position() as usize,
            ticks_per_velocity: self.periods.ticks_per_velocity() as usize,
        }
    }

    fn bank(&self) -> Bank {
        let loops: Vec<Loops> = self.axes.iter().map(|axis| axis.loops).collect();
        Bank::new(&loops, self.timing())
    }
}

/// What an axis did in a position period, over all of its ticks.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Activity {
    /// Largest |i|, A.
    pub peak_current: f64,
    /// Ticks with speed, current or voltage setpoint at its limit.
    pub saturated_ticks: u64,
    /// Whether the friction law was used beyond the range that it was fitted for.
    pub friction_extrapolated: bool,
}

/// A machine: axes that move on one grid of ticks.
///
/// ```
/// use virtual_axes::{config::Parameters, machine::{Machine, MachineParameters}};
///
/// let config = Parameters::embedded_default()?.machine_config()?;
/// let mut machine = Machine::new(MachineParameters::new(&config)?.into());
/// // 1 mm in X, then a second of standstill: the axis arrives, but for what friction holds.
/// for _ in 0..167 {
///     machine.advance(&[0.001, 0.0, 0.0, 0.0, 0.0], &[]);
/// }
/// let x = machine.axis(0).sample();
/// assert!((x.position - 0.001).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    parameters: Arc<MachineParameters>,
    axes: Vec<Axis>,
    bank: Bank,
    tick: u64,
}

impl Machine {
    /// A machine at rest at home (0 on every axis).
    pub fn new(parameters: Arc<MachineParameters>) -> Self {
        let (axes, states): (Vec<_>, Vec<_>) = parameters.axes.iter().map(|p| Axis::at_rest(p, 0.0)).unzip();
        let mut bank = parameters.bank();
        for (axis, state) in states.iter().enumerate() {
            bank.set_state(axis, state);
        }
        Machine { axes, bank, parameters, tick: 0 }
    }

    /// Back to rest at `positions` (m or rad, one per axis), at tick 0.
    pub fn reset(&mut self, positions: &[f64]) {
        for (place, ((axis, p), &position)) in
            self.axes.iter_mut().zip(&self.parameters.axes).zip(positions).enumerate()
        {
            let (at_rest, state) = Axis::at_rest(p, position);
            *axis = at_rest;
            self.bank.set_state(place, &state);
        }
        self.tick = 0;
    }

    /// How wide the processor's vectors are used from now on; the results are the same.
    pub fn set_width(&mut self, width: Width) {
        self.bank.set_width(width);
    }

    /// Takes over changed gains, weights, delays or physics; states go on as they are.
    ///
    /// To be called between two position periods. Another reach of delays and preview makes a new history
    /// of setpoints, which is the only case that allocates.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if number of axes or periods differ; nothing is changed then.
    pub fn adopt(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        let same = parameters.axes.len() == self.axes.len() && parameters.periods == self.parameters.periods;
        if !same {
            return Err(MachineError::AnotherMachine);
        }
        let changed = self.parameters.axes.iter().zip(&parameters.axes);
        for (place, (axis, (old, p))) in self.axes.iter_mut().zip(changed).enumerate() {
            let mut state = self.bank.state(place);
            axis.adopt(old, p, &mut state);
            self.bank.set_state(place, &state);
            self.bank.set_loops(place, &p.loops);
            if old.compensation.is_some() {
                self.bank.set_compensation(place, |_| 0.0);
            }
        }
        self.parameters = parameters;
        Ok(())
    }

    /// Number of axes.
    pub fn axis_count(&self) -> usize {
        self.axes.len()
    }

    /// One axis, by its place in `joints`.
    ///
    /// # Panics
    /// If there is no such place.
    pub fn axis(&self, index: usize) -> &Axis {
        &self.axes[index]
    }

    /// All axes, in the order of `joints`.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Ticks since the start.
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Time since the start, ns.
    pub fn time(&self) -> Nanoseconds {
        self.tick as Nanoseconds * self.parameters.periods.current
    }

    /// Sampling periods.
    pub fn periods(&self) -> Periods {
        self.parameters.periods
    }

    /// The longest delay of a setpoint on any axis, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.parameters.axes.iter().map(AxisParameters::longest_delay).max().unwrap_or(0)
    }

    /// Setpoints ahead of the present one that the position controllers read, the most of any axis.
    pub fn horizon(&self) -> usize {
        self.parameters.axes.iter().map(AxisParameters::horizon).max().unwrap_or(0)
    }

    /// External force or torque on one axis (N or N·m, positive towards plus) from the next tick on.
    pub fn set_load(&mut self, axis: usize, load: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_load(load);
        }
    }

    /// One position period with the setpoints `psec` (m or rad, one per axis).
    ///
    /// `ahead` holds the setpoints of the next periods, as many for each axis, one axis behind the other;
    /// beyond them, up to the [`horizon`](Self::horizon), the last one is taken. With none the future is
    /// not known: controllers that read ahead find the present one.
    ///
    /// The samples of the axes are those of the position instant then; [`position`](Self::position) and
    /// [`activity`](Self::activity) tell what happened at every tick.
    pub fn advance(&mut self, psec: &[f64], ahead: &[f64]) {
        self.begin_period(psec, ahead);
        self.bank.run(false);
        self.observe(0);
        self.tick += self.parameters.periods.ticks_per_position();
    }

    /// Likewise, showing the machine to `observe` at every tick: after the controllers have acted on the
    /// tick's state and before the plant moves. The first call is the position instant. The samples of the
    /// axes are those of the tick then, and those of the position instant in the end.
    pub fn advance_with(&mut self, psec: &[f64], ahead: &[f64], mut observe: impl FnMut(&Machine)) {
        self.begin_period(psec, ahead);
        self.bank.run(true);
        for tick in 0..self.parameters.periods.ticks_per_position() {
            self.observe(tick as usize);
            observe(self);
            self.tick += 1;
        }
        self.observe(0);
    }

    /// What the axes are asked for in the next position period.
    fn begin_period(&mut self, psec: &[f64], ahead: &[f64]) {
        let known = ahead.len() / self.axes.len().max(1);
        let parameters = &*self.parameters;
        for (place, ((axis, p), &setpoint)) in
            self.axes.iter_mut().zip(&parameters.axes).zip(psec).enumerate()
        {
            let state = self.bank.state(place);
            let demand = axis.control_position(p, &state, setpoint, &ahead[place * known..][..known]);
            self.bank.set_demand(place, &demand);
            if let Some(of) = &p.compensation {
                self.bank.set_compensation(place, |instant| axis.compensation(of, p, instant));
            }
        }
    }

    /// Ticks of a position period.
    pub fn ticks_per_period(&self) -> usize {
        self.parameters.timing().ticks_per_position
    }

    /// Makes the samples of a tick of the position period.
    fn observe(&mut self, tick: usize) {
        for (place, (axis, p)) in self.axes.iter_mut().zip(&self.parameters.axes).enumerate() {
            axis.observe(p, tick, &self.bank.motor(place, tick), &self.bank.done(place, tick));
        }
    }

    /// Position of an axis at a tick of the position period that was computed last, m or rad.
    ///
    /// # Panics
    /// If there is no such axis or tick.
    #[inline]
    pub fn position(&self, axis: usize, tick: usize) -> f64 {
        self.parameters.axes[axis].loops.plant.position(self.bank.motor(axis, tick).angle)
    }

    /// Puts the positions of an axis at the ticks of the position period that was computed last, m or rad,
    /// into `positions`, as far as it goes.
    ///
    /// # Panics
    /// If there is no such axis.
    #[inline]
    pub fn positions(&self, axis: usize, positions: &mut [f64]) {
        let plant = &self.parameters.axes[axis].loops.plant;
        self.bank.angles(axis, positions);
        positions.iter_mut().for_each(|value| *value = plant.position(*value));
    }

    /// Current of an axis at that tick of the position period that was computed last where it is largest in
    /// size, A.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn largest_current(&self, axis: usize) -> f64 {
        let currents = (0..self.ticks_per_period()).map(|tick| self.bank.motor(axis, tick).current);
        currents
            .fold(0.0, |largest: f64, current| if current.abs() > largest.abs() { current } else { largest })
    }

    /// What an axis did in the position period that was computed last.
    ///
    /// # Panics
    /// If there is no such axis.
    pub fn activity(&self, axis: usize) -> Activity {
        let tally = self.bank.tally(axis);
        let plant = &self.parameters.axes[axis].loops.plant;
        Activity {
            peak_current: tally.peak_current,
            saturated_ticks: tally.saturated_ticks as u64,
            friction_extrapolated: plant.friction_is_extrapolated(tally.peak_speed),
        }
    }
}

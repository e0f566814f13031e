//! Plants and controllers joined into axes, and axes into a machine.
//!
//! The same [`Machine`] runs in the node, in the offline command and in the benchmarks. Time is an
//! integer count of ticks of the current loop; nothing here knows the wall clock.

mod axis;
mod compensation;
mod controller;
mod prediction;
mod sample;

pub use axis::{Axis, AxisParameters};
pub use controller::designed;
pub use prediction::{deviating_model, prediction_model};
pub use sample::AxisSample;

use std::sync::Arc;

use crate::config::{MachineConfig, Periods};
use crate::design::DesignError;
use crate::drive::DriveError;
use crate::units::Nanoseconds;

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

/// Everything immutable about a machine, discretised and ready to run.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineParameters {
    periods: Periods,
    axes: Vec<AxisParameters>,
}

impl MachineParameters {
    /// Discretises every axis of `config`.
    ///
    /// # Errors
    /// [`MachineError::Axis`] naming the axis that cannot be built.
    pub fn new(config: &MachineConfig) -> Result<Self, MachineError> {
        let axes = config
            .axes
            .iter()
            .map(|axis| {
                AxisParameters::new(axis, &config.periods)
                    .map_err(|source| MachineError::Axis { axis: axis.name.clone(), source })
            })
            .collect::<Result<_, _>>()?;
        Ok(MachineParameters { periods: config.periods, axes })
    }

    /// Sampling periods.
    pub fn periods(&self) -> Periods {
        self.periods
    }
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
///     machine.advance(&[0.001, 0.0, 0.0, 0.0, 0.0]);
/// }
/// let x = machine.axis(0).sample();
/// assert!((x.position - 0.001).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    parameters: Arc<MachineParameters>,
    axes: Vec<Axis>,
    tick: u64,
}

impl Machine {
    /// A machine at rest at home (0 on every axis).
    pub fn new(parameters: Arc<MachineParameters>) -> Self {
        let axes = parameters.axes.iter().map(|p| Axis::at_rest(p, 0.0)).collect();
        Machine { parameters, axes, tick: 0 }
    }

    /// Back to rest at `positions` (m or rad, one per axis), at tick 0.
    pub fn reset(&mut self, positions: &[f64]) {
        for ((axis, p), &position) in self.axes.iter_mut().zip(&self.parameters.axes).zip(positions) {
            *axis = Axis::at_rest(p, position);
        }
        self.tick = 0;
    }

    /// Takes over changed gains, weights, delays or physics; states go on as they are.
    ///
    /// To be called between two position periods. Another reach of delays and preview makes a new history
    /// of set-points, which is the only case that allocates.
    ///
    /// # Errors
    /// [`MachineError::AnotherMachine`] if number of axes or periods differ; nothing is changed then.
    pub fn adopt(&mut self, parameters: Arc<MachineParameters>) -> Result<(), MachineError> {
        let same = parameters.axes.len() == self.axes.len() && parameters.periods == self.parameters.periods;
        if !same {
            return Err(MachineError::AnotherMachine);
        }
        for ((axis, old), p) in self.axes.iter_mut().zip(&self.parameters.axes).zip(&parameters.axes) {
            axis.adopt(old, p, self.tick);
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

    /// The longest delay of a set-point on any axis, ticks.
    pub fn longest_delay(&self) -> u64 {
        self.parameters.axes.iter().map(AxisParameters::longest_delay).max().unwrap_or(0)
    }

    /// Set-points ahead of the present one that the position controllers read, the most of any axis.
    pub fn horizon(&self) -> usize {
        self.parameters.axes.iter().map(AxisParameters::horizon).max().unwrap_or(0)
    }

    /// External force or torque on one axis (N or N·m, positive towards plus) from the next tick on.
    pub fn set_load(&mut self, axis: usize, load: f64) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.set_load(load);
        }
    }

    /// One position period with the set-points `psec` (m or rad, one per axis), of whose future nothing
    /// is known: controllers that read ahead find the present one.
    pub fn advance(&mut self, psec: &[f64]) {
        self.advance_with(psec, &[], |_| ());
    }

    /// One position period, showing the machine to `observe` at every tick: after the controllers have
    /// acted on the tick's state and before the plant moves. The first call is the position instant.
    ///
    /// `ahead` holds the set-points of the next periods, as many for each axis, one axis behind the
    /// other; beyond them, up to the [`horizon`](Self::horizon), the last one is taken.
    pub fn advance_with(&mut self, psec: &[f64], ahead: &[f64], mut observe: impl FnMut(&Machine)) {
        let parameters = Arc::clone(&self.parameters);
        let known = ahead.len() / self.axes.len().max(1);
        for (place, (axis, &setpoint)) in self.axes.iter_mut().zip(psec).enumerate() {
            axis.begin_period(setpoint, &ahead[place * known..][..known]);
        }
        for tick_in_period in 0..parameters.periods.ticks_per_position() {
            for (axis, p) in self.axes.iter_mut().zip(&parameters.axes) {
                axis.control(p, self.tick, tick_in_period);
            }
            observe(self);
            for (axis, p) in self.axes.iter_mut().zip(&parameters.axes) {
                axis.step(p);
            }
            self.tick += 1;
        }
    }
}

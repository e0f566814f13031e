//! Errors, compensation and limits of the learning axes.

use virtual_axes_core::config::{AxisConfig, MachineConfig};
use virtual_axes_core::design::LearningTuning;
use virtual_axes_core::statistics::rms_of_sum;
use virtual_axes_core::trial::{ContourFigures, Figures, TrialOutcome};
use virtual_axes_core::units::seconds;

use super::axis::LearningAxis;
use super::error::LearningError;
use super::setpoint_limits::{SetpointExcess, first_excess};
use crate::tune::has_contour;

/// Position cycles over which the compensation fades to 0 at standstill of the programmed setpoints.
const FADE: usize = 16;
/// Position cycles before and after a motion without a fade, beyond the delay of the setpoints.
const HOLD: usize = 8;

/// Options of iterative learning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningOptions {
    /// Number of iterations after the run of the programmed setpoints.
    pub iterations: usize,
    /// Gain and bandwidth of the filters.
    pub tuning: LearningTuning,
    /// Encoder step by which measured positions are rounded before learning, m or rad; 0 is the exact position.
    pub encoder_step: f64,
    /// Acceleration of the compensated setpoints beyond the limit of an axis, relative to it.
    pub acceleration_excess: f64,
    /// Relative deviation of inertia and torque constant for which the convergence condition is computed.
    pub deviation: f64,
}

/// Error of an axis in a run: delayed programmed setpoint − measured position at the position cycles, m or rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearningAxisError {
    /// Index in the machine.
    pub index: usize,
    /// Largest absolute value.
    pub max: f64,
    /// RMS.
    pub rms: f64,
    /// Largest absolute compensation of the setpoints in this run.
    pub compensation: f64,
}

/// Run with the compensation of an iteration.
#[derive(Debug, Clone, PartialEq)]
pub struct LearningIteration {
    /// Figures of the run; their following errors are those against the compensated setpoints.
    pub figures: Figures,
    /// Errors of the moving axes.
    pub axes: Vec<LearningAxisError>,
}

impl LearningIteration {
    /// Returns the error that the learning minimizes: the largest contour error, m. Without a contour, of one axis or of
    /// rotary axes alone, the largest error of an axis, m or rad.
    pub fn error(&self) -> f64 {
        let of_axes = || self.axes.iter().map(|axis| axis.max).fold(0.0, f64::max);
        self.contour().map_or_else(of_axes, |contour| contour.max)
    }

    /// Returns the contour error of several axes, one of which is linear.
    pub fn contour(&self) -> Option<ContourFigures> {
        self.figures.contour.filter(|_| has_contour(&self.figures))
    }
}

/// Programmed setpoints and the learning axes.
pub(super) struct Learner<'a> {
    machine: &'a MachineConfig,
    pub axes: Vec<LearningAxis>,
    /// A row of all axes per position cycle, m or rad.
    pub programmed: Vec<f64>,
    /// Position cycles by which the setpoints are delayed before the comparison.
    pub delay: usize,
    encoder_step: f64,
    acceleration_excess: f64,
}

impl<'a> Learner<'a> {
    pub fn new(
        machine: &'a MachineConfig,
        programmed: Vec<f64>,
        figures: &Figures,
        options: &LearningOptions,
    ) -> Result<Self, LearningError> {
        if machine.contour_gain() > 0.0 {
            return Err(LearningError::ContourControl);
        }
        if machine.has_coupled_axes() {
            return Err(LearningError::CoupledAxes);
        }
        let periods = machine.periods();
        let all = machine.axes().iter().enumerate().zip(&figures.axes);
        let moving: Vec<(usize, &AxisConfig)> =
            all.filter(|(_, figures)| figures.moves).map(|(axis, _)| axis).collect();
        let longest = moving.iter().map(|(_, axis)| axis.alpha()).max().ok_or(LearningError::NothingMoves)?;
        let delay = (longest.max(0) + periods.position - 1) / periods.position;
        let design = |axis| LearningAxis::design(axis, &periods, delay, options.deviation, &options.tuning);
        let axes = moving.into_iter().map(design).collect::<Result<_, _>>()?;
        let delay = usize::try_from(delay).unwrap_or(0);
        let LearningOptions { encoder_step, acceleration_excess, .. } = *options;
        Ok(Learner { machine, axes, programmed, delay, encoder_step, acceleration_excess })
    }

    /// Returns the number of position cycles.
    pub fn rows(&self) -> usize {
        self.programmed.len() / self.machine.axes().len().max(1)
    }

    /// Returns Tsp, s.
    fn period(&self) -> f64 {
        seconds(self.machine.periods().position)
    }

    /// Returns the column of an axis.
    fn column(&self, rows: &[f64], axis: &LearningAxis) -> Vec<f64> {
        rows.iter().skip(axis.index).step_by(self.machine.axes().len().max(1)).copied().collect()
    }

    /// Returns the errors of the moving axes, one value per position cycle.
    pub fn errors(&self, positions: &[f64]) -> Vec<Vec<f64>> {
        let of_axis = |axis: &LearningAxis| {
            let programmed = self.column(&self.programmed, axis);
            let measured = |position: f64| match self.encoder_step {
                0.0 => position,
                step => (position / step).round() * step,
            };
            let positions = self.column(positions, axis).into_iter().map(measured);
            let error = |(k, position): (usize, f64)| programmed[k.saturating_sub(self.delay)] - position;
            positions.take(programmed.len()).enumerate().map(error).collect()
        };
        self.axes.iter().map(of_axis).collect()
    }

    /// Computes the next compensation of each axis.
    pub fn update(&self, compensation: &mut [Vec<f64>], errors: &[Vec<f64>]) {
        for ((axis, v), error) in self.axes.iter().zip(compensation).zip(errors) {
            let mut error = error.clone();
            error.resize(v.len(), 0.0);
            *v = axis.filter.next_compensation(v, &error);
            let programmed = self.column(&self.programmed, axis);
            for (value, weight) in v.iter_mut().zip(motion_weights(&programmed, self.delay)) {
                *value *= weight;
            }
            limit_compensation(v, &programmed, &self.machine.axes()[axis.index], self.period());
            // The motion starts and ends at the programmed positions.
            for end in [v.len().saturating_sub(1), 0] {
                if let Some(value) = v.get_mut(end) {
                    *value = 0.0;
                }
            }
        }
    }

    /// Returns the programmed setpoints with the compensation.
    pub fn compensated(&self, compensation: &[Vec<f64>]) -> Vec<f64> {
        let (mut psec, count) = (self.programmed.clone(), self.machine.axes().len().max(1));
        for (axis, v) in self.axes.iter().zip(compensation) {
            for (row, v) in psec.chunks_exact_mut(count).zip(v) {
                row[axis.index] += v;
            }
        }
        psec
    }

    pub fn first_excess(&self, psec: &[f64]) -> Option<SetpointExcess> {
        let period = self.period();
        self.axes.iter().find_map(|axis| {
            let config = &self.machine.axes()[axis.index];
            let [psec, programmed] = [psec, &self.programmed].map(|rows| self.column(rows, axis));
            first_excess(config, &psec, &programmed, period, self.acceleration_excess)
        })
    }

    pub fn iteration(
        &self,
        outcome: &TrialOutcome,
        errors: &[Vec<f64>],
        compensation: &[Vec<f64>],
    ) -> LearningIteration {
        let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let of_axis = |((axis, error), v): ((&LearningAxis, &Vec<f64>), &Vec<f64>)| LearningAxisError {
            index: axis.index,
            max: largest(error),
            rms: rms_of_sum(error.iter().map(|e| e * e).sum(), error.len() as u64).unwrap_or(0.0),
            compensation: largest(v),
        };
        let axes = self.axes.iter().zip(errors).zip(compensation).map(of_axis).collect();
        LearningIteration { figures: outcome.figures.clone(), axes }
    }
}

/// Returns the weight of the compensation in each position cycle: 1 while the programmed setpoints move, falling to 0 at
/// standstill. Setpoints that never rest would keep an axis hunting in its static friction.
fn motion_weights(programmed: &[f64], delay: usize) -> Vec<f64> {
    let is_moving = |k: usize| k > 0 && programmed[k] != programmed[k - 1];
    let mut distance = vec![usize::MAX; programmed.len()];
    let mut pass = |order: &mut dyn Iterator<Item = usize>| {
        let mut nearest = usize::MAX;
        for k in order {
            nearest = if is_moving(k) { 0 } else { nearest.saturating_add(1) };
            distance[k] = distance[k].min(nearest);
        }
    };
    pass(&mut (0..programmed.len()));
    pass(&mut (0..programmed.len()).rev());
    let weight = |distance: usize| {
        let beyond = distance.saturating_sub(HOLD + delay) as f64;
        (1.0 - beyond / FADE as f64).max(0.0)
    };
    distance.into_iter().map(weight).collect()
}

/// Limits a compensation so that the sum with the `programmed` setpoints keeps travel limits and velocity of `axis`.
fn limit_compensation(compensation: &mut [f64], programmed: &[f64], axis: &AxisConfig, period: f64) {
    let limits = &axis.limits;
    let mut before = programmed.first().copied().unwrap_or(0.0);
    for (v, &programmed) in compensation.iter_mut().zip(programmed) {
        let step = limits.velocity * period;
        let moved = (programmed + *v).clamp(before - step, before + step);
        let (low, high) = (limits.travel_min.min(programmed), limits.travel_max.max(programmed));
        before = moved.max(low).min(high);
        *v = before - programmed;
    }
}

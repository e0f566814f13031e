//! Figures of one motion: following errors of the axes and contour error.

use crate::config::AxisKind;
use crate::machine::Machine;
use crate::statistics::rms_of_sum;

use super::ContourTracker;
use super::axis::{AxisAssessor, AxisReport};

/// Figures of a motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionReport {
    /// Figures of each axis of the motion, in the order of the assessor's axes.
    pub axes: Vec<AxisReport>,
    /// Largest contour error at any tick, m: distance from the path of the setpoints; `None` without a
    /// linear axis.
    pub max_contour_error: Option<f64>,
    /// RMS of the contour error, m; `None` without a linear axis.
    pub rms_contour_error: Option<f64>,
}

/// Accumulator of the figures of a motion; its updates do not allocate.
#[derive(Debug, Clone)]
pub struct MotionAssessor {
    /// Machine indices of the axes, and their accumulators.
    axes: Vec<(usize, AxisAssessor)>,
    /// Machine indices of the linear axes.
    linear: Vec<usize>,
    contour: ContourTracker,
    /// Length of the preview of the path beyond the current setpoint, position cycles.
    horizon: u32,
    has_preview: bool,
    position: Vec<f64>,
    sum_contour_squared: f64,
    max_contour: f64,
    ticks: u64,
    tick: f64,
}

impl MotionAssessor {
    /// Creates an assessor of the axes at `indices` of a machine whose axes are of `kinds`, with ticks of
    /// `tick` seconds.
    ///
    /// The path is known `horizon` position cycles beyond the current setpoint.
    pub fn new(indices: &[usize], kinds: &[AxisKind], tick: f64, horizon: u32) -> Self {
        let linear: Vec<usize> =
            indices.iter().copied().filter(|&p| kinds.get(p) == Some(&AxisKind::Linear)).collect();
        MotionAssessor {
            axes: indices.iter().map(|&p| (p, AxisAssessor::default())).collect(),
            contour: ContourTracker::new(linear.len()),
            horizon,
            has_preview: false,
            position: vec![0.0; linear.len()],
            linear,
            sum_contour_squared: 0.0,
            max_contour: 0.0,
            ticks: 0,
            tick,
        }
    }

    /// Adds future setpoints to the path before a position cycle.
    ///
    /// `psec` returns the setpoint of an axis, by its machine index, the given number of cycles after that
    /// instant. The preview is needed where an axis overshoots a corner: it is closest to a later part of
    /// the path.
    pub fn push_preview(&mut self, psec: impl Fn(usize, u32) -> f64) {
        let first = if self.has_preview { self.horizon } else { 0 };
        self.has_preview = true;
        for periods in first..=self.horizon {
            self.contour.push(self.linear.iter().map(|&index| psec(index, periods)));
        }
    }

    /// Adds the position cycle that `machine` computed last.
    pub fn observe(&mut self, machine: &Machine) {
        for (index, assessor) in &mut self.axes {
            assessor.observe(machine.axis(*index).sample(), &machine.activity(*index));
        }
        let ticks = machine.ticks_per_period();
        if !self.linear.is_empty() {
            for tick in 0..ticks {
                for (value, &index) in self.position.iter_mut().zip(&self.linear) {
                    *value = machine.position(index, tick);
                }
                let distance = self.contour.distance(&self.position);
                self.max_contour = self.max_contour.max(distance);
                self.sum_contour_squared += distance * distance;
            }
        }
        self.ticks += ticks as u64;
    }

    /// Returns the figures so far.
    pub fn report(&self) -> MotionReport {
        let has_path = !self.linear.is_empty();
        MotionReport {
            axes: self.axes.iter().map(|(_, assessor)| assessor.report(self.tick)).collect(),
            max_contour_error: has_path.then_some(self.max_contour),
            rms_contour_error: has_path
                .then(|| rms_of_sum(self.sum_contour_squared, self.ticks).unwrap_or(0.0)),
        }
    }
}

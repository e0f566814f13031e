//! Figures of one motion: following errors of the axes and contour error.

use crate::config::{AxisKind, Periods};
use crate::machine::Machine;
use crate::statistics::rms_of_sum;
use crate::units::seconds;

use super::axis::{AxisAssessor, AxisReport};
use super::contour::{ContourTracker, FootPoints};

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
    /// Positions of the linear axes at the ticks of a position cycle, m; 0 in further columns.
    positions: Vec<Vec<f64>>,
    feet: FootPoints,
    sum_contour_squared: f64,
    max_contour: f64,
    ticks: u64,
    tick: f64,
}

impl MotionAssessor {
    /// Creates an assessor of the axes at `indices` of a machine whose axes are of `kinds`, with the current cycle
    /// of `periods`.
    ///
    /// The path is known `horizon` position cycles beyond the current setpoint.
    pub fn new(indices: &[usize], kinds: &[AxisKind], periods: &Periods, horizon: u32) -> Self {
        let ticks = periods.ticks_per_position() as usize;
        let linear: Vec<usize> =
            indices.iter().copied().filter(|&p| kinds.get(p) == Some(&AxisKind::Linear)).collect();
        let contour = ContourTracker::new(linear.len());
        let mut feet = FootPoints::default();
        feet.resize(ticks);
        MotionAssessor {
            axes: indices.iter().map(|&p| (p, AxisAssessor::default())).collect(),
            horizon,
            has_preview: false,
            positions: vec![vec![0.0; ticks]; contour.column_count()],
            contour,
            feet,
            linear,
            sum_contour_squared: 0.0,
            max_contour: 0.0,
            ticks: 0,
            tick: seconds(periods.current),
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
            self.observe_contour(machine);
        }
        self.ticks += ticks as u64;
    }

    fn observe_contour(&mut self, machine: &Machine) {
        for (&index, positions) in self.linear.iter().zip(&mut self.positions) {
            machine.positions(index, positions);
        }
        self.contour.nearest(&self.positions, &mut self.feet);
        for square in self.feet.square_distance.iter() {
            let distance = square.sqrt();
            self.max_contour = self.max_contour.max(distance);
            self.sum_contour_squared += distance * distance;
        }
    }

    /// Returns the contour error at the last tick of the position cycle that was observed last, m; `None` without a
    /// linear axis or before the first cycle.
    pub fn contour_error(&self) -> Option<f64> {
        let has_error = self.ticks > 0 && !self.linear.is_empty();
        self.feet.square_distance.last().filter(|_| has_error).map(|square| square.sqrt())
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

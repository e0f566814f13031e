//! Figures of one motion, gathered while it runs.

use crate::config::AxisKind;
use crate::machine::Machine;

use super::ContourTracker;
use super::axis::{AxisAssessor, AxisReport, root_mean};

/// Figures of a motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MotionReport {
    /// Of each axis that took part, in the order of the assessor's axes.
    pub axes: Vec<AxisReport>,
    /// Largest distance from the path of the setpoints at any tick, m; none without a linear axis.
    pub max_contour_error: Option<f64>,
    /// RMS of that distance, m.
    pub rms_contour_error: Option<f64>,
}

/// Gathers the figures of a motion of some axes; nothing is allocated while it runs.
#[derive(Debug, Clone)]
pub struct MotionAssessor {
    /// Places of the axes in the machine, and their figures.
    axes: Vec<(usize, AxisAssessor)>,
    /// Places of the linear ones among them.
    linear: Vec<usize>,
    contour: ContourTracker,
    /// Position periods that the path is known ahead of the setpoint, and whether it is yet.
    horizon: u32,
    looked_ahead: bool,
    position: Vec<f64>,
    square_contour: f64,
    max_contour: f64,
    ticks: u64,
    tick: f64,
}

impl MotionAssessor {
    /// An assessor of the axes at `places` of a machine whose axes are of `kinds`, with ticks of
    /// `tick` seconds; the path is looked at `horizon` position periods ahead of the setpoint.
    pub fn new(places: &[usize], kinds: &[AxisKind], tick: f64, horizon: u32) -> Self {
        let linear: Vec<usize> =
            places.iter().copied().filter(|&p| kinds.get(p) == Some(&AxisKind::Linear)).collect();
        MotionAssessor {
            axes: places.iter().map(|&p| (p, AxisAssessor::default())).collect(),
            contour: ContourTracker::new(linear.len()),
            horizon,
            looked_ahead: false,
            position: vec![0.0; linear.len()],
            linear,
            square_contour: 0.0,
            max_contour: 0.0,
            ticks: 0,
            tick,
        }
    }

    /// Learns the path before a position instant: `psec` gives the setpoint of an axis, by its place,
    /// so many periods after that instant. An axis that overshoots a corner is nearest to what comes
    /// behind it.
    pub fn look_ahead(&mut self, psec: impl Fn(usize, u32) -> f64) {
        let first = if self.looked_ahead { self.horizon } else { 0 };
        self.looked_ahead = true;
        for periods in first..=self.horizon {
            self.contour.push(self.linear.iter().map(|&place| psec(place, periods)));
        }
    }

    /// Takes the position period in that `machine` has computed last.
    pub fn observe(&mut self, machine: &Machine) {
        for (place, assessor) in &mut self.axes {
            assessor.observe(machine.axis(*place).sample(), &machine.activity(*place));
        }
        let ticks = machine.ticks_per_period();
        if !self.linear.is_empty() {
            for tick in 0..ticks {
                for (value, &place) in self.position.iter_mut().zip(&self.linear) {
                    *value = machine.position(place, tick);
                }
                let distance = self.contour.distance(&self.position);
                self.max_contour = self.max_contour.max(distance);
                self.square_contour += distance * distance;
            }
        }
        self.ticks += ticks as u64;
    }

    /// The figures so far.
    pub fn report(&self) -> MotionReport {
        let has_path = !self.linear.is_empty();
        MotionReport {
            axes: self.axes.iter().map(|(_, assessor)| assessor.report(self.tick)).collect(),
            max_contour_error: has_path.then_some(self.max_contour),
            rms_contour_error: has_path.then(|| root_mean(self.square_contour, self.ticks)),
        }
    }
}
